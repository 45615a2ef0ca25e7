"""Numbers given by the user as arrays that the library can read."""

from __future__ import annotations

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


def real(value: Any, what: str) -> float:
    """One finite number."""
    return float(table(value, (), what))


def whole(value: Any, what: str, least: int = 0, most: int = 2**63 - 1) -> int:
    """A whole number, that a C long holds without ``most``."""
    try:
        number = int(value.__index__())
    except AttributeError:
        raise Misuse(f"{what} is {value!r}; a whole number is needed") from None
    if number < least:
        raise Misuse(f"{what} is {number}; at least {least} is needed")
    if number > most:
        raise Misuse(f"{what} is {number}; at most {most} is taken")
    return number


def address(array: np.ndarray | None) -> int | None:
    """Where an array begins, for a pointer of C."""
    return None if array is None else array.ctypes.data
