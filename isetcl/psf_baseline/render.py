"""Retinal images by PSF convolution: `isetcl.psf_baseline.render`.

Nothing here is shared with the ray-tracing renderer: PSFs come from the float64 tracer, views from
analytic intersections on the host, and every wavelength is computed by itself.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_between,
    check_choice,
    check_count,
    check_type,
)
from isetcl.eye.field import direction_from_field
from isetcl.eye.model import Eye, check_eye_wavelengths
from isetcl.eye.people.ocular_media import OcularMedia, transmittance_or_one
from isetcl.eye.people.scatter import ScatterModel
from isetcl.memory import available_bytes, check_memory
from isetcl.psf_baseline.bank import PsfBank, check_field
from isetcl.psf_baseline.borders import Border
from isetcl.psf_baseline.depth_image import DepthImage
from isetcl.psf_baseline.depths import plan_depths
from isetcl.psf_baseline.methods import Method, methods
from isetcl.psf_baseline.on_retina import throughput
from isetcl.psf_baseline.patch_image import Job
from isetcl.psf_baseline.patches import Patch, field_patches, tiles
from isetcl.psf_baseline.picture_source import (
    Source,
    image_grid,
    image_wavelengths,
    picture_stack,
)
from isetcl.psf_baseline.picture_stack import Hidden, PictureStack
from isetcl.psf_baseline.psf import Psf
from isetcl.psf_baseline.psf_cache import PsfCache
from isetcl.psf_baseline.psfs import PsfKind
from isetcl.psf_baseline.pupil import MAX_SAMPLES
from isetcl.psf_baseline.transforms import RealFft, fft_of
from isetcl.psf_baseline.view import Layers
from isetcl.retina.depth import vergence_map
from isetcl.retina.grid import Centre, RetinalGrid
from isetcl.retina.image import RetinalImage
from isetcl.retina.pinhole_view import PinholeView
from isetcl.scene.basis import spectral_basis
from isetcl.scene.light import Environment
from isetcl.scene.light_field import LightField
from isetcl.scene.model import Scene
from isetcl.scene.texture import Image
from isetcl.scene.view import intersect, texels_across
from isetcl.units import MM_PER_M
from isetcl.version import __version__

SLICINGS = ("auto", "hard", "soft")

_TILE_BYTES = 1.6e9
_LEAST_TILE = 64  # pixels
_LARGEST_REACH_DEG = 2.0


def render(
    scene: Source,
    eye: Eye,
    *,
    method: str = "layered_sum",
    psf: str | PsfKind | Psf = "geometric",
    field: str | int = "centre",
    psf_error: float = 0.01,
    psf_cache: bool | PsfCache | None = True,
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
    fft: str | RealFft = "scipy",
    progress: Callable[[float], None] | None = None,
) -> RetinalImage:
    """The retinal image of a scene approximated by PSF convolution, in absolute units.

    One PSF per layer and wavelength, that of the middle of the field, serves the whole image,
    unless `field` asks for more.

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
        One of `psf_kinds()`: ``"geometric"`` is from the eye's own rays to each retinal point,
        ``"wave"`` has diffraction too, but is that of object points, as ``"geometric_spread"`` is:
        far out of focus coma makes their blur 1 % too large or small. A `Psf` of your own, on the
        grid of the view's samples, serves all.
    field
        ``"centre"``; ``"patches"``: PSFs change across the image, made at so many nodes a side
        that those interpolated between them err by `psf_error`; or the number of nodes a side.
    psf_error
        Largest error of interpolated PSFs, half the L1 distance of kernels: no image value is
        farther off in units of the range of radiance.
    psf_cache
        Whether PSFs are kept on disk; see `PsfBank`.
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
    fft
        Who makes the Fourier transforms: ``"scipy"``, or an object that does, such as
        `isetcl.device_fft` for an OpenCL device. Images differ by the rounding of single precision.
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
    check_field(field)
    check_between("psf_error", psf_error, 1e-4, 1.0)
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
    transforms = fft_of(fft)
    grid = image_grid(scene, eye, fov_deg, resolution, centre_deg)
    wavelengths = image_wavelengths(scene, wavelengths_nm)
    check_eye_wavelengths(eye, wavelengths)
    _check_square(grid)
    transmittance = transmittance_or_one(media, wavelengths)
    if isinstance(scene, Scene):
        source: Scene | PictureStack = _filtered(scene, grid, oversampling)
    else:
        source = picture_stack(scene, wavelengths, border, hidden)
    basis = spectral_basis(source, wavelengths) if isinstance(source, Scene) else source.basis
    bank = PsfBank(
        eye,
        psf,
        grid.pitch_deg[0] / oversampling,
        reach_deg=min(_LARGEST_REACH_DEG, max(grid.fov_deg)),
        cache=psf_cache,
    )
    depths = plan_depths(source, grid, layers, wavelengths, bank, psf_error)
    job = Job(
        source,
        grid,
        wavelengths,
        basis,
        depths,
        bank,
        chosen,
        slicing,
        oversampling,
        pupil_samples,
        scatter,
        psf_error,
        transforms=transforms,
    )
    patches = _patches(job, field)
    if len(patches) > 1 and chosen.name == "single":
        # Every patch on its own would choose the PSF of what it shows most of.
        job = dataclasses.replace(job, one_layer=int(np.argmax(depths.areas)))
    if len(patches) > 1 and field != "centre":
        job = job.with_layers_of(patches, _allowed_bytes())
    irradiance = np.zeros((len(wavelengths), *grid.shape), dtype=np.float32)
    verges: set[float] = set()
    for n, patch in enumerate(patches):
        for i, (seen, image) in enumerate(job.images(patch)):
            irradiance[i, patch.rows, patch.columns] += patch.weight * image
            verges.update(seen)
            if progress is not None:
                progress((n + (i + 1) / len(wavelengths)) / len(patches))
    for i, wavelength in enumerate(wavelengths):
        irradiance[i] *= throughput(grid, float(wavelength)) * transmittance[i]
    details = {
        "method": method,
        "psf": bank.describe()["kind"],
        "psfs": bank.describe(),
        "field": field,
        "patches": len(patches),
        "version": __version__,
        "scene": source.name,
        "scene_digest": source.digest(),
        **({} if isinstance(source, Scene) else source.assumptions(grid, job.reach_deg())),
        "layers_dpt": sorted(verges),
        "oversampling": oversampling,
        "slicing": chosen.slicing if slicing == "auto" else slicing,
        "media": None if media is None else media.describe(),
        "scatter": None if scatter is None else scatter.describe(),
        "fft": str(transforms),
        "psf_energy_outside": bank.describe()["energy_outside"],
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


def _patches(job: Job, field: str | int) -> list[Patch]:
    """The parts in which an image is made; raise OutOfMemoryError where they do not fit."""
    grid = job.grid
    if field == "centre":
        count = _tiles_needed(job)
        parts = tiles(grid, count)
    else:
        if field == "patches":
            middle = job.wavelengths_nm[len(job.wavelengths_nm) // 2]
            field = job.bank.patches_needed(
                float(middle),
                job.depths.vergences_dpt,
                grid.centre_deg,
                grid.fov_deg,
                job.depth_bound,
            )
        parts = field_patches(grid, int(field))
    largest = max(parts, key=lambda patch: patch.weight.size)
    _check_memory(job, largest)
    return parts


def _allowed_bytes() -> float:
    return min(_TILE_BYTES, available_bytes() / 2.0)


def _tiles_needed(job: Job) -> int:
    """Tiles across each side of an image that keep the memory of each in bounds."""
    allowed = _allowed_bytes()
    count = 1
    while True:
        patch = tiles(job.grid, count)[0]
        view = job.view(patch, job.psfs(patch))
        if job.needed_bytes(view) <= allowed or max(patch.weight.shape) <= _LEAST_TILE:
            return count
        count += 1


def _check_square(grid: RetinalGrid) -> None:
    width, height = grid.pitch_deg
    if abs(width / height - 1.0) > 1e-6:
        raise InvalidInputError(
            f"PSF methods need square pixels, got {width:g} by {height:g} deg; "
            "pass one number for fov_deg"
        )


def _check_memory(job: Job, patch: Patch) -> None:
    """Raise OutOfMemoryError, naming a resolution that fits, before anything large is allocated."""
    view = job.view(patch, job.psfs(patch))
    rows, columns = job.grid.shape
    needed = job.needed_bytes(view) + rows * columns * len(job.wavelengths_nm) * 16
    check_memory(
        f"a view of {view.shape[1]} x {view.shape[0]} samples in "
        f"{len(job.depths.vergences_dpt)} layers",
        needed,
        lambda share: (
            f"about {int(columns * share)} x {int(rows * share)} pixels would fit, or use fewer "
            "layers"
        ),
    )
