"""What may lie behind a picture without hidden layers, and how much of it would be seen."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from isetcl.eye.model import Eye
from isetcl.psf_baseline.depth_image import DepthImage
from isetcl.psf_baseline.picture_source import Source, picture_stack
from isetcl.psf_baseline.prediction import REFERENCE, few_wavelengths
from isetcl.psf_baseline.psfs.reach import REACH
from isetcl.psf_baseline.render import render
from isetcl.psf_baseline.view import ViewGrid
from isetcl.retina.grid import RetinalGrid
from isetcl.retina.pinhole_view import PinholeView
from isetcl.scene.model import Scene
from isetcl.spectrum import photopic_weights
from isetcl.units import MM_PER_M

_SAMPLES = 256


def hidden_part(scene: Source, grid: RetinalGrid, eye: Eye, options: dict[str, Any]) -> np.ndarray:
    """What content behind a picture could change where the pupil sees behind its edges.

    Parameters
    ----------
    options
        Of `render`, for views.

    Returns
    -------
    ndarray, (rows, columns)
        Relative to the mean of the sharp picture.
    """
    even = None if isinstance(scene, Scene) else _even_front(scene)
    if even is None or isinstance(scene, Scene):
        return np.zeros(grid.shape)
    shown = {k: v for k, v in options.items() if k != "hidden"}
    full, seen = (
        render(
            even,
            eye,
            method=REFERENCE,
            psf=REACH,
            psf_cache=None,
            pupil_samples=_SAMPLES,
            wavelengths_nm=np.array([grid.wavelength_nm]),
            fov_deg=grid.fov_deg,
            resolution=grid.resolution,
            centre_deg=grid.centre_deg,
            hidden=hidden,
            **shown,
        )
        for hidden in ("extend", "none")
    )
    lit = full.irradiance.values[0]
    behind = 1.0 - seen.irradiance.values[0] / np.where(lit > 0, lit, 1.0)
    return np.clip(behind, 0.0, 1.0) * _far_contrast(scene, grid, eye)


def _far_contrast(scene: PinholeView | DepthImage, grid: RetinalGrid, eye: Eye) -> np.ndarray:
    """Range of what lies in the farther half of the depths within reach of the blur.

    Of the sharp picture, photopic, relative to its mean.
    """
    from scipy.ndimage import maximum_filter, minimum_filter

    wavelengths = few_wavelengths(scene, None)
    stack = picture_stack(scene, wavelengths)
    (front,) = stack.layers_on(ViewGrid(grid, 1, 0), np.array([-np.inf, np.inf]), False)
    weights = photopic_weights(wavelengths)
    weights = weights if np.any(weights > 0) else np.ones(len(wavelengths))
    light = np.tensordot(stack.basis.spectra @ weights, front.colour, axes=1)
    light = light / max(float(light.mean()), 1e-300)
    verges = stack.vergence_map(grid)
    pupil_m = eye.entrance_pupil(grid.wavelength_nm).diameter_mm / 2.0 / MM_PER_M
    reach = math.degrees(pupil_m * float(np.ptp(verges))) / min(grid.pitch_deg)
    size = 2 * math.ceil(min(reach, max(grid.shape))) + 1
    # Twice the reach: whoever is within reach of a pixel near an edge must know of the edge too.
    wide = 2 * size + 1
    most, least = (f(verges, wide, mode="nearest") for f in (maximum_filter, minimum_filter))
    is_far = verges <= (most + least) / 2.0
    high = maximum_filter(np.where(is_far, light, -np.inf), size, mode="nearest")
    low = minimum_filter(np.where(is_far, light, np.inf), size, mode="nearest")
    known = np.isfinite(high) & np.isfinite(low)
    return np.where(known, high, 0.0) - np.where(known, low, 0.0)


def _even_front(scene: PinholeView | DepthImage) -> DepthImage | None:
    """A white picture with the depth of one without hidden layers; None of others."""
    if isinstance(scene, DepthImage):
        if scene.hidden:
            return None
        return dataclasses.replace(scene, picture=np.ones(scene.shape), display=None)
    if scene.layers > 1:
        return None
    seen = scene.dataset.isel(layer=0) if "layer" in scene.dataset.dims else scene.dataset
    covered = (seen["object"].values >= 0) | (seen["radiance"].values > 0).any(axis=0)
    x, y = seen["x"].values, seen["y"].values
    step = float(abs(x[-1] - x[0])) / (len(x) - 1)
    high = float(abs(y[-1] - y[0])) / (len(y) - 1) if len(y) > 1 else step
    return DepthImage(
        np.ones(covered.shape),
        np.asarray(seen["vergence_dpt"].values, np.float64),
        (step * len(x), high * len(y)),
        alpha=covered.astype(np.float64),
        centre_deg=(float(x[0] + x[-1]) / 2.0, float(y[0] + y[-1]) / 2.0),
        depth_unit="dpt",
        projection="angular",
    )
