"""Folders and files that results are written to."""

from __future__ import annotations

import os
from pathlib import Path

from isetcl.errors import FileError


def check_folder(folder: Path, option: str = "--output") -> None:
    """Create the output folder, named by an option; raise FileError if it cannot be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".isetcl-{os.getpid()}"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise FileError(
            f"cannot write into folder {str(folder)!r}: {error}; choose another with {option}"
        ) from error


def write_file(path: Path, data: bytes) -> Path:
    """Write a file under a temporary name and move it into place; returns its path.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        temporary.write_bytes(data)
        os.replace(temporary, path)
    except OSError as error:
        raise FileError(f"cannot write {str(path)!r}: {error}") from error
    finally:
        temporary.unlink(missing_ok=True)
    return path
