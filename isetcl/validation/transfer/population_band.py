"""How far the modulation transfer of healthy eyes scatters, to be drawn behind a curve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_count, check_positive, check_type
from isetcl.eye.people.population import Population
from isetcl.eye.people.virtual_eye import radial_mtf
from isetcl.eye.waves.otf import check_frequencies

_NEAR_MM = 0.5

# Radial, photopic transfer of 100 virtual eyes drawn from the statistics of Thibos, Bradley & Hong
# 2002, Ophthalmic Physiol Opt 22:427, the set behind Figures 3 and 5 of Lian et al. 2019, J Vis
# 19(13):23. By pupil: mean, 5th and 95th percentile at these frequencies.
_FREQUENCY_CPD = (0.0, 5.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0)
_PUBLISHED = {
    3.0: (
        (1.0, 0.777, 0.542, 0.264, 0.149, 0.096, 0.067, 0.049),
        (1.0, 0.570, 0.228, 0.070, 0.033, 0.018, 0.011, 0.007),
        (1.0, 0.869, 0.711, 0.440, 0.278, 0.198, 0.150, 0.113),
    ),
    4.0: (
        (1.0, 0.688, 0.422, 0.180, 0.099, 0.066, 0.049, 0.037),
        (1.0, 0.378, 0.173, 0.049, 0.026, 0.019, 0.016, 0.012),
        (1.0, 0.832, 0.613, 0.307, 0.181, 0.126, 0.094, 0.072),
    ),
}


@dataclass(frozen=True, eq=False)
class PopulationBand:
    """Transfer of many eyes; f frequencies.

    Attributes
    ----------
    frequency_cpd : ndarray, (f,)
        Frequencies, cycles/degree.
    mean, low, high : ndarray, (f,)
        Mean, 5th and 95th percentile.
    pupil_diameter_mm
        Their pupil.
    name
        Which eyes, for legends.
    """

    frequency_cpd: np.ndarray
    mean: np.ndarray
    low: np.ndarray
    high: np.ndarray
    pupil_diameter_mm: float
    name: str

    def __post_init__(self) -> None:
        frequency = check_frequencies(self.frequency_cpd)
        for name in ("mean", "low", "high"):
            values = check_array(name, getattr(self, name))
            if values.shape != frequency.shape or not np.all(np.isfinite(values)):
                raise InvalidInputError(
                    f"{name} must be one finite number per frequency {frequency.shape}, got shape "
                    f"{values.shape}"
                )
            object.__setattr__(self, name, values)
        object.__setattr__(self, "frequency_cpd", frequency)
        check_positive("pupil_diameter_mm", self.pupil_diameter_mm, "mm")

    def at(self, frequency_cpd: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Low, mean and high at other frequencies, by monotone cubics; NaN beyond the last one."""
        from scipy.interpolate import PchipInterpolator

        # A frequency computed from pixels may miss the last one by rounding.
        last = self.frequency_cpd[-1]
        wanted = np.where(np.isclose(frequency_cpd, last), last, frequency_cpd)
        low, mean, high = (
            PchipInterpolator(self.frequency_cpd, values, extrapolate=False)(wanted)
            for values in (self.low, self.mean, self.high)
        )
        return low, mean, high


def published_band(pupil_diameter_mm: float) -> PopulationBand | None:
    """Percentiles of 100 virtual eyes with a pupil of 3 or 4 mm, whichever is within 0.5 mm.

    Source: statistics of Thibos, Bradley & Hong 2002, as in Figures 3 and 5 of Lian et al. 2019.
    """
    wanted = check_positive("pupil_diameter_mm", pupil_diameter_mm, "mm")
    pupil = min(_PUBLISHED, key=lambda known: abs(known - wanted))
    if abs(pupil - wanted) > _NEAR_MM:
        return None
    mean, low, high = (np.array(row) for row in _PUBLISHED[pupil])
    return PopulationBand(
        np.array(_FREQUENCY_CPD), mean, low, high, pupil, f"100 virtual eyes, {pupil:g} mm"
    )


def population_band(
    population: Population,
    frequency_cpd: np.ndarray | Sequence[float],
    pupil_diameter_mm: float,
    *,
    count: int = 100,
    seed: int = 0,
) -> PopulationBand:
    """The transfer of eyes drawn from a population, in white light and over all orientations.

    Parameters
    ----------
    population
        See `isetcl.eye.people.population.load_population`.
    frequency_cpd
        Frequencies, cycles/degree.
    pupil_diameter_mm
        Pupil, at most that of the population.
    count, seed
        How many eyes are drawn, at least 20, and which.

    Raises
    ------
    InvalidInputError
        If an argument breaks its rule.
    """
    check_type("population", population, Population)
    number = check_count("count", count, 20)
    frequency = check_frequencies(frequency_cpd)
    grid = np.arange(440.0, 681.0, 40.0)
    curves = np.array(
        [
            radial_mtf(eye, frequency, pupil_diameter_mm=pupil_diameter_mm, wavelengths_nm=grid)
            for eye in population.draw(number, seed)
        ]
    )
    low, high = np.percentile(curves, [5.0, 95.0], axis=0)
    name = f"{number} eyes of the population, {pupil_diameter_mm:.3g} mm"
    return PopulationBand(frequency, curves.mean(axis=0), low, high, pupil_diameter_mm, name)
