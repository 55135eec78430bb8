"""Folders where OpenCL keeps what it compiled: replaced where they cannot be written.

pyopencl and PoCL fail, pyopencl with a traceback of its own and PoCL by finding no device, where
their cache folders cannot be made, as in containers whose user has no home.
"""

from __future__ import annotations

import functools
import os
import tempfile
import warnings
from pathlib import Path

import platformdirs


@functools.cache
def make_writable() -> None:
    """Point caches that cannot be written to a temporary folder, with a warning; once a process.

    To be called before pyopencl is imported.
    """
    user = Path(platformdirs.user_cache_dir())
    if not _is_writable(user):
        os.environ["XDG_CACHE_HOME"] = _substitute("XDG_CACHE_HOME", user)
    named = os.environ.get("POCL_CACHE_DIR")
    pocl = Path(named) if named else Path(platformdirs.user_cache_dir()) / "pocl"
    if not _is_writable(pocl):
        os.environ["POCL_CACHE_DIR"] = _substitute("POCL_CACHE_DIR", pocl)
    elif named is None and not _is_writable(Path("~/.cache").expanduser()):
        # PoCL looks for the folder in the home directory, whatever the system's convention.
        os.environ["POCL_CACHE_DIR"] = str(pocl)


def _is_writable(folder: Path) -> bool:
    """Whether a folder exists, or can be made, and takes files."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _substitute(variable: str, folder: Path) -> str:
    replacement = tempfile.mkdtemp(prefix="isetcl-cache-")
    warnings.warn(
        f"the cache folder {str(folder)!r} cannot be written, so kernels are compiled anew in "
        f"every process; set {variable} to a folder that can",
        stacklevel=2,
    )
    return replacement
