"""What a run came to: the points of a motion as arrays."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Mapping, Sequence

import numpy as np

from . import _library as c
from .arrays import column, real
from .errors import Misuse
from .plan import TextTable

if TYPE_CHECKING:
    from .integrator import Gradient, Jacobian
    from .scene import Scene


@dataclass(frozen=True)
class Statistics:
    """Work of a run or of an integrator since its start."""

    method: str
    order: int
    step: float  #: its size; 0 where steps vary
    steps: int
    solves: int
    iterations: int
    residuals: int
    jacobians: int
    retries: int  #: steps that needed more than Newton's method from its first guess
    smallest: float = 0.0  #: size of a step that varies
    largest: float = 0.0
    resets: int = 0  #: of the controller of steps that vary
    stopped: bool = False  #: whether an event has ended the motion


@dataclass(frozen=True, eq=False)
class Event:
    """Where an event of the scene was met.  The arrays own their memory."""

    name: str
    t: float
    q: np.ndarray  #: s numbers, just before it
    v: np.ndarray  #: n numbers, just before it
    after_q: np.ndarray | None  #: what it made of them; None where it does not act
    after_v: np.ndarray | None
    impulse: float  #: of a contact, momentum over the unit of its row; NaN where there is none


def event_from(read: Any, widths: Mapping[str, int]) -> Event:
    """A copy of what the library tells of an event."""
    q, v, after_q, after_v = (np.ctypeslib.as_array(column, (widths[what],)).copy() if column else None
                              for column, what in ((read.q, "q"), (read.v, "v"), (read.after_q, "q"), (read.after_v, "v")))
    return Event(c.decoded(read.name), read.time, q, v, after_q, after_v, read.impulse)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Search:
    """How an error asked for was reached."""

    estimate: float  #: of the relative error at the end
    observed_order: float
    method: str
    order: int
    step: float  #: eps where steps vary
    varies: bool
    solves: int  #: of all runs
    reason: str
    warning: str
    runs: TextTable
    stopped: bool = False  #: whether an event has ended the motion


def search_from(found: Any) -> Search:
    """A copy of what the library tells of a search."""
    heading = ("step", "steps", "solves", "difference", "estimate", "order", "")
    return Search(found.estimate, found.observed_order, c.decoded(found.method), found.order, found.step, bool(found.varies),
                  found.solves, c.decoded(found.reason), c.decoded(found.warning), TextTable("", heading, found.runs.lines()), bool(found.stopped))


@dataclass(frozen=True, repr=False, eq=False)
class Points:
    """Points of one scene: row k of each array is point k.

    ``t``, ``energy``: N numbers.  ``q``: N × s, a column for each of ``scene.positions``.  ``v``, ``p``: N × n, a column for each
    coordinate; v lies in the distribution, p is the representative asked for.  ``lambda_``: N × m, the forces of the rows.  ``invariants``: N × i, what the scene declares as
    kept.  ``outputs``: N × o, formulas of the scene's file.  Units are those of the scene.  The arrays own their memory.
    """

    scene: Scene
    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    p: np.ndarray
    lambda_: np.ndarray
    energy: np.ndarray
    invariants: np.ndarray
    outputs: np.ndarray

    @cached_property
    def _places(self) -> dict[str, tuple[np.ndarray, int]]:
        """Array and column of each quantity."""
        scene, places = self.scene, {}
        for index, name in enumerate(scene.rows):
            places[name] = (self.lambda_, index)
        for index, name in enumerate(scene.invariants):
            places[name] = (self.invariants, index)
        for index, name in enumerate(scene.outputs):
            places[name] = (self.outputs, index)
        for index, name in enumerate(scene.coordinates):
            places["v_" + name] = (self.v, index)
            places["p_" + name] = (self.p, index)
        for index, name in enumerate(scene.positions):
            places[name] = (self.q, index)
        return places

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_places"}  # they are views

    def __len__(self) -> int:
        """The number of points."""
        return len(self.t)

    def __getitem__(self, name: str) -> np.ndarray:
        """One quantity of all points: ``"x"``, ``"v_x"``, ``"p_x"``, the name of a row for its force, of an invariant, of an
        output of the scene's file, or ``"t"`` and ``"energy"``."""
        if isinstance(name, str) and name in self._places:
            array, index = self._places[name]
            return array[:, index]
        if name in ("t", "energy"):
            return getattr(self, name)
        raise KeyError(f"no quantity {name!r}; there are t, energy, " + ", ".join(self._places))

    def __contains__(self, name: object) -> bool:
        """Whether ``[name]`` is known."""
        return name in self.names

    __iter__ = None  # it has points, and quantities by name: neither is what a loop would mean

    @property
    def names(self) -> list[str]:
        """The quantities that ``[name]`` knows."""
        return ["t", *self._places, "energy"]

    def table(self) -> Any:
        """All quantities as a pandas.DataFrame, or as a structured array where pandas is not installed."""
        columns = {name: self[name] for name in self.names}
        try:
            import pandas
        except ImportError:
            table = np.empty(len(self), dtype=[(name, float) for name in columns])
            for name, values in columns.items():
                table[name] = values
            return table
        return pandas.DataFrame(columns)

    def plot(self, *names: str, x: str = "t", ax: Any = None, **style: Any) -> Any:
        """Draws quantities (all of q without names) over the time or another quantity; the axes of matplotlib."""
        if ax is None:
            ax = _pyplot().subplots()[1]
        for name in names or self.scene.positions:
            ax.plot(self[x], self[name], **{"label": name, **style})
        ax.set_xlabel(_labelled(x, self.scene))
        if len(names) == 1:
            ax.set_ylabel(_labelled(names[0], self.scene))
        else:
            ax.legend()
        return ax


