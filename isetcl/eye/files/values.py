"""Eyes and their parts as plain values, and back.

A part becomes a mapping of its fields and of "kind", its name in `KINDS`. Floats stay what they
are, so that an eye read back is the same eye.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from isetcl.errors import FileError, InvalidInputError, check_choice
from isetcl.eye.files.kinds import KINDS

_DEEPEST = 40
"""Levels of a file that are followed; an eye needs about ten."""


def to_values(part: Any, place: str, *, strict: bool = True) -> Any:
    """A part of an eye as mappings, lists, strings and numbers.

    Raises
    ------
    InvalidInputError
        If it holds something that `KINDS` does not know; unless `strict` is False, which writes its
        name only.
    """
    if part is None or isinstance(part, (bool, str)):
        return part
    if isinstance(part, np.ndarray):
        return to_values(part.tolist(), place, strict=strict)
    if isinstance(part, (int, np.integer)):
        return int(part)
    if isinstance(part, (float, np.floating)):
        if not math.isfinite(part):
            raise InvalidInputError(f"{place} must be finite to be written, got {part}")
        return float(part)
    if isinstance(part, (tuple, list)):
        return [to_values(p, f"{place}[{i}]", strict=strict) for i, p in enumerate(part)]
    name = type(part).__name__
    if KINDS.get(name) is not type(part):
        if not strict:
            return {"kind": name}
        raise InvalidInputError(
            f"{place} cannot be written: {name} is no kind that eye files know; use a built-in "
            "one, or None for an accommodation model"
        )
    fields = (f for f in dataclasses.fields(part) if f.init)
    return {"kind": name} | {
        f.name: to_values(getattr(part, f.name), f"{place}.{f.name}", strict=strict) for f in fields
    }


def from_values(value: Any, place: str, depth: int = 0) -> Any:
    """The part of an eye that plain values describe; lists become tuples.

    Raises
    ------
    FileError
        If a kind or field is unknown or missing, or a value breaks its rule; the message begins
        with the place.
    """
    if depth > _DEEPEST:
        raise FileError(f"{place}: must be nested at most {_DEEPEST} deep")
    if isinstance(value, list):
        return tuple(from_values(v, f"{place}[{i}]", depth + 1) for i, v in enumerate(value))
    if not isinstance(value, dict):
        return value
    try:
        kind = check_choice("kind", value["kind"], KINDS)
    except KeyError:
        raise FileError(
            f"{place}: must have a 'kind' (one of {', '.join(sorted(KINDS))})"
        ) from None
    except InvalidInputError as error:
        raise FileError(f"{place}: {error}") from error
    part = KINDS[kind]
    arguments = {
        _field(part, name, place): from_values(v, f"{place}.{name}", depth + 1)
        for name, v in value.items()
        if name != "kind"
    }
    return _made(part, arguments, place)


def _field(part: type[Any], name: str, place: str) -> str:
    try:
        names = [f.name for f in dataclasses.fields(part) if f.init]
        return check_choice(f"field of {part.__name__}", name, names)
    except InvalidInputError as error:
        raise FileError(f"{place}: {error}") from error


def _made(part: type[Any], arguments: dict[str, Any], place: str) -> Any:
    missing = [
        f.name
        for f in dataclasses.fields(part)
        if f.init
        and f.name not in arguments
        and f.default is dataclasses.MISSING
        and f.default_factory is dataclasses.MISSING
    ]
    if missing:
        raise FileError(f"{place}: {part.__name__} needs {', '.join(missing)}")
    try:
        return part(**arguments)
    except InvalidInputError as error:
        raise FileError(f"{place}: {error}") from error
    except (TypeError, ValueError, AttributeError, OverflowError) as error:
        raise FileError(f"{place}: is no {part.__name__} ({error})") from error
