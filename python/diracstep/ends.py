"""Motions between two ends, and controls of least cost."""

from __future__ import annotations

import ctypes
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Mapping

import numpy as np

from . import _library as c
from . import run as points_of_motions
from .arrays import column, flag, real, reals, table, text, whole
from .errors import Doubt, Misuse, spelled
from .options import options_from, stop_flag
from .points import Points

if TYPE_CHECKING:
    from .scene import Scene

_LARGEST_INT = 2**31 - 1  # of C


@dataclass(frozen=True, repr=False, eq=False)
class BoundaryMotion(points_of_motions.Points):
    """A motion between two ends, with the arrays of ``Points`` at the ends of its N steps.

    Forces of rows are not known there: ``lambda_``, and outputs that read it, are NaN.
    """

    method: str
    iterations: int  #: Newton's
    residual: float  #: of the conditions, largest entry
    doubt: str  #: empty, or why the motion is not to be believed
    other: str  #: empty, or that another motion fulfils the conditions
    action: float | None  #: S(q0, qN), the sum of the discrete Lagrangians; None where there is none
    no_action: str  #: why there is none
    action_gradient: np.ndarray | None  #: 2n numbers, by q0 and qN: (−p0, pN)
    action_hessian: np.ndarray | None  #: 2n × 2n; None with rows too
    free_directions: int  #: that periodic conditions leave
    multipliers: np.ndarray  #: complex, Floquet's, of a periodic motion

    def __repr__(self) -> str:
        return _told("motion between two ends", self)


@dataclass(frozen=True, repr=False, eq=False)
class ControlledMotion(points_of_motions.Points):
    """The motion of least cost, with the arrays of ``Points`` at the ends of its N steps, and its controls.

    ``[name]`` knows the controls as well, K values at ``control_times``.  Forces of rows are not known: NaN.
    """

    method: str
    iterations: int
    cost: float
    residual: float  #: of the steps, the rows and the conditions, largest entry
    end_of_run: float  #: how far from the end a run with these controls ends; NaN where it fails
    doubt: str  #: empty, or why the controls are not to be believed
    control_names: tuple[str, ...]  #: P
    control_times: np.ndarray  #: K numbers: the middles of the steps, or where the polynomials have values
    controls: np.ndarray  #: K × P

    def __getitem__(self, name: str) -> np.ndarray:
        if isinstance(name, str) and name in self.control_names:
            return self.controls[:, self.control_names.index(name)]
        return super().__getitem__(name)

    def __repr__(self) -> str:
        return _told(f"controlled motion of cost {self.cost:.6g}", self)


def _told(what: str, motion: Any) -> str:
    doubted = ", doubted" if motion.doubt else ""
    return f"<{what} of {motion.scene.name}: {len(motion)} points, {motion.iterations} iterations, {motion.method}{doubted}>"


class _Asked:
    """The struct that both searches take, and what it points to."""

    def __init__(self, scene: Scene, to: Any, start: Any, guess: Any, max_iterations: int, periodic: bool = False) -> None:
        self.struct = c.Ends(periodic=int(flag(periodic, "periodic")),
                             max_iterations=whole(max_iterations, "max_iterations", 1, _LARGEST_INT))
        self.flag = stop_flag()
        self.struct.stop = ctypes.pointer(self.flag)
        self._kept: list[Any] = [_put(self.struct, "of_start", "at_start", _by_name(scene, start, "start")),
                                 _put(self.struct, "of_end", "at_end", _by_name(scene, to, "to"))]
        if guess is not None:
            self._guess(scene, guess)

    def _guess(self, scene: Scene, guess: Any) -> None:
        """A motion: what has t, q and v, or a dictionary of them."""
        parts: list[Any] = [guess.get(name) if isinstance(guess, Mapping) else getattr(guess, name, None) for name in "tqv"]
        if any(part is None for part in parts):
            raise Misuse(f"guess is {type(guess).__name__}; a run, or a dictionary with t, q and v, is needed")
        count, n = np.size(parts[0]), len(scene._coordinates)
        arrays = [table(part, shape, f"{name} of guess")
                  for part, name, shape in zip(parts, "tqv", ((count,), (count, n), (count, n)))]
        if not count:
            raise Misuse("guess has no points")
        self._kept.append(arrays)
        self.struct.guesses = count
        self.struct.guess_time, self.struct.guess_q, self.struct.guess_v = (array.ctypes.data for array in arrays)


def _by_name(scene: Scene, given: Any, what: str) -> dict[str, float]:
    """Numbers by name; a column is a place."""
    if given is None or isinstance(given, Mapping):
        return reals(given, what)
    if isinstance(given, (str, bytes)) or not hasattr(given, "__iter__"):
        raise Misuse(f"{what} is {given!r}; a dictionary of numbers by name, or a place, is needed")
    return dict(zip(scene._positions, column(given, scene._positions, what).tolist()))


