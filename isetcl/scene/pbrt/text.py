"""Numbers, spectra and names as PBRT 4 text."""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np

from isetcl.spectrum import Spectrum

_A_LINE = 8


def numbers(values: Iterable[float] | np.ndarray) -> str:
    """A bracketed list of numbers that reads back exactly."""
    words = [repr(float(value)) for value in np.asarray(values).reshape(-1)]
    rows = [" ".join(words[i : i + _A_LINE]) for i in range(0, len(words), _A_LINE)]
    return "[ " + "\n    ".join(rows) + " ]"


def number(name: str, value: float) -> str:
    """A float parameter."""
    return f'"float {name}" {float(value)!r}'


def texture(name: str, of: str) -> str:
    """A texture parameter."""
    return f'"texture {name}" "{of}"'


def spectrum(name: str, wavelengths_nm: np.ndarray, values: np.ndarray) -> str:
    """A spectrum parameter: wavelengths (nm) and values in turn."""
    return f'"spectrum {name}" {numbers(np.stack([wavelengths_nm, values], axis=1))}'


def spectral(name: str, of: Spectrum) -> str:
    """A spectrum parameter from a spectrum."""
    return spectrum(name, of.wavelengths_nm, of.values)


def file_stem(name: str) -> str:
    """A name that can stand in any file name and in quotes."""
    return re.sub(r"[^A-Za-z0-9_.-]", "_", name)[:80] or "scene"


def name_comment(name: str) -> str:
    """The comment by which the reader knows the name of the block that follows."""
    return "# Name: " + " ".join(name.split())


def comment(text: str) -> str:
    """A line of comment."""
    return "# " + " ".join(str(text).split())[:120]