@dataclass(frozen=True, repr=False, eq=False)
class Run(Points):
    """Points of a motion, with the arrays of ``Points``, and how they came about."""

    statistics: Statistics | None = None
    search: Search | None = None  #: where an error was asked for
    doubt: str = ""  #: empty, or why the points are not to be believed
    interrupted: bool = False  #: whether Ctrl-C ended it
    events: list[Event] = field(default_factory=list)  #: of the scene, in the order of time; the last ends a ``stopped`` run
    _again: Any = None  #: end, options and number of the steps of this run; None where they are not of one size

    @property
    def stopped(self) -> bool:
        """Whether an event of the scene has ended the motion."""
        how = self.statistics or self.search
        return how is not None and how.stopped

    # ---- derivatives ----
    def jacobian(self, parameters: Sequence[str] = ()) -> Jacobian:
        """The exact derivatives of the end of this run by its start, q and v, and by parameters of the scene.

        The motion is taken once more, with its derivatives.  Of runs of fixed steps without events.
        """
        return self._stepped("jacobian", parameters)

    def gradient(self, cotangent: Any, parameters: Sequence[str] = ()) -> Gradient:
        """The exact derivatives of a function of the end of this run by its start and by parameters, by the adjoint: about four
        motions, whatever their number.

        cotangent: the derivatives of the function by the end, {"q": n numbers, "v": …, "p": …}, or a function of the end, a
        ``State``, that gives them.
        """
        return self._stepped("gradient", cotangent, parameters)

    def vjp(self, *, q: Any = None, v: Any = None, p: Any = None, parameters: Sequence[str] = ()) -> Gradient:
        """Cotangents of the end, n numbers each, pulled back to the start and to parameters: gradient() of what is linear."""
        given = {name: column for name, column in (("q", q), ("v", v), ("p", p)) if column is not None}
        return self.gradient(given, parameters)

    def jvp(self, *, q: Any = None, v: Any = None, parameters: Mapping[str, float] | None = None) -> dict[str, np.ndarray]:
        """What a direction at the start and in the parameters becomes at the end: {"q": n numbers, "v": …, "p": …}.

        q, v: n numbers, or by coordinate; parameters: by name.  A product with jacobian(), which is taken for it.
        """
        moved = parameters or {}
        direction = np.concatenate([np.zeros(len(names)) if given is None else column(given, names, what)
                                    for given, what, names in ((q, "q", self.scene.positions), (v, "v", self.scene.coordinates))] + [[real(value, name) for name, value in moved.items()]])
        found = self.jacobian(list(moved))
        return {what: getattr(found, what) @ direction for what in "qvp"}

    def _stepped(self, what: str, *arguments: Any) -> Any:
        if self._again is None or self.statistics is not None and self.statistics.step == 0.0:
            raise Misuse("derivatives need a run of steps of fixed size to its end (adaptive=False, or a step)")
        end, options, steps = self._again
        integrator = self.scene.integrator(until=end, **options)
        if steps is None:
            steps = round((end - self.scene.start_time) / integrator.statistics.step)
        if what == "jacobian":
            return integrator.jacobian(steps, *arguments)
        return integrator.gradient(steps, *arguments)

    def animate(self, x: str, y: str, *, frames: int = 200, interval: int = 40, ax: Any = None) -> Any:
        """A point that moves in the plane of two quantities, with its path: a matplotlib.animation.FuncAnimation.

        Frames are evenly spaced in time.  Keep what is returned as long as it is to move.
        """
        pyplot = _pyplot()
        from matplotlib.animation import FuncAnimation

        if len(self) < 2:
            raise Misuse(f"a run of {len(self)} points does not move")
        if ax is None:
            ax = pyplot.subplots()[1]
        forward = np.argsort(self.t, kind="stable")
        times = np.linspace(self.t[forward[0]], self.t[forward[-1]], frames)
        across, up = (np.interp(times, self.t[forward], self[name][forward]) for name in (x, y))
        ax.plot(self[x], self[y], color="0.85", zorder=0)
        ax.set(xlabel=_labelled(x, self.scene), ylabel=_labelled(y, self.scene))
        ax.set_aspect("equal", adjustable="datalim")
        (path,), (point,) = ax.plot([], []), ax.plot([], [], "o")
        title = ax.set_title("")

        def show(k: int) -> tuple[Any, ...]:
            path.set_data(across[:k + 1], up[:k + 1])
            point.set_data(across[k:k + 1], up[k:k + 1])
            title.set_text(f"t = {times[k]:.3g}")
            return path, point, title

        return FuncAnimation(ax.figure, show, frames=frames, interval=interval, blit=False)

    def __repr__(self) -> str:
        span = f", t = {self.t[0]:g} … {self.t[-1]:g}" if len(self) else ""
        how = f", {self.statistics.method}" if self.statistics else f", {self.search.method}" if self.search else ""
        state = ", interrupted" if self.interrupted else ", doubted" if self.doubt else ""
        return f"<run of {self.scene.name}: {len(self)} points{span}{how}{state}>"


@dataclass(frozen=True, repr=False, eq=False)
class Ensemble(Points):
    """Ends of many motions of one scene: row k is that of start k.

    ``failures`` says why some stopped early; their rows are the last points that could be read.  ``doubts`` says which
    members are not to be believed, of at most twenty that were looked at.
    """

    failures: dict[int, str]
    doubts: dict[int, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"<ensemble of {self.scene.name}: {len(self)} ends, {len(self.failures)} failed>"


def _pyplot() -> Any:
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise ImportError("drawing needs matplotlib (Debian package python3-matplotlib)") from error
    return pyplot


def _labelled(name: str, scene: Scene) -> str:
    unit = scene.units.get(name, "")
    return f"{name} [{unit}]" if unit else name
