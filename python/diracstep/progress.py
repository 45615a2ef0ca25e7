"""A bar on long runs: of tqdm where it is installed, else a line on standard error."""

from __future__ import annotations

import sys
import time
from typing import Any

from .points import Points

_PATIENCE = 2.0  # seconds until a bar is shown that was not asked for


class Progress:
    """Shows what part of a run is done; used as a context."""

    def __init__(self, wanted: bool | None, points: Points, room: int, start: float, end: float | None) -> None:
        self._points, self._room, self._start, self._end = points, room, start, end
        self._begun = time.monotonic()
        self._quiet = wanted is False or wanted is None and not sys.stderr.isatty() and "ipykernel" not in sys.modules
        self._patience = 0.0 if wanted else _PATIENCE
        self._bar: Any = None
        self._lines = False

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: Any) -> None:
        if self._bar is not None:
            self._bar.close()
        elif self._lines:
            print(file=sys.stderr)

    def part(self) -> float | None:
        """Between 0 and 1, or None where it is not known."""
        count = self._points.struct.count
        if self._room:
            return min(1.0, count / self._room)
        if count and self._end is not None and self._end != self._start:
            now = float(self._points.arrays["t"][count - 1])
            return min(1.0, max(0.0, (now - self._start) / (self._end - self._start)))
        return None

    def show(self) -> None:
        """Called now and then; shows nothing before a run has taken some time."""
        if self._quiet or time.monotonic() - self._begun < self._patience:
            return
        part = self.part()
        if self._bar is None and not self._lines:
            try:
                from tqdm.auto import tqdm
                self._bar = tqdm(total=100, bar_format="{l_bar}{bar}| {elapsed}<{remaining}")
            except ImportError:
                self._lines = True
        if self._bar is not None:
            self._bar.update(100.0 * (part or 0.0) - self._bar.n)
        else:
            done = f"{100.0 * part:.0f} %" if part is not None else f"{self._points.struct.count} points"
            print(f"\rdiracstep: {done}, {time.monotonic() - self._begun:.0f} s", end="", file=sys.stderr, flush=True)
