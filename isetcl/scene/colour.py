"""Spectra from colours: RGB, XYZ, colour temperatures and spectrum files.

A colour becomes a spectrum once, when a scene is made or loaded; what is traced are spectra. RGB is
linear sRGB (white D65) throughout: decode a stored code first, as `load_image` does.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from isetcl.errors import (
    FileError,
    InvalidInputError,
    check_array,
    check_choice,
    check_positive,
    check_type,
)
from isetcl.scene.display import display_primaries
from isetcl.spectrum import VISIBLE_RANGE_NM, Spectrum
from isetcl.units import LUMINOUS_EFFICACY_LM_PER_W, PLANCK_J_S, SPEED_OF_LIGHT_M_S

Colour = tuple[float, float, float] | Sequence[float] | np.ndarray

BOLTZMANN_J_K = 1.380649e-23
"""Boltzmann constant, exact. Source: CODATA 2018."""

_HOTTEST_K = 1e9
_OVERSHOOT = 1e-6
"""How far above 1 a reflectance may lie through rounding; it is then taken as 1."""


@functools.cache
def reflectance_primaries() -> tuple[Spectrum, Spectrum, Spectrum]:
    """Spectral reflectances that stand for linear sRGB red, green and blue; their sum is 1.

    Linear RGB between 0 and 1 times these spectra is a reflectance between 0 and 1 that has, under
    D65 and for the CIE 1931 observer, the colour those values stand for. They are the spectra for
    a reflectance `Image` of three channels. Known from 360 to 830 nm.

    Source: Mallett & Yuksel 2019, Spectral primary decomposition for rendering with sRGB
    reflectance (EGSR), as tabulated by colour-science from 380 to 780 nm; beyond its ends, where
    the eye hardly sees, the values there are kept.
    """
    import colour

    basis = colour.recovery.MSDS_BASIS_FUNCTIONS_sRGB_MALLETT2019
    values = np.maximum(np.asarray(basis.values, dtype=np.float64), 0.0)
    # The published basis sums to 1 within 1e-6; made exact, so that a white object reflects all.
    values = values / values.sum(axis=1, keepdims=True)
    grid = np.concatenate([[VISIBLE_RANGE_NM[0]], basis.domain, [VISIBLE_RANGE_NM[1]]])
    values = np.concatenate([values[:1], values, values[-1:]])
    red, green, blue = (
        Spectrum(grid, values[:, i], f"sRGB reflectance {name}")
        for i, name in enumerate(("red", "green", "blue"))
    )
    return red, green, blue


def reflectance_of_rgb(rgb: Colour) -> Spectrum:
    """Spectral reflectance that has a linear sRGB colour under D65, 360 to 830 nm.

    Parameters
    ----------
    rgb
        Linear sRGB reflectance, three numbers between 0 and 1; (1, 1, 1) reflects everything.

    Raises
    ------
    InvalidInputError
        If a value is negative or above 1: no surface reflects so.
    """
    values = _check_rgb("reflectance rgb", rgb)
    if np.any(values > 1.0 + _OVERSHOOT):
        raise InvalidInputError(
            f"reflectance rgb must be <= 1, got {_listed(values)}; scale it down, or make it an "
            "emission if the surface shines"
        )
    return _combined(np.minimum(values, 1.0), reflectance_primaries(), "rgb reflectance")


def radiance_of_rgb(rgb: Colour, luminance_of_white_cd_m2: float) -> Spectrum:
    """Spectral radiance of a linear RGB emission, 380 to 780 nm, W m^-2 sr^-1 nm^-1.

    Parameters
    ----------
    rgb
        Linear sRGB values >= 0, as large as you like.
    luminance_of_white_cd_m2
        Luminance that (1, 1, 1) stands for, cd/m^2; its spectrum is D65.

    Raises
    ------
    InvalidInputError
        If a value is negative or not finite.
    """
    values = _check_rgb("emission rgb", rgb)
    white = check_positive("luminance_of_white_cd_m2", luminance_of_white_cd_m2, "cd/m^2")
    return _combined(values, display_primaries(white), "rgb emission")


def blackbody(temperature_k: float) -> Spectrum:
    """Spectral radiance of a black body, 300 to 1100 nm in 1 nm steps, W m^-2 sr^-1 nm^-1.

    L = 2 h c^2 / l^5 / (exp(h c / (l k T)) - 1), l in vacuum. Use `.with_luminance` for the colour
    of a temperature at another luminance.

    Source: Planck's law; constants CODATA 2018, exact.

    Raises
    ------
    InvalidInputError
        If the temperature is not positive, or above 1e9 K.
    """
    kelvin = check_positive("temperature_k", temperature_k, "K")
    if kelvin > _HOTTEST_K:
        raise InvalidInputError(f"temperature_k must be <= {_HOTTEST_K:g} K, got {kelvin:g}")
    grid = np.arange(300.0, 1101.0)
    metres = grid * 1e-9
    with np.errstate(over="ignore"):
        quanta = PLANCK_J_S * SPEED_OF_LIGHT_M_S / (metres * BOLTZMANN_J_K) / kelvin
    # Beyond exp(700) the radiance is below 1e-280: zero for any purpose, and no overflow.
    per_metre = (
        2.0 * PLANCK_J_S * SPEED_OF_LIGHT_M_S**2 / metres**5 / np.expm1(np.minimum(quanta, 700.0))
    )
    values = np.where(quanta < 700.0, per_metre * 1e-9, 0.0)
    return Spectrum(grid, values, f"black body {kelvin:g} K")


def spectrum_of_xyz(
    xyz: Colour, *, kind: Literal["radiance", "reflectance"] = "radiance"
) -> Spectrum:
    """A smooth spectrum with given CIE 1931 tristimulus values.

    Colours inside the sRGB triangle are made of its primaries. A radiance outside it is the
    non-negative spectrum of least squared slope with that colour.

    Parameters
    ----------
    xyz
        X, Y, Z >= 0.
    kind
        "radiance": Y is the luminance in cd/m^2, result W m^-2 sr^-1 nm^-1 from 380 to 780 nm.
        "reflectance": the colour under D65, Y = 1 for a perfect white; 360 to 830 nm.

    Raises
    ------
    InvalidInputError
        If no light has that colour, or no colour of sRGB reflectance does.
    """
    check_choice("kind", kind, ("radiance", "reflectance"))
    values = _check_rgb("xyz", xyz)
    rgb = np.linalg.solve(_xyz_of_primaries(), values)
    tolerance = _OVERSHOOT * max(float(np.max(np.abs(rgb))), 1e-300)
    inside = bool(np.all(rgb >= -tolerance))
    rgb = np.where(np.abs(rgb) <= tolerance, np.maximum(rgb, 0.0), rgb)
    if kind == "radiance":
        if inside:
            return _combined(rgb, display_primaries(1.0), "xyz emission")
        return _smoothest(values)
    if not inside:
        raise InvalidInputError(
            f"xyz reflectance must lie inside the sRGB triangle, got {_listed(values)}, which is "
            f"linear rgb {_listed(rgb)}; use a less saturated colour or a measured spectrum"
        )
    return reflectance_of_rgb(rgb)


def load_spd(path: str | Path) -> Spectrum:
    """A spectrum from a text file of two columns: wavelength in nm, value.

    Columns are separated by blanks, tabs, commas or semicolons; what follows # is a comment;
    wavelengths ascend. The unit of the values is that of the file.

    Raises
    ------
    FileError
        If the file is missing, is no text, or a line is wrong; the message names the line.
    """
    check_type("path", path, (str, Path))
    file = Path(path)
    if not file.is_file():
        raise FileError(f"spectrum file {str(file)!r} does not exist")
    wavelengths: list[float] = []
    values: list[float] = []
    try:
        with file.open(encoding="utf-8-sig") as lines:
            for number, line in enumerate(lines, start=1):
                entry = line.partition("#")[0].replace(",", " ").replace(";", " ").split()
                if entry:
                    where = f"spectrum file {str(file)!r}, line {number}"
                    wavelength, value = _spd_entry(where, entry)
                    if wavelengths and wavelength <= wavelengths[-1]:
                        raise FileError(
                            f"{where}: wavelengths must ascend, got {wavelength:g} nm after "
                            f"{wavelengths[-1]:g} nm; sort and de-duplicate the lines"
                        )
                    wavelengths.append(wavelength)
                    values.append(value)
    except UnicodeDecodeError:
        raise FileError(
            f"spectrum file {str(file)!r} is no text; write two columns, wavelength (nm) and value"
        ) from None
    except OSError as error:
        if isinstance(error, FileError):
            raise
        raise FileError(f"spectrum file {str(file)!r} cannot be read ({error})") from error
    if not wavelengths:
        raise FileError(
            f"spectrum file {str(file)!r} holds no values; write two columns, wavelength (nm) "
            "and value"
        )
    return Spectrum(np.array(wavelengths), np.array(values), file.name)


def _spd_entry(where: str, entry: list[str]) -> tuple[float, float]:
    """Wavelength and value of a line."""
    try:
        wavelength, value = (float(word) for word in entry)
    except ValueError:
        shown = " ".join(entry)[:60]
        raise FileError(
            f"{where}: must be a wavelength (nm) and a value, got {shown!r}; start a comment with #"
        ) from None
    if not (math.isfinite(wavelength) and wavelength > 0):
        raise FileError(f"{where}: wavelength must be finite and > 0 nm, got {wavelength:g}")
    if not (math.isfinite(value) and value >= 0):
        raise FileError(
            f"{where}: value must be finite and >= 0, got {value:g}; clip noise at 0 first"
        )
    return wavelength, value


def _check_rgb(name: str, rgb: Colour) -> np.ndarray:
    """Three finite numbers >= 0."""
    values = check_array(name, rgb)
    if values.shape != (3,):
        raise InvalidInputError(f"{name} must be three numbers, got shape {values.shape}")
    if not np.all(np.isfinite(values)) or np.any(values < 0):
        raise InvalidInputError(
            f"{name} must be finite and >= 0, got {_listed(values)}; clip it at 0 first"
        )
    return values


def _listed(values: np.ndarray) -> str:
    return "(" + ", ".join(f"{value:g}" for value in values) + ")"


def _combined(weights: np.ndarray, spectra: tuple[Spectrum, ...], what: str) -> Spectrum:
    """A weighted sum of spectra on one grid."""
    values = sum(w * s.values for w, s in zip(weights, spectra, strict=True))
    return Spectrum(spectra[0].wavelengths_nm, np.asarray(values), f"{what} {_listed(weights)}")


@functools.cache
def _observer(step_nm: int) -> tuple[np.ndarray, np.ndarray]:
    """Grid from 380 to 780 nm, and 683 times the CIE 1931 functions there, (n, 3), lm/W."""
    import colour

    functions = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    grid = np.arange(380.0, 781.0, step_nm)
    rows = np.isin(np.asarray(functions.domain), grid)
    return grid, LUMINOUS_EFFICACY_LM_PER_W * np.asarray(functions.values)[rows]


@functools.cache
def _xyz_of_primaries() -> np.ndarray:
    """Tristimulus values of the primaries of a display whose white has 1 cd/m^2, (3, 3)."""
    grid, functions = _observer(1)
    return functions.T @ np.stack([s.at(grid) for s in display_primaries(1.0)], axis=1)


def _smoothest(xyz: np.ndarray) -> Spectrum:
    """The non-negative radiance of least squared slope with given tristimulus values."""
    from scipy.optimize import nnls

    step = 5
    grid, functions = _observer(step)
    slopes = np.diff(np.eye(len(grid)), axis=0)
    # The colour is a heavily weighted row of the least squares; scales make all rows comparable.
    scale = float(np.max(xyz))
    match = functions.T * step
    weight = 1e4 / float(np.max(match))
    rows = np.concatenate([slopes, weight * match])
    wanted = np.concatenate([np.zeros(len(slopes)), weight * xyz / scale])
    solution, _ = nnls(rows, wanted, maxiter=30 * len(grid))
    if np.max(np.abs(match @ solution - xyz / scale)) > 1e-3:
        raise InvalidInputError(
            f"xyz must be the colour of some light (inside the spectral locus), got {_listed(xyz)};"
            " check the order X, Y, Z"
        )
    return Spectrum(grid, solution * scale, f"xyz emission {_listed(xyz)}")
