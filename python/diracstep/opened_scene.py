"""A scene of the library: its handle, what it says of itself, and how its errors are raised."""

from __future__ import annotations

import ctypes
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, Mapping, NoReturn, Sequence

import numpy as np

from . import _library as c
from .arrays import real, reals
from .arrays import text as _text
from .callbacks import CallbackScene, GeneratingFunction
from .errors import Failure, raised
from .opening import checked, source_of

if TYPE_CHECKING:
    from .run import Points


class OpenedScene:
    """What a Scene holds of the library; nothing of it is for users."""

    def _open(self, *, name: str | None = None, text: str | None = None, callbacks: CallbackScene | None = None,
              coordinates: Sequence[str] | None = None, parameters: Mapping[str, float] | None = None,
              plugins: Sequence[str] = (), methods: Sequence[GeneratingFunction] = (), drop_redundant: bool = False,
              tolerances: Mapping[str, float] | None = None) -> None:
        self._handle = 0
        self._callbacks = callbacks
        self._tolerances = reals(tolerances, "tolerances")
        self._changes = {_text(key, "the name of a parameter"): real(value, f"the parameter {key}") for key, value in (parameters or {}).items()}
        loaded = checked(plugins, methods, drop_redundant)
        self._methods = loaded["methods"]
        self._again: dict[str, Any] = {"name": name, "text": text, "coordinates": coordinates, "tolerances": self._tolerances,
                                       **loaded}
        source, kept = source_of(name, text, callbacks, self._changes, tolerances=self._tolerances, **loaded)
        handle = ctypes.c_void_p()
        self._check(c.lib.open(c.VERSION, ctypes.byref(source), ctypes.byref(handle)))
        del kept
        self._handle = handle.value or 0
        self._close = c.lib.close  # there until the end of the interpreter
        if name is not None and name.endswith((".toml", ".cir")) and text is None:
            self._again["name"] = os.path.abspath(name)  # also where the process moves to another folder
            text = Path(name).read_text(encoding="utf-8")
        self.text = text  #: of the scene file; None for scenes of the catalogue, of plugins, and of callbacks
        self._read_facts(coordinates)

    def _read_facts(self, coordinates: Sequence[str] | None) -> None:
        facts = c.Facts()
        self._check(c.lib.read_facts(self._handle, ctypes.byref(facts)))
        listed = self._lines(c.COORDINATES)
        # The sizes of what the library writes: not to be changed from outside.
        self._coordinates = tuple(coordinates or (name for name, _, _ in listed))
        self._positions = self._coordinates if facts.storage == facts.dimension else tuple(
            name for name, in self._lines(c.POSITIONS))
        self._rows = tuple(name for name, in self._lines(c.ROWS))
        self._invariants = tuple(name for name, _ in self._lines(c.INVARIANTS))
        self._outputs = tuple(name for name, in self._lines(c.OUTPUTS))
        n, stored = facts.dimension, facts.storage
        self._widths = {"q": stored, "v": n, "p": n, "lambda_": facts.rows, "invariants": facts.invariants, "outputs": facts.outputs}
        self.inputs: dict[str, tuple[float, float]] = {  #: tables of the time, and between which times they have values
            name: (float(first), float(last)) for name, first, last in self._lines(c.INPUTS)}
        self.events: dict[str, str] = {name: what for name, what in self._lines(c.EVENTS)}  #: by name: "record", "stop" or "act"
        self.units: dict[str, str] = {name: unit for name, (_, unit, _) in zip(self._coordinates, listed)}
        self.parameters: dict[str, float] = {name: float(value) for name, value, _, _ in self._lines(c.PARAMETERS)}
        self.about: list[tuple[str, str]] = [(what, text) for what, text in self._lines(c.ABOUT)]  #: what the scene says of itself
        self.name: str = self.about[0][1]
        self.start_time: float = facts.start_time
        self.start_q = np.ctypeslib.as_array(facts.start_q, (stored,)).copy()
        self.start_v = np.ctypeslib.as_array(facts.start_v, (n,)).copy()
        self.start_q.flags.writeable = self.start_v.flags.writeable = False
        self.until: float = facts.end_time  #: where a run ends that is given no other end
        self.step: float = facts.step  #: a coarse but sensible step

    def __del__(self) -> None:
        if getattr(self, "_handle", 0):
            self._close(self._handle)

    def _lines(self, what: int) -> list[tuple[str, ...]]:
        return c.lines_of(self._handle, what)

    def _check(self, code: int) -> None:
        if code != c.OK:
            self._raise(code, c.decoded(c.lib.message()))

    def _raise(self, code: int, message: str, run: Points | None = None) -> NoReturn:
        """The exception for a code, with what a callback raised as its cause."""
        exception = raised(code, message)
        if isinstance(exception, Failure):
            exception.run = run
        for owner in [self._callbacks, *self._methods]:
            if owner is not None and owner.exceptions.kept is not None:
                raise exception from owner.exceptions.take()
        raise exception
