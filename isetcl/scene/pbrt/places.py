"""Where something stands in a file, and what a reader has to say about it."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Iterator
from dataclasses import dataclass

from isetcl.errors import FileError, IsetclError

_MOST_LISTED = 12


@dataclass(frozen=True)
class Place:
    """A position in a file, counted from 1."""

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}, line {self.line}, column {self.column}"


def wrong(place: Place, message: str) -> FileError:
    """The error for what is wrong at a place."""
    return _mark(FileError(f"{place}: {message}"))


def _mark(error: FileError) -> FileError:
    error.place_is_named = True  # type: ignore[attr-defined]
    return error


@contextlib.contextmanager
def located(place: Place) -> Iterator[None]:
    """Errors of isetcl that are raised inside name the place."""
    try:
        yield
    except IsetclError as error:
        if getattr(error, "place_is_named", False):
            raise
        placed = type(error)(f"{place}: {error}")
        placed.place_is_named = True  # type: ignore[attr-defined]
        raise placed from error


class Notes:
    """What was not taken over as it stands in a file: one warning per kind."""

    def __init__(self, subject: str) -> None:
        self._subject = subject
        self._kinds: dict[str, dict[str, list[str]]] = {}

    def add(self, kind: str, what: str, place: Place | None = None) -> None:
        """Note something of a kind, at a place."""
        where = "" if place is None else f"{place.file}:{place.line}"
        places = self._kinds.setdefault(kind, {}).setdefault(what, [])
        if where and where not in places and len(places) <= _MOST_LISTED:
            places.append(where)

    def warn(self) -> None:
        """Issue the warnings."""
        for kind, entries in self._kinds.items():
            listed = [_entry(what, places) for what, places in entries.items()]
            more = len(listed) - _MOST_LISTED
            text = "; ".join(listed[:_MOST_LISTED]) + (f"; and {more} more" if more > 0 else "")
            warnings.warn(f"{self._subject}: {kind}: {text}", UserWarning, stacklevel=4)


def _entry(what: str, places: list[str]) -> str:
    if not places:
        return what
    more = ", ..." if len(places) > _MOST_LISTED else ""
    return f"{what} ({', '.join(places[:_MOST_LISTED])}{more})"
