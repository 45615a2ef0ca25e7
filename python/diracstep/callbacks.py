"""Scenes and methods whose formulas are Python functions that are called at every evaluation: for teaching, and for what
cannot be written as a formula.  They are hundreds of times slower than traced ones."""

from __future__ import annotations

import ctypes
import time
import warnings
from typing import TYPE_CHECKING, Any, Callable, Mapping, Sequence

import numpy as np

from . import _library as c
from .arrays import text
from .errors import CallbackCost, Failure, Misuse
from .scene_text import arguments_of, scene_name

if TYPE_CHECKING:
    from .scene import Scene


def _view(address: int, count: int) -> np.ndarray:
    """The library's column as an array, not copied."""
    return np.frombuffer((ctypes.c_double * count).from_address(address))  # type: ignore[call-overload]


def _copy(address: int, count: int) -> np.ndarray:
    """The column for a user's function, who may keep it and may not write to it."""
    column = _view(address, count).copy()
    column.flags.writeable = False
    return column


class _Called:
    """A Python function with some of its arguments fixed, asked for by name."""

    def __init__(self, function: Callable[..., Any], parameters: Mapping[str, float], columns: Sequence[str], what: str) -> None:
        self.function, self.what = function, what
        wanted = arguments_of(function, {**{name: None for name in columns}, **parameters}, what)
        self.fixed = {name: value for name, value in parameters.items() if name in wanted}
        self.columns = [name for name in columns if name in wanted]

    def __call__(self, **columns: Any) -> Any:
        return self.function(**{name: columns[name] for name in self.columns}, **self.fixed)


class CallbackScene:
    """The structs of a scene of Python functions, and all that they point to."""

    def __init__(self, name: str, coordinates: Sequence[str], parameters: Mapping[str, float], lagrangian: Callable[..., Any],
                 rows: Any, force: Any, q: np.ndarray, v: np.ndarray, t: float, end: float, step: float) -> None:
        self.exceptions = c.KeptException()
        self.calls = 0
        self._kept: list[Any] = []  # everything that C points to
        self._n = len(coordinates)
        self._parameters = dict(parameters)
        self.struct = c.CallbackScene(name=c.encoded(name), dimension=self._n, start_time=t, end_time=end, step=step)
        self.struct.coordinates = self._keep((ctypes.c_char_p * self._n)(*(c.encoded(scene_name(entry)) for entry in coordinates)))
        self.struct.start_q, self.struct.start_v = (self._keep(column).ctypes.data_as(c.Numbers) for column in (q, v))
        self.struct.lagrangian = ctypes.pointer(self._keep(c.Function(value=self._scalar(lagrangian))))
        blocks = [self._block(function, q, k) for k, function in enumerate(
            rows if isinstance(rows, (list, tuple)) else [rows] if rows else [])]
        self.struct.row_blocks = len(blocks)
        self.struct.rows = self._keep((ctypes.POINTER(c.Rows) * max(1, len(blocks)))(*(ctypes.pointer(block) for block in blocks)))
        if force is not None:
            self.struct.force = ctypes.pointer(self._keep(c.Force(value=self._force(force))))

    def _keep(self, thing: Any) -> Any:
        self._kept.append(thing)
        return thing

    def _guard(self, kind: Any, action: Callable[..., None]) -> Any:
        def call(_: Any, *arguments: Any) -> int:
            self.calls += 1
            try:
                action(*arguments)
                return 0
            except BaseException as error:  # noqa: BLE001  it cannot pass through C
                return self.exceptions.keep(error)

        return self._keep(kind(call))

    def _scalar(self, function: Callable[..., Any]) -> Any:
        called, n = _Called(function, self._parameters, ("q", "v", "t"), "lagrangian"), self._n

        def value(t: float, q: Any, v: Any, result: Any) -> None:
            _view(result, 1)[0] = float(called(q=_copy(q, n), v=_copy(v, n), t=t))

        return self._guard(c.VALUE, value)

    def _force(self, function: Callable[..., Any]) -> Any:
        called, n = _Called(function, self._parameters, ("q", "v", "t"), "force"), self._n

        def value(t: float, q: Any, v: Any, result: Any) -> None:
            _view(result, n)[:] = called(q=_copy(q, n), v=_copy(v, n), t=t)

        return self._guard(c.VALUE, value)

    def _block(self, function: Callable[..., Any], q: np.ndarray, index: int) -> c.Rows:
        """Rows φ(q, t) = 0, or rows that are linear in v where the function takes v."""
        called, n = _Called(function, self._parameters, ("q", "v", "t"), f"rows[{index}]"), self._n
        count = len(np.atleast_1d(np.asarray(called(q=q.copy(), v=np.zeros(n), t=self.struct.start_time), dtype=float)))
        block = self._keep(c.Rows(rows=count))
        if "v" not in called.columns:
            def position(t: float, at: Any, result: Any) -> None:
                _view(result, count)[:] = called(q=_copy(at, n), v=None, t=t)

            block.holonomic, block.position = 1, self._guard(c.POSITION, position)
            return block
        basis = np.eye(n)

        def coefficients(t: float, at: Any, a: Any, b: Any) -> None:
            place = _copy(at, n)
            constant = np.atleast_1d(np.asarray(called(q=place, v=np.zeros(n), t=t), dtype=float))
            matrix = _view(a, n * count).reshape(n, count)  # column by column
            for k in range(n):
                matrix[k] = np.atleast_1d(called(q=place, v=basis[k], t=t)) - constant
            _view(b, count)[:] = constant

        block.coefficients = self._guard(c.COEFFICIENTS, coefficients)
        return block


