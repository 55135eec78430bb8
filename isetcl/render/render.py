"""Rendering a scene onto a retina: `isetcl.render`."""

from __future__ import annotations

import time
import warnings
from typing import Literal, overload

import numpy as np

from isetcl.device.layout import Precision
from isetcl.errors import InvalidInputError, check_count, check_type
from isetcl.eye.bending.ray_bending import DiffractionChoice
from isetcl.eye.model import Eye
from isetcl.eye.people.ocular_media import OcularMedia
from isetcl.eye.people.scatter import ScatterModel
from isetcl.render.device_scene import DeviceScene
from isetcl.render.direct import DirectPipeline
from isetcl.render.film import Film
from isetcl.render.goal import Goal
from isetcl.render.interrupt import DeferredInterrupt
from isetcl.render.kernel_config import KernelConfig, Sampler
from isetcl.render.noise_goal import NoiseGoal
from isetcl.render.paths import PathPipeline
from isetcl.render.pinhole import look_at
from isetcl.render.plan import DEFAULT_BOUNCES, check_memory, plan
from isetcl.render.progress import Progress, ProgressCallback, display
from isetcl.retina.cone_noise import ConeNoise
from isetcl.retina.grid import Centre
from isetcl.retina.image import RetinalImage
from isetcl.retina.places import HasPlaces, IrradianceAtPlaces, Places
from isetcl.scene.model import Scene


@overload
def render(
    scene: Scene,
    eye: Eye,
    *,
    at: None = ...,
    fov_deg: float | tuple[float, float] = ...,
    resolution: int | tuple[int, int] = ...,
    centre_deg: Centre = ...,
    spp: int | None = ...,
    time_budget_s: float | None = ...,
    target_error: float | str | ConeNoise | None = ...,
    wavelengths_nm: np.ndarray | None = ...,
    bands: int | Literal["auto"] = ...,
    precision: Precision | Literal["auto"] = ...,
    max_bounces: int = ...,
    layers: bool = ...,
    media: OcularMedia | None = ...,
    diffraction: DiffractionChoice = ...,
    scatter: ScatterModel | None = ...,
    sampler: Sampler = ...,
    seed: int = ...,
    device: str | None = ...,
    progress: bool | ProgressCallback | None = ...,
) -> RetinalImage: ...


@overload
def render(
    scene: Scene,
    eye: Eye,
    *,
    at: HasPlaces,
    spp: int | None = ...,
    time_budget_s: float | None = ...,
    target_error: float | str | ConeNoise | None = ...,
    wavelengths_nm: np.ndarray | None = ...,
    bands: int | Literal["auto"] = ...,
    precision: Precision | Literal["auto"] = ...,
    max_bounces: int = ...,
    media: OcularMedia | None = ...,
    diffraction: DiffractionChoice = ...,
    scatter: ScatterModel | None = ...,
    sampler: Sampler = ...,
    seed: int = ...,
    device: str | None = ...,
    progress: bool | ProgressCallback | None = ...,
) -> IrradianceAtPlaces: ...


