"""The MTF of an eye in several kinds of light, side by side."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from isetcl.errors import IsetclError, check_positive
from isetcl.eye.aberrations.polychromatic import Model
from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye
from isetcl.eye.waves.otf import check_frequencies

PHOTOPIC_RANGE_NM = (410.0, 700.0)
LIGHTS = ("monochromatic", "photopic")
MODELS: tuple[Model, ...] = ("diffraction", "geometric")
SECTIONS = {"tangential": 90.0, "sagittal": 0.0}
"""Directions across the stripes of field angles upwards, degrees; see `OpticalTransfer.mtf`."""

_ALIKE = 1e-6


@dataclass(frozen=True, eq=False)
class MtfTable:
    """Modulation transfer by frequency.

    Attributes
    ----------
    frequency_cpd : ndarray, (n,)
        Frequencies, cycles/degree.
    columns : dict of ndarray, (n,)
        By "light_model_section": light monochromatic or photopic (V(lambda)), model diffraction or
        geometric, section tangential or sagittal.
    refused : dict of str
        Columns that the eye does not allow, and why.
    field_deg, wavelength_nm
        Field angle upwards and wavelength of monochromatic light.
    """

    frequency_cpd: np.ndarray
    columns: dict[str, np.ndarray]
    refused: dict[str, str]
    field_deg: float
    wavelength_nm: float

    def curves(self) -> Iterator[tuple[str, str, str | None, np.ndarray | None]]:
        """(light, model, section, values) of all columns.

        Sections that are alike are one, whose name is None; values are None where refused.
        """
        for light in LIGHTS:
            for model in MODELS:
                both = [self.columns.get(f"{light}_{model}_{section}") for section in SECTIONS]
                if both[0] is None or both[1] is None:
                    yield light, model, None, None
                elif np.allclose(both[0], both[1], rtol=0.0, atol=_ALIKE):
                    yield light, model, None, both[0]
                else:
                    for section, values in zip(SECTIONS, both, strict=True):
                        yield light, model, section, values

    def label(self, light: str, model: str, section: str | None) -> str:
        """A curve in words."""
        source = f"{self.wavelength_nm:g} nm" if light == "monochromatic" else light
        return ", ".join([source, model] + ([] if section is None else [section]))

    def at(self, frequency_cpd: np.ndarray | Sequence[float]) -> MtfTable:
        """The rows of some of its own frequencies."""
        rows = [int(np.argmin(np.abs(self.frequency_cpd - f))) for f in frequency_cpd]
        columns = {name: column[rows] for name, column in self.columns.items()}
        return dataclasses.replace(self, frequency_cpd=self.frequency_cpd[rows], columns=columns)


def mtf_table(
    eye: Eye,
    frequency_cpd: np.ndarray | Sequence[float],
    field_deg: float = 0.0,
    wavelength_nm: float = REFERENCE_WAVELENGTH_NM,
    *,
    step_nm: float = 10.0,
    object_distance_m: float = math.inf,
) -> MtfTable:
    """The MTF of an eye in light of one wavelength and in photopic light, by both models.

    Parameters
    ----------
    frequency_cpd
        Frequencies, cycles/degree.
    field_deg
        Field angle upwards, degrees.
    wavelength_nm
        Wavelength of monochromatic light, nm.
    step_nm
        Step of the wavelengths of photopic light, 410 to 700 nm as far as the media are defined.
    object_distance_m
        Distance of the object plane from the corneal vertex, m.

    Raises
    ------
    InvalidInputError
        If an argument breaks its rule. What the eye does not allow is a refused column.
    """
    frequency = check_frequencies(frequency_cpd)
    step = check_positive("step_nm", step_nm, "nm")
    low, high = eye.wavelength_range_nm()
    ends = max(PHOTOPIC_RANGE_NM[0], low), min(PHOTOPIC_RANGE_NM[1], high)
    grid = np.arange(ends[0], ends[1] + 1e-6, step)
    columns: dict[str, np.ndarray] = {}
    refused: dict[str, str] = {}

    def compute(light: str, model: Model, orientation: float) -> np.ndarray:
        options = {"orientation_deg": orientation, "object_distance_m": object_distance_m}
        if light == "monochromatic":
            return eye.mtf(frequency, field_deg, wavelength_nm, model=model, **options)
        return eye.polychromatic_mtf(
            frequency, field_deg=field_deg, wavelengths_nm=grid, model=model, **options
        )

    for light in LIGHTS:
        for model in MODELS:
            _fill(columns, refused, f"{light}_{model}", lambda turn: compute(light, model, turn))  # noqa: B023
    return MtfTable(frequency, columns, refused, float(field_deg), float(wavelength_nm))


def _fill(
    columns: dict[str, np.ndarray],
    refused: dict[str, str],
    name: str,
    compute: Callable[[float], np.ndarray],
) -> None:
    """Both sections of a light and a model, or neither."""
    try:
        both = {section: compute(orientation) for section, orientation in SECTIONS.items()}
    except IsetclError as error:
        refused[name] = str(error)
        return
    columns.update({f"{name}_{section}": values for section, values in both.items()})