class GeneratingFunction:
    """A method whose generating function of type 1, S(q0, q1), is a Python function: a discrete Lagrangian.

    ``function(L, q0, q1, h, t)`` returns S in units of action; ``L(t, q, v)`` evaluates the scene's Lagrangian.  The library takes
    S by differences.  Give the method to a scene with ``methods=[…]``, and its name to ``run``.
    """

    def __init__(self, name: str, order: int, function: Callable[..., Any], *, self_adjoint: bool = False) -> None:
        if not text(name, "name").startswith("type1/"):
            raise Misuse(f"the name {name!r} does not begin with type1/")
        self.name = name
        self.exceptions = c.KeptException()

        def value(_: Any, system: Any, interval: Any, y: Any, result: Any) -> int:
            try:
                seen = system.contents
                n = seen.dimension
                columns = _copy(y, 2 * n).reshape(2, n)
                _view(result, 1)[0] = float(function(_lagrangian_of(seen), columns[0], columns[1], interval.size, interval.start))
                return 0
            except BaseException as error:  # noqa: BLE001  it cannot pass through C
                return self.exceptions.keep(error)

        self._value = c.GENERATING_VALUE(value)
        self._method = c.GeneratingMethod(name=c.encoded(name), type=1, order=order, flags=1 if self_adjoint else 0, value=self._value)
        self._list = (ctypes.POINTER(c.GeneratingMethod) * 1)(ctypes.pointer(self._method))
        self.struct = c.Plugin(version=c.PLUGIN_VERSION, size=ctypes.sizeof(c.Plugin), name=f"python_{id(self)}".encode(), methods=1,
                               method=self._list)


def _lagrangian_of(system: c.System) -> Callable[[float, Any, Any], float]:
    def evaluate(t: float, q: Any, v: Any) -> float:
        q, v = (np.ascontiguousarray(column, dtype=float) for column in (q, v))
        result = ctypes.c_double()
        status = system.lagrangian.value(system.lagrangian.data, t, q.ctypes.data_as(c.Numbers), v.ctypes.data_as(c.Numbers),
                                         ctypes.pointer(result))
        if status != 0:
            raise ArithmeticError(f"the scene's Lagrangian returned error {status}")
        return result.value

    return evaluate


def say_cost(scene: Scene, source: CallbackScene) -> None:
    """Measures one step of a scene of callbacks, without the checks of a run, and warns of what it takes."""
    try:
        integrator = scene.integrator()
        size, before, start = integrator.statistics.step, source.calls, time.perf_counter()
        integrator.step(size=size)
    except (Misuse, Failure):
        source.exceptions.take()
        return  # a run will tell
    taken, calls = time.perf_counter() - start, source.calls - before
    warnings.warn(f"{scene.name}: a step takes {taken:.2g} s, in which the Python functions are called {calls} times, and the checks "
                  "of a run take some dozens of steps more; traced functions (without callback=True) take microseconds", CallbackCost, stacklevel=3)
