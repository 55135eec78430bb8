"""Reading a text file whatever its encoding."""

from __future__ import annotations

import codecs
from pathlib import Path

from isetcl.errors import FileError

LARGEST_BYTES = 64 * 1024 * 1024
"""Largest file that is read: height maps of 1024 x 1024 take a third of it."""

_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)


def read_text(file: Path, what: str) -> str:
    """The text of a file in UTF-8 or UTF-16, with or without a mark; else in Latin-1.

    Zemax writes UTF-16 or the encoding of the machine, in which only comments can differ.

    Raises
    ------
    FileError
        If the file is missing, a folder, larger than 64 MiB, unreadable or binary.
    """
    try:
        if file.is_dir():
            raise FileError(f"{what} {str(file)!r} is a folder; name the file in it")
        if not file.is_file():
            raise FileError(f"{what} {str(file)!r} does not exist")
        size = file.stat().st_size
        if size > LARGEST_BYTES:
            raise FileError(
                f"{what} {str(file)!r} must be at most {LARGEST_BYTES >> 20} MiB, got "
                f"{size >> 20} MiB"
            )
        data = file.read_bytes()
    except FileError:
        raise
    except (OSError, ValueError) as error:
        raise FileError(f"{what} {str(file)!r} cannot be read ({error})") from error
    try:
        text = _decoded(data)
    except UnicodeDecodeError as error:
        raise FileError(f"{what} {str(file)!r} is no text ({error})") from error
    if "\0" in text:
        raise FileError(f"{what} {str(file)!r} is no text but binary")
    return text


def _decoded(data: bytes) -> str:
    for mark, encoding in _MARKS:
        if data.startswith(mark):
            return data.decode(encoding)
    # UTF-16 without a mark: every second byte of plain letters is zero.
    if data[1:2] == b"\0":
        return data.decode("utf-16-le")
    if data[:1] == b"\0":
        return data.decode("utf-16-be")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")
