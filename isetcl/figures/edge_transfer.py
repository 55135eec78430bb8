"""MTFs as the paper measures them: a rendered slanted edge in photopic light, at best focus."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from isetcl.eye.bending.bent_otf import bent_otf
from isetcl.eye.bending.ray_bending import Hurb
from isetcl.scene import targets
from isetcl.spectrum import luminous_efficiency
from isetcl.units import ARCMIN_PER_DEG

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from isetcl.eye.model import Eye
    from isetcl.figures.quality import Quality
    from isetcl.validation.transfer.slanted_edge import SlantedEdgeMtf

FAR_M = 1e6
_FOCUS_CPD = 20.0
_FOCUS_DPT = np.linspace(0.0, 2.5, 126)
_FOCUS_NM = np.arange(450.0, 651.0, 25.0)
_FOCUS_RINGS = 12

BAND_CPD = np.array([5.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0])
"""Frequencies of the bands, cycles/degree."""

POPULATION = {
    3.0: (
        np.array([0.570, 0.228, 0.070, 0.033, 0.018, 0.011, 0.007]),
        np.array([0.869, 0.711, 0.440, 0.278, 0.198, 0.150, 0.113]),
    ),
    4.0: (
        np.array([0.378, 0.173, 0.049, 0.026, 0.019, 0.016, 0.012]),
        np.array([0.832, 0.613, 0.307, 0.181, 0.126, 0.094, 0.072]),
    ),
}
"""Radial photopic MTF of 100 virtual eyes by pupil in mm, 5th and 95th percentile: statistics of
Thibos, Bradley & Hong 2002, Ophthalmic Physiol Opt 22:427, as in the paper's Figures 3 and 5."""


def best_distance_m(eye: Eye) -> float:
    """Distance at which an eye sees 20 cycles/degree best in photopic light, m.

    Rays bent at the stop as the paper bends them, summed over the pupil; at least 0.4 m.
    """
    weights = luminous_efficiency(_FOCUS_NM)
    total = np.zeros(len(_FOCUS_DPT), dtype=complex)
    for nm, weight in zip(_FOCUS_NM, weights / weights.sum(), strict=True):
        rays = eye.spot(0.0, float(nm), rings=_FOCUS_RINGS, scale_wavelength_nm=550.0)
        index = float(eye.indices(float(nm))[eye.stop_index])
        for i, vergence in enumerate(_FOCUS_DPT):
            # An object nearer by 1/m turns a ray by its height in metres, in radians; the spot lies
            # in visual angles, whose directions are opposite to those on the retina.
            turn = np.degrees(vergence * rays.entrance_mm * 1e-3) * ARCMIN_PER_DEG
            moved = dataclasses.replace(
                rays, x_arcmin=rays.x_arcmin - turn[:, 0], y_arcmin=rays.y_arcmin - turn[:, 1]
            )
            model = Hurb.iset3d()
            total[i] += (
                weight * bent_otf(moved, model, [_FOCUS_CPD], stop=eye.stop, stop_index=index)[0]
            )
    best = float(_FOCUS_DPT[int(np.argmax(np.abs(total)))])
    return 1.0 / best if best > 0.0 else FAR_M


def edge_mtf(
    quality: Quality, eye: Eye, distance_m: float, diffraction: str, **options: Any
) -> SlantedEdgeMtf:
    """The MTF across a rendered slanted edge, up to `highest_cpd`."""
    from isetcl.validation.transfer.slanted_edge import slanted_edge_mtf

    pixels = quality.pick(120, 240)
    weights = options.pop("weights", None)
    usual = {
        "spp": quality.pick(16, 128),
        "wavelengths_nm": quality.pick(np.arange(410.0, 691.0, 20.0), None),
    }
    image = quality.render(
        targets.slanted_edge(distance_m),
        eye,
        fov_deg=pixels / (2.0 * highest_cpd(quality)),
        resolution=pixels,
        diffraction=diffraction,
        **(usual | options),
    )
    return slanted_edge_mtf(image, weights=weights, eye=eye)


def highest_cpd(quality: Quality) -> float:
    """Highest frequency of the images, half a cycle per pixel."""
    return quality.pick(40.0, 60.0)


def mean_of_moduli(measured: SlantedEdgeMtf) -> np.ndarray:
    """The paper's polychromatic MTF: that of every wavelength, weighted by V(lambda)."""
    assert measured.wavelengths_nm is not None
    weights = luminous_efficiency(measured.wavelengths_nm)
    return np.asarray(weights @ measured.mtf / weights.sum())


def draw_band(ax: Axes, pupil_mm: float) -> None:
    """The population's 5th to 95th percentile, from no frequency on."""
    low, high = (np.concatenate([[1.0], edge]) for edge in POPULATION[pupil_mm])
    ax.fill_between(
        np.concatenate([[0.0], BAND_CPD]),
        low,
        high,
        color="0.87",
        lw=0,
        label="100 virtual eyes, 5 to 95 %",
    )


def share_within_band(measured: SlantedEdgeMtf, pupil_mm: float) -> float:
    """Share of the band's frequencies at which an MTF lies within it."""
    assert measured.frequency_cpd is not None
    known = BAND_CPD[measured.frequency_cpd[-1] * (1.0 + 1e-9) >= BAND_CPD]
    values = measured.at(known)
    low, high = (edge[: len(known)] for edge in POPULATION[pupil_mm])
    return float(np.mean((values >= low) & (values <= high)))


def dress_mtf(ax: Axes, quality: Quality, title: str) -> None:
    """Axes of an MTF."""
    ax.set(
        xlabel="frequency (cycles/degree)",
        ylabel="modulation transfer",
        xlim=(0.0, highest_cpd(quality)),
        ylim=(0.0, 1.02),
    )
    ax.set_title(title, fontsize="medium")
    ax.grid(True, lw=0.4, alpha=0.7)
    ax.set_axisbelow(True)
    ax.legend(frameon=False, fontsize="small")


def distance_text(distance_m: float) -> str:
    """A distance in words."""
    return "infinity" if math.isclose(distance_m, FAR_M) else f"{distance_m:.3g} m"
