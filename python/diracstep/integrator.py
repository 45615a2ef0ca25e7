"""Stepping by hand: for control loops, learning, and runs that end at an event of one's own."""

from __future__ import annotations

import ctypes
import threading
import time
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Mapping, NoReturn, Sequence

import numpy as np

from . import _library as c
from .arrays import column, real, texts, whole
from .errors import Doubt, Misuse, spelled
from .options import momentum_from, options_from, stop_flag
from .plan import TextTable
from .run import Event, Statistics, event_from

if TYPE_CHECKING:
    from .scene import Scene

_OK = c.OK


def _cotangent(given: Any) -> Mapping[str, Any]:
    if not isinstance(given, Mapping) or not set(given) <= {"q", "v", "p"}:
        raise Misuse(f"the cotangent is {given!r}; a dictionary of columns \"q\", \"v\", \"p\" is needed")
    return given


@dataclass(frozen=True, eq=False)
class State:
    """A point of a motion.  The arrays are copies and own their memory."""

    t: float
    q: np.ndarray  #: s numbers, of ``scene.positions``
    v: np.ndarray  #: n numbers, in the distribution
    p: np.ndarray  #: n numbers, the representative asked for
    lambda_: np.ndarray  #: m numbers: forces of the rows
    energy: float
    invariants: np.ndarray  #: i numbers that the scene declares as kept
    outputs: np.ndarray  #: o numbers, formulas of the scene's file


@dataclass(frozen=True, eq=False)
class Jacobian:
    """Derivatives of the end of a motion, one column for each of ``inputs``."""

    inputs: tuple[str, ...]  #: "x(0)", "v_x(0)", and parameters
    q: np.ndarray  #: n rows
    v: np.ndarray  #: n rows
    p: np.ndarray  #: n rows, of the projected momentum


@dataclass(frozen=True, eq=False)
class Gradient:
    """Derivatives of a function of the end of a motion by its start and by parameters."""

    q: np.ndarray  #: n numbers
    v: np.ndarray  #: n numbers, with q held
    parameters: dict[str, float]


