"""Scenes by their names, from files and from text; and what the library lists without a scene."""

from __future__ import annotations

import ctypes
import os
from typing import Iterator, Mapping, Sequence

from . import _library as c
from .arrays import path
from .arrays import text as checked_text
from .callbacks import GeneratingFunction
from .errors import Misuse
from .opening import checked, source_of
from .plan import TextTable
from .scene import Scene


def load(name: str | os.PathLike[str], *, plugins: Sequence[str] = (), methods: Sequence[GeneratingFunction] = (),
         drop_redundant: bool = False, tolerances: Mapping[str, float] | None = None, **parameters: float) -> Scene:
    """A scene from a file NAME.toml, or one of the catalogue or of a plugin by its name; parameters and sizes changed."""
    return Scene._made(name=path(name, "name"), parameters=parameters, plugins=plugins, methods=methods, drop_redundant=drop_redundant,
                       tolerances=tolerances)


def parse(text: str, *, name: str = "text", plugins: Sequence[str] = (), methods: Sequence[GeneratingFunction] = (),
          drop_redundant: bool = False, tolerances: Mapping[str, float] | None = None, **parameters: float) -> Scene:
    """A scene from the text of a scene file; ``name`` stands in messages."""
    return Scene._made(name=checked_text(name, "name"), text=checked_text(text, "text"), parameters=parameters,
                       plugins=plugins, methods=methods, drop_redundant=drop_redundant, tolerances=tolerances)


class _Lists:
    """A model without a scene, for the lists of the library."""

    def __init__(self, plugins: Sequence[str] = ()) -> None:
        source, kept = source_of(None, None, None, {}, tolerances={}, **checked(plugins, (), False))
        self._handle = ctypes.c_void_p()
        c.check(c.lib.open(c.VERSION, ctypes.byref(source), ctypes.byref(self._handle)))
        del kept
        self._close = c.lib.close

    def lines(self, what: int) -> list[tuple[str, ...]]:
        return c.lines_of(self._handle.value or 0, what)

    def __del__(self) -> None:
        if getattr(self, "_handle", None):
            self._close(self._handle)


class Catalogue(Mapping[str, Scene]):
    """The scenes that come with the library, by name; each is made when it is asked for."""

    def __getitem__(self, name: str) -> Scene:
        if name not in self:
            raise KeyError(f"no scene {name!r}; there are " + ", ".join(self))
        return load(name)

    def __iter__(self) -> Iterator[str]:
        return iter([name for name, in _Lists().lines(c.SCENES)])

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, name: object) -> bool:
        return any(name == known for known in self)

    def __repr__(self) -> str:
        return "<catalogue: " + ", ".join(self) + ">"

    def _repr_html_(self) -> str:
        return TextTable("", ("scene", "kind", "description"), [(name, *self._described(name)) for name in self])._repr_html_()

    def _described(self, name: str) -> tuple[str, str]:
        try:
            about = dict(self[name].about)
        except Misuse as misuse:  # a scene on a group, which the command alone runs
            return "", str(misuse)
        return about.get("kind", ""), about.get("description", "")


catalogue = Catalogue()


def methods(plugins: Sequence[str] = ()) -> TextTable:
    """The methods, with those of plugins: name, order, whether self-adjoint, formula."""
    return TextTable("", ("method", "order", "", "formula"), _Lists(plugins).lines(c.METHODS))
