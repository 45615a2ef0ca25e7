"""What is raised and what is warned of."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .run import Points


_LONGEST_WORD = 1000  # characters of one that is shown whole


def shown(text: str) -> str:
    """Text of unknown origin as it may be shown: control characters and marks that reorder text as \\uXXXX, bytes that are no UTF-8
    as \\xXX, of a word of many thousand letters its beginning."""
    text = re.sub("[\udc80-\udcff]", lambda byte: f"\\x{ord(byte[0]) - 0xdc00:02x}", text)
    text = re.sub("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff]", lambda letter: f"\\u{ord(letter[0]):04x}", text)
    return re.sub(rf"\S{{{_LONGEST_WORD},}}", lambda word: f"{word[0][:100]}… ({len(word[0])} characters)", text)


class Error(Exception):
    """Base of the exceptions of this package; the text is the library's."""

    def __init__(self, text: str = "") -> None:
        super().__init__(shown(text))


class Misuse(Error, ValueError):
    """A wrong name, size, value or start, found before anything is computed."""


class Failure(Error, RuntimeError):
    """A step that cannot be solved, a search for an error that was refused, a function that failed.

    ``run`` holds what was computed before, or is None.
    """

    run: Points | None = None


class Doubt(UserWarning):
    """A run came to its end, and its checks found why the result is not to be believed."""


class Interrupted(UserWarning):
    """A run was ended by Ctrl-C; it holds what was computed until then."""


class CallbackCost(UserWarning):
    """A scene calls Python functions at every evaluation: what that costs."""


def spelled(text: str) -> str:
    """A text of the library or of the command, with options as they are spelled here: --max-time is max_time."""
    text = shown(text)
    text = text.replace('--drop-redundant, redundant = "drop" in a scene file, or IntegratorOptions::drop_redundant_rows',
                        'drop_redundant=True, or redundant = "drop" in a scene file')
    text = text.replace("; Space::normalised() makes them so", "")
    text = text.replace("(option `fixed`)", "(adaptive=False)")
    text = text.replace("--method damped/radau:3 --adaptive", 'method="damped/radau:3", adaptive=True')
    text = re.sub(r"(?:set )?IntegratorOptions::(\w+)", r"\1=True", text)
    return re.sub(r"(?<![\w-])--([a-z][a-z-]*)", lambda option: option[1].replace("-", "_"), text)


def raised(code: int, message: str) -> Any:
    """The exception for a code of the library."""
    return (Misuse if code == 2 else Failure)(spelled(message))