def _put(struct: Any, count: str, values: str, numbers: Mapping[str, float]) -> Any:
    """Writes named numbers into a struct; what it then points to."""
    entries = (c.Parameter * max(1, len(numbers)))(*(c.Parameter(c.encoded(name), value) for name, value in numbers.items()))
    setattr(struct, count, len(numbers))
    setattr(struct, values, entries)
    return entries


def _bounds(given: Any, what: str) -> dict[str, float]:
    """Numbers by name, which may be infinite."""
    if given is not None and not isinstance(given, Mapping):
        raise Misuse(f"{what} is {given!r}; a dictionary of numbers by name is needed")
    infinite = {name: float(value) for name, value in (given or {}).items() if isinstance(value, float) and np.isinf(value)}
    others = {name: value for name, value in (given or {}).items() if name not in infinite}
    return {**reals(others, what), **{text(name, f"a name of {what}"): value for name, value in infinite.items()}}


def _numbers(address: Any, shape: tuple[int, ...]) -> np.ndarray | None:
    return np.ctypeslib.as_array(address, shape).copy() if address else None


def boundary_of(scene: Scene, to: Any, start: Any, periodic: bool, until: float | None, guess: Any, max_iterations: int,
                options: dict[str, Any]) -> BoundaryMotion:
    asked, chosen = _Asked(scene, to, start, guess, max_iterations, periodic), options_from(options, _end(scene, until))
    n = len(scene._coordinates)
    told: dict[str, Any] = {}

    def call(points: Points) -> int:
        found = c.Boundary()
        code = c.lib.solve_boundary(scene._handle, ctypes.byref(chosen), ctypes.byref(asked.struct), points.reference(),
                                    ctypes.byref(found))
        pairs = _numbers(found.multiplier, (found.multipliers, 2))
        told.update(method=c.decoded(found.method), iterations=found.iterations, residual=found.residual,
                    doubt=c.decoded(found.doubt), other=c.decoded(found.other),
                    action=None if np.isnan(found.action) else found.action, no_action=c.decoded(found.no_action),
                    action_gradient=_numbers(found.gradient, (2 * n,)), action_hessian=_numbers(found.hessian, (2 * n, 2 * n)),
                    free_directions=found.free_directions,
                    multipliers=np.empty(0, complex) if pairs is None else pairs[:, 0] + 1j * pairs[:, 1])
        return code

    return _searched(scene, asked, call, told, BoundaryMotion)


def control_of(scene: Scene, to: Any, start: Any, at_least: Any, at_most: Any, degree: int, until: float | None, guess: Any,
               tolerance: float, max_iterations: int, options: dict[str, Any]) -> ControlledMotion:
    asked, chosen = _Asked(scene, to, start, guess, max_iterations), options_from(options, _end(scene, until))
    wanted = c.Control(degree=whole(degree, "degree", 0, 8), tolerance=real(tolerance, "tolerance"))
    if not 0.0 < wanted.tolerance < 1.0:
        raise Misuse(f"tolerance is {wanted.tolerance}; a number between 0 and 1 is needed")
    kept = [_put(wanted, "of_least", "least", _bounds(at_least, "at_least")),
            _put(wanted, "of_greatest", "greatest", _bounds(at_most, "at_most"))]
    told: dict[str, Any] = {}

    def call(points: Points) -> int:
        found, _ = c.Controlled(), kept
        code = c.lib.solve_control(scene._handle, ctypes.byref(chosen), ctypes.byref(asked.struct), ctypes.byref(wanted),
                                   points.reference(), ctypes.byref(found))
        times = _numbers(found.control_time, (found.control_points,))
        values = _numbers(found.control_value, (found.control_points, found.controls))
        told.update(method=c.decoded(found.method), iterations=found.iterations, cost=found.cost, residual=found.residual,
                    end_of_run=found.end_of_run, doubt=c.decoded(found.doubt),
                    control_names=tuple(c.decoded(found.name[k]) for k in range(found.controls)),
                    control_times=np.empty(0) if times is None else times,
                    controls=np.empty((0, found.controls)) if values is None else values)
        return code

    return _searched(scene, asked, call, told, ControlledMotion)


def _end(scene: Scene, until: float | None) -> float:
    return scene.until if until is None else real(until, "until")


def _searched(scene: Scene, asked: _Asked, call: Any, told: dict[str, Any], kind: Any) -> Any:
    """Makes the call: what was found, as ``kind``; raises what it ended with, with the last iterate as ``run``."""
    points = Points(scene._widths, 1024)
    code, message = c.call_interruptibly(lambda: call(points), asked.flag)
    if points.failure is not None:
        raise points.failure
    motion = kind(scene, **points.finish(), **told)
    if code == c.INTERRUPTED:
        raise KeyboardInterrupt(message)
    if code != c.OK:
        scene._raise(code, message, motion if len(motion) else None)
    if motion.doubt:
        warnings.warn(f"{scene.name}: {spelled(motion.doubt)}", Doubt, stacklevel=4)
    return motion
