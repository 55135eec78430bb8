"""The words, strings, numbers and lists of numbers that a PBRT file consists of."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from isetcl.scene.pbrt.places import Place, wrong

Kind = Literal["word", "string", "number", "numbers", "open", "close"]

_BLANK = re.compile(r"(?:\s+|#[^\n]*)+")
_NAME = re.compile(r"^[ \t]*# Name:([^\n]*)$", re.MULTILINE)
_STRING = re.compile(r'"((?:[^"\\\n]|\\[^\n])*)"')
_WORD = re.compile(r'[^\s"\[\]#]+')
_DIGITS = re.compile(r"[-+0-9.eE\s]*")
# Characters of numbers that do not make numbers: 1-2, 1.2.3, 1e5.3.
_RUN_TOGETHER = re.compile(r"[0-9.+-][-+]|\.\d*\.|[eE][-+]?\d*\.")
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?\Z")
_ESCAPES = {"b": "\b", "f": "\f", "n": "\n", "r": "\r", "t": "\t"}
_LONGEST_SHOWN = 40


@dataclass(frozen=True, eq=False)
class Token:
    """A piece of a file: its kind, its value and where it stands.

    A list of nothing but numbers, in brackets, is one token of kind "numbers". The name is that of
    a comment `# Name: ...` before AttributeBegin, by which scenes keep the names of their objects.
    """

    kind: Kind
    value: str | float | np.ndarray
    place: Place
    name: str = ""

    def shown(self) -> str:
        """The token for a message."""
        if self.kind == "numbers":
            return "a list of numbers"
        if self.kind == "number":
            return f"the number {self.value:g}"
        if self.kind == "string":
            return f"the string {_short(str(self.value))!r}"
        return repr(_short(str(self.value)))


def tokens(text: str, file: str) -> Iterator[Token]:
    """The tokens of a text, one after the other.

    Parameters
    ----------
    text
        The text of a file.
    file
        Its name, for messages.

    Raises
    ------
    FileError
        Where a string is not closed or a number is none; names file, line and column.
    """
    position, counted, line = 0, 0, 1
    while True:
        blank = _BLANK.match(text, position)
        position = blank.end() if blank else position
        if position >= len(text):
            return
        line += text.count("\n", counted, position)
        counted = position
        place = Place(file, line, position - text.rfind("\n", 0, position))
        token, position = _next(text, position, place)
        if blank and token.kind == "word" and token.value == "AttributeBegin":
            token = replace(token, name=_name(blank.group()))
        yield token


def _name(blank: str) -> str:
    """The name that the last of some comments states; empty without one."""
    names = _NAME.findall(blank)
    return names[-1].strip() if names else ""


def _next(text: str, start: int, place: Place) -> tuple[Token, int]:
    """The token that starts at a position, and where it ends."""
    first = text[start]
    if first == '"':
        return _string(text, start, place)
    if first == "[":
        digits = _DIGITS.match(text, start + 1)
        end = digits.end() if digits else start
        if digits and text[end : end + 1] == "]":
            return Token("numbers", _numbers(digits.group(), place), place), end + 1
        return Token("open", first, place), start + 1
    if first == "]":
        return Token("close", first, place), start + 1
    match = _WORD.match(text, start)
    if match is None:  # pragma: no cover - a word is whatever else there is
        raise wrong(place, f"{first!r} cannot be read")
    word = match.group()
    if word[0] in "-+.0123456789":
        return Token("number", _number(word, place), place), match.end()
    return Token("word", word, place), match.end()


def _string(text: str, start: int, place: Place) -> tuple[Token, int]:
    match = _STRING.match(text, start)
    if match is None:
        shown = _short(text[start : start + _LONGEST_SHOWN].split("\n", 1)[0])
        raise wrong(place, f"the string {shown} is not closed on its line; add the missing quote")
    value = match.group(1)
    if "\\" in value:
        value = re.sub(r"\\(.)", lambda m: _ESCAPES.get(m.group(1), m.group(1)), value)
    return Token("string", value, place), match.end()


def _number(word: str, place: Place) -> float:
    if not _NUMBER.match(word):
        raise wrong(place, f"{_short(word)!r} must be a number, such as 0.5 or 1e-3")
    value = float(word)
    if not np.isfinite(value):
        raise wrong(place, f"the number {_short(word)} must be smaller than 1.8e308")
    return value


def _numbers(body: str, place: Place) -> np.ndarray:
    """The numbers of a list; long lists without a Python object for each."""
    if len(body) > 200 and not _RUN_TOGETHER.search(body):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                values = np.fromstring(body, sep=" ")
            if np.isfinite(values).all():
                return values
        except (ValueError, DeprecationWarning):
            pass
    return np.array([_number(word, _inside(body, place, word)) for word in body.split()])


def _inside(body: str, place: Place, word: str) -> Place:
    """Where a word of a list stands: looked for only if it is wrong."""
    if _NUMBER.match(word) and len(word) < 300:
        return place
    offset = re.search(rf"(?<!\S){re.escape(word)}(?!\S)", body)
    before = body[: offset.start() if offset else 0]
    lines = before.count("\n")
    column = len(before) - before.rfind("\n") if lines else place.column + 1 + len(before)
    return Place(place.file, place.line + lines, column)


def _short(text: str) -> str:
    return text if len(text) <= _LONGEST_SHOWN else text[: _LONGEST_SHOWN - 3] + "..."
