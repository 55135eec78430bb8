"""The transfer function of rays that bend at the stop, in closed form, for any spot diagram.

What the ray tracer draws at random is summed here over the pupil: each ray of a spot diagram has
the transfer of the Gaussians (HURB) or of the Airy pattern about its own direction. Beside the
exact transfer of the wavefront it tells how good such a model is for an eye with aberrations.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from isetcl.eye.aberrations.geometric import Spot
from isetcl.eye.bending.airy import circle_otf
from isetcl.eye.bending.ray_bending import Diffraction, Hurb, to_disc
from isetcl.eye.stop import Stop
from isetcl.eye.waves.otf import check_frequencies
from isetcl.units import NM_PER_MM

_RIM = 1.0 - 1e-6


def bent_otf(
    rays: Spot,
    model: Diffraction | None,
    frequency_cpd: np.ndarray | Sequence[float],
    *,
    stop: Stop,
    stop_index: float = 1.0,
    orientation_deg: float = 0.0,
) -> np.ndarray:
    """Complex OTF of rays that are bent at the stop by a model, along one direction, (n,).

    Parameters
    ----------
    rays
        The spot diagram of straight rays; see `isetcl.eye.aberrations.geometric`.
    model
        None for straight rays.
    frequency_cpd
        Frequencies, cycles/degree.
    stop
        The stop; the size of its image is taken from the rays, which fill it evenly.
    stop_index
        Index in the stop's medium; counts where HURB takes the wavelength in vacuum.
    """
    angle = math.radians(orientation_deg)
    per_rad = np.degrees(check_frequencies(frequency_cpd))
    waves = np.exp(
        -2j
        * np.pi
        * np.outer(
            per_rad / np.degrees(60.0),
            math.cos(angle) * rays.x_arcmin + math.sin(angle) * rays.y_arcmin,
        )
    )
    shape = to_disc(stop) * stop.radius_mm
    centred = rays.entrance_mm - rays.weights @ rays.entrance_mm
    # A disc that is filled evenly has the mean square R^2 / 2.
    matrix = shape / math.sqrt(2.0 * float(rays.weights @ np.sum((centred @ shape.T) ** 2, axis=1)))
    across = matrix @ np.array([math.cos(angle), math.sin(angle)])
    if isinstance(model, Hurb):
        disc, plane = centred @ matrix.T, np.outer(per_rad, across)
        waves *= _hurb(model, disc, plane, rays.wavelength_nm, stop_index)
    total = waves @ rays.weights
    if model is not None and not isinstance(model, Hurb):
        share = per_rad * np.linalg.norm(across) * rays.wavelength_nm / NM_PER_MM / 2.0
        total = total * circle_otf(share)
    return np.asarray(total)


def _hurb(
    model: Hurb, disc: np.ndarray, frequency: np.ndarray, wavelength_nm: float, index: float
) -> np.ndarray:
    """Transfer of the Gaussians of every ray, (frequencies, rays)."""
    radius = np.linalg.norm(disc, axis=1)
    s = disc / np.where(radius > 0, radius, 1.0)[:, None]
    across, along = model.distances(np.minimum(radius, _RIM))
    scale = 2.0 * np.pi * model.scale_mm(wavelength_nm, index)
    on_s = frequency @ s.T / across
    on_l = frequency @ np.stack([-s[:, 1], s[:, 0]]) / along
    return np.asarray(np.exp(-0.5 * scale**2 * (on_s**2 + on_l**2)))
