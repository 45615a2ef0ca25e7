"""The text of a scene file from traced functions."""

from __future__ import annotations

import inspect
import json
import numbers
import re
import reprlib
import unicodedata
from typing import Any, Callable, Mapping, Sequence

import numpy as np

from .arrays import real
from .errors import Misuse
from .symbols import Column, Expression, formulas

Formula = Callable[..., Any]


def scene_name(name: str) -> str:
    """A name that scene files know: Greek letters by their names, other letters beyond ASCII by their numbers."""
    if name.isascii():
        return name
    parts = []
    for letter in unicodedata.normalize("NFC", name):
        greek = re.match(r"GREEK (CAPITAL|SMALL) LETTER (\w+)$", unicodedata.name(letter, ""))
        if letter.isascii():
            parts.append(letter)
        elif greek:
            parts.append(greek[2].capitalize() if greek[1] == "CAPITAL" else greek[2].lower())
        else:
            parts.append(f"u{ord(letter):x}")
    return "".join(parts)


def require_names(names: Sequence[Any], what: str) -> None:
    """Raises Misuse for a name that formulas cannot have: no text, or other signs, those that do not print among them."""
    for name in names:
        if not isinstance(name, str) or not name.isprintable() or not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", scene_name(name)):
            raise Misuse(f"{what}: {reprlib.repr(name)} is no name; letters, digits and _ are needed, and no digit first")


class Symbols:
    """What functions are called with: q, v, p, t, and each parameter under its name."""

    def __init__(self, coordinates: Sequence[str], parameters: Sequence[str]) -> None:
        names = {name: index for index, name in enumerate(coordinates)}
        known = [scene_name(name) for name in coordinates]
        self.by_name: dict[str, Any] = {
            "q": Column([Expression(name) for name in known], names),
            "v": Column([Expression("v_" + name) for name in known], names),
            "p": Column([Expression("p_" + name) for name in known], names),
            "t": Expression("t"),
        }
        for name in parameters:
            if name in self.by_name:
                raise Misuse(f"a parameter cannot be named {name!r}: functions get the {name} of the scene under this name")
            self.by_name[name] = Expression(scene_name(name))

    def traced(self, function: Formula, what: str) -> Any:
        """What the function returns, called once."""
        return function(**arguments_of(function, self.by_name, what))


def arguments_of(function: Formula, by_name: Mapping[str, Any], what: str) -> dict[str, Any]:
    """The function's arguments by its own names of them; raises Misuse for a name that is not known."""
    if not callable(function):
        raise Misuse(f"{what} is {type(function).__name__}; a function is needed, such as lambda q, v: …")
    try:
        wanted = inspect.signature(function).parameters.values()
    except ValueError:
        raise Misuse(f"{what} is {function!r}, which does not tell its arguments; a function is needed, such as lambda q, v: …") from None
    unknown = [entry.name for entry in wanted if entry.name not in by_name and entry.default is entry.empty]
    if unknown:
        raise Misuse(f"{what} has an argument {unknown[0]!r}; known are " + ", ".join(by_name))
    return {entry.name: by_name[entry.name] for entry in wanted if entry.name in by_name}


