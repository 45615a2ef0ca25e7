"""Tables of texts that a notebook shows as such."""

from __future__ import annotations

import html
from typing import Iterator, Sequence


class TextTable(Sequence[tuple[str, ...]]):
    """Rows of texts with a heading: a plan, a list of methods."""

    def __init__(self, title: str, heading: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        self.title = title
        self.heading = tuple(heading)
        self._rows = [tuple(row) for row in rows]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, TextTable) and (self.title, self.heading, self._rows) == (other.title, other.heading, other._rows)

    __hash__ = None  # type: ignore[assignment]

    def __len__(self) -> int:
        return len(self._rows)

    def __getitem__(self, index):  # type: ignore[no-untyped-def,override]
        return self._rows[index]

    def __iter__(self) -> Iterator[tuple[str, ...]]:
        return iter(self._rows)

    def __str__(self) -> str:
        rows = [self.heading, *self._rows]
        widths = [max(len(row[k]) for row in rows) for k in range(len(self.heading))]
        lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() for row in rows]
        return "\n".join([self.title, "", *lines]) if self.title else "\n".join(lines)

    __repr__ = __str__

    def _repr_html_(self) -> str:
        def line(cells: Sequence[str], tag: str) -> str:
            return "<tr>" + "".join(f"<{tag} style='text-align:left'>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

        head = f"<caption>{html.escape(self.title)}</caption>" if self.title else ""
        return f"<table>{head}{line(self.heading, 'th')}{''.join(line(row, 'td') for row in self._rows)}</table>"
