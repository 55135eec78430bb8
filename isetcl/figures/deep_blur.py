"""The blur of solid things among others at other depths, in an image and by PSF convolution.

Around a thing other depths are seen, blurred more or less than the thing itself: a disc that suits
the pixels there is not the spot of the thing's distance, but may be half as large again. What the
disc should be is therefore found from the sharp view with the depth of every sample, blurred depth
by depth.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from isetcl.figures.blur import (
    SHARP_PUPIL_MM,
    ObjectBlur,
    SharpView,
    blur_arcmin,
    blur_error_arcmin,
    brightness,
    pitch_arcmin,
)
from isetcl.units import ARCMIN_PER_DEG

if TYPE_CHECKING:
    from isetcl.eye.model import Eye
    from isetcl.figures.quality import Quality
    from isetcl.retina.image import RetinalImage
    from isetcl.scene.model import Scene

LAYER_SOURCE = "the sharp view blurred depth by depth with spots of the axis (the paper: no number)"
_WAVELENGTHS_NM = np.arange(450.0, 651.0, 50.0)
_ERRORS = 3.5
_HIDDEN = 0.12  # of the blur: light from behind nearer things is guessed, and slices overlap
_PIXEL = 0.1  # of a pixel: slices meet in pixels


@dataclass(frozen=True, eq=False)
class DeepView:
    """A scene through a tiny pupil, with depth.

    Attributes
    ----------
    sharp
        By pixel.
    light, vergence_dpt
        Brightness and vergence of what is seen, on a grid several times as fine, (n rows,
        n columns).
    """

    sharp: SharpView
    light: np.ndarray
    vergence_dpt: np.ndarray


def deep_view(
    quality: Quality,
    scene: Scene,
    eye: Eye,
    finer: int,
    resolution: tuple[int, int],
    **options: Any,
) -> DeepView:
    """The scene on a grid of a resolution, with `finer` x `finer` samples of depth a pixel."""
    columns, rows = resolution
    size = (finer * columns, finer * rows)
    tiny = eye.with_pupil(SHARP_PUPIL_MM)
    image = quality.render(scene, tiny, layers=True, resolution=size, **options)

    def means(values: np.ndarray) -> np.ndarray:
        parts = values.astype(np.float64).reshape(rows, finer, columns, finer)
        return np.asarray(parts.mean(axis=(1, 3)))

    value, error = brightness(image)
    numbers = image.dataset["object"].values
    sharp = SharpView(
        means(value),
        means(error**2) / finer**2,
        {item.name: means(numbers == i) > 0.5 for i, item in enumerate(scene.objects)},
        finer * pitch_arcmin(image),
    )
    vergence = image.dataset["vergence_dpt"].values.astype(np.float64)
    return DeepView(sharp, value.astype(np.float64), np.maximum(vergence, 0.0))


def layered_image(eye: Eye, view: DeepView) -> np.ndarray:
    """The sharp view blurred depth by depth with the spots of the axis, (rows, columns).

    By the PSF method that composes blurred depth layers over one another, which shares no code with
    the ray tracer of images; what stands hidden behind nearer things is guessed from beside them.
    """
    from isetcl import psf_baseline

    rows, columns = view.sharp.signal.shape
    pitch = view.sharp.pitch_arcmin / ARCMIN_PER_DEG
    picture = psf_baseline.DepthImage(
        view.light / float(view.light.max()),
        view.vergence_dpt,
        fov_deg=(columns * pitch, rows * pitch),
        depth_unit="dpt",
        projection="angular",
    )
    image = psf_baseline.render(
        picture,
        eye,
        method="layered_over",
        wavelengths_nm=_WAVELENGTHS_NM,
        resolution=(columns, rows),
        oversampling=view.light.shape[0] // rows,
    )
    return brightness(image)[0].astype(np.float64)


def deep_blurs(
    image: RetinalImage,
    view: DeepView,
    eye: Eye,
    distances_m: Mapping[str, float],
    most_arcmin: float,
) -> list[ObjectBlur]:
    """The blur of some objects, by name, with their distances along the axis.

    They may differ from what is expected by 3.5 standard errors, 12 % and a tenth of a pixel.
    """
    seen, error = (part.astype(np.float64) for part in brightness(image))
    expected_image = layered_image(eye, view)
    # The noise of the sharp view is in both, and drops out.
    noiseless = dataclasses.replace(view.sharp, variance=np.zeros_like(expected_image))
    found = []
    for name, distance in distances_m.items():
        size = blur_arcmin(seen, view.sharp, name, most_arcmin)
        noise = blur_error_arcmin(seen, error**2, view.sharp, name, most_arcmin, size)
        expected = blur_arcmin(expected_image, noiseless, name, most_arcmin)
        tolerance = _ERRORS * noise + _HIDDEN * expected + _PIXEL * view.sharp.pitch_arcmin
        found.append(ObjectBlur(name, distance, size, expected, tolerance, LAYER_SOURCE))
    return found
