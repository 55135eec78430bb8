"""Synthetic layers with disc PSFs, and the image they must give, for tests of PSF methods.

Lengths are samples; a degree is a sample. `reference` evaluates the integral over the pupil that
all methods approximate, point by point, and shares nothing with them.
"""

from __future__ import annotations

import functools

import numpy as np

from isetcl.psf_baseline.convolve import LayerSpectra, SpectralBlur
from isetcl.psf_baseline.methods import methods
from isetcl.psf_baseline.psf import Psf
from isetcl.psf_baseline.pupil import PupilOffsets, thin_lens_offsets
from isetcl.psf_baseline.slicing import closed
from isetcl.psf_baseline.view import Layer

RADIUS_MM = 1e3 * np.pi / 180.0
"""With this pupil radius the blur circle of a dioptre has a radius of a degree, a sample."""


@functools.lru_cache(maxsize=32)
def disc(radius, fineness=16):
    """A uniform disc PSF by its area on each sample; less than half a sample wide it is a point."""
    if abs(radius) < 0.5:
        return Psf(np.ones((1, 1)), 1.0, 0.0)
    half = int(np.ceil(abs(radius) + 0.5))
    fine = (np.arange((2 * half + 1) * fineness) + 0.5) / fineness - half - 0.5
    inside = fine[:, None] ** 2 + fine[None, :] ** 2 <= radius**2
    n = 2 * half + 1
    kernel = inside.reshape(n, fineness, n, fineness).mean(axis=(1, 3))
    return Psf(kernel / kernel.sum(), 1.0, 0.0)


def layer(vergence, colour, coverage):
    """A layer of one colour channel times its coverage."""
    cover = np.asarray(coverage, np.float32)
    return Layer(vergence, (np.asarray(colour, np.float32) * cover)[None], cover)


def visible(layers):
    """What is seen of layers from the middle of the pupil."""
    light = np.ones_like(layers[0].coverage)
    seen = []
    for each in reversed(layers):
        seen.insert(0, Layer(each.vergence_dpt, each.colour * light, each.coverage * light))
        light = light * (1.0 - each.coverage)
    return seen


def combined(name, layers, defocus, *, samples=64, rays=64):
    """A method's image of complete layers with disc PSFs of signed radii `defocus`."""
    method = methods()[name]
    used = layers if method.needs_complete_layers else closed(visible(layers))
    pupil: PupilOffsets | None = None
    if method.pupil_samples > 0:
        each = rays if method.rays_per_sample > 1 else 1
        pupil = thin_lens_offsets(RADIUS_MM, defocus, samples, rays_per_sample=each)
    blur = SpectralBlur(LayerSpectra(used), [disc(d) for d in defocus], pupil)
    return method.combine(blur, len(used))[0]


def reference(layers, defocus, places, count=400):
    """The integral over the pupil at places (row, column), (n, 2), by a square grid of points.

    `layers` are functions of (row, column), far to near, that return (radiance, coverage).
    Radii: +1 at the pupil's edge; rows count downwards.
    """
    g = (np.arange(count) + 0.5) / count * 2.0 - 1.0
    px, py = (a.ravel() for a in np.meshgrid(g, g))
    inside = px**2 + py**2 <= 1.0
    px, py = px[inside], py[inside]
    values = []
    for row, column in places:
        light = np.ones(len(px))
        total = np.zeros(len(px))
        for function, d in reversed(list(zip(layers, defocus, strict=True))):
            radiance, cover = function(row - py * d, column + px * d)
            total += light * radiance * cover
            light = light * (1.0 - cover)
        values.append(total.mean())
    return np.array(values)
