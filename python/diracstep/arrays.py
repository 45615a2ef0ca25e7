"""What users give, checked: numbers as arrays that the library can read, texts, flags.  Misuse names the argument."""

from __future__ import annotations

import numbers
import os
import re
import reprlib
from typing import Any, Mapping, Sequence

import numpy as np

from .errors import Misuse


def column(values: Any, names: Sequence[str], what: str) -> np.ndarray:
    """n finite doubles, one behind the other: from a sequence in the order of the names, or by name, 0 where nothing is said.

    A copy is made where the array given is of another type or lies otherwise in memory; a read-only one serves.
    """
    if isinstance(values, Mapping):
        unknown = [name for name in values if name not in names]
        if unknown:
            raise Misuse(f"{what}: no coordinate {unknown[0]!r}; there are " + ", ".join(names))
        values = [values.get(name, 0.0) for name in names]
    return table(values, (len(names),), what)


def table(values: Any, shape: tuple[int, ...], what: str) -> np.ndarray:
    """Finite doubles of this shape; raises Misuse with what is wrong."""
    array = np.asarray(values)
    if array.dtype.kind not in "fiub" or array.dtype.itemsize > 8:
        raise Misuse(f"{what} is of type {array.dtype}; real numbers are needed")
    array = np.asarray(array, dtype=np.float64, order="C")
    if array.shape != shape:
        raise Misuse(f"{what} has shape {array.shape}; {shape} is needed")
    if not np.isfinite(array).all():
        place = tuple(int(k) for k in np.argwhere(~np.isfinite(array))[0])
        raise Misuse(f"{what}[{', '.join(map(str, place))}] is {array[place]}; finite numbers are needed")
    return array


def _refused(value: Any, what: str, needed: str) -> Misuse:
    return Misuse(f"{what} is {reprlib.repr(value)}; {needed} is needed")


def real(value: Any, what: str) -> float:
    """One finite number."""
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value.item()
    if not isinstance(value, (numbers.Real, np.bool_)):
        raise _refused(value, what, "a number")
    if not np.isfinite(number := float(value)):
        raise _refused(number, what, "a finite number")
    return number


def reals(values: Any, what: str) -> dict[str, float]:
    """Finite numbers by name; none for None."""
    if values is None:
        return {}
    if not isinstance(values, Mapping):
        raise _refused(values, what, "a dictionary of numbers by name")
    return {text(name, f"a name of {what}"): real(value, f"{name} of {what}") for name, value in values.items()}


def text(value: Any, what: str) -> str:
    """A text that C can read: one without NUL, and without surrogates but those that stand for bytes of a path."""
    if not isinstance(value, str):
        raise _refused(value, what, "a text")
    if re.search("[\0\ud800-\udc7f\udd00-\udfff]", value):
        raise _refused(value, what, "a text without NUL and without surrogates")
    return value


def texts(values: Any, what: str) -> list[str]:
    """A list of texts; one text alone is refused."""
    if isinstance(values, (str, bytes, Mapping)) or not hasattr(values, "__iter__"):
        raise _refused(values, what, "a list of texts")
    return [text(value, f"{what}[{index}]") for index, value in enumerate(values)]


def path(value: Any, what: str) -> str:
    """The path of a file, as a text."""
    given = os.fspath(value) if isinstance(value, (str, os.PathLike)) else None
    if not isinstance(given, str):
        raise _refused(value, what, "a text or a path")
    return text(given, what)


def flag(value: Any, what: str) -> bool:
    """True or False, which other values are not taken for."""
    if not isinstance(value, (bool, np.bool_)):
        raise _refused(value, what, "True or False")
    return bool(value)


def whole(value: Any, what: str, least: int = 0, most: int = 2**63 - 1) -> int:
    """A whole number, that a C long holds without ``most``."""
    try:
        number = int(value.__index__())
    except AttributeError:
        raise _refused(value, what, "a whole number") from None
    if number < least:
        raise Misuse(f"{what} is {number}; at least {least} is needed")
    if number > most:
        raise Misuse(f"{what} is {number}; at most {most} is taken")
    return number


def address(array: np.ndarray | None) -> int | None:
    """Where an array begins, for a pointer of C."""
    return None if array is None else array.ctypes.data
