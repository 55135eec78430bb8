"""What a scene, an eye and the options need: `isetcl.plan`.

A plan decides what is compiled in, with a reason for each decision. Nothing in it depends on the
prescription, the pupil or the accommodation, except through features that are needed or not; so
kernels are not recompiled when those change.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from isetcl import memory
from isetcl.device.choose import find_device
from isetcl.device.devices import Device
from isetcl.device.layout import Precision
from isetcl.errors import check_choice, check_count, check_type
from isetcl.eye.bending.ray_bending import DiffractionChoice
from isetcl.eye.exit_pupil import ExitPupilBound
from isetcl.eye.exit_pupil_plane import PlanePupilBound, pupil_bounds
from isetcl.eye.field import direction_from_field
from isetcl.eye.model import Eye, check_eye_wavelengths
from isetcl.eye.people.ocular_media import OcularMedia, transmittance_or_one
from isetcl.eye.people.scatter import ScatterModel
from isetcl.eye.retina_form import relief
from isetcl.eye.throughput import axial_irradiance_per_radiance
from isetcl.render.decision import Decision, left_out
from isetcl.render.kernel_config import (
    SAMPLES_AT_ONCE,
    TEXELS_PER_FOOTPRINT,
    KernelConfig,
    PathConfig,
    PlaceKind,
    Sampler,
)
from isetcl.render.pack_paths import WAVELENGTHS_AT_ONCE
from isetcl.render.plan_bends import NO_BENDS, Bends, decide_bends
from isetcl.render.plan_eye import decide_eye_features
from isetcl.render.plan_paths import (
    check_mesh_memory,
    check_spectra,
    decide_bounces,
    decide_features,
    path_images,
)
from isetcl.render.schedule import MAX_REPLICATES
from isetcl.retina.bands import BandChoice, choose_bands, split_bands
from isetcl.retina.grid import Centre, RetinalGrid
from isetcl.retina.places import PlaceGrid, Places
from isetcl.scene.basis import SpectralBasis, spectral_basis
from isetcl.scene.model import Disc, Scene, Shape, Sphere
from isetcl.scene.texture import Checkerboard, Image
from isetcl.scene.view import intersect, texels_across
from isetcl.spectrum import check_wavelengths, default_wavelengths_nm
from isetcl.units import MM_PER_M

PACKING_ERROR = 3e-4
"""Largest root-mean-square error of an 11-11-10 texel (blue, 1/1023/sqrt(12)), of its maximum."""

_SPHERE_ROUNDING = 2.4e-7  # of the radius: four roundings of its square

_TILE_FILM_BYTES = 4 << 20
_TILE_PATHS_BYTES = 64 << 20
_PATH_BYTES = 160

DEFAULT_BOUNCES = 8


@dataclass(frozen=True, eq=False)
class Plan:
    """Everything the direct pipeline needs, before any kernel is built.

    Attributes
    ----------
    scene, eye, grid
        What is rendered.
    wavelengths_nm : ndarray, (wavelengths,)
    band_choice : BandChoice
        Groups of wavelengths that share a trace.
    basis : SpectralBasis or None
        The spectra that span the scene; None where paths carry wavelengths.
    pupils : tuple of ExitPupilBound or PlanePupilBound
        One for each band.
    images : tuple of Image or None, or dict
        For each object the picture as it is uploaded; of the path pipeline, pictures averaged down
        by the digest of those they replace.
    config : KernelConfig or PathConfig
        What is compiled in: the direct pipeline, or the path pipeline.
    decisions : tuple of Decision
    tile : (columns, rows)
        Largest piece of the image rendered by one launch.
    device : Device
    media : OcularMedia or None
        What multiplies the spectrum behind the eye's optics.
    bends : Bends
        Diffraction and scatter.
    """

    scene: Scene
    eye: Eye
    grid: RetinalGrid
    wavelengths_nm: np.ndarray
    band_choice: BandChoice
    basis: SpectralBasis | None
    pupils: tuple[ExitPupilBound | PlanePupilBound, ...]
    images: tuple[Image | None, ...] | dict[str, Image]
    config: KernelConfig | PathConfig
    decisions: tuple[Decision, ...]
    tile: tuple[int, int]
    device: Device
    media: OcularMedia | None = None
    bends: Bends = NO_BENDS

    def explain(self) -> str:
        """The decisions as a table: what, how, why."""
        widths = [max(len(getattr(d, f)) for d in self.decisions) for f in ("feature", "choice")]
        return "\n".join(
            f"{d.feature:<{widths[0]}}  {d.choice:<{widths[1]}}  {d.reason}" for d in self.decisions
        )

    @functools.cached_property
    def expansion(self) -> np.ndarray:
        """Matrix from film channels (band, basis) to spectral irradiance, (wavelengths, channels).

        A wavelength takes its band's film, its own spectra, a factor for the small difference of
        the eye's throughput on axis between the wavelength and its band, and the transmittance of
        the ocular media.
        """
        n_basis = self.config.n_basis
        matrix = np.zeros((len(self.wavelengths_nm), len(self.band_choice.bands) * n_basis))
        for b, band in enumerate(self.band_choice.bands):
            traced = axial_irradiance_per_radiance(self.eye, band.wavelength_nm)
            for i in range(band.first, band.last + 1):
                own = axial_irradiance_per_radiance(self.eye, float(self.wavelengths_nm[i]))
                if self.basis is None:
                    matrix[i, b * n_basis + i - band.first] = own / traced
                else:
                    row = self.basis.spectra[:, i] * (own / traced)
                    matrix[i, b * n_basis : (b + 1) * n_basis] = row
        return matrix * transmittance_or_one(self.media, self.wavelengths_nm)[:, None]

    @property
    def has_light(self) -> bool:
        """Whether anything in the scene sends out light."""
        if self.basis is not None:
            return bool(np.any(self.basis.spectra))
        emitters = any(o.emitted is not None for o in self.scene.objects)
        return emitters or bool(self.scene.lights) or self.scene.background is not None


def plan(
    scene: Scene,
    eye: Eye,
    *,
    fov_deg: float | tuple[float, float] = 10.0,
    resolution: int | tuple[int, int] = 256,
    centre_deg: Centre = (0.0, 0.0),
    wavelengths_nm: np.ndarray | None = None,
    bands: int | Literal["auto"] = "auto",
    precision: Precision | Literal["auto"] = "auto",
    max_bounces: int = DEFAULT_BOUNCES,
    expected_error: float = 0.01,
    device: str | None = None,
    pipeline: Literal["auto", "paths"] = "auto",
    media: OcularMedia | None = None,
    diffraction: DiffractionChoice = "none",
    scatter: ScatterModel | None = None,
    sampler: Sampler = "sobol",
    places: Places | None = None,
) -> Plan:
    """What rendering a scene through an eye will take, with reasons; see `render` for arguments.

    Parameters
    ----------
    max_bounces
        Times a path may be scattered.
    expected_error
        Relative error the image will have; decides how many bands are needed and whether packed
        textures are harmless.
    pipeline
        ``"paths"`` follows paths even where all surfaces only send out light.
    places
        Apertures instead of the pixels of `fov_deg`, `resolution` and `centre_deg`.

    Raises
    ------
    InvalidInputError, DeviceError, OutOfMemoryError
        Everything that can be known to be wrong before a kernel is built.
    """
    check_type("scene", scene, Scene)
    check_type("eye", eye, Eye)
    if places is None:
        grid = RetinalGrid.of(eye, fov_deg, resolution, centre_deg)
    else:
        grid = PlaceGrid.around(eye, places)
    wavelengths = check_wavelengths(
        default_wavelengths_nm() if wavelengths_nm is None else wavelengths_nm
    )
    check_eye_wavelengths(eye, wavelengths)
    max_bounces = check_count("max_bounces", max_bounces, 0, 1000)
    check_choice("pipeline", pipeline, ("auto", "paths"))
    check_choice("sampler", sampler, get_args(Sampler))
    is_direct = scene.is_flat_light and pipeline == "auto"
    # Either way every spectrum must be known at all wavelengths.
    basis = spectral_basis(scene, wavelengths) if is_direct else None
    if not is_direct:
        check_spectra(scene, wavelengths)
    chosen_device = find_device(device)
    notes: list[Decision] = []
    _decide_media(media, wavelengths, notes)
    resolved = _decide_precision(precision, chosen_device, scene, grid, notes)
    bends = decide_bends(eye, grid, wavelengths, diffraction, scatter, notes)
    choice = _decide_bands(eye, grid, wavelengths, bands, expected_error, bends, notes)
    if not is_direct:
        choice = split_bands(choice, wavelengths, WAVELENGTHS_AT_ONCE)
    waves = [band.wavelength_nm for band in choice.bands]
    pupils = pupil_bounds(eye, waves, grid.field_map, grid.rectangle, grid.limit_deg)
    if is_direct:
        shown = [_uploaded_image(scene, i, grid, notes) for i in range(len(scene.objects))]
        images: tuple[Image | None, ...] | dict[str, Image] = tuple(shown)
    else:
        check_mesh_memory(scene, resolved)
        images = path_images(scene, grid, notes)
    width = _decide_width(chosen_device, resolved, notes)
    if sampler == "random":
        notes.append(Decision("samples", "random", "asked for: noisier than Sobol' points"))
    config: KernelConfig | PathConfig
    if basis is not None:
        config = KernelConfig(
            precision=resolved,
            vector_width=width,
            n_basis=_decide_basis(basis, notes),
            sampler=sampler,
            places=_decide_places(places, notes),
            **_decide_eye(eye, pupils, bends, grid.wavelength_nm, resolved, notes),
            **_decide_shapes(scene, notes),  # type: ignore[arg-type]
            **_decide_textures(scene, shown, resolved, expected_error, notes),  # type: ignore[arg-type]
        )
    else:
        config = PathConfig(
            precision=resolved,
            vector_width=width,
            is_fused=_decide_fused(chosen_device, notes),
            sampler=sampler,
            places=_decide_places(places, notes),
            max_bounces=decide_bounces(scene, max_bounces, notes),
            **_decide_eye(eye, pupils, bends, grid.wavelength_nm, resolved, notes),
            **decide_features(scene, notes),  # type: ignore[arg-type]
        )
    tile = _decide_tile(grid, config, len(choice.bands), notes)
    return Plan(
        scene,
        eye,
        grid,
        wavelengths,
        choice,
        basis,
        pupils,
        images,
        config,
        tuple(notes),
        tile,
        chosen_device,
        media,
        bends,
    )


def _decide_places(places: Places | None, notes: list[Decision]) -> PlaceKind:
    if places is None:
        return "none"
    kind: PlaceKind = "gaussian" if places.is_gaussian else "disc"
    notes.append(Decision("pixels", kind, f"{len(places)} apertures instead of a grid"))
    return kind


def _decide_media(
    media: OcularMedia | None, wavelengths_nm: np.ndarray, notes: list[Decision]
) -> None:
    if media is None:
        return
    share = transmittance_or_one(media, wavelengths_nm)
    reason = (
        f"{media.age_years:g} years; {100 * share.min():.3g} to {100 * share.max():.3g} % of the "
        "light comes through"
    )
    notes.append(Decision("ocular media", media.model, reason))


def _decide_precision(
    precision: Precision | Literal["auto"],
    device: Device,
    scene: Scene,
    grid: RetinalGrid,
    notes: list[Decision],
) -> Precision:
    check_choice("precision", precision, ("single", "double", "auto"))
    if precision != "auto":
        device.check_precision(precision)
        notes.append(Decision("precision", precision, "asked for"))
        return precision
    huge = [item.name for item in scene.objects if _is_huge(item.shape)]
    if huge and device.has_double:
        reason = f"single would displace the surface of {huge[0]!r} by 1e-4 of its distance"
        notes.append(Decision("precision", "double", reason))
        return "double"
    pixel_um = 1000.0 * min(grid.pitch_deg) * grid.field_map.axial_scale_mm_per_deg()
    reason = f"rounding moves rays by 0.005 um at most, a pixel is {pixel_um:.3g} um wide"
    notes.append(Decision("precision", "single", reason))
    return "single"


def _is_huge(shape: Shape) -> bool:
    """Whether rounding to single moves a sphere's surface by 1e-4 of its distance from the eye."""
    if not isinstance(shape, Sphere):
        return False
    distance = abs(float(np.linalg.norm(shape.centre_m)) - shape.radius_m)
    return shape.radius_m * _SPHERE_ROUNDING > 1e-4 * distance