def _string(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def _one(value: Any, what: str) -> Any:
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value.item()
    if not isinstance(value, (Expression, numbers.Real)):
        hint = ", written with return" if value is None else ""
        raise Misuse(f"{what} returned {type(value).__name__}; one formula is needed{hint}")
    return value


def _by_name(values: Any, names: Sequence[str], what: str) -> dict[str, Any]:
    """A column as a dictionary, from one or from a sequence of the right length."""
    if isinstance(values, Mapping):
        unknown = [name for name in values if name not in names]
        if unknown:
            raise Misuse(f"{what}: no coordinate {unknown[0]!r}; there are " + ", ".join(names))
        return dict(values)
    if isinstance(values, str) or not hasattr(values, "__iter__") or np.ndim(values) == 0:
        raise Misuse(f"{what} is {type(values).__name__}; {len(names)} entries or a dictionary by coordinate are needed")
    values = list(values)
    if len(values) != len(names):
        raise Misuse(f"{what} has {len(values)} entries; the scene has {len(names)} coordinates")
    return dict(zip(names, values))


class SceneText:
    """Gathers the formulas of a scene, and writes them as the text of a scene file."""

    def __init__(self, name: str, coordinates: Sequence[str], parameters: Mapping[str, float]) -> None:
        self.name, self.coordinates, self.parameters = name, list(coordinates), dict(parameters)
        self.symbols = Symbols(self.coordinates, list(self.parameters))
        self._keys: list[tuple[str, str]] = []  # table and key of each formula
        self._formulas: list[Any] = []

    def _add(self, table: str, key: str, formula: Any) -> None:
        self._keys.append((table, key))
        self._formulas.append(formula)

    def add(self, key: str, function: Formula | None) -> None:
        """One of lagrangian, hamiltonian, dissipation."""
        if function is not None:
            self._add("", key, _one(self.symbols.traced(function, key), key))

    def add_rows(self, rows: Any) -> None:
        for index, function in enumerate(rows if isinstance(rows, (list, tuple)) else [rows] if rows else []):
            what = "rows" if index == 0 else f"rows[{index}]"
            traced = self.symbols.traced(function, what)
            if isinstance(traced, Mapping):
                require_names(list(traced), what)
                named = {scene_name(name): row for name, row in traced.items()}
            else:
                listed = list(traced) if isinstance(traced, (list, tuple, np.ndarray)) and np.ndim(traced) > 0 else [traced]
                count = sum(table == "rows" for table, _ in self._keys)
                named = {f"row{count + k + 1}": row for k, row in enumerate(listed)}
            for name, row in named.items():
                self._add("rows", name, _one(row, f"row {name}"))

    def add_force(self, function: Formula | None) -> None:
        if function is not None:
            for name, formula in _by_name(self.symbols.traced(function, "force"), self.coordinates, "force").items():
                self._add("force", scene_name(name), _one(formula, f"force on {name}"))

    def add_invariants(self, invariants: Mapping[str, Formula]) -> None:
        if not isinstance(invariants, Mapping):
            raise Misuse(f"invariants is {type(invariants).__name__}; a dictionary of functions by name is needed")
        require_names(list(invariants), "invariants")
        for name, function in invariants.items():
            self._add("invariants", scene_name(name), _one(self.symbols.traced(function, f"invariant {name}"), f"invariant {name}"))

    def text(self, start: Mapping[str, float], end: float, step: float, note: Mapping[str, str]) -> str:
        definitions, texts = formulas(self._formulas)
        by_table: dict[str, list[tuple[str, str]]] = {}
        for (table, key), text in zip(self._keys, texts):
            by_table.setdefault(table, []).append((key, text))
        lines = [f"name = {_string(self.name)}"]
        lines += [f"{key} = {_string(text)}" for key, text in note.items() if text]
        lines += [f"{key} = {_string(text)}" for key, text in by_table.pop("", [])]
        lines += ["", "[coordinates]"] + [f"{scene_name(name)} = {{}}" for name in self.coordinates]
        if self.parameters:
            lines += ["", "[parameters]"] + [f"{scene_name(name)} = {_real(value, name)}" for name, value in self.parameters.items()]
        if definitions:
            lines += ["", "[definitions]"] + [f"{name} = {_string(text)}" for name, text in definitions.items()]
        for name, text in by_table.pop("rows", []):
            lines += ["", "[[rows]]", f"name = {_string(name)}", f"equation = {_string(text + ' = 0')}"]
        for table, entries in by_table.items():
            lines += ["", f"[{table}]"] + [f"{key} = {_string(text)}" for key, text in entries]
        lines += ["", "[start]"] + [f"{key} = {_real(value, key)}" for key, value in start.items()]
        lines += ["", "[span]", f"end = {_real(end, 'until')}", f"step = {_real(step, 'step')}", ""]
        return "\n".join(lines)


def _real(value: Any, what: str) -> str:
    return repr(real(value, what))


def start_values(coordinates: Sequence[str], q: Any, v: Any, p: Any, t: float) -> dict[str, float]:
    """The entries of [start]."""
    start: dict[str, float] = {"t": t} if t != 0.0 else {}
    for prefix, what, values in (("", "q", q), ("v_", "v", v), ("p_", "p", p)):
        if values is not None:
            for name, value in _by_name(values, coordinates, f"start {what}").items():
                start[prefix + scene_name(name)] = value
    return start
