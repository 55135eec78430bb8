"""Finding and reading the files that a scene refers to, none outside its folder."""

from __future__ import annotations

import gzip
import io
import zlib
from pathlib import Path

from isetcl.errors import FileError
from isetcl.memory import check_memory
from isetcl.scene.pbrt.places import Place, wrong

_CHUNK = 1 << 22
_BYTES_A_BYTE = 12.0
"""Memory that a byte of scene text takes while it is read: text, numbers, arrays."""


class SceneFiles:
    """The files around a scene.

    Names are relative to the folder of the main file, as in PBRT. What lies outside of it is
    refused unless `allow_outside`; what is missing is collected, to be told all at once.
    """

    def __init__(self, main: Path, *, allow_outside: bool) -> None:
        self.root = main.resolve().parent
        self._allow_outside = allow_outside
        self._missing: dict[str, list[Place]] = {}

    def find(self, name: str, place: Place) -> Path | None:
        """The file of a name; None where there is none, which `check` tells later.

        Raises
        ------
        FileError
            If the name is no name of a file, or lies outside the scene's folder.
        """
        if not name or "\0" in name or len(name) > 4000:
            raise wrong(place, "the name of a file must not be empty, nor hold a NUL")
        try:
            path = (self.root / name).resolve()
            if not path.is_file() and "\\" in name:
                path = (self.root / name.replace("\\", "/")).resolve()
            inside = path.is_relative_to(self.root)
            exists = path.is_file()
        except (OSError, ValueError, RuntimeError) as error:
            raise wrong(place, f"the file {name!r} cannot be looked up ({error})") from error
        if not (inside or self._allow_outside):
            raise wrong(
                place,
                f"the file {name!r} lies outside the scene's folder {str(self.root)!r}; move it "
                "there, or pass allow_outside=True if you trust the scene",
            )
        if not exists:
            self._missing.setdefault(name, []).append(place)
            return None
        return path

    def check(self) -> None:
        """Raise FileError naming all files that are missing, if any."""
        if not self._missing:
            return
        listed = "; ".join(f"{name!r} ({places[0]})" for name, places in self._missing.items())
        count = len(self._missing)
        files = "1 file that the scene needs is" if count == 1 else f"{count} files are"
        raise FileError(f"{files} missing below {str(self.root)!r}: {listed}; add them there")


def read_bytes(path: Path, what: str, *, factor: float = 2.0) -> bytes:
    """The contents of a file, unpacked if its name ends in .gz.

    Raises
    ------
    FileError
        If it cannot be read.
    OutOfMemoryError
        If `factor` times its size does not fit.
    """
    try:
        if path.suffix.lower() == ".gz":
            return _unpacked(path, what, factor)
        _check_fits(what, path, path.stat().st_size, factor)
        return path.read_bytes()
    except (OSError, EOFError, zlib.error) as error:
        if isinstance(error, FileError):
            raise
        raise FileError(f"{what} {str(path)!r} cannot be read ({error})") from error


def _unpacked(path: Path, what: str, factor: float) -> bytes:
    buffer = io.BytesIO()
    with gzip.open(path, "rb") as stream:
        while chunk := stream.read(_CHUNK):
            buffer.write(chunk)
            _check_fits(what, path, buffer.tell() * 2, factor)
    return buffer.getvalue()


def _check_fits(what: str, path: Path, size: float, factor: float) -> None:
    check_memory(
        f"{what} {str(path)!r} ({size / 2**20:.3g} MiB)",
        factor * size,
        lambda _: "use a machine with more memory, or a scene with fewer triangles",
    )


def read_text(path: Path) -> str:
    """The text of a scene file.

    Raises
    ------
    FileError
        If it cannot be read or is no text.
    OutOfMemoryError
        If its contents would not fit.
    """
    data = read_bytes(path, "scene file", factor=_BYTES_A_BYTE)
    if b"\0" in data:
        raise FileError(
            f"scene file {str(path)!r} is no text (it holds NUL bytes); a PBRT scene is plain text"
        )
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")