def _decide_bands(
    eye: Eye,
    grid: RetinalGrid,
    wavelengths_nm: np.ndarray,
    bands: int | Literal["auto"],
    expected_error: float,
    bends: Bends,
    notes: list[Decision],
) -> BandChoice:
    has_diffraction = bends.diffraction is not None
    choice = choose_bands(
        eye, grid, wavelengths_nm, bands, expected_error, has_diffraction=has_diffraction
    )
    count = len(choice.bands)
    if len(wavelengths_nm) == 1:
        reason = "the image has one wavelength"
    elif bands != "auto":
        shift = f"{choice.displacement_pixels:.2g} pixels"
        reason = f"asked for; chromatic displacement inside a band {shift}"
    elif choice.is_achromatic:
        reason = "the eye bends all wavelengths alike"
    else:
        reason = (
            f"{len(wavelengths_nm)} wavelengths; chromatic displacement inside a band "
            f"{choice.displacement_pixels:.2g} pixels"
        )
    notes.append(Decision("bands", str(count), reason))
    return choice


def _decide_width(device: Device, precision: Precision, notes: list[Decision]) -> int:
    width = device.vector_width(precision)
    reason = (
        "a GPU's lanes are its work-items" if width == 1 else "four hardware vectors side by side"
    )
    if width == 1 and device.is_cpu:
        reason = "this device interprets kernels"
    notes.append(Decision("vector width", str(width), reason))
    return width


