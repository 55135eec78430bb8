"""Spectra counted in photons, as ISETBio and ISETCam have them in their files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from isetcl.errors import FileError, InvalidInputError
from isetcl.matlab import numbers
from isetcl.spectrum import check_wavelengths, is_even
from isetcl.units import NM_PER_M, PLANCK_J_S, SPEED_OF_LIGHT_M_S


def photons_per_joule(wavelengths_nm: np.ndarray) -> np.ndarray:
    """Photons in a joule of light of each wavelength: lambda / (h c)."""
    return np.asarray(wavelengths_nm / (NM_PER_M * PLANCK_J_S * SPEED_OF_LIGHT_M_S))


def check_even(what: str, wavelengths_nm: np.ndarray) -> np.ndarray:
    """Return a grid of equal steps; ISETBio takes the first step for all.

    Raises
    ------
    InvalidInputError
        If the steps differ.
    """
    grid = check_wavelengths(wavelengths_nm)
    if not is_even(grid):
        steps = np.diff(grid)
        raise InvalidInputError(
            f"wavelengths of {what} must lie in equal steps for ISETBio, got steps of "
            f"{steps.min():g} to {steps.max():g} nm; render an even grid"
        )
    return grid


def photon_wavelengths(path: str | Path, record: dict[str, Any], *keys: str) -> np.ndarray:
    """An even wavelength grid at a path of fields; raise FileError where there is none."""
    found = numbers(path, record, *keys)
    try:
        return check_even("the file", found.ravel())
    except InvalidInputError as error:
        raise FileError(f"file {str(path)!r}: {error}") from error


def photon_cube(
    path: str | Path, record: dict[str, Any], keys: tuple[str, ...], layers: int
) -> np.ndarray:
    """Photons at a path of fields as (rows, columns, wavelengths).

    Whole numbers are those that ISET stored until about 2014: 0 to 2^n - 1 between the smallest and
    the largest value, ``dmin`` and ``dmax`` beside them (``ieUncompressData`` of ISETBio).

    Raises
    ------
    FileError
        If there are none, their shape is another, or some are negative or not finite.
    """
    values = numbers(path, record, *keys)
    if values.dtype.kind != "f":
        values = _expanded(path, values, record, keys[:-1])
    return checked_cube(path, values, layers)


def checked_cube(path: str | Path, photons: np.ndarray, layers: int) -> np.ndarray:
    """Photons as (rows, columns, wavelengths); raise FileError unless they fit and are >= 0."""
    values = photons[..., None] if photons.ndim == 2 else photons
    if values.ndim != 3 or values.shape[2] != layers:
        raise FileError(
            f"file {str(path)!r}: photons must have shape (rows, columns, {layers} wavelengths), "
            f"got {photons.shape}"
        )
    if not np.all(np.isfinite(values)) or values.min() < 0:
        raise FileError(f"file {str(path)!r}: photons must be finite and >= 0; mend them first")
    return values


def _expanded(
    path: str | Path, stored: np.ndarray, record: dict[str, Any], keys: tuple[str, ...]
) -> np.ndarray:
    """Numbers of which an old file keeps whole numbers only."""
    if stored.dtype not in (np.uint8, np.uint16, np.uint32):
        raise FileError(
            f"file {str(path)!r}: photons must be of class single or double, got {stored.dtype}; "
            "save them as double"
        )
    try:
        low, high = (float(numbers(path, record, *keys, name).item()) for name in ("dmin", "dmax"))
    except (FileError, ValueError) as error:
        raise FileError(
            f"file {str(path)!r}: photons of class {stored.dtype} are compressed, and need the "
            "numbers dmin and dmax beside them; save them as single or double"
        ) from error
    return stored * ((high - low) / np.iinfo(stored.dtype).max) + low
