"""Retinal images by PSF convolution: `isetcl.psf_baseline.render`.

Nothing here is shared with the ray-tracing renderer: PSFs come from the float64 tracer, views from
analytic intersections on the host, and every wavelength is computed by itself.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from isetcl.errors import InvalidInputError, check_choice, check_count, check_type
from isetcl.eye.field import FieldMap, direction_from_field
from isetcl.eye.field_plane import FieldPlane
from isetcl.eye.model import Eye, check_eye_wavelengths
from isetcl.eye.people.ocular_media import OcularMedia, transmittance_or_one
from isetcl.eye.people.scatter import ScatterModel
from isetcl.eye.throughput import irradiance_per_radiance
from isetcl.memory import check_memory
from isetcl.psf_baseline.convolve import LayerSpectra, SpectralBlur
from isetcl.psf_baseline.depth_image import DepthImage
from isetcl.psf_baseline.methods import Method, methods
from isetcl.psf_baseline.picture_source import (
    Source,
    image_grid,
    image_wavelengths,
    picture_stack,
)
from isetcl.psf_baseline.picture_stack import Border, Hidden, PictureStack
from isetcl.psf_baseline.plane import fields_seen_deg, plane_throughput
from isetcl.psf_baseline.psf import Psf, geometric_psf
from isetcl.psf_baseline.pupil import MAX_SAMPLES, PupilOffsets, pupil_offsets
from isetcl.psf_baseline.slicing import closed, soft_slices
from isetcl.psf_baseline.veil import veil
from isetcl.psf_baseline.view import (
    Layer,
    Layers,
    ViewGrid,
    blur_step_dpt,
    layer_edges_dpt,
    take_layers,
)
from isetcl.retina.depth import vergence_map
from isetcl.retina.grid import Centre, RetinalGrid
from isetcl.retina.image import RetinalImage
from isetcl.retina.pinhole_view import PinholeView
from isetcl.scene.basis import SpectralBasis, spectral_basis
from isetcl.scene.light import Environment
from isetcl.scene.light_field import LightField
from isetcl.scene.model import Scene
from isetcl.scene.texture import Image
from isetcl.scene.view import intersect, texels_across
from isetcl.units import MM_PER_M
from isetcl.version import __version__

PSF_KINDS = ("geometric",)
SLICINGS = ("auto", "hard", "soft")

_SHIFT_TOLERANCE = 0.05
_MARGIN_ROUNDS = 4


def render(
    scene: Source,
    eye: Eye,
    *,
    method: str = "layered_sum",
    psf: str = "geometric",
    layers: Layers = "auto",
    fov_deg: float | tuple[float, float] | None = None,
    resolution: int | tuple[int, int] | None = None,
    centre_deg: Centre | None = None,
    wavelengths_nm: np.ndarray | None = None,
    border: Border = "reflect",
    hidden: Hidden = "extend",
    oversampling: int = 2,
    slicing: str = "auto",
    pupil_samples: int | None = None,
    scatter: ScatterModel | None = None,
    media: OcularMedia | None = None,
    progress: Callable[[float], None] | None = None,
) -> RetinalImage:
    """The retinal image of a scene approximated by PSF convolution, in absolute units.

    One PSF per layer and wavelength, that of the middle of the field, serves the whole image.

    Parameters
    ----------
    scene
        A `Scene`, or pictures of one: a `PinholeView` or a `DepthImage`, seen from the middle of
        the entrance pupil.
    eye, fov_deg, resolution, centre_deg, wavelengths_nm
        As in `isetcl.render`; the image lies on the same grid. None is what the picture has.
    border
        What lies beyond the borders of a picture, which blur brings in: ``"reflect"`` (mirrored,
        as often as the PSF needs), ``"replicate"`` (its outermost pixels) or ``"zero"`` (dark). A
        scene goes on by itself.
    hidden
        What lies behind a picture without hidden layers, for methods that need it: ``"extend"``
        (the nearest pixel that is farther away) or ``"none"`` (dark).
    method
        One of `methods()`, for instance ``"layered_sum"`` or ``"pupil_clipped"``.
    psf
        ``"geometric"``: from the eye's own rays.
    layers
        Depth layers: ``"auto"`` (blur changes by less than a pixel inside a layer), a number, or
        edges in dioptres.
    oversampling
        Samples across a pixel in views and PSFs.
    slicing
        ``"hard"``: every sample belongs to one layer; ``"soft"``: layers of one surface share their
        samples by vergence, so that blur does not jump; ``"auto"``: as the method is known for.
    pupil_samples
        Samples of the pupil for methods that take such; None for what the method wants.
    scatter
        Light that is scattered inside the eye: its share is taken from the image and spread as a
        veil, from sources outside the image too. None leaves it out.
    media
        Ocular media whose transmittance multiplies the spectrum; None is clear media.
    progress
        Called with the fraction done after every wavelength.

    Returns
    -------
    RetinalImage
        With a standard error of zero: it has no noise, only bias.

    Raises
    ------
    InvalidInputError
        Before any work starts, if an argument breaks its rule.
    """
    start = time.perf_counter()
    chosen: Method = methods()[check_choice("method", method, methods())]
    check_type("scene", scene, (Scene, PinholeView, DepthImage))
    check_type("eye", eye, Eye)
    if isinstance(scene, Scene):
        _check_emission_only(scene)
    check_choice("psf", psf, PSF_KINDS)
    oversampling = check_count("oversampling", oversampling, 1, 8)
    check_choice("slicing", slicing, SLICINGS)
    if pupil_samples is not None:
        pupil_samples = check_count("pupil_samples", pupil_samples, 1, MAX_SAMPLES)
    if progress is not None and not callable(progress):
        raise InvalidInputError(
            f"progress must be a function of the fraction done, or None, got {progress!r}"
        )
    if scatter is not None:
        check_type("scatter", scatter, ScatterModel)
        check_type("scene", scene, Scene, "scattered light comes from outside pictures too")
    grid = image_grid(scene, eye, fov_deg, resolution, centre_deg)
    wavelengths = image_wavelengths(scene, wavelengths_nm)
    check_eye_wavelengths(eye, wavelengths)
    _check_square(grid)
    transmittance = transmittance_or_one(media, wavelengths)
    if isinstance(scene, Scene):
        source: Scene | PictureStack = _filtered(scene, grid, oversampling)
    else:
        source = picture_stack(scene, wavelengths, border, hidden)
    basis = _basis(source, wavelengths)
    edges, psfs, margin = _layers_and_psfs(source, grid, layers, wavelengths, oversampling)
    view = ViewGrid(grid, oversampling, margin)
    _check_memory(view, len(edges) - 1, len(basis.spectra), len(wavelengths), chosen)
    taken = take_layers(
        source, view, basis, _open_ended(edges), complete=chosen.needs_complete_layers
    )
    taken = _prepared(taken, chosen, slicing)
    irradiance = np.zeros((len(wavelengths), *grid.shape), dtype=np.float32)
    spread = None
    if scatter is not None and isinstance(source, Scene):
        spread = veil(source, view, basis, scatter)
    if taken or spread is not None:
        spectra = LayerSpectra(taken) if taken else None
        for i, wavelength in enumerate(wavelengths):
            channels = np.zeros((len(basis.spectra), *view.shape), dtype=np.float32)
            if spectra is not None:
                pupil = _pupil(grid, float(wavelength), taken, chosen, pupil_samples)
                blur = SpectralBlur(spectra, [_nearest(psfs[i], layer) for layer in taken], pupil)
                channels = chosen.combine(blur, len(taken))
            if scatter is not None and spread is not None:
                channels = (1.0 - scatter.fraction) * channels + spread
            radiance = np.tensordot(basis.spectra[:, i].astype(np.float32), channels, axes=1)
            on_retina = _onto_retina(radiance, view, float(wavelength))
            irradiance[i] = on_retina * _throughput(grid, float(wavelength)) * transmittance[i]
            if progress is not None:
                progress((i + 1) / len(wavelengths))
    details = {
        "method": method,
        "psf": psf,
        "version": __version__,
        "scene": source.name,
        "scene_digest": source.digest(),
        **_assumed(source, view),
        "layers_dpt": [layer.vergence_dpt for layer in taken],
        "oversampling": oversampling,
        "slicing": chosen.slicing if slicing == "auto" else slicing,
        "media": None if media is None else media.describe(),
        "scatter": None if scatter is None else scatter.describe(),
        "psf_energy_outside": max(
            (p.energy_outside for row in psfs for p in row.values()), default=0.0
        ),
        "elapsed_s": time.perf_counter() - start,
    }
    return RetinalImage.from_arrays(
        grid,
        wavelengths,
        irradiance,
        vergence_dpt=(
            vergence_map(source, grid) if isinstance(source, Scene) else source.vergence_map(grid)
        ),
        provenance=details,
    )


def _basis(source: Scene | PictureStack, wavelengths_nm: np.ndarray) -> SpectralBasis:
    if isinstance(source, Scene):
        return spectral_basis(source, wavelengths_nm)
    return source.basis


def _assumed(source: Scene | PictureStack, view: ViewGrid) -> dict[str, Any]:
    """What was assumed beyond and behind pictures, for provenance."""
    if isinstance(source, Scene):
        return {}
    across = min(view.shape) - 2 * view.margin
    return {
        "border": source.border,
        "border_samples": view.margin,
        "blur_is_wider_than_image": view.margin > across,
        "hidden": source.hidden if len(source.sheets) == 1 else "given",
    }


def _prepared(layers: list[Layer], method: Method, slicing: str) -> list[Layer]:
    """The layers as a method wants them: sliced, and without gaps if they are visible ones."""
    if (method.slicing if slicing == "auto" else slicing) == "soft":
        layers = soft_slices(layers, complete=method.needs_complete_layers)
    if layers and not method.needs_complete_layers:
        layers = closed(layers)
    return layers


def _pupil(
    grid: RetinalGrid,
    wavelength_nm: float,
    layers: list[Layer],
    method: Method,
    samples: int | None,
) -> PupilOffsets | None:
    """Rays through the pupil for methods that follow them."""
    if method.pupil_samples == 0:
        return None
    return pupil_offsets(
        grid.eye,
        wavelength_nm,
        [layer.vergence_dpt for layer in layers],
        method.pupil_samples if samples is None else samples,
        rays_per_sample=method.rays_per_sample,
        field_deg=grid.centre_deg,
    )


def _check_emission_only(scene: Scene) -> None:
    """Refuse what a view along single rays cannot show: light that is scattered."""
    if isinstance(scene.background, Environment):
        raise InvalidInputError(
            "PSF methods know only an even background, but the scene has an Environment; use a "
            "spectrum, or ray tracing"
        )
    for item in scene.objects:
        if item.scatters:
            raise InvalidInputError(
                f"PSF methods see only surfaces that send out light by themselves, but object "
                f"{item.name!r} is {type(item.material).__name__}; use UnlitReflectance, or ray "
                "tracing"
            )
        if isinstance(item.material.texture, LightField):
            raise InvalidInputError(
                f"PSF methods see surfaces that shine alike in all directions, but object "
                f"{item.name!r} shows a light field; use ray tracing"
            )
        if not item.is_opaque:
            raise InvalidInputError(
                f"PSF methods see only opaque surfaces, but light passes object {item.name!r}; "
                "make it opaque, or use ray tracing"
            )


def _filtered(scene: Scene, grid: RetinalGrid, oversampling: int) -> Scene:
    """The scene with pictures averaged down where a sample of the view covers several texels."""
    sample_rad = math.radians(min(grid.pitch_deg)) / oversampling
    pupil_m = grid.field_map.entrance_mm(np.array(0.0), np.array(0.0)) / MM_PER_M
    x = np.linspace(grid.x_deg[0], grid.x_deg[-1], 33)
    y = np.linspace(grid.y_deg[0], grid.y_deg[-1], 33)
    directions = direction_from_field(*np.meshgrid(x, y))
    objects = []
    for item in scene.objects:
        image = item.material.texture
        if isinstance(image, Image):
            hits = intersect(item.shape, pupil_m, directions)
            nearest = float(np.min(hits.distance_m))
            if math.isfinite(nearest):
                across = texels_across(item.shape, image, nearest, sample_rad)
                small = image.halved(max(0, math.floor(math.log2(max(across, 1.0)))))
                material = dataclasses.replace(item.material, texture=small)  # type: ignore[arg-type]
                item = dataclasses.replace(item, material=material)
        objects.append(item)
    return dataclasses.replace(scene, objects=tuple(objects))


def _layers_and_psfs(
    scene: Scene | PictureStack,
    grid: RetinalGrid,
    layers: Layers,
    wavelengths_nm: np.ndarray,
    oversampling: int,
) -> tuple[np.ndarray, list[dict[float, Psf]], int]:
    """Edges of layers, PSFs by wavelength and vergence, and the margin the view needs.

    Blur brings light from beyond the borders into the image, so that the margin depends on the
    PSFs, those on the layers, and the layers on what lies in the margin.
    """
    psfs: list[dict[float, Psf]] = [{} for _ in wavelengths_nm]
    pitch = grid.pitch_deg[0] / oversampling
    reach = 0.0
    for _ in range(_MARGIN_ROUNDS):
        edges = layer_edges_dpt(scene, grid, layers, blur_step_dpt(grid), reach)
        verges = _layer_vergences(scene, grid, edges)
        for known, wavelength in zip(psfs, wavelengths_nm, strict=True):
            for v in verges:
                if v not in known:
                    known[v] = geometric_psf(grid.eye, float(wavelength), v, pitch, grid.centre_deg)
        used = [{v: known[v] for v in verges} for known in psfs]
        margin = _margin(grid, wavelengths_nm, used, oversampling)
        if margin * pitch <= reach:
            break
        reach = margin * pitch
    return edges, used, margin


def _open_ended(edges_dpt: np.ndarray) -> np.ndarray:
    """Edges whose outer layers hold everything beyond them."""
    edges = edges_dpt.copy()
    edges[0], edges[-1] = -np.inf, np.inf
    return edges


def _layer_vergences(
    scene: Scene | PictureStack, grid: RetinalGrid, edges_dpt: np.ndarray
) -> list[float]:
    """A vergence for every layer: its mean in a coarse view, or its middle if nothing is seen."""
    coarse = RetinalGrid.of(grid.eye, grid.fov_deg, (33, 33), grid.centre_deg)
    basis = _basis(scene, np.array([grid.wavelength_nm]))
    verges = []
    for low, high in itertools.pairwise(edges_dpt):
        view = ViewGrid(coarse, 1, 0)
        between = np.array([low if low > 0 else -np.inf, high])
        layers = take_layers(scene, view, basis, between, complete=True, refinement=1)
        verges.append(layers[0].vergence_dpt if layers else max(0.0, (low + high) / 2.0))
    return verges


def _check_square(grid: RetinalGrid) -> None:
    width, height = grid.pitch_deg
    if abs(width / height - 1.0) > 1e-6:
        raise InvalidInputError(
            f"PSF methods need square pixels, got {width:g} by {height:g} deg; "
            "pass one number for fov_deg"
        )


def _check_memory(
    view: ViewGrid, n_layers: int, n_basis: int, n_wavelengths: int, method: Method
) -> None:
    """Raise OutOfMemoryError, naming a resolution that fits, before anything large is allocated.

    A sample of the view takes a float for every layer and channel, twice that for their transforms,
    and working space for one wavelength.
    """
    rows, columns = view.shape
    per_sample = 4 * n_layers * (n_basis + 2) + 8 * n_layers * (n_basis + 1) + 32 * (n_basis + 2)
    if method.slicing == "soft" or method.pupil_samples > 0:
        # Sliced copies of the layers, and sums over the pupil in double precision.
        per_sample += n_layers * 12 * (n_basis + 1)
    pixels = view.grid.shape[0] * view.grid.shape[1]
    needed = rows * columns * per_sample + pixels * n_wavelengths * 16
    check_memory(
        f"a view of {columns} x {rows} samples in {n_layers} layers",
        needed,
        lambda share: (
            f"about {int(view.grid.shape[1] * share)} x {int(view.grid.shape[0] * share)} pixels "
            "would fit, or use fewer layers"
        ),
    )


def _nearest(psfs: dict[float, Psf], layer: Layer) -> Psf:
    """The PSF computed for a layer: that of the nearest vergence."""
    return psfs[min(psfs, key=lambda v: abs(v - layer.vergence_dpt))]


def _margin(
    grid: RetinalGrid,
    wavelengths_nm: np.ndarray,
    psfs: list[dict[float, Psf]],
    oversampling: int,
) -> int:
    """Samples a view must reach beyond the image: the largest PSF and the lateral colour shift."""
    radius = max(psf.radius for row in psfs for psf in row.values())
    shift = 0.0
    for wavelength in (wavelengths_nm[0], wavelengths_nm[-1]):
        shift = max(shift, _shift_deg(grid, float(wavelength)))
    return radius + int(np.ceil(shift / min(grid.pitch_deg) * oversampling)) + 2


def _shift_deg(grid: RetinalGrid, wavelength_nm: float) -> float:
    """How far from its label a retinal point of the image looks at a wavelength, at the worst."""
    labels, own = grid.field_map, grid.eye.field_map(wavelength_nm)
    if isinstance(labels, FieldPlane) and isinstance(own, FieldPlane):
        at = grid.rectangle.lattice(5)
        return float(np.max(np.linalg.norm(fields_seen_deg(labels, own, at) - at, axis=1)))
    assert isinstance(labels, FieldMap)
    assert isinstance(own, FieldMap)
    arc = float(labels.arc_mm(grid.limit_deg))
    return abs(float(own.field_deg(_within(arc, own))) - grid.limit_deg)


def _within(arc_mm: np.ndarray | float, field_map: FieldMap) -> np.ndarray:
    return np.minimum(arc_mm, float(field_map.arc_mm(field_map.max_field_deg)))


def _onto_retina(radiance: np.ndarray, view: ViewGrid, wavelength_nm: float) -> np.ndarray:
    """Blurred radiance at the retinal pixels: moved by lateral colour, averaged over samples.

    A retinal point receives another direction at each wavelength. The blurred view is looked up
    there, linearly between samples, and averaged over the samples of a pixel.
    """
    from scipy.ndimage import map_coordinates

    grid, n = view.grid, view.oversampling
    rows, columns = grid.shape
    inner = slice(view.margin, -view.margin) if view.margin else slice(None)
    x, y = view.x_deg()[inner], view.y_deg()[inner]
    seen_x, seen_y, largest = _seen(grid, wavelength_nm, x, y)
    if largest > _SHIFT_TOLERANCE * view.pitch_deg[0]:
        column = (seen_x - view.x_deg()[0]) / view.pitch_deg[0]
        row = (view.y_deg()[0] - seen_y) / view.pitch_deg[1]
        samples = map_coordinates(radiance, [row, column], order=1, mode="nearest")
    else:
        samples = radiance[inner, inner]
    return samples.reshape(rows, n, columns, n).mean(axis=(1, 3))


def _seen(
    grid: RetinalGrid, wavelength_nm: float, x_deg: np.ndarray, y_deg: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Directions (x, y) that retinal points see at a wavelength, and their largest shift, degrees.

    The points have the labels of a grid of columns `x_deg` and rows `y_deg`.
    """
    labels, own = grid.field_map, grid.eye.field_map(wavelength_nm)
    if isinstance(labels, FieldPlane) and isinstance(own, FieldPlane):
        x, y = np.meshgrid(x_deg, y_deg)
        at = np.stack([x.ravel(), y.ravel()], axis=1)
        both = fields_seen_deg(labels, own, at)
        shift = float(np.max(np.linalg.norm(both - at, axis=1)))
        return both[:, 0].reshape(x.shape), both[:, 1].reshape(x.shape), shift
    assert isinstance(labels, FieldMap)
    assert isinstance(own, FieldMap)
    field = np.linspace(0.0, grid.limit_deg, 65)
    seen = own.field_deg(_within(labels.arc_mm(field), own))
    ratio = np.ones_like(field)
    ratio[1:] = seen[1:] / field[1:]
    ratio[0] = ratio[1]
    scale = np.interp(np.hypot(x_deg[None, :], y_deg[:, None]), field, ratio)
    shift = float(np.max(np.abs(seen - field)))
    return x_deg[None, :] * scale, y_deg[:, None] * scale, shift


def _throughput(grid: RetinalGrid, wavelength_nm: float) -> np.ndarray:
    """Irradiance per unit radiance at every pixel, sr, (rows, columns)."""
    from scipy.interpolate import CubicSpline

    labels = grid.field_map
    if isinstance(labels, FieldPlane):
        return plane_throughput(grid, wavelength_nm)
    # A node every two degrees: far out the pupil closes quickly.
    nodes = np.linspace(0.0, grid.limit_deg, max(9, math.ceil(grid.limit_deg / 2.0) + 1))
    values = irradiance_per_radiance(grid.eye, wavelength_nm, labels, nodes)
    even = CubicSpline(
        np.concatenate([-nodes[:0:-1], nodes]), np.concatenate([values[:0:-1], values])
    )
    x, y = np.meshgrid(grid.x_deg, grid.y_deg)
    return np.asarray(even(np.hypot(x, y)))