def _decide_fused(device: Device, notes: list[Decision]) -> bool:
    is_fused = device.is_cpu and not device.is_interpreter
    reason = (
        "bundles of paths stay in the cache of a core"
        if is_fused
        else "every stage works on all paths of a tile"
    )
    notes.append(Decision("kernels", "one" if is_fused else "by stages", reason))
    return is_fused


def _decide_basis(basis: SpectralBasis, notes: list[Decision]) -> int:
    count = len(basis.spectra)
    reason = (
        "all light in the scene has one spectrum: one channel serves every wavelength"
        if count == 1
        else f"{count} spectra span all light in the scene"
    )
    notes.append(Decision("spectra", str(count), reason))
    return count


def _decide_eye(
    eye: Eye,
    pupils: tuple[ExitPupilBound | PlanePupilBound, ...],
    bends: Bends,
    wavelength_nm: float,
    precision: Precision,
    notes: list[Decision],
) -> dict[str, Any]:
    fill = min(p.fill for p in pupils)
    notes.append(
        Decision("pupil sampling", "exit pupil", f"{100 * fill:.3g} % of the rays pass the stop")
    )
    return decide_eye_features(eye, wavelength_nm, precision, notes) | {
        "has_aspheric_retina": left_out(
            notes,
            "aspheric retina",
            eye.retina.conic != 0,
            "the retina is not a sphere",
            "the retina is a sphere",
        ),
        "has_asymmetry": left_out(
            notes,
            "two field angles",
            not eye.is_rotational,
            ", ".join(eye.asymmetries()),
            "the eye is a figure of revolution: one field angle tells all",
        ),
        "has_relief": left_out(
            notes,
            "relief of the retina",
            relief(eye.retina) is not None,
            "a height map lies on the retina",
            "the retina is smooth",
        ),
        "has_far_side": left_out(
            notes,
            "far sides of surfaces",
            any(p.has_far_side for p in pupils),
            "at this field angle rays may cross a surface beyond its equator",
            "no ray crosses a surface beyond its equator at these field angles",
        ),
        "has_semi_diameters": left_out(
            notes,
            "clipping at surfaces",
            bends.diffraction is not None or any(p.clipped_elsewhere for p in pupils),
            "rays that pass the stop may miss or leave a surface",
            "every ray that passes the stop passes all surfaces",
        ),
        **bends.features,
    }


