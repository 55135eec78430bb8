"""Eyes as JSON: written with every digit, read back as the same eye."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NoReturn

from isetcl.errors import FileError, check_type
from isetcl.eye.files.text import read_text
from isetcl.eye.files.values import from_values, to_values
from isetcl.eye.model import Eye

FORMAT = "isetcl eye"
VERSION = 1


def eye_to_json(eye: Eye, path: str | Path | None = None) -> str:
    """The eye as JSON text, also written to `path` unless that is None; see `Eye.to_json`.

    Raises
    ------
    InvalidInputError
        If the eye holds a part of the user's own making.
    FileError
        If the file cannot be written.
    """
    document = {"format": FORMAT, "version": VERSION, "eye": to_values(eye, f"eye {eye.name!r}")}
    text = json.dumps(document, indent=1, allow_nan=False) + "\n"
    if path is not None:
        check_type("path", path, (str, Path))
        try:
            Path(path).write_text(text, encoding="utf-8")
        except (OSError, ValueError) as error:
            raise FileError(f"eye file {str(path)!r} cannot be written ({error})") from error
    return text


def eye_from_json(source: str | Path) -> Eye:
    """The eye of a JSON file, or of JSON text that begins with a brace; see `Eye.from_json`.

    Raises
    ------
    FileError
        If the file is missing or breaks the format; the message names the place.
    """
    check_type("source", source, (str, Path))
    if isinstance(source, str) and source.lstrip()[:1] == "{":
        return _parsed(source, "eye text")
    return _parsed(read_text(Path(source), "eye file"), f"eye file {str(source)!r}")


def _parsed(text: str, where: str) -> Eye:
    def refuse(constant: str) -> NoReturn:
        raise FileError(f"{where}: numbers must be finite, got {constant}")

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) < len(pairs):
            names = [name for name, _ in pairs]
            twice = next(name for name in names if names.count(name) > 1)
            raise FileError(f"{where}: a field may stand once, got {twice!r} twice")
        return found

    try:
        document = json.loads(text, parse_constant=refuse, object_pairs_hook=unique)
    except json.JSONDecodeError as error:
        raise FileError(
            f"{where}, line {error.lineno}, column {error.colno}: is no JSON ({error.msg})"
        ) from error
    except (RecursionError, ValueError) as error:
        raise FileError(f"{where}: cannot be read ({error})") from error
    _check_head(document, where)
    eye = from_values(document["eye"], f"{where}: eye")
    if not isinstance(eye, Eye):
        raise FileError(f"{where}: eye must be of kind 'Eye', got {type(eye).__name__}")
    return eye


def _check_head(document: Any, where: str) -> None:
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise FileError(
            f'{where}: must be an object with "format": {FORMAT!r}; write one with Eye.to_json'
        )
    version = document.get("version")
    if isinstance(version, int) and version > VERSION:
        raise FileError(
            f"{where}: version must be <= {VERSION}, got {version}; it was written by a newer "
            "isetcl, so update"
        )
    if version != VERSION or isinstance(version, bool):
        raise FileError(f"{where}: version must be {VERSION}, got {version!r}")
    if "eye" not in document:
        raise FileError(f"{where}: must have an 'eye'; write one with Eye.to_json")
