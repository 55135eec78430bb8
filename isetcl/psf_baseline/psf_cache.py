"""PSFs kept on disk, under names that hold everything they depend on.

A file is written beside its place and then moved there, so that readers never see half of one, and
two writers of one PSF write the same. Files that cannot be read are removed and made anew. The
least recently used go when the folder grows too large. The environment variable
ISETCL_PSF_CACHE switches all of this off ("off", "0" or "no") or names another folder;
ISETCL_PSF_CACHE_MB limits its size.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import os
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from isetcl.errors import InvalidInputError, check_positive
from isetcl.psf_baseline.psf import Psf
from isetcl.version import __version__

DEFAULT_LIMIT_MB = 512.0

_OFF = ("off", "0", "no", "false")
_PRUNED_TO = 0.8
_PRUNED_EVERY = 64
_FORMAT = 1


@dataclass
class PsfCache:
    """PSFs in a folder.

    Attributes
    ----------
    folder
        Where they are kept; it is made when something is stored.
    limit_mb
        Largest size of the folder, 10^6 bytes.
    """

    folder: Path
    limit_mb: float = DEFAULT_LIMIT_MB

    def __post_init__(self) -> None:
        self.folder = Path(self.folder)
        check_positive("psf cache: limit_mb", self.limit_mb, "MB")
        self._stored = 0

    def load(self, key: str) -> Psf | None:
        """The PSF of a key; None if it is not there or cannot be read."""
        path = self._path(key)
        try:
            with np.load(path, allow_pickle=False) as file:
                found = Psf(file["kernel"], float(file["pitch_deg"]), float(file["energy_outside"]))
        except FileNotFoundError:
            return None
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, InvalidInputError):
            with contextlib.suppress(OSError):
                path.unlink()
            return None
        with contextlib.suppress(OSError):
            os.utime(path)
        return found

    def store(self, key: str, psf: Psf) -> None:
        """Keep a PSF; where the folder cannot be written nothing happens."""
        path = self._path(key)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".tmp", delete=False) as file:
                try:
                    np.savez(
                        file,
                        kernel=psf.kernel,
                        pitch_deg=psf.pitch_deg,
                        energy_outside=psf.energy_outside,
                    )
                    file.close()
                    os.replace(file.name, path)
                except BaseException:
                    file.close()
                    with contextlib.suppress(OSError):
                        os.unlink(file.name)
                    raise
        except OSError:
            return
        self._stored += 1
        if self._stored % _PRUNED_EVERY == 1:
            self.prune()

    def prune(self) -> None:
        """Remove the least recently used files if all take more than the limit."""
        files = []
        for path in self.folder.glob("??/*"):
            with contextlib.suppress(OSError):
                status = path.stat()
                files.append((status.st_mtime, status.st_size, path))
        total, allowed = sum(size for _, size, _ in files), self.limit_mb * 1e6
        if total <= allowed:
            return
        for _, size, path in sorted(files):
            with contextlib.suppress(OSError):
                path.unlink()
            total -= size
            if total <= _PRUNED_TO * allowed:
                break

    def _path(self, key: str) -> Path:
        return self.folder / key[:2] / f"{key}.npz"


def default_cache() -> PsfCache | None:
    """The user's cache; None if the environment switches it off."""
    import platformdirs

    named = os.environ.get("ISETCL_PSF_CACHE", "")
    if named.lower() in _OFF:
        return None
    folder = Path(named) if named else Path(platformdirs.user_cache_dir("isetcl")) / "psfs"
    limit = os.environ.get("ISETCL_PSF_CACHE_MB", "")
    try:
        return PsfCache(folder, float(limit) if limit else DEFAULT_LIMIT_MB)
    except ValueError:
        raise InvalidInputError(
            f"ISETCL_PSF_CACHE_MB must be a number > 0, got {limit!r}"
        ) from None


def key_of(parts: Mapping[str, Any]) -> str:
    """A name for everything a PSF depends on: plain values, and the source text that makes it."""
    text = json.dumps([_FORMAT, __version__, _source_digest(), parts], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


@functools.cache
def _source_digest() -> str:
    """A digest of all code that PSFs come from, so that none outlives what it was made by."""
    package = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for folder in ("eye", "psf_baseline/psfs"):
        for path in sorted((package / folder).rglob("*.py")):
            digest.update(path.read_bytes())
    for name in ("psf.py", "outgoing.py"):
        digest.update((package / "psf_baseline" / name).read_bytes())
    return digest.hexdigest()