def _decide_shapes(scene: Scene, notes: list[Decision]) -> dict[str, bool]:
    shapes = [item.shape for item in scene.objects]
    discs = sum(isinstance(s, Disc) for s in shapes)
    spheres = sum(isinstance(s, Sphere) for s in shapes)
    quads = len(shapes) - discs - spheres
    textured = sum(
        isinstance(item.shape, Sphere) and item.material.texture is not None
        for item in scene.objects
    )
    notes.append(
        Decision(
            "lighting", "emission only", "every surface sends out light by itself: no shadow rays"
        )
    )
    none = "none in the scene"
    return {
        "has_patches": left_out(
            notes, "flat shapes", quads + discs > 0, f"{quads} quads, {discs} discs", none
        ),
        "has_discs": left_out(notes, "discs", discs > 0, f"{discs} in the scene", none),
        "has_spheres": left_out(notes, "spheres", spheres > 0, f"{spheres} in the scene", none),
        "has_textured_spheres": left_out(
            notes, "textured spheres", textured > 0, f"{textured} in the scene", none
        ),
    }


def _decide_textures(
    scene: Scene,
    images: list[Image | None],
    precision: Precision,
    expected_error: float,
    notes: list[Decision],
) -> dict[str, bool | int]:
    boards = sum(isinstance(item.material.texture, Checkerboard) for item in scene.objects)
    pictures = [image for image in images if image is not None]
    channels = max((image.channels for image in pictures), default=1)
    is_packed = channels == 3 and precision == "single" and expected_error > 5 * PACKING_ERROR
    left_out(notes, "checkerboards", boards > 0, f"{boards} in the scene", "none in the scene")
    left_out(notes, "images", bool(pictures), f"{len(pictures)} in the scene", "none in the scene")
    if pictures:
        reason = (
            f"11-11-10 bits: wrong by {PACKING_ERROR:g}, the image by {expected_error:.2g}"
            if is_packed
            else "one word a texel is exact for grey"
            if channels == 1
            else f"an error of {expected_error:.2g} is wanted; packing would add {PACKING_ERROR:g}"
        )
        notes.append(Decision("texels", "packed" if is_packed else "float", reason))
    return {
        "has_checkerboards": boards > 0,
        "has_images": bool(pictures),
        "texture_channels": channels,
        "is_texture_packed": is_packed,
    }


