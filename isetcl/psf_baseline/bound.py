"""How wrong a PSF method will be, before anything is ray-traced: `error_bound`.

At a depth edge the light of a pixel is the integral over the pupil of what each ray meets first.
That integral is evaluated on the layers of the view, at a few wavelengths, by moving them as their
defocus says (M10); what the method makes of the same layers less this is its predicted error. For
even layers at a straight edge it is the closed form of `edge_error`. To it are added what the
prediction itself may be wrong by, each part from its cause:

* place: a pixel's error is taken as the largest of its neighbourhood of 3 x 3, since edges are
  known to half a pixel;
* pupil: what half as many rays through the pupil change;
* field: what the rays of other field positions change, from those at the borders, blended; of a
  method whose PSFs change over the field, what blending leaves of it;
* hidden: of a picture without hidden layers, the share of the pupil that sees what is hidden, times
  the range of the farther radiances within reach: what is hidden is like what is seen beside it;
* agreement: 0.2 % of each pixel, what methods and ray tracing agree to on flat scenes.

What counts as error depends on the kind of PSF. The eye's own (of rays, wave, hurb) are judged by
ray tracing with the same diffraction, or none: diffraction changes the prediction by what it
changes in M8, whose layers are the same. All others, and a `Psf` of the user's, are judged by the
eye's rays, so that what they leave out or add is error too, everywhere in the image.

Scatter is not in it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from isetcl.errors import check_between, check_choice, check_count
from isetcl.eye.model import Eye
from isetcl.psf_baseline.bank import check_field
from isetcl.psf_baseline.hidden_part import hidden_part
from isetcl.psf_baseline.methods import methods
from isetcl.psf_baseline.picture_source import Source, image_grid
from isetcl.psf_baseline.prediction import NODES, few_wavelengths, is_own, predict
from isetcl.psf_baseline.psf import Psf
from isetcl.psf_baseline.psfs import PsfKind, psf_kind
from isetcl.psf_baseline.pupil import MAX_SAMPLES
from isetcl.psf_baseline.render import render
from isetcl.retina.depth_edges import occlusion_strip
from isetcl.retina.grid import Centre, RetinalGrid
from isetcl.retina.image import RetinalImage

AGREEMENT = 0.002
"""Largest bias of PSF methods against ray tracing on flat scenes, of the mean."""

_PUPIL_SAMPLES = 256
_OF_VIEWS = ("layers", "slicing", "oversampling", "border", "hidden", "fft")
_OF_PSFS = ("psf_error", "psf_cache")


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

    Against ray tracing without scatter: with the diffraction of the PSFs if they are the eye's own,
    else with none.

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
    psf: str | PsfKind | Psf = "geometric",
    field: str | int = "centre",
    pupil_samples: int = _PUPIL_SAMPLES,
    wavelengths_nm: np.ndarray | None = None,
    fov_deg: float | tuple[float, float] | None = None,
    resolution: int | tuple[int, int] | None = None,
    centre_deg: Centre | None = None,
    **options: Any,
) -> dict[str, ErrorBound]:
    """The bounds of `error_bound` for several methods, which share one prediction of the truth.

    It takes a rendering for every method and about as long as five of M10, at five wavelengths.

    Parameters
    ----------
    scene, eye, fov_deg, resolution, centre_deg
        As for `isetcl.psf_baseline.render`.
    methods_named
        Names of methods.
    psf, field
        The PSFs of the methods and how they change over the field, as for `render`.
    pupil_samples
        Rays through the pupil.
    wavelengths_nm
        Where it is evaluated; None is five across the visible range, or the nearest that a view
        or cube has.
    options
        `layers`, `slicing`, `oversampling`, `border`, `hidden`, `fft`, `psf_error` and `psf_cache`
        of `render`.

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
        check_choice("option of error_bound", name, _OF_VIEWS + _OF_PSFS)
    check_field(field)
    if not isinstance(psf, Psf):
        psf = psf_kind(psf)
    grid = image_grid(scene, eye, fov_deg, resolution, centre_deg)
    views = {name: value for name, value in options.items() if name in _OF_VIEWS}
    where: dict[str, Any] = {
        "fov_deg": grid.fov_deg,
        "resolution": grid.resolution,
        "centre_deg": grid.centre_deg,
        "wavelengths_nm": few_wavelengths(scene, wavelengths_nm),
    }
    found = predict(scene, eye, psf, samples, views | where)
    turn = np.abs(found.truth - found.centred)
    blended = is_own(psf) and field not in ("centre", 1)
    common = {
        "pupil": _around(np.abs(found.centred - found.coarse)),
        "field": _around(turn / (NODES - 1) ** 2 if blended else turn),
        "hidden": hidden_part(scene, grid, eye, views),
        "agreement": AGREEMENT * np.maximum(found.centred, 0.0),
    }
    strip = _strip(found.image, grid)
    bounds = {}
    for name in names:
        made = render(scene, eye, method=name, psf=psf, field=field, **(options | where))
        image = made.brightness()[0] / found.level
        edges = _around(np.abs(image - (found.truth if blended else found.centred)))
        parts = {"edges": edges, **common}
        bound = np.sum(list(parts.values()), axis=0)
        elapsed = time.perf_counter() - start
        bounds[name] = ErrorBound(name, bound, image - found.truth, parts, strip, elapsed)
    return bounds


def _around(values: np.ndarray) -> np.ndarray:
    """The largest value of each neighbourhood of 3 x 3."""
    from scipy.ndimage import maximum_filter

    return np.asarray(maximum_filter(values, 3, mode="nearest"))


def _strip(image: RetinalImage, grid: RetinalGrid) -> np.ndarray:
    assert image.vergence_dpt is not None
    return occlusion_strip(
        image.vergence_dpt.values, grid.pitch_deg, image.entrance_pupil_diameter_mm
    )
