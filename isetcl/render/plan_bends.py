"""Whether diffraction and scatter bend rays in a render, and why."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from isetcl.errors import IsetclError, check_type
from isetcl.eye.aberrations.geometric import spot_of_wavefront
from isetcl.eye.aberrations.polychromatic import PEAK_NM
from isetcl.eye.bending.bent_otf import bent_otf
from isetcl.eye.bending.ray_bending import (
    Airy,
    Diffraction,
    DiffractionChoice,
    Hurb,
    diffraction_model,
)
from isetcl.eye.model import Eye
from isetcl.eye.people.scatter import ScatterModel
from isetcl.render.decision import Decision, left_out
from isetcl.retina.grid import RetinalGrid
from isetcl.spectrum import luminous_efficiency

AUTO_BOUND = 0.02
"""Error of the MTF, pixel included, that ``diffraction="auto"`` accepts without diffraction."""

SEEN_CPD = 60.0
"""Highest frequency that matters to "auto": the limit of visual acuity, cycles/degree."""

_CANDIDATES: dict[str, Diffraction | None] = {"none": None, "airy": Airy(), "hurb": Hurb()}
_FREQUENCIES = 12
_WAVELENGTHS = 5
_RAYS_ACROSS = 64
_LEAST_SEEN = 0.05


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
    """Nothing where that is right to the bound, or else the model that is nearest to the truth."""
    try:
        errors = mtf_errors(eye, grid, wavelengths_nm)
    except IsetclError as error:
        notes.append(Decision("diffraction", "airy", f"its effect cannot be weighed: {error}"))
        return Airy()
    without = errors.pop("none")
    told = ", ".join(f"{name} {error:.2g}" for name, error in errors.items())
    reason = (
        f"without it the MTF of the eye in focus is wrong by {without:.2g} up to "
        f"{_highest_cpd(grid):.3g} cycles/deg (bound {AUTO_BOUND:g}); {told}"
    )
    if without <= AUTO_BOUND:
        notes.append(Decision("diffraction", "left out", reason))
        return None
    best = _CANDIDATES[min(errors, key=lambda name: errors[name])]
    notes.append(Decision("diffraction", _name(best), reason))
    return best


def mtf_errors(eye: Eye, grid: RetinalGrid, wavelengths_nm: np.ndarray) -> dict[str, float]:
    """How far rays are from the exact MTF of eye and pixel without, and with each, model of bends.

    The largest difference of the transfer functions on the axis, in best focus for 555 nm and
    weighted by V(lambda), times that of a pixel, up to the highest frequency that pixels can show.

    Returns
    -------
    dict
        ``"none"`` and the models' names; no unit.
    """
    frequency = _highest_cpd(grid) * np.arange(1, _FREQUENCIES + 1) / _FREQUENCIES
    vergence = eye.focus_vergence_dpt(_nearest(wavelengths_nm, PEAK_NM))
    exact = np.zeros(_FREQUENCIES, dtype=complex)
    found = {name: np.zeros(_FREQUENCIES, dtype=complex) for name in _CANDIDATES}
    for wavelength in _few(wavelengths_nm):
        weight = float(luminous_efficiency(wavelength))
        front = eye.wavefront(wavelength_nm=wavelength, scale_wavelength_nm=PEAK_NM)
        exact += weight * front.defocused(vergence).otf().along(frequency, 0.0)
        # Rays are smooth where waves are not; as many as the waves need would take seconds.
        few = eye.wavefront(
            wavelength_nm=wavelength, scale_wavelength_nm=PEAK_NM, samples=_RAYS_ACROSS
        )
        rays = spot_of_wavefront(few.defocused(vergence))
        for name, model in _CANDIDATES.items():
            found[name] += weight * bent_otf(rays, model, frequency, stop=eye.stop)
    total = sum(float(luminous_efficiency(w)) for w in _few(wavelengths_nm))
    pixel = np.sinc(frequency * min(grid.pitch_deg)) / total
    return {name: float(np.max(np.abs(otf - exact) * pixel)) for name, otf in found.items()}


def _few(wavelengths_nm: np.ndarray) -> list[float]:
    """A few wavelengths that stand for a grid: evenly among those that are seen best."""
    seen = wavelengths_nm[luminous_efficiency(wavelengths_nm) >= _LEAST_SEEN]
    if len(seen) == 0:
        return [_nearest(wavelengths_nm, PEAK_NM)]
    chosen = np.linspace(0, len(seen) - 1, min(_WAVELENGTHS, len(seen)))
    return [float(w) for w in seen[np.round(chosen).astype(int)]]


def _nearest(wavelengths_nm: np.ndarray, wavelength_nm: float) -> float:
    return float(wavelengths_nm[np.argmin(np.abs(wavelengths_nm - wavelength_nm))])


def _highest_cpd(grid: RetinalGrid) -> float:
    """The highest frequency that pixels can show and an eye can see, cycles/degree."""
    return min(0.5 / min(grid.pitch_deg), SEEN_CPD)


def _name(model: Diffraction | None) -> str:
    if not isinstance(model, Hurb):
        return "airy"
    return f"hurb ({model.axes}, gamma {model.gamma:.4g}, lambda in {model.wavelength})"