class Integrator:
    """Steps a scene with one method; made by ``Scene.integrator``.  Threads take turns.

    Events of the scene are looked for, and act.  The checks of a run go along with ``step()``; ``state()`` warns with Doubt of
    what they have found.
    """

    def __init__(self, scene: Scene, until: float | None, pushed: bool, given: dict[str, Any], fixed: bool = True) -> None:
        self.scene = scene
        self._lock = threading.Lock()
        self._options = options_from(given, until, pushed, fixed)
        self._told = ""  # doubts that were warned of
        handle = ctypes.c_void_p()
        scene._check(c.lib.create(scene._handle, ctypes.byref(self._options), ctypes.byref(handle)))
        self._handle: int = handle.value or 0
        self._destroy = c.lib.destroy  # there until the end of the interpreter
        self._step = c.lib.step

    def __del__(self) -> None:
        if getattr(self, "_handle", 0):
            self._destroy(self._handle)

    def __reduce__(self) -> NoReturn:
        raise TypeError("an integrator is not copied or pickled; save() and restore() carry its state to another one")

    def step(self, count: int = 1, *, size: float | None = None) -> None:
        """Takes so many steps, of another size where one is given; fewer where an event of the scene ends the motion, and then
        no more.

        After a Failure the state is that before the failed step; Ctrl-C ends many steps within a fraction of a second, where the
        motion has come to by then."""
        if size is None:
            if isinstance(count, int) and count == 1:
                self._take(1)
                return
            left, part = whole(count, "steps"), 1
            while left > 0:  # Ctrl-C is heard between the parts
                begin = time.perf_counter()
                self._take(min(part, left))
                left = 0 if self.stopped else left - part
                if time.perf_counter() - begin < 0.05:
                    part *= 2
            return
        size, left = real(size, "size"), whole(count, "steps")
        while left > 0:
            with self._lock:
                self._check(c.lib.step_by(self._handle, size))
            left = 0 if left > 1 and self.stopped else left - 1

    def _take(self, count: int) -> None:
        with self._lock:
            code = self._step(self._handle, count)
            if code == _OK:
                return
            message = c.decoded(c.lib.message())
        self.scene._raise(code, message)

    def push(self, force: Any) -> None:
        """A further generalised force, by coordinate or in their order, that acts until the next push.

        The integrator must be made with ``pushed=True``.
        """
        numbers = column(force, self.scene._coordinates, "force")
        with self._lock:
            self._check(c.lib.push(self._handle, numbers.ctypes.data))

    @property
    def time(self) -> float:
        """The time of the current point."""
        return c.lib.time(self._handle)

    def state(self, momentum: str = "projected") -> State:
        """The current point.  Warns with Doubt where it is not to be believed, once for each reason."""
        columns = {name: np.empty(width) for name, width in self.scene._widths.items()}
        read = c.State(**{name: array.ctypes.data for name, array in columns.items()})
        with self._lock:
            self._check(c.lib.read(self._handle, momentum_from(momentum), ctypes.byref(read)))
            doubt = c.decoded(c.lib.doubt(self._handle))
        if doubt and doubt != self._told:
            self._told = doubt
            warnings.warn(f"{self.scene.name}: {spelled(doubt)}", Doubt, stacklevel=2)
        return State(t=read.time, energy=read.energy, **columns)

    @property
    def events(self) -> list[Event]:
        """The events of the scene that were met since the start, in the order of time."""
        met: list[Event] = []
        with self._lock:
            for k in range(c.lib.count_events(self._handle)):
                read = c.Event()
                self._check(c.lib.read_event(self._handle, k, ctypes.byref(read)))
                met.append(event_from(read, self.scene._widths))
        return met

    @property
    def stopped(self) -> bool:
        """Whether an event of the scene has ended the motion: there are no further steps until ``reset()``."""
        return self.statistics.stopped

    def jacobian(self, steps: int, parameters: Sequence[str] = ()) -> Jacobian:
        """Takes so many steps; the exact derivatives of their end by q, by v and by parameters of the scene where they began.

        Parameters move the start as the scene's file says.  Ctrl-C ends it with KeyboardInterrupt, where the motion has come to by
        then.
        """
        parameters = texts(parameters, "parameters")
        n, wanted = len(self.scene._coordinates), self._derivatives(steps, parameters)
        inputs = 2 * n + len(parameters)
        arrays = {name: np.empty((inputs, n)) for name in "qvp"}
        for name, array in arrays.items():
            setattr(wanted, name, array.ctypes.data)
        self._differentiate(wanted)
        names = [*(f"{name}(0)" for name in self.scene._coordinates), *(f"v_{name}(0)" for name in self.scene._coordinates),
                 *parameters]
        return Jacobian(tuple(names), **{name: array.T for name, array in arrays.items()})

    def gradient(self, steps: int, cotangent: Any, parameters: Sequence[str] = ()) -> Gradient:
        """Takes so many steps; the exact derivatives of a function of their end, by the adjoint: one way back, whatever the
        number of parameters.

        cotangent: the derivatives of the function by the end, a dict of arrays "q", "v" and "p" where they are not zero; or a
        function that gives it for the end, a ``State``.
        """
        n, m = len(self.scene._coordinates), len(self.scene._rows)
        kept = c.KeptException()

        def write(_: Any, end: Any, q: Any, v: Any, p: Any) -> int:
            try:
                at = end.contents
                seen = [np.ctypeslib.as_array(ctypes.cast(address, c.Numbers), (size,)).copy() if size else np.empty(0)
                           for address, size in ((at.q, n), (at.v, n), (at.p, n), (at.lambda_, m))]
                state = State(at.time, seen[0], seen[1], seen[2], seen[3], at.energy, np.empty(0), np.empty(0))
                given = _cotangent(cotangent(state) if callable(cotangent) else cotangent)
                for name, to in (("q", q), ("v", v), ("p", p)):
                    if name in given:
                        np.ctypeslib.as_array(to, (n,))[:] = column(given[name], self.scene._coordinates, name)
                return 0
            except BaseException as error:  # noqa: BLE001  raised below
                return kept.keep(error)

        parameters = texts(parameters, "parameters")
        wanted = self._derivatives(steps, parameters)
        q, v, by_parameters = np.empty(n), np.empty(n), np.empty(len(parameters))
        wanted.q, wanted.v, wanted.by_parameters = q.ctypes.data, v.ctypes.data, by_parameters.ctypes.data
        wanted.cotangent = c.COTANGENT(write)
        try:
            self._differentiate(wanted)
        finally:
            if (raised := kept.take()) is not None:
                raise raised
        return Gradient(q, v, dict(zip(parameters, by_parameters.tolist())))

    @staticmethod
    def _derivatives(steps: int, parameters: Sequence[str]) -> Any:
        names = (ctypes.c_char_p * max(1, len(parameters)))(*(c.encoded(name) for name in parameters))
        return c.Derivatives(steps=whole(steps, "steps", 1), parameters=len(parameters), parameter=names)

    def _differentiate(self, wanted: Any) -> None:
        flag = stop_flag()
        wanted.stop = ctypes.pointer(flag)
        with self._lock:
            code, message = c.call_interruptibly(
                lambda: c.lib.differentiate(self.scene._handle, self._handle, ctypes.byref(wanted)), flag)
        if code == c.INTERRUPTED:
            raise KeyboardInterrupt(message)
        if code != c.OK:
            self.scene._raise(code, message)

    def reset(self, q: Any = None, v: Any = None, t: float | None = None) -> None:
        """Starts anew: at the scene's start, or at a consistent point of one's own.  A column that is not given is the scene's;
        one given by names is 0 where nothing is said."""
        scene, self._told = self.scene, ""
        if q is None and v is None and t is None:
            with self._lock:
                self._check(c.lib.reset(self._handle, 0.0, None, None))
            return
        start_q = column(scene.start_q if q is None else q, scene._positions, "q")
        start_v = column(scene.start_v if v is None else v, scene._coordinates, "v")
        start_t = scene.start_time if t is None else real(t, "t")
        with self._lock:
            self._check(c.lib.reset(self._handle, start_t, start_q.ctypes.data, start_v.ctypes.data))

    def save(self) -> bytes:
        """All that the next steps depend on, the push included.  An integrator of the same scene, parameters, method and step goes
        on from it with the same bits; any other refuses it."""
        size = ctypes.c_size_t()
        with self._lock:
            self._check(c.lib.save(self._handle, None, 0, ctypes.byref(size)))
            room = ctypes.create_string_buffer(size.value)
            self._check(c.lib.save(self._handle, ctypes.cast(room, ctypes.c_void_p), size.value, ctypes.byref(size)))
        return room.raw

    def restore(self, snapshot: bytes) -> None:
        """Goes on from ``save()``; raises Misuse for a snapshot that does not fit."""
        if not isinstance(snapshot, bytes):
            raise Misuse(f"the snapshot is {type(snapshot).__name__}; bytes from save() are needed")
        with self._lock:
            self._check(c.lib.restore(self._handle, snapshot, len(snapshot)))

    @property
    def plan(self) -> TextTable:
        """What is assembled, and what is left out and why."""
        table = c.Table()
        with self._lock:
            self._check(c.lib.plan(self._handle, ctypes.byref(table)))
            rows = table.lines()
        how = self.statistics
        return TextTable(f"{self.scene.name} with {how.method}, order {how.order}", ("item", "decision", "reason"), rows)

    @property
    def doubt(self) -> str:
        """Empty, or why what was read is not to be believed."""
        with self._lock:
            return c.decoded(c.lib.doubt(self._handle))

    @property
    def statistics(self) -> Statistics:
        """Work since the start."""
        read = c.Statistics()
        self._check(c.lib.read_statistics(self._handle, ctypes.byref(read)))
        return Statistics(c.decoded(read.method), read.order, read.step, read.steps, read.solves, read.iterations,
                          read.residuals, read.jacobians, read.retries, read.smallest, read.largest, read.resets,
                          bool(read.stopped))

    def __repr__(self) -> str:
        return f"<integrator of {self.scene.name} at t = {self.time:g}>"

    def _check(self, code: int) -> None:
        self.scene._check(code)
