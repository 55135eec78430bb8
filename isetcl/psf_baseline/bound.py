"""How wrong a PSF method will be, before anything is ray-traced: `error_bound`.

At a depth edge the light of a pixel is the integral over the pupil of what each ray meets first.
That integral is evaluated on the layers of the view, at a few wavelengths, by moving them as their
defocus says (M10); what the method makes of the same layers less this is its predicted error. For
even layers at a straight edge it is the closed form of `edge_error`. To it are added what the
prediction itself may be wrong by, each part from its cause:

* place: a pixel's error is taken as the largest of its neighbourhood of 3 x 3, since edges are
  known to half a pixel;
* pupil: what half as many rays through the pupil change;
* field: one PSF serves the whole image; its shift and spread are traced at the corners, and grow
  towards them linearly. A shift s changes the image by s . grad L, a variance by half of it times
  the Laplacian;
* hidden: of a picture without hidden layers, the share of the pupil that sees what is hidden, times
  the range of the farther radiances within reach: what is hidden is like what is seen beside it;
* agreement: 0.2 % of each pixel, what methods and ray tracing agree to on flat scenes.

Not in it: detail of two or three pixels in focus, which the samples of a view and the pixels of a
ray tracer render a little differently; diffraction and scatter.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from isetcl.errors import check_between, check_choice, check_count
from isetcl.eye.model import Eye
from isetcl.psf_baseline.depth_image import DepthImage
from isetcl.psf_baseline.methods import methods
from isetcl.psf_baseline.picture_source import (
    Source,
    image_grid,
    image_wavelengths,
    picture_stack,
)
from isetcl.psf_baseline.pupil import MAX_SAMPLES, pupil_offsets
from isetcl.psf_baseline.render import render
from isetcl.psf_baseline.view import ViewGrid
from isetcl.retina.depth_edges import occlusion_strip
from isetcl.retina.grid import Centre, RetinalGrid
from isetcl.retina.image import RetinalImage
from isetcl.retina.pinhole_view import PinholeView
from isetcl.scene.model import Scene
from isetcl.spectrum import photopic_weights
from isetcl.units import MM_PER_M

AGREEMENT = 0.002
"""Largest bias of PSF methods against ray tracing on flat scenes, of the mean."""

_REFERENCE = "aperture_samples"
_PUPIL_SAMPLES = 256
_FIELD_SAMPLES = 48
_OPTIONS = ("layers", "slicing", "oversampling", "border", "hidden")
# A step of about one standard deviation of the photopic weighting, whose sum then is near exact.
_WAVELENGTHS_NM = (470.0, 515.0, 560.0, 605.0, 650.0)


@dataclass(frozen=True)
class Verdict:
    """Whether a PSF method will do.

    Attributes
    ----------
    method
        Its name.
    tolerance
        Error that is allowed, of the mean of the image.
    share
        Share of the pixels whose bound is within it.
    is_safe
        Whether that is as large as was asked for.
    text
        The same in words.
    """

    method: str
    tolerance: float
    share: float
    is_safe: bool
    text: str


@dataclass(frozen=True, eq=False)
class ErrorBound:
    """Predicted error of a PSF method, photopic, relative to the mean of the image.

    Attributes
    ----------
    method
        Name of the method.
    bound : ndarray, (rows, columns)
        What the absolute error should stay below: the sum of `parts`.
    estimate : ndarray, (rows, columns)
        Predicted error with its sign.
    parts : dict of ndarray, (rows, columns)
        "edges", "pupil", "field", "hidden" and "agreement".
    strip : ndarray of bool, (rows, columns)
        Pixels within a |D1 - D2| of a depth edge.
    elapsed_s
        Time it took, s.
    """

    method: str
    bound: np.ndarray
    estimate: np.ndarray
    parts: dict[str, np.ndarray]
    strip: np.ndarray
    elapsed_s: float

    def share(self, tolerance: float = 0.01) -> float:
        """Share of the pixels whose bound is at most a tolerance."""
        allowed = check_between("tolerance", tolerance, 0.0, 1e9)
        return float(np.mean(self.bound <= allowed))

    def verdict(self, tolerance: float = 0.01, needed: float = 0.95) -> Verdict:
        """Whether the method is within a tolerance on enough of the image.

        Parameters
        ----------
        tolerance
            Allowed error, of the mean of the image.
        needed
            Share of the pixels on which it must be met.

        Raises
        ------
        InvalidInputError
            If a number is out of range.
        """
        share = self.share(tolerance)
        is_safe = share >= check_between("needed", needed, 0.0, 1.0)
        # Rounded down: it must not claim more than it found.
        percent = math.floor(1000.0 * share) / 10.0
        text = f"{self.method} within {100 * tolerance:g} % on {percent:g} % of the image"
        return Verdict(self.method, tolerance, share, is_safe, text)


def error_bound(
    scene: Source, eye: Eye, *, method: str = "layered_sum", **options: Any
) -> ErrorBound:
    """The error of a PSF method in every pixel, predicted from depth, blur and contrast.

    Of the method with PSFs from the eye's own rays at the middle of the field, against ray tracing
    without diffraction or scatter.

    Parameters
    ----------
    scene, eye, method
        As for `isetcl.psf_baseline.render`.
    options
        As for `error_bounds`.

    Raises
    ------
    InvalidInputError
        If an argument breaks its rule.
    """
    return error_bounds(scene, eye, [method], **options)[method]


def error_bounds(
    scene: Source,
    eye: Eye,
    methods_named: Sequence[str],
    *,
    pupil_samples: int = _PUPIL_SAMPLES,
    wavelengths_nm: np.ndarray | None = None,
    fov_deg: float | tuple[float, float] | None = None,
    resolution: int | tuple[int, int] | None = None,
    centre_deg: Centre | None = None,
    **options: Any,
) -> dict[str, ErrorBound]:
    """The bounds of `error_bound` for several methods, which share one prediction of the truth.

    It takes a rendering for every method and two more, at five wavelengths.

    Parameters
    ----------
    scene, eye, fov_deg, resolution, centre_deg
        As for `isetcl.psf_baseline.render`.
    methods_named
        Names of methods.
    pupil_samples
        Rays through the pupil.
    wavelengths_nm
        Where it is evaluated; None is five across the visible range, or the nearest that a view
        or cube has.
    options
        `layers`, `slicing`, `oversampling`, `border` and `hidden` of `render`.

    Returns
    -------
    dict of ErrorBound

    Raises
    ------
    InvalidInputError
        If an argument breaks its rule.
    """
    start = time.perf_counter()
    names = [check_choice("method", name, methods()) for name in methods_named]
    samples = check_count("pupil_samples", pupil_samples, 8, MAX_SAMPLES)
    for name in options:
        check_choice("option of error_bound", name, _OPTIONS)
    grid = image_grid(scene, eye, fov_deg, resolution, centre_deg)
    where: dict[str, Any] = options | {
        "fov_deg": grid.fov_deg,
        "resolution": grid.resolution,
        "centre_deg": grid.centre_deg,
        "wavelengths_nm": _few_wavelengths(scene, wavelengths_nm),
    }

    def predicted(count: int) -> RetinalImage:
        return render(scene, eye, method=_REFERENCE, pupil_samples=count, **where)

    reference = predicted(samples)
    truth, coarse = reference.brightness()[0], predicted(samples // 2).brightness()[0]
    level = float(np.mean(truth[truth > 0])) if np.any(truth > 0) else 1.0
    truth, coarse = truth / level, coarse / level
    common = {
        "pupil": _around(np.abs(truth - coarse)),
        "field": _field_part(truth, grid, reference.provenance["layers_dpt"]),
        "hidden": _hidden_part(scene, grid, eye, options),
        "agreement": AGREEMENT * truth,
    }
    strip = _strip(reference, grid)
    bounds = {}
    for name in names:
        made = render(scene, eye, method=name, **where)
        estimate = made.brightness()[0] / level - truth
        parts = {"edges": _around(np.abs(estimate)), **common}
        bound = np.sum(list(parts.values()), axis=0)
        elapsed = time.perf_counter() - start
        bounds[name] = ErrorBound(name, bound, estimate, parts, strip, elapsed)
    return bounds


def _few_wavelengths(scene: Source, wavelengths_nm: np.ndarray | None) -> np.ndarray:
    if wavelengths_nm is not None:
        return image_wavelengths(scene, wavelengths_nm)
    wanted = np.array(_WAVELENGTHS_NM)
    if isinstance(scene, Scene):
        return wanted
    known = image_wavelengths(scene, None)
    return np.unique(known[np.argmin(np.abs(known[:, None] - wanted), axis=0)])


def _around(values: np.ndarray) -> np.ndarray:
    """The largest value of each neighbourhood of 3 x 3."""
    from scipy.ndimage import maximum_filter

    return np.asarray(maximum_filter(values, 3, mode="nearest"))


def _slope(image: np.ndarray, axis: int) -> np.ndarray:
    """The larger of the changes to the next pixel before and after; 0 along an axis of one pixel.

    Fine detail has no slope in differences over two pixels.
    """
    step = np.diff(image, axis=axis)
    after = np.insert(step, step.shape[axis], 0.0, axis=axis)
    before = np.insert(step, 0, 0.0, axis=axis)
    return np.where(np.abs(after) >= np.abs(before), after, before)


def _bend(image: np.ndarray) -> np.ndarray:
    """Absolute Laplacian of an image, per pixel squared; borders are mirrored."""
    around = np.pad(image, 1, mode="symmetric")
    crossed = (
        around[:-2, 1:-1] + around[2:, 1:-1] + around[1:-1, :-2] + around[1:-1, 2:] - 4.0 * image
    )
    return np.abs(crossed)


def _field_part(truth: np.ndarray, grid: RetinalGrid, layers_dpt: list[float]) -> np.ndarray:
    """What one PSF for the whole field changes: its shift and its spread at other places."""
    if not layers_dpt:
        return np.zeros_like(truth)
    half = np.array(grid.fov_deg) / 2.0
    x, y = np.meshgrid(
        (grid.x_deg - grid.centre_deg[0]) / half[0], (grid.y_deg - grid.centre_deg[1]) / half[1]
    )
    right, up = _slope(truth, 1), -_slope(truth, 0)
    bend = _bend(truth)
    pitch = grid.pitch_deg[0]
    part = np.zeros_like(truth)
    for vergence in {min(layers_dpt), max(layers_dpt)}:
        shift, variance = _field_change(grid, vergence, half)
        moved = np.abs(
            right * (shift[0, 0] * x + shift[0, 1] * y) + up * (shift[1, 0] * x + shift[1, 1] * y)
        )
        spread = 0.5 * variance / pitch**2 * np.hypot(x, y) / math.sqrt(2.0)
        part = np.maximum(part, moved / pitch + spread * bend)
    return part


def _field_change(
    grid: RetinalGrid, vergence_dpt: float, half_deg: np.ndarray
) -> tuple[np.ndarray, float]:
    """Shift of the PSF's centroid, (2, 2), and the largest change of its variance at the corners.

    The shift, in degrees, is that matrix times (x, y), which are 1 at the right and upper borders.
    """
    corners = np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)])
    moments = []
    for corner in ((0, 0), *corners):
        at = np.array(grid.centre_deg) + np.array(corner) * half_deg
        rays = pupil_offsets(
            grid.eye,
            grid.wavelength_nm,
            [vergence_dpt],
            _FIELD_SAMPLES,
            field_deg=(float(at[0]), float(at[1])),
        )
        offset = np.stack([rays.x_deg[0].ravel(), rays.y_deg[0].ravel()])
        mean = offset @ rays.weights.ravel()
        variance = float(((offset - mean[:, None]) ** 2).sum(axis=0) @ rays.weights.ravel()) / 2.0
        moments.append((mean, variance))
    (middle, own), *others = moments
    shifts = np.array([mean - middle for mean, _ in others])
    matrix = np.linalg.lstsq(corners.astype(float), shifts, rcond=None)[0].T
    return matrix, max(abs(variance - own) for _, variance in others)


def _hidden_part(scene: Source, grid: RetinalGrid, eye: Eye, options: dict[str, Any]) -> np.ndarray:
    """What content behind a picture could change where the pupil sees behind its edges."""
    even = None if isinstance(scene, Scene) else _even_front(scene)
    if even is None or isinstance(scene, Scene):
        return np.zeros(grid.shape)
    shown = {k: v for k, v in options.items() if k != "hidden"}
    full, seen = (
        render(
            even,
            eye,
            method=_REFERENCE,
            pupil_samples=_PUPIL_SAMPLES,
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

    wavelengths = _few_wavelengths(scene, None)
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


def _strip(image: RetinalImage, grid: RetinalGrid) -> np.ndarray:
    assert image.vergence_dpt is not None
    return occlusion_strip(
        image.vergence_dpt.values, grid.pitch_deg, image.entrance_pupil_diameter_mm
    )
