"""Whether diffraction and scatter bend rays in a render, and why."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from isetcl.errors import InvalidInputError, check_type
from isetcl.eye.airy import circle_otf
from isetcl.eye.geometric import spot_of_wavefront
from isetcl.eye.model import Eye
from isetcl.eye.ray_bending import (
    Airy,
    Diffraction,
    DiffractionChoice,
    Hurb,
    diffraction_model,
)
from isetcl.eye.scatter import ScatterModel
from isetcl.render.decision import Decision, left_out
from isetcl.retina.grid import RetinalGrid
from isetcl.units import MM_PER_M, NM_PER_M

AUTO_BOUND = 0.02
"""Change of the MTF, pixel included, above which ``diffraction="auto"`` switches it on."""

_FREQUENCIES = 32
_LUMINOUS_NM = 555.0


@dataclass(frozen=True)
class Bends:
    """What bends rays inside the eye.

    Attributes
    ----------
    diffraction
        The model, or None.
    scatter
        The model, or None.
    """

    diffraction: Diffraction | None = None
    scatter: ScatterModel | None = None

    @property
    def features(self) -> dict[str, Any]:
        """Fields of a kernel's configuration."""
        model = self.diffraction
        name = "none" if model is None else model.axes if isinstance(model, Hurb) else "airy"
        return {"diffraction": name, "has_scatter": self.scatter is not None}

    def describe(self) -> dict[str, Any]:
        """Everything as plain values, for provenance."""
        return {
            "diffraction": None if self.diffraction is None else self.diffraction.describe(),
            "scatter": None if self.scatter is None else self.scatter.describe(),
        }


NO_BENDS = Bends()


def decide_bends(
    eye: Eye,
    grid: RetinalGrid,
    wavelengths_nm: np.ndarray,
    diffraction: DiffractionChoice,
    scatter: ScatterModel | None,
    notes: list[Decision],
) -> Bends:
    """The models that `diffraction` and `scatter` ask for.

    Raises
    ------
    InvalidInputError
        If one of them is no model.
    """
    if scatter is not None:
        check_type("scatter", scatter, ScatterModel)
        share = f"{100 * scatter.fraction:.3g} % of the light is turned after {scatter.function}"
    left_out(notes, "scatter", scatter is not None, share if scatter else "", "not asked for")
    model = diffraction_model(diffraction)
    if model == "auto":
        model = _decide(eye, grid, wavelengths_nm, notes)
    elif model is None:
        notes.append(Decision("diffraction", "left out", "not asked for"))
    else:
        notes.append(Decision("diffraction", _name(model), "asked for"))
    return Bends(model, scatter)


def _decide(
    eye: Eye, grid: RetinalGrid, wavelengths_nm: np.ndarray, notes: list[Decision]
) -> Diffraction | None:
    wavelength = float(wavelengths_nm[np.argmin(np.abs(wavelengths_nm - _LUMINOUS_NM))])
    change, frequency = mtf_change(eye, grid, wavelength)
    reason = (
        f"it changes the MTF at {wavelength:.4g} nm by up to {change:.2g} (at {frequency:.3g} "
        f"cycles/deg; a pixel shows up to {nyquist_cpd(grid):.3g}); the bound is {AUTO_BOUND:g}"
    )
    is_on = change > AUTO_BOUND
    notes.append(Decision("diffraction", "airy" if is_on else "left out", reason))
    return Airy() if is_on else None


def nyquist_cpd(grid: RetinalGrid) -> float:
    """The highest frequency that pixels can show, cycles/degree."""
    return 0.5 / min(grid.pitch_deg)


def mtf_change(eye: Eye, grid: RetinalGrid, wavelength_nm: float) -> tuple[float, float]:
    """Largest change that diffraction makes to the MTF of eye and pixel, and where.

    sinc(f p) G(f) (1 - D(f)) up to half a cycle a pixel of pitch p, with the rays' MTF G on the
    axis in best focus (blur, where there is more of it, hides diffraction) and D the transfer of
    diffraction alone in the direction where the stop is narrowest.

    Returns
    -------
    (float, float)
        The change, and its frequency in cycles/degree.
    """
    frequency = nyquist_cpd(grid) * np.arange(1, _FREQUENCIES + 1) / _FREQUENCIES
    diameter_m = 2.0 * eye.entrance_pupil(wavelength_nm).radius_mm / MM_PER_M * eye.stop.aspect
    cutoff_cpd = np.radians(diameter_m / (wavelength_nm / NM_PER_M))
    change = (
        np.sinc(frequency * min(grid.pitch_deg))
        * _best_mtf(eye, wavelength_nm, frequency)
        * (1.0 - circle_otf(frequency / cutoff_cpd))
    )
    worst = int(np.argmax(change))
    return float(change[worst]), float(frequency[worst])


def _best_mtf(eye: Eye, wavelength_nm: float, frequency_cpd: np.ndarray) -> np.ndarray:
    """Geometric MTF on the axis in best focus; 1 where the axis is no way for light."""
    try:
        front = eye.wavefront(wavelength_nm=wavelength_nm, reference="best_focus")
    except InvalidInputError:
        return np.ones(len(frequency_cpd))
    return spot_of_wavefront(front).mtf(frequency_cpd)


def _name(model: Diffraction) -> str:
    if isinstance(model, Airy):
        return "airy"
    return f"hurb ({model.axes}, gamma {model.gamma:.4g}, lambda in {model.wavelength})"
