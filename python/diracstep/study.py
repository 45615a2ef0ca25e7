"""Studies by the command: error against run time, beside SUNDIALS IDA and an explicit code.

References and baselines are parts of the command and not of libdiracstep, so it is the command that measures.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Sequence

import numpy as np

from .arrays import real, texts, whole
from .command import Verbs
from .errors import Misuse
from .run import _pyplot

if TYPE_CHECKING:
    from .scene import Scene


class Study:
    """Rows of a study: one for each method, order and step, and for each tolerance of a baseline."""

    def __init__(self, scene: str, document: dict[str, Any]) -> None:
        self.scene = scene
        self.document = document["studies"][0]  #: as the command gives it, with the reference and the orders measured
        self.rows: list[dict[str, Any]] = self.document["rows"]

    def curves(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """CPU seconds and relative error at the end, by method."""
        curves: dict[str, list[tuple[float, float]]] = {}
        for row in self.rows:
            seconds, error = (row.get("cpu_seconds") or {}).get("median"), row.get("error_q")
            if seconds and error:
                curves.setdefault(_label(row), []).append((seconds, error))
        return {label: tuple(np.array(sorted(points)).T) for label, points in curves.items()}  # type: ignore[misc]

    def plot(self, ax: Any = None) -> Any:
        """Error against run time, both logarithmic; the axes of matplotlib."""
        if ax is None:
            ax = _pyplot().subplots()[1]
        for label, (seconds, error) in sorted(self.curves().items()):
            ax.loglog(seconds, error, "o-", label=label)
        ax.set(xlabel="CPU time [s]", ylabel="relative error at the end", title=self.scene)
        ax.legend()
        return ax

    def table(self) -> Any:
        """The rows as a pandas.DataFrame, or as they are where pandas is not installed."""
        try:
            import pandas
        except ImportError:
            return self.rows
        return pandas.DataFrame(self.rows)

    def __repr__(self) -> str:
        return f"<study of {self.scene}: {len(self.rows)} rows>"


def _label(row: dict[str, Any]) -> str:
    order = row.get("order")
    return f"{row['method']}, order {order}" if order else str(row["method"])


def _listed(values: Any, what: str) -> list[Any]:
    if isinstance(values, str) or not hasattr(values, "__iter__"):
        raise Misuse(f"{what} is {values!r}; a list of numbers is needed")
    return list(values)


def run_study(scene: Scene, *, methods: Sequence[str], orders: Sequence[int], steps: Sequence[float], rtols: Sequence[float],
              until: float | None, ida: bool, erk: bool, repeat: int, budget: float) -> Study:
    if rtols is not None and len(_listed(rtols, "rtols")) and not (ida or erk):
        raise Misuse(f"rtols is {rtols!r}; it holds tolerances of IDA and the explicit code, which ida=False and erk=False leave out")
    arguments = ["--repeat", str(whole(repeat, "repeat", 1)), "--budget", repr(real(budget, "budget"))]
    given = {"methods": texts(methods, "methods"), "orders": [str(whole(order, "orders", 1)) for order in _listed(orders, "orders")],
             "steps": [repr(real(step, "steps")) for step in _listed(steps, "steps")],
             "rtols": [repr(real(rtol, "rtols")) for rtol in _listed(rtols, "rtols")]}
    for option, values in given.items():
        arguments += ["--" + option, ",".join(values)] if values else []
    arguments += ["--end", repr(real(until, "until"))] if until is not None else []
    arguments += [] if ida else ["--without-ida"]
    arguments += [] if erk else ["--without-erk"]
    with Verbs(scene) as verbs:
        return Study(scene.name, verbs.call("study", *arguments, *verbs.tolerances()))
