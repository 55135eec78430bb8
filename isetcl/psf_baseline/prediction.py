"""What an eye would see of a view, evaluated from its layers: what methods are judged by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeGuard

import numpy as np

from isetcl.eye.model import Eye
from isetcl.psf_baseline.picture_source import Source, image_wavelengths
from isetcl.psf_baseline.psf import Psf
from isetcl.psf_baseline.psfs import PsfKind, psf_kind
from isetcl.psf_baseline.psfs.reach import REACH
from isetcl.psf_baseline.render import render
from isetcl.retina.image import RetinalImage
from isetcl.scene.model import Scene

REFERENCE = "aperture_samples"
NODES = 3
"""Nodes across the field, at its borders and in its middle, between which rays are blended."""

# A step of about one standard deviation of the photopic weighting, whose sum then is near exact.
_WAVELENGTHS_NM = (470.0, 515.0, 560.0, 605.0, 650.0)


@dataclass(frozen=True, eq=False)
class Prediction:
    """Photopic images of a view, of mean 1.

    Attributes
    ----------
    truth : ndarray, (rows, columns)
        With the rays of each field position.
    centred : ndarray, (rows, columns)
        With those of the middle of the field everywhere.
    coarse : ndarray, (rows, columns)
        As that, with half as many rays.
    level
        What they were divided by, lux.
    image
        The image of `centred`.
    """

    truth: np.ndarray
    centred: np.ndarray
    coarse: np.ndarray
    level: float
    image: RetinalImage


def predict(
    scene: Source, eye: Eye, psf: str | PsfKind | Psf, samples: int, where: dict[str, Any]
) -> Prediction:
    """The images that rays through the pupil make of a view's layers.

    What the field changes is taken from half as many rays. The eye's own PSFs with diffraction
    change the image by what they change in M8, which has the same layers.
    """

    def made(count: int, field: str | int) -> RetinalImage:
        # The PSF only says how large the view must be.
        rays = {"pupil_samples": count, "psf": REACH, "psf_cache": None, "field": field}
        return render(scene, eye, method=REFERENCE, **(where | rays))

    image = made(samples, "centre")
    centred, coarse = image.brightness()[0], made(samples // 2, "centre").brightness()[0]
    by_field = made(samples // 2, NODES).brightness()[0] - coarse
    if is_own(psf) and psf_kind(psf).name not in ("geometric", "geometric_spread"):
        # Diffraction is known of object points; rays of the same leave nothing else in the change.
        diffracted, sharp = (
            render(scene, eye, method="layered_over", psf=kind, **where).brightness()[0]
            for kind in (psf, "geometric_spread")
        )
        centred, coarse = (part + diffracted - sharp for part in (centred, coarse))
    level = float(np.mean(centred[centred > 0])) if np.any(centred > 0) else 1.0
    truth = centred + by_field
    return Prediction(truth / level, centred / level, coarse / level, level, image)


def is_own(psf: str | PsfKind | Psf) -> TypeGuard[str | PsfKind]:
    """Whether a PSF is that of the eye itself, which changes over the field."""
    return not isinstance(psf, Psf) and psf_kind(psf).knows_field


def few_wavelengths(scene: Source, wavelengths_nm: np.ndarray | None) -> np.ndarray:
    """Where photopic images are evaluated: as asked, or the nearest that a picture has to five."""
    if wavelengths_nm is not None:
        return image_wavelengths(scene, wavelengths_nm)
    wanted = np.array(_WAVELENGTHS_NM)
    if isinstance(scene, Scene):
        return wanted
    known = image_wavelengths(scene, None)
    return np.unique(known[np.argmin(np.abs(known[:, None] - wanted), axis=0)])
