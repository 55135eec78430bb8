"""Folders and files that results are written to."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from isetcl.errors import FileError, check_type


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


def replace_file(path: str | Path, write: Callable[[Path], None]) -> Path:
    """Have a file written under a temporary name and move it into place; returns its path.

    A crash leaves what stood there before, and no half-written file.

    Parameters
    ----------
    path
        The file.
    write
        Writes it to the path it is given, whose suffix is that of the file.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    check_type("path", path, (str, Path))
    target = Path(path)
    if not target.name or target.is_dir():
        raise FileError(f"cannot write {str(target)!r}: it is a folder; name a file in it")
    if not target.parent.is_dir():
        raise FileError(
            f"cannot write {str(target)!r}: there is no folder {str(target.parent)!r}; choose an "
            "existing, writable folder"
        )
    temporary = target.with_name(f".{os.getpid()}.tmp.{target.name}")
    try:
        write(temporary)
        os.replace(temporary, target)
    except FileError:  # says already what is wrong
        raise
    except OSError as error:
        raise FileError(
            f"cannot write {str(target)!r}: {error}; choose an existing, writable folder"
        ) from error
    finally:
        temporary.unlink(missing_ok=True)
    return target


def write_file(path: Path, data: bytes) -> Path:
    """Write bytes to a file, as `replace_file` does; returns its path."""
    return replace_file(path, lambda file: _write(file, data))


def _write(file: Path, data: bytes) -> None:
    file.write_bytes(data)
