"""The arrays a run is written into."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

from . import _library as c

COLUMNS = ("t", "q", "v", "p", "lambda_", "invariants", "outputs", "energy")


class Points:
    """NumPy's arrays, which the library fills row by row; they grow where the number of points is not known."""

    def __init__(self, widths: dict[str, int], room: int, grows: bool = True) -> None:
        """widths: numbers of a point in each column that holds several."""
        self.arrays: dict[str, np.ndarray] = {
            name: np.empty((room, widths[name]) if name in widths else room) for name in COLUMNS}
        self.struct = c.Points(room=room)
        self._enlarge = c.ENLARGE(self._grow)  # kept: the library calls it
        if grows:
            self.struct.enlarge = self._enlarge
        self.failure: BaseException | None = None
        self._point()

    def _point(self) -> None:
        for name, array in self.arrays.items():
            setattr(self.struct, name, array.ctypes.data if array.size else None)

    def _grow(self, _: Any, points: Any) -> int:
        try:
            self._resize(2 * self.struct.room)
            self.struct.room *= 2
            self._point()
            return 0
        except BaseException as error:  # noqa: BLE001  memory, mostly; it cannot pass through C
            self.failure = error
            return 1

    def _resize(self, room: int) -> None:
        for array in self.arrays.values():
            array.resize((room, *array.shape[1:]), refcheck=False)  # in place where the memory allows

    def finish(self) -> dict[str, np.ndarray]:
        """The arrays, of as many rows as were written."""
        if self.struct.count != len(self.arrays["t"]):
            self._resize(self.struct.count)
        return self.arrays

    def reference(self) -> Any:
        return ctypes.byref(self.struct)
