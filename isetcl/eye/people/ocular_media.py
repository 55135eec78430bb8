"""Light lost on its way to the retina: transmittance of the ocular media by age and wavelength.

Published families. The total media of van de Kraats and van Norren (CIE 203:2012 is their
formula with other constants) hold scatter, the cornea and a neutral part, and cover the near
ultraviolet. The lens densities of Pokorny, Smith and Lutze and of CIE 170-1:2006 are relative: zero
at long wavelengths. None holds macular pigment.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from isetcl.errors import InvalidInputError, check_between, check_choice, check_type
from isetcl.eye.people.stockman_rider import template_lens_density
from isetcl.spectrum import check_wavelengths

MediaModel = Literal[
    "cie_203",
    "van_de_kraats_small_field",
    "van_de_kraats_large_field",
    "pokorny_1987",
    "cie_170",
    "stockman_rider_2023",
]

# Pokorny, Smith & Lutze 1987, Appl Opt 26:1437: every 10 nm from 400 nm.
_POKORNY_STEP_NM = 10.0
_POKORNY_AGING = (
    0.600, 0.510, 0.433, 0.377, 0.327, 0.295, 0.267, 0.233, 0.207, 0.187, 0.167, 0.147, 0.133,
    0.120, 0.107, 0.093, 0.080, 0.067, 0.053, 0.040, 0.033, 0.027, 0.020, 0.013, 0.007, 0.0,
)  # fmt: skip
_POKORNY_STABLE = (1.000, 0.583, 0.300, 0.116, 0.033, 0.005, 0.0)

# CIE 170-1:2006 (after Stockman & Sharpe 2000, Vision Res 40:1711): every 5 nm from 400 nm, age 32.
_CIE_170_STEP_NM = 5.0
_CIE_170_AGING = (
    0.661837, 0.587956, 0.530708, 0.46804, 0.427672, 0.393583, 0.372871, 0.336814, 0.310032,
    0.282708, 0.258499, 0.24165, 0.2279, 0.21306, 0.20458, 0.19292, 0.18338, 0.1749, 0.16748,
    0.16006, 0.1537, 0.14628, 0.1378, 0.12932, 0.12296, 0.1166, 0.11024, 0.10494, 0.09858, 0.09222,
    0.08586, 0.0795, 0.0742, 0.06784, 0.06148, 0.05512, 0.04876, 0.04346, 0.03812, 0.03286, 0.02968,
    0.02544, 0.02226, 0.01908, 0.01696, 0.01484, 0.01166, 0.00848, 0.0053, 0.00424, 0.00318,
    0.00106, 0.0,
)  # fmt: skip
_CIE_170_STABLE = (
    1.103063, 0.837744, 0.606672, 0.43826, 0.296308, 0.202137, 0.114729, 0.071286, 0.031288,
    0.017272, 0.004381, 0.00215, 0.0,
)  # fmt: skip

_TABLES_FROM_NM = 400.0


def _formula(rayleigh: float, young: float, neutral: float) -> Callable[..., np.ndarray]:
    """The sum of scatter, four absorbers and a neutral part of van de Kraats & van Norren 2007."""

    def density(age: float, nm: np.ndarray) -> np.ndarray:
        squared = age * age
        return np.asarray(
            (rayleigh + 3.1e-5 * squared) * (400.0 / nm) ** 4
            + 14.19 * 10.68 * np.exp(-((0.057 * (nm - 273.0)) ** 2))
            + (young - 6.3e-5 * squared) * 2.13 * np.exp(-((0.029 * (nm - 370.0)) ** 2))
            + (0.059 + 1.86e-4 * squared) * 11.95 * np.exp(-((0.021 * (nm - 325.0)) ** 2))
            + (0.016 + 1.32e-4 * squared) * 1.43 * np.exp(-((0.008 * (nm - 325.0)) ** 2))
            + neutral
        )

    return density


def _two_parts(
    step_nm: float, aging: Sequence[float], stable: Sequence[float]
) -> Callable[..., np.ndarray]:
    """A tabulated lens whose first part grows with age (Pokorny, Smith & Lutze 1987)."""
    nodes = _TABLES_FROM_NM + step_nm * np.arange(len(aging))
    fixed = np.pad(stable, (0, len(aging) - len(stable)))

    def density(age: float, nm: np.ndarray) -> np.ndarray:
        growth = 1.0 + 0.02 * (age - 32.0) if age <= 60.0 else 1.56 + 0.0667 * (age - 60.0)
        return np.interp(nm, nodes, np.asarray(aging)) * growth + np.interp(nm, nodes, fixed)

    return density


def _template(age: float, nm: np.ndarray) -> np.ndarray:
    """The template's density as a whole, scaled by the growth at 400 nm of Pokorny et al.'s law."""
    at_400 = [_MODELS["cie_170"].density(each, np.array([400.0]))[0] for each in (age, 32.0)]
    return template_lens_density(nm) * float(at_400[0] / at_400[1])


@dataclass(frozen=True)
class _Published:
    """A model with the ages (years) and wavelengths (nm) it was published for."""

    density: Callable[..., np.ndarray]
    ages: tuple[float, float]
    range_nm: tuple[float, float]


_MODELS = {
    "cie_203": _Published(_formula(0.15, 1.05, 0.06), (0.0, 100.0), (300.0, 700.0)),
    "van_de_kraats_small_field": _Published(
        _formula(0.446, 0.998, 0.111), (0.0, 100.0), (300.0, 700.0)
    ),
    "van_de_kraats_large_field": _Published(
        _formula(0.225, 0.998, 0.111), (0.0, 100.0), (300.0, 700.0)
    ),
    "pokorny_1987": _Published(
        _two_parts(_POKORNY_STEP_NM, _POKORNY_AGING, _POKORNY_STABLE), (20.0, 80.0), (400.0, 780.0)
    ),
    "cie_170": _Published(
        _two_parts(_CIE_170_STEP_NM, _CIE_170_AGING, _CIE_170_STABLE), (20.0, 80.0), (400.0, 830.0)
    ),
    "stockman_rider_2023": _Published(_template, (20.0, 80.0), (360.0, 850.0)),
}


def ocular_density(
    age_years: float,
    wavelengths_nm: np.ndarray | Sequence[float] | float,
    model: MediaModel = "cie_203",
) -> np.ndarray:
    """Optical density (log10) of the ocular media, (wavelengths,).

    Parameters
    ----------
    age_years
        Age: 0 to 100 years for the total media, 20 to 80 for the lens alone.
    wavelengths_nm
        Ascending wavelengths, nm: 300 to 700 for the total media, from 400 for the lens alone.
    model
        ``"cie_203"``: total media, CIE 203:2012. ``"van_de_kraats_small_field"`` and
        ``"van_de_kraats_large_field"``: total media, van de Kraats & van Norren 2007, J Opt Soc
        Am A 24:1842; scattered light is lost to a small field, but not to a large one.
        ``"pokorny_1987"``: lens, Pokorny, Smith & Lutze 1987, Appl Opt 26:1437, small pupil.
        ``"cie_170"``: lens, CIE 170-1:2006. Both lenses are linear between tabulated values.
        ``"stockman_rider_2023"``: lens, Fourier template of Stockman & Rider 2023, Color Res Appl
        48:818, for 32 years; with age it grows at every wavelength as the lens of CIE 170-1 does at
        400 nm, as one factor on a template must.

    Raises
    ------
    InvalidInputError
        If the model is unknown, or the age or a wavelength lies outside its range.
    """
    chosen = _MODELS[check_choice("model of the ocular media", model, _MODELS)]
    age = check_between(f"age_years of ocular media {model!r}", age_years, *chosen.ages, "years")
    grid = check_wavelengths(wavelengths_nm)
    low, high = chosen.range_nm
    if grid[0] < low or grid[-1] > high:
        raise InvalidInputError(
            f"ocular media {model!r} are known from {low:g} to {high:g} nm, got {grid[0]:g} to "
            f"{grid[-1]:g} nm; narrow the wavelength grid or use another model"
        )
    return chosen.density(age, grid)


def ocular_transmittance(
    age_years: float,
    wavelengths_nm: np.ndarray | Sequence[float] | float,
    model: MediaModel = "cie_203",
) -> np.ndarray:
    """Share of the light that comes through, (wavelengths,); arguments of `ocular_density`."""
    return np.asarray(10.0 ** -ocular_density(age_years, wavelengths_nm, model))


@dataclass(frozen=True)
class OcularMedia:
    """The ocular media of a person, which multiply the spectrum of a retinal image.

    Parameters
    ----------
    age_years
        Age, years.
    model
        See `ocular_density`.

    Raises
    ------
    InvalidInputError
        If the model is unknown or the age lies outside its range.
    """

    age_years: float
    model: MediaModel = "cie_203"

    def __post_init__(self) -> None:
        chosen = _MODELS[check_choice("model of the ocular media", self.model, _MODELS)]
        name = f"age_years of ocular media {self.model!r}"
        age = check_between(name, self.age_years, *chosen.ages, "years")
        object.__setattr__(self, "age_years", age)

    def transmittance(self, wavelengths_nm: np.ndarray | Sequence[float] | float) -> np.ndarray:
        """Share of the light that comes through, (wavelengths,).

        Raises
        ------
        InvalidInputError
            If a wavelength lies outside the model's range.
        """
        return ocular_transmittance(self.age_years, wavelengths_nm, self.model)

    def describe(self) -> dict[str, Any]:
        """Everything as plain values, for provenance."""
        return {"age_years": self.age_years, "model": self.model}


def transmittance_or_one(media: OcularMedia | None, wavelengths_nm: np.ndarray) -> np.ndarray:
    """The transmittance of media, 1 where there are none; refuses what is no `OcularMedia`."""
    if media is None:
        return np.ones(len(wavelengths_nm))
    check_type("media", media, OcularMedia)
    return media.transmittance(wavelengths_nm)