def render(
    scene: Scene,
    eye: Eye,
    *,
    at: HasPlaces | None = None,
    fov_deg: float | tuple[float, float] = 10.0,
    resolution: int | tuple[int, int] = 256,
    centre_deg: Centre = (0.0, 0.0),
    spp: int | None = None,
    time_budget_s: float | None = None,
    target_error: float | str | ConeNoise | None = None,
    wavelengths_nm: np.ndarray | None = None,
    bands: int | Literal["auto"] = "auto",
    precision: Precision | Literal["auto"] = "auto",
    max_bounces: int = DEFAULT_BOUNCES,
    layers: bool = False,
    media: OcularMedia | None = None,
    diffraction: DiffractionChoice = "none",
    scatter: ScatterModel | None = None,
    sampler: Sampler = "sobol",
    seed: int = 0,
    device: str | None = None,
    progress: bool | ProgressCallback | None = None,
) -> RetinalImage | IrradianceAtPlaces:
    """The retinal image of a scene by ray tracing, in absolute units, with its standard error.

    Rays start on the retina, pass the eye and meet the scene. The image is the same, bit for bit,
    whatever the tiles, threads or launches.

    Parameters
    ----------
    scene, eye
        What is seen, and by which eye (at the origin, looking along -z).
    at
        Apertures, such as those of a `ConeMosaic`, instead of the pixels of an image: rays start in
        these only, and the result is an `IrradianceAtPlaces`, which
        `ConeMosaic.excitations` takes in place of an image. `fov_deg`, `resolution`, `centre_deg`
        and `layers` belong to images.
    fov_deg
        Field of view in degrees: the width (pixels are square), or (width, height).
    resolution
        Pixels: a number for a square, or (columns, rows).
    centre_deg
        Field angles (x, y) of the middle of the image, or "fovea" for those of `eye.fovea_deg`.
    spp
        Samples a pixel and band, at least 2. Default 256 if neither of the next two is given.
    time_budget_s
        Stop after about so many seconds, preparation included.
    target_error
        Stop when the relative standard error of the image has fallen to this: photopic, root mean
        square over lit pixels divided by their mean. ``bands="auto"`` takes as many bands as keep
        their part of the error small beside it; a number of bands is taken as it is. Or
        ``"cone_noise:0.1"``: a tenth of the Poisson noise of a foveal cone, or of the cones of
        `at`, within 5 ms, root mean square over pixels; see `ConeNoise`, which may be passed
        itself.
    wavelengths_nm
        Ascending wavelengths; default 400 to 700 in steps of 10 nm.
    bands
        Lens traces for all wavelengths; ``"auto"`` chooses from dispersion and pixel size.
    precision
        ``"single"``, ``"double"`` or ``"auto"``.
    max_bounces
        Times light may be scattered between a light and the eye; 1 is direct light only. Nothing is
        scattered in scenes whose surfaces all send out light by themselves.
    layers
        Add what the pixels' chief rays meet as layers of the result: ``distance_m``, ``object``,
        ``material``, ``position_m``, ``normal`` and ``albedo`` (see `PinholeView`), beside
        ``vergence_dpt``, which every image has.
    media
        Ocular media whose transmittance multiplies the spectrum; None is clear media.
    diffraction
        Bends of rays at the stop: ``"none"``; ``"airy"``, drawn from the stop's exact pattern;
        ``"hurb"`` (`Hurb`'s defaults), ``"iset3d"`` (the paper's values) or a `Hurb`; or
        ``"auto"``: nothing where the MTF of eye and pixels is right to 0.02 without, or else
        whichever of "airy" and "hurb" comes nearer to the exact one.
    scatter
        Light that is scattered inside the eye; None leaves it out.
    sampler
        ``"sobol"``: Owen-scrambled points; ``"random"``: independent random numbers, which are
        noisier, for references that share no point set with what they judge.
    seed
        Images of different seeds are independent.
    device
        See `find_device`.
    progress
        True shows a bar, False none, None a bar on a terminal; or a function of `Progress`.

    Returns
    -------
    RetinalImage or IrradianceAtPlaces
        Interrupted by Ctrl-C, what was finished, with its error; ``is_complete`` in its provenance
        is then False.

    Raises
    ------
    InvalidInputError, DeviceError, OutOfMemoryError
        Before any work starts.
    KeyboardInterrupt
        If interrupted before two replicates, which make an error, are finished.
    """
    start = time.perf_counter()
    goal = Goal(spp, time_budget_s, target_error, start)
    check_type("layers", layers, bool)
    is_image_asked = fov_deg != 10.0 or resolution != 256 or centre_deg != (0.0, 0.0) or layers
    places = None if at is None else _places(at, is_image_asked=is_image_asked)
    seed = check_count("seed", seed, 0, (1 << 63) - 1)
    prepared = plan(
        scene,
        eye,
        fov_deg=fov_deg,
        resolution=resolution,
        centre_deg=centre_deg,
        wavelengths_nm=wavelengths_nm,
        bands=bands,
        precision=precision,
        max_bounces=max_bounces,
        expected_error=goal.expected_error(),
        device=device,
        media=media,
        diffraction=diffraction,
        scatter=scatter,
        sampler=sampler,
        places=places,
    )
    check_memory(prepared)
    noise = None if goal.cone_noise is None else NoiseGoal(prepared, goal.cone_noise)
    transferred_s = prepared.device.transfer_s
    is_direct = isinstance(prepared.config, KernelConfig)
    pipeline = DirectPipeline(prepared) if is_direct else PathPipeline(prepared)
    film = Film(prepared, pipeline, seed, noise)
    is_complete = True
    with display(progress, f"tracing {scene.name}") as show, DeferredInterrupt() as interrupt:
        try:
            for fraction in goal.work(film):
                show(Progress(fraction, film.error(), time.perf_counter() - start))
                interrupt.check()
        except KeyboardInterrupt:
            if not film.keep_finished():
                raise
            is_complete = False
    if film.is_dark:
        warnings.warn(
            f"no light of scene {scene.name!r} was found in {film.samples} samples a pixel: it may "
            "be out of sight, or too small; the image is black and its error says nothing",
            stacklevel=2,
        )
    details = {
        "is_complete": is_complete,
        "elapsed_s": time.perf_counter() - start,
        "transfer_s": prepared.device.transfer_s - transferred_s,
        "kernel": pipeline.kernel_digest,
    }
    if places is not None:
        return film.at_places(details)
    is_simple = not scene.has_meshes and all(item.is_opaque for item in scene.objects)
    if not layers and is_simple:
        # The host looks at a few analytic shapes sooner than a kernel is built.
        return film.image(details)
    if isinstance(pipeline, PathPipeline):
        return film.image(details, look_at(prepared, pipeline.scene, everything=layers))
    surveyed = plan(
        scene,
        eye,
        fov_deg=fov_deg,
        resolution=resolution,
        centre_deg=centre_deg,
        wavelengths_nm=wavelengths_nm,
        precision=prepared.config.precision,
        device=device,
        pipeline="paths",
    )
    return film.image(details, look_at(surveyed, DeviceScene(surveyed), everything=True))


def _places(at: HasPlaces, *, is_image_asked: bool) -> Places:
    """The apertures to render at; raise InvalidInputError for other things."""
    if not callable(getattr(at, "places", None)):
        raise InvalidInputError(
            f"at must be a mosaic of cones or Places, got an object of type {type(at).__name__}"
        )
    if is_image_asked:
        raise InvalidInputError(
            "give at, or fov_deg, resolution, centre_deg and layers, not both: apertures say "
            "themselves where they are"
        )
    places = at.places()
    check_type("at.places()", places, Places)
    return places
