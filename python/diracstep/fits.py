"""Parameters of a scene from measured data."""

from __future__ import annotations

import ctypes
import os
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Mapping, Sequence

import numpy as np

from . import _library as c
from .arrays import path, real, reals, texts, whole
from .errors import Doubt, Misuse, spelled
from .options import options_from, stop_flag

if TYPE_CHECKING:
    from .scene import Scene


@dataclass(frozen=True, repr=False, eq=False)
class Fit:
    """Parameters that fit data best, Σ ((measured − motion)/σ)² being least."""

    scene: Scene  #: with these parameters
    parameters: dict[str, float]
    intervals: dict[str, float]  #: half widths of the confidence intervals; infinite where the data do not determine one
    covariance: np.ndarray  #: P × P, in the order of ``parameters``
    residual: float  #: standard deviation of what is left, in units of sigma
    measured: int  #: numbers that were fitted to
    motions: int  #: that the search took
    ending: str  #: of the search, in words
    doubt: str  #: empty, or why the parameters are not to be believed

    def __repr__(self) -> str:
        values = ", ".join(f"{name} = {value:.10g} ± {self.intervals[name]:.3g}" for name, value in self.parameters.items())
        return f"<fit of {self.scene.name}: {values}{', doubted' if self.doubt else ''}>"


def _columns(data: Mapping[str, Any]) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Names, times and values, a row for each time; NaN stands for what was not measured."""
    names = texts(list(data), "the names of data")
    arrays = {name: np.asarray(data[name]) for name in names}
    if "t" not in names or any(array.ndim != 1 or array.shape != arrays["t"].shape for array in arrays.values()):
        raise Misuse("data needs columns of one length, 't' among them")
    for name, array in arrays.items():
        if array.dtype.kind not in "fiub" or array.dtype.itemsize > 8:
            raise Misuse(f"data[{name!r}] is of type {array.dtype}; real numbers are needed")
        if np.isinf(array).any():
            raise Misuse(f"data[{name!r}] holds an infinite number; NaN stands for what was not measured")
    times = np.ascontiguousarray(arrays.pop("t"), dtype=np.float64)
    if np.isnan(times).any():
        raise Misuse("data['t'] holds NaN; each row needs its time")
    return list(arrays), times, np.array([*arrays.values()], dtype=np.float64).reshape(len(arrays), times.size).T.copy()


def _pairs(numbers: Mapping[str, float]) -> Any:
    return (c.Parameter * max(1, len(numbers)))(*(c.Parameter(c.encoded(name), value) for name, value in numbers.items()))


def _names(names: Sequence[str]) -> Any:
    return (ctypes.c_char_p * max(1, len(names)))(*(c.encoded(name) for name in names))


def fit_of(scene: Scene, data: Any, parameters: Sequence[str], start: Any, sigma: Any, confidence: float, max_motions: int,
           options: dict[str, Any]) -> Fit:
    wanted, flag = c.Data(), stop_flag()
    wanted.stop = ctypes.pointer(flag)
    if isinstance(data, (str, os.PathLike)):
        wanted.file = c.encoded(path(data, "data"))
    elif isinstance(data, Mapping):
        names, times, values = _columns(data)
        wanted.columns, wanted.column, wanted.rows = len(names), _names(names), len(times)
        wanted.time, wanted.value = times.ctypes.data, values.ctypes.data
        wanted.kept = times, values
    else:
        raise Misuse(f"data is {type(data).__name__}; the path of a file, or columns by name, 't' among them, are needed")
    fitted, starts, deviations = texts(parameters, "parameters"), reals(start, "start"), reals(sigma, "sigma")
    wanted.sigmas, wanted.sigma = len(deviations), _pairs(deviations)
    wanted.parameters, wanted.parameter = len(fitted), _names(fitted)
    wanted.starts, wanted.start = len(starts), _pairs(starts)
    wanted.confidence, wanted.max_motions = real(confidence, "confidence"), whole(max_motions, "max_motions", 1, 2**31 - 1)
    if not 0.0 < wanted.confidence < 1.0:
        raise Misuse(f"confidence is {wanted.confidence}; a number between 0 and 1 is needed")
    chosen, told, count = options_from(options, None), {}, len(fitted)

    def call() -> int:
        found = c.Fitted()
        code = c.lib.fit(scene._handle, ctypes.byref(chosen), ctypes.byref(wanted), ctypes.byref(found))
        if code == c.OK:
            value, interval = (np.ctypeslib.as_array(numbers, (count,)).tolist() for numbers in (found.value, found.interval))
            told.update(parameters=dict(zip(fitted, value)), intervals=dict(zip(fitted, interval)),
                        covariance=np.ctypeslib.as_array(found.covariance, (count, count)).copy(), residual=found.residual,
                        measured=found.measured, motions=found.motions, ending=c.decoded(found.ending),
                        doubt=spelled(c.decoded(found.doubt)))
        return code

    code, message = c.call_interruptibly(call, flag)
    if code == c.INTERRUPTED:
        raise KeyboardInterrupt(message)
    if code != c.OK:
        scene._raise(code, message)
    fit = Fit(scene.with_parameters(**told["parameters"]), **told)
    if fit.doubt:
        warnings.warn(f"{scene.name}: {fit.doubt}", Doubt, stacklevel=3)
    return fit
