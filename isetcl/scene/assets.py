"""Files that a scene file names: found in its folder, read once, and complained about together."""

from __future__ import annotations

import base64
import binascii
import functools
import io
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import unquote

import numpy as np

from isetcl.errors import FileError
from isetcl.memory import check_memory
from isetcl.scene.texture import decode_srgb


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture as stored, row 0 at the top.

    Attributes
    ----------
    codes : ndarray of uint8 or float32, (rows, columns, 4)
        Red, green, blue, alpha; not decoded. Floats lie between 0 and 1.
    has_alpha
        Whether the file holds an alpha channel.
    is_linear
        Whether the file holds floats, which are linear light.
    """

    codes: np.ndarray
    has_alpha: bool
    is_linear: bool

    def colour(self) -> np.ndarray:
        """Linear light, (rows, columns, 3), float32."""
        rgb = self.codes[..., :3]
        if rgb.dtype == np.uint8:
            return _decoded_levels()[rgb]
        return rgb if self.is_linear else decode_srgb(rgb).astype(np.float32)

    def channel(self, index: int) -> np.ndarray:
        """One channel as stored, between 0 and 1, (rows, columns), float32."""
        values = self.codes[..., index]
        return values / np.float32(255.0) if values.dtype == np.uint8 else values


@dataclass(eq=False)
class Assets:
    """What one scene file refers to.

    Parameters
    ----------
    file
        The scene file; names are relative to its folder.
    allow_outside
        Whether names may lead out of that folder.
    """

    file: Path
    allow_outside: bool = False
    missing: list[str] = field(default_factory=list)
    notes: dict[str, list[str]] = field(default_factory=dict)
    _pictures: dict[str, Picture | None] = field(default_factory=dict)

    def note(self, kind: str, what: str) -> None:
        """Remember something of the file that isetcl leaves out, for one warning a kind."""
        listed = self.notes.setdefault(kind, [])
        if what not in listed:
            listed.append(what)

    def find(self, name: str, *, is_needed: bool = True) -> Path | None:
        """The path of a named file; None if there is none, remembered as missing if needed.

        Letters may differ in case, and a path of another computer is sought in the folder by its
        last part.

        Raises
        ------
        FileError
            If the name leads out of the folder and `allow_outside` is False.
        """
        folder = self.file.parent.resolve()
        cleaned = name.strip().strip('"').replace("\\", "/")
        if "\0" in cleaned or "://" in cleaned:
            raise FileError(
                f"mesh file {str(self.file)!r} asks for {name[:100]!r}, which is no file name; "
                "copy the file beside it and name it there"
            )
        is_foreign = cleaned[1:3] == ":/" or cleaned.startswith("/")
        candidates = [cleaned.rsplit("/", 1)[-1]] if is_foreign else [cleaned]
        if is_foreign and self.allow_outside:
            candidates.insert(0, cleaned)
        for candidate in candidates:
            path = _whatever_case(folder, candidate)
            if path is None:
                continue
            if not self.allow_outside and not path.resolve().is_relative_to(folder):
                raise FileError(
                    f"mesh file {str(self.file)!r} asks for {name[:200]!r}, outside its folder; "
                    "pass allow_outside=True if you trust the file, or copy it into the folder"
                )
            if path.is_file():
                return path
        if is_needed and name not in self.missing:
            self.missing.append(name)
        return None

    def data(self, uri: str) -> bytes | None:
        """Bytes of a name or ``data:`` URI; None if the file is missing.

        Raises
        ------
        FileError
            If the bytes cannot be read.
        """
        if uri.startswith("data:"):
            head, comma, body = uri.partition(",")
            try:
                if not comma:
                    raise ValueError("no comma")
                if head.endswith(";base64"):
                    return base64.b64decode(body, validate=False)
                return unquote(body).encode("latin-1")
            except (ValueError, binascii.Error) as error:
                raise FileError(
                    f"mesh file {str(self.file)!r} holds a broken data URI ({error})"
                ) from error
        path = self.find(uri)
        return None if path is None else read_bytes(path)

    def picture(self, name: str, data: bytes | None = None) -> Picture | None:
        """A picture by name, from its file or from bytes; None if it is missing."""
        if name not in self._pictures:
            if data is None:
                path = self.find(name)
                data = None if path is None else read_bytes(path)
            label = "an embedded picture" if name.startswith("data:") else repr(name)
            self._pictures[name] = None if data is None else self._decoded(label, data)
        return self._pictures[name]

    def _decoded(self, name: str, data: bytes) -> Picture:
        try:
            return _decode(data, f"texture {name} of mesh file {str(self.file)!r}")
        except MemoryError:
            raise
        except Exception as error:
            # Readers raise what they like; whatever it is, the file is no image.
            raise FileError(
                f"texture {name} of mesh file {str(self.file)!r} cannot be read as an image "
                f"({str(error)[:200]}); save it as PNG or JPEG"
            ) from error

    def finish(self) -> None:
        """Warn of what was left out.

        Raises
        ------
        FileError
            If files are missing; all are listed.
        """
        if self.missing:
            listed = ", ".join(repr(name) for name in sorted(self.missing)[:20])
            more = f" and {len(self.missing) - 20} more" if len(self.missing) > 20 else ""
            raise FileError(
                f"mesh file {str(self.file)!r} asks for {len(self.missing)} file(s) that are not in"
                f" its folder: {listed}{more}; put them there, or take their names out of the file"
            )
        for kind, what in self.notes.items():
            more = f" and {len(what) - 10} more" if len(what) > 10 else ""
            names = ", ".join(name for name in what[:10] if name)
            warnings.warn(
                f"{self.file.name}: {kind}" + (f": {names}{more}" if names else ""), stacklevel=3
            )


def read_bytes(path: Path) -> bytes:
    """All bytes of a file.

    Raises
    ------
    FileError
        If it cannot be read.
    OutOfMemoryError
        If it does not fit into memory.
    """
    try:
        check_memory(
            f"file {str(path)!r}", 2.0 * path.stat().st_size, lambda _: "use a smaller file"
        )
        return path.read_bytes()
    except OSError as error:
        raise FileError(f"file {str(path)!r} cannot be read ({error})") from error


def _whatever_case(folder: Path, name: str) -> Path | None:
    """The path of a name in a folder; if there is none, that which differs in case only."""
    try:
        path = folder / name
        if path.exists() or not path.parent.is_dir():
            return path
        folded = path.name.lower()
        return next((p for p in path.parent.iterdir() if p.name.lower() == folded), path)
    except OSError:
        return None


@functools.cache
def _decoded_levels() -> np.ndarray:
    """Linear light of the codes of eight bits."""
    return decode_srgb(np.arange(256) / 255.0).astype(np.float32)


def _decode(data: bytes, what: str) -> Picture:
    """A picture from the bytes of its file."""
    from PIL import Image as Pillow
    from PIL import ImageOps

    with warnings.catch_warnings():
        # The size is checked here, against the memory there is.
        warnings.simplefilter("ignore", Pillow.DecompressionBombWarning)
        with Pillow.open(io.BytesIO(data)) as opened:
            check_memory(
                what,
                70.0 * opened.width * opened.height,
                lambda factor: f"shrink each side by {factor:.2g}",
            )
            picture = ImageOps.exif_transpose(opened)
            if picture.mode in ("I;16", "I;16B", "I"):
                grey = np.asarray(picture).astype(np.float32) / np.float32(65535.0)
                return Picture(_opaque(np.clip(grey, 0.0, 1.0)), False, False)
            if picture.mode == "F":
                return Picture(_opaque(np.asarray(picture, dtype=np.float32)), False, True)
            has_alpha = "A" in picture.getbands() or "transparency" in opened.info
            return Picture(np.asarray(picture.convert("RGBA")), has_alpha, False)


def _opaque(grey: np.ndarray) -> np.ndarray:
    return np.stack([grey, grey, grey, np.ones_like(grey)], axis=-1)
