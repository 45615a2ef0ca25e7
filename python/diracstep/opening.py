"""What a scene is made from, as the struct of the library."""

from __future__ import annotations

import ctypes
from typing import Any, Mapping, Sequence

from . import _library as c
from .arrays import flag, path, texts
from .callbacks import CallbackScene, GeneratingFunction
from .errors import Misuse
from .scene_text import require_names


def checked(plugins: Any, methods: Any, drop_redundant: Any) -> dict[str, Any]:
    """What all ways of making a scene take; raises Misuse for what is of another kind."""
    if isinstance(plugins, (str, bytes)) or not hasattr(plugins, "__iter__"):
        raise Misuse(f"plugins is {plugins!r}; a list of paths is needed")
    if isinstance(methods, GeneratingFunction) or not hasattr(methods, "__iter__"):
        raise Misuse(f"methods is {methods!r}; a list of ds.GeneratingFunction is needed")
    for index, method in enumerate(methods):
        if not isinstance(method, GeneratingFunction):
            raise Misuse(f"methods[{index}] is {method!r}; a ds.GeneratingFunction is needed")
    return {"plugins": [path(file, f"plugins[{index}]") for index, file in enumerate(plugins)], "methods": list(methods),
            "drop_redundant": flag(drop_redundant, "drop_redundant")}


def source_of(name: str | None, text: str | None, callbacks: CallbackScene | None, changes: Mapping[str, float],
              plugins: Sequence[str], methods: Sequence[GeneratingFunction], drop_redundant: bool,
              tolerances: Mapping[str, float]) -> tuple[c.Source, Any]:
    """The struct, and what must stay until it has been used."""
    source = c.Source(name=c.encoded(name), text=c.encoded(text), drop_redundant=int(drop_redundant))
    if callbacks is not None:
        source.callbacks = ctypes.pointer(callbacks.struct)
    parameters = (c.Parameter * max(1, len(changes)))(*(c.Parameter(c.encoded(key), value) for key, value in changes.items()))
    source.parameters, source.parameter = len(changes), parameters
    files = (ctypes.c_char_p * max(1, len(plugins)))(*(c.encoded(file) for file in plugins))
    source.plugins, source.plugin = len(plugins), files
    linked = (ctypes.POINTER(c.Plugin) * max(1, len(methods)))(*(ctypes.pointer(method.struct) for method in methods))
    source.linked, source.linked_plugin = len(methods), linked
    own = (c.Parameter * max(1, len(tolerances)))(*(c.Parameter(c.encoded(key), value) for key, value in tolerances.items()))
    source.tolerances, source.tolerance = len(tolerances), own
    return source, (parameters, files, linked, own)


def names_of(coordinates: Any) -> list[str]:
    """The coordinates of a scene; raises Misuse for what is no list of different names."""
    names = texts(coordinates, "coordinates")
    if not names:
        raise Misuse("a scene needs coordinates")
    twice = [name for index, name in enumerate(names) if name in names[:index]]
    if twice:
        raise Misuse(f"coordinates: {twice[0]!r} stands twice")
    require_names(names, "coordinates")
    return names


def parts_of(start: Mapping[str, float], coordinates: Sequence[str]) -> tuple[Any, ...]:
    """q, v and p by coordinate, None where there are none, of a start by names."""
    if not isinstance(start, Mapping):
        raise Misuse(f"start is {start!r}; a dictionary of numbers by name is needed, q and v take columns")
    parts: tuple[dict[str, float], ...] = {}, {}, {}
    for name, value in start.items():
        for part, prefix in zip(parts, ("", "v_", "p_")):
            if name.startswith(prefix) and name[len(prefix):] in coordinates:
                part[name[len(prefix):]] = value
                break
        else:
            raise Misuse(f"start: no coordinate {name!r}; there are " + ", ".join(coordinates) + ", and v_ and p_ of them")
    return tuple(part or None for part in parts)
