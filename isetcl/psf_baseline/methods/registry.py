"""The list of methods."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from isetcl.psf_baseline.methods.blur import Blur
from isetcl.psf_baseline.methods.clipped import pupil_clipped
from isetcl.psf_baseline.methods.gather import gather
from isetcl.psf_baseline.methods.ikoma import ikoma
from isetcl.psf_baseline.methods.layered import (
    layered_normalized,
    layered_over,
    layered_over_normalized,
    layered_over_visible,
    layered_sum,
)
from isetcl.psf_baseline.methods.multi_view import aperture_samples
from isetcl.psf_baseline.methods.single import single
from isetcl.psf_baseline.methods.splat import splat, splat_normalized

Slicing = Literal["hard", "soft"]


@dataclass(frozen=True)
class Method:
    """A way to combine layers.

    Attributes
    ----------
    id
        Its place in the survey, "M0" to "M10".
    name
        Name used in `render`.
    combine
        The function; see `layered_sum`.
    summary, failure
        What it does, and what it does wrong, in a line each.
    needs_complete_layers
        Whether layers must be known behind what hides them; otherwise visible ones are used.
    uses_centre_depth
        Whether each pixel's own depth, as seen from the centre of the pupil, chooses its PSF.
    pupil_samples, rays_per_sample
        Samples of the pupil, and rays in each, that it takes unless told otherwise; 0 if it needs
        no rays.
    slicing
        How it cuts depth into layers unless told otherwise; see `soft_slices`.
    conserves_light
        Whether the light of every visible point arrives in the image, no more and no less.
    keeps_uniform
        Whether a scene of even radiance gives an even image whatever its depths.
    """

    id: str
    name: str
    combine: Callable[[Blur, int], np.ndarray]
    summary: str
    failure: str
    needs_complete_layers: bool = False
    uses_centre_depth: bool = False
    pupil_samples: int = 0
    rays_per_sample: int = 1
    slicing: Slicing = "hard"
    conserves_light: bool = False
    keeps_uniform: bool = False


_METHODS = (
    Method(
        "M0",
        "single",
        single,
        "one PSF for the whole view",
        "no depth at all",
        conserves_light=True,
        keeps_uniform=True,
    ),
    Method(
        "M1",
        "gather",
        gather,
        "each pixel gathers with the PSF of its own depth",
        "sharp foregrounds bleed, blurred ones keep a hard edge",
        uses_centre_depth=True,
        slicing="soft",
        keeps_uniform=True,
    ),
    Method(
        "M2",
        "splat",
        splat,
        "each pixel spreads with the PSF of its own depth",
        "light and dark gaps at depth edges",
        uses_centre_depth=True,
        slicing="soft",
        conserves_light=True,
    ),
    Method(
        "M2n",
        "splat_normalized",
        splat_normalized,
        "M2 over the spread weights",
        "colours leak over depth edges; no order",
        uses_centre_depth=True,
        slicing="soft",
        keeps_uniform=True,
    ),
    Method(
        "M3",
        "layered_sum",
        layered_sum,
        "blurred visible layers, added",
        "light and dark gaps at depth edges",
        conserves_light=True,
    ),
    Method(
        "M4",
        "layered_normalized",
        layered_normalized,
        "M3 over the blurred coverage",
        "the background tints a sharp foreground; no order",
        keeps_uniform=True,
    ),
    Method(
        "M5",
        "layered_over_visible",
        layered_over_visible,
        "blurred visible layers over each other",
        "dark rims: what is hidden is missing; slopes darken",
    ),
    Method(
        "M6",
        "layered_over_normalized",
        layered_over_normalized,
        "M5 with the background normalised",
        "dark rims where the foreground is blurred",
    ),
    Method(
        "M7",
        "ikoma",
        ikoma,
        "M5 normalised by all at or behind a layer",
        "wrong where the foreground is blurred",
    ),
    Method(
        "M8",
        "layered_over",
        layered_over,
        "blurred complete layers over each other",
        "two blurred textured layers; slopes darken",
        needs_complete_layers=True,
        keeps_uniform=True,
    ),
    Method(
        "M9",
        "pupil_clipped",
        pupil_clipped,
        "PSFs clipped by what stands before each point",
        "cost grows with pupil cells and occluders",
        needs_complete_layers=True,
        pupil_samples=48,
        rays_per_sample=256,
        slicing="soft",
        keeps_uniform=True,
    ),
    Method(
        "M10",
        "aperture_samples",
        aperture_samples,
        "mean of views from points of the pupil",
        "staircases of copies with few samples",
        needs_complete_layers=True,
        pupil_samples=256,
        slicing="soft",
        keeps_uniform=True,
    ),
)


def methods() -> dict[str, Method]:
    """The methods by name."""
    return {method.name: method for method in _METHODS}