def _uploaded_image(
    scene: Scene, index: int, grid: RetinalGrid, notes: list[Decision]
) -> Image | None:
    """The picture of an object, averaged down where a pixel covers many of its texels."""
    item = scene.objects[index]
    image = item.material.texture
    if not isinstance(image, Image):
        return None
    footprint = _texels_per_pixel(scene, index, image, grid)
    times = max(0, math.floor(math.log2(max(footprint, 1.0) / TEXELS_PER_FOOTPRINT)))
    if times > 0:
        reason = f"a pixel covers {footprint:.3g} texels of {item.name!r} across"
        notes.append(Decision("texture filter", f"1/{1 << times}", reason))
    return image.halved(times)


def _texels_per_pixel(scene: Scene, index: int, image: Image, grid: RetinalGrid) -> float:
    """Texels across the footprint of a pixel on the nearest visible part of an object."""
    shape = scene.objects[index].shape
    step_x, step_y = (max(1, n // 64) for n in grid.resolution)
    directions = direction_from_field(*np.meshgrid(grid.x_deg[::step_x], grid.y_deg[::step_y]))
    pupil_m = grid.eye.entrance_pupil(grid.wavelength_nm).z_mm / MM_PER_M
    hits = intersect(shape, np.array([0.0, 0.0, pupil_m]), directions)
    nearest = float(np.min(hits.distance_m))
    if not math.isfinite(nearest):
        return 1.0
    return texels_across(shape, image, nearest, math.radians(min(grid.pitch_deg)))


def _decide_tile(
    grid: RetinalGrid, config: KernelConfig | PathConfig, n_bands: int, notes: list[Decision]
) -> tuple[int, int]:
    """Columns and rows of a tile whose film, or whose paths, fit the device comfortably."""
    columns, rows = grid.resolution
    bytes_per_pixel = n_bands * config.n_basis * (4 if config.precision == "single" else 8)
    by_stages = isinstance(config, PathConfig) and not config.is_fused
    if by_stages:
        bytes_per_pixel = n_bands * SAMPLES_AT_ONCE * _PATH_BYTES
        pixels = _TILE_PATHS_BYTES // bytes_per_pixel
    else:
        pixels = max(config.vector_width, _TILE_FILM_BYTES // bytes_per_pixel)
    width = min(columns, max(1, pixels))
    height = min(rows, max(1, pixels // width))
    if width == columns and height == rows:
        reason = "the whole image fits"
    else:
        what = "paths" if by_stages else "film"
        reason = f"the {what} of a tile takes {width * height * bytes_per_pixel / 2**20:.3g} MB"
    notes.append(Decision("tile", f"{width} x {height}", reason))
    return width, height


def check_memory(plan: Plan) -> None:
    """Raise OutOfMemoryError, naming a resolution that fits, if the image needs more than there is.

    Raises
    ------
    OutOfMemoryError
    """
    columns, rows = plan.grid.resolution
    if isinstance(plan.grid, PlaceGrid):
        memory.check_memory(
            f"rendering at {len(plan.grid.listed)} apertures and {len(plan.wavelengths_nm)} "
            "wavelengths",
            columns * rows * bytes_per_pixel(plan),
            lambda share: f"a list of {share * share:.2g} times as many would fit",
        )
        return
    memory.check_memory(
        f"an image of {columns} x {rows} pixels and {len(plan.wavelengths_nm)} wavelengths",
        columns * rows * bytes_per_pixel(plan),
        lambda share: (
            f"about {int(columns * share)} x {int(rows * share)} pixels would fit, or use fewer "
            "wavelengths"
        ),
    )


def bytes_per_pixel(plan: Plan) -> int:
    """Host memory an image takes while it is rendered, bytes a pixel."""
    channels = plan.expansion.shape[1]
    wavelengths = len(plan.wavelengths_nm)
    tracked = 1 + (channels if plan.config.n_basis == 1 else wavelengths)
    result = wavelengths * 2 * (4 if plan.config.precision == "single" else 8)
    accumulators = 8 * (channels + 2 * tracked)
    # A pilot's accumulators are kept beside those of the longer replicates that follow it.
    kept = 0
    if plan.config.places != "none":
        # Every replicate is kept, first as film and then as spectra.
        kept = MAX_REPLICATES * (channels + wavelengths) * (result // (2 * wavelengths))
    return 2 * accumulators + 2 * result + kept
