"""The command `isetcl cones`: what the cones of a mosaic catch of a scene or a saved image."""

from __future__ import annotations

import io
import math
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from isetcl.cli import inputs
from isetcl.cli.interrupt import end_interrupted
from isetcl.cli.render import as_notes, goal_of
from isetcl.errors import InvalidInputError, check_choice, check_count, check_finite, check_positive
from isetcl.retina.image import RetinalImage

if TYPE_CHECKING:
    from rich.table import Table

    from isetcl.cones.excitations import Excitations
    from isetcl.cones.mosaic import ConeMosaic
    from isetcl.eye.model import Eye
    from isetcl.retina.places import IrradianceAtPlaces
    from isetcl.scene.model import Scene

DEFAULT_FOV_DEG = 0.7
_MARGIN = 1.12  # of the mosaic's field: what is rendered of the scene
_PIXELS_PER_APERTURE = 3.0
_MOST_PIXELS = 512
_MOST_GAZE_DEG = 0.3

_SOURCE_HELP = (
    "A scene file or target, as `isetcl render` takes them, or an image it saved (.nc): the middle "
    "of the image lies on the fovea."
)
_LUX_HELP = "Scale the image to this mean illuminance, lux (default: as it is)."
_CENTRE_HELP = "Middle of the mosaic, degrees right and up from the fovea."
_AGE_HELP = (
    "Age of the lens in front of the retina, years; 0 leaves it out. An image that has come "
    "through a lens already keeps it."
)
_SIZE_HELP = (
    "Pixels across the rendered image (default: three for the smallest aperture, 512 at most)."
)
_NO_IMAGE_HELP = (
    "Trace rays to the cones alone, without an image: no --movie, --mat, --lux and --size."
)
_MP4_HELP = "Write the movie as MP4, not as GIF; needs isetcl's extra 'movies' or ffmpeg."
_MOVIE_HELP = "Also write a fixation as a movie: its length, ms."


def cones(
    source: Annotated[str, typer.Argument(metavar="SOURCE", help=_SOURCE_HELP)],
    fov: Annotated[float, typer.Option(help="Width of the mosaic, degrees.")] = DEFAULT_FOV_DEG,
    centre: Annotated[str, typer.Option(metavar="X,Y", help=_CENTRE_HELP)] = "0,0",
    density: Annotated[
        str, typer.Option(help="Density of the cones: curcio1990, watson2014 or song2011.")
    ] = "curcio1990",
    time: Annotated[float, typer.Option(help="Integration time, ms.")] = 5.0,
    dark: Annotated[
        float, typer.Option(help="Excitations a second without light, in every cone.")
    ] = 0.0,
    lux: Annotated[float | None, typer.Option(help=_LUX_HELP)] = None,
    age: Annotated[float, typer.Option(help=_AGE_HELP)] = 32.0,
    eye: Annotated[
        str | None, typer.Option(help="Model eye or its file, for scenes (default: navarro).")
    ] = None,
    pupil: Annotated[
        float | None, typer.Option(help="Diameter of the stop (iris), mm (default: 4).")
    ] = None,
    accommodation: Annotated[
        str | None,
        typer.Option(
            help="As in `isetcl render`: dioptres, a distance, relaxed or (default) centre."
        ),
    ] = None,
    size: Annotated[int | None, typer.Option(help=_SIZE_HELP)] = None,
    spp: Annotated[
        int | None, typer.Option(help="Samples a pixel, instead of --error or --render-time.")
    ] = None,
    error: Annotated[
        str | None,
        typer.Option(help="Stop rendering at this error, as in `isetcl render` (default: 0.02)."),
    ] = None,
    render_time: Annotated[
        float | None, typer.Option(help="Stop rendering after about so many seconds (default: 60).")
    ] = None,
    no_image: Annotated[bool, typer.Option("--no-image", help=_NO_IMAGE_HELP)] = False,
    movie: Annotated[float | None, typer.Option(metavar="MS", help=_MOVIE_HELP)] = None,
    mp4: Annotated[bool, typer.Option("--mp4", help=_MP4_HELP)] = False,
    mat: Annotated[
        bool, typer.Option("--mat", help="Also write image and mosaic for ISETBio.")
    ] = False,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the results.")] = Path(
        "isetcl-cones"
    ),
    allow_outside: Annotated[
        bool,
        typer.Option("--allow-outside", help="The scene may read files outside of its folder."),
    ] = False,
    seed: Annotated[int, typer.Option(help="Seed of mosaic, samples, noise and movements.")] = 0,
    device: Annotated[
        str | None, typer.Option(help="OpenCL device: 'platform:device' or part of its name.")
    ] = None,
) -> None:
    """Make a mosaic of cones, let it look at a scene or an image, and count its excitations.

    Prints means by type, and writes excitations.nc, mosaic.nc, retina.nc (light.nc where there is
    no image), pictures and, on request, files for ISETBio and a movie of a fixation. Ctrl-C ends
    the render of a scene early and goes on with the image so far.
    """
    from isetcl.cones.movies import check_movie
    from isetcl.output import check_folder

    if size is not None:
        check_count("--size", size, 2)
    wanted = _checked(fov, centre, density, time, dark, lux, age)
    movie_file = output / ("fixation.mp4" if mp4 else "fixation.gif")
    if mp4 and movie is None:
        raise InvalidInputError("--mp4 says how to write a movie; ask for one with --movie MS")
    if movie is not None:
        check_positive("--movie", movie, "ms")
        check_movie(movie_file)
    is_image = Path(source).suffix.lower() == ".nc"
    if no_image and (is_image or mat or movie is not None or lux is not None or size is not None):
        raise InvalidInputError(
            "--no-image needs a scene, and leaves no image for --movie, --mat, --lux and --size"
        )
    if is_image:
        _check_unused(
            {"--size": size, "--spp": spp, "--error": error, "--render-time": render_time}
            | {"--eye": eye, "--pupil": pupil, "--accommodation": accommodation}
        )
    focus = inputs.vergence(accommodation or "centre")
    options = goal_of(spp, error, render_time) | {"seed": seed, "device": device}
    looking = {"dark_rate_hz": wanted["dark_rate_hz"], "seed": seed, "device": device}
    looking["media"] = "as_is"  # the lens is the light's own, or left out by --age 0
    path = np.zeros((1, 2)) if movie is None else _gazes(movie, time, seed)
    try:
        with as_notes():
            saved = _loaded(source, wanted, path, mat=mat) if is_image else None
            seen = (
                None
                if is_image
                else _scene(
                    source, eye or "navarro", 4.0 if pupil is None else pupil, focus, allow_outside
                )
            )
            check_folder(output)
            mosaic = _mosaic(wanted, seed, device)
            light: RetinalImage | IrradianceAtPlaces | None = saved
            if seen is not None and no_image:
                light = _at_the_cones(seen, mosaic, wanted, options)
            elif seen is not None:
                view = _view(mosaic, _reach(wanted, movie), size)
                light = _rendered(seen, view | options)
            if isinstance(light, RetinalImage):
                light = _lit(light, wanted)
            assert light is not None
            found = mosaic.excitations(light, 1e-3 * time, **looking)
            written = _write(found, mosaic, light, output, mat=mat)
            was_interrupted = saved is None and not light.provenance["is_complete"]
            if movie is not None and not was_interrupted:
                moving = mosaic.excitations(light, 1e-3 * time, gaze_deg=path, **looking)
                written.append(moving.movie(movie_file))
    except KeyboardInterrupt:
        end_interrupted(" before there were excitations to write")
    _report(found, mosaic, written)
    if was_interrupted:
        what = "the light at the cones" if no_image else "the image of the scene"
        end_interrupted(f"; {what} holds what was finished")


def _checked(
    fov: float,
    centre: str,
    density: str,
    time: float,
    dark: float,
    lux: float | None,
    age: float,
) -> dict[str, Any]:
    """The options of mosaic and excitations; raises before any work."""
    from isetcl.cones.density import DENSITIES
    from isetcl.retina.transmittance import transmittance

    try:
        x, y = (float(part) for part in centre.strip("()").split(","))
    except ValueError:
        x = y = math.nan
    if not (math.isfinite(x) and math.isfinite(y)):
        raise InvalidInputError(
            f"--centre must be two numbers in degrees with a comma, such as 5,0, got {centre!r}"
        )
    check_positive("--time", time, "ms")
    if check_finite("--dark", dark, "Hz") < 0:
        raise InvalidInputError(f"--dark must be >= 0 Hz, got {dark:g}")
    return {
        "fov_deg": check_positive("--fov", fov, "deg"),
        "centre_deg": (x, y),
        "density": check_choice("--density", density, DENSITIES),
        "dark_rate_hz": dark,
        "lux": None if lux is None else check_positive("--lux", lux, "lux"),
        "lens": None if age == 0 else transmittance(age),
    }


def _reach(wanted: dict[str, Any], movie: float | None) -> float:
    """How far from the fovea the image must reach, degrees."""
    half = 0.5 * wanted["fov_deg"] * _MARGIN
    return float(half + (_MOST_GAZE_DEG if movie is not None else 0.0))


def _check_unused(given: dict[str, Any]) -> None:
    """Raise InvalidInputError for options of a render where a saved image is not rendered."""
    names = [name for name, value in given.items() if value is not None]
    if names:
        raise InvalidInputError(
            f"{', '.join(names)}: a saved image is not rendered again; leave that out, or give the "
            "scene"
        )


def _loaded(
    source: str, wanted: dict[str, Any], gaze_deg: np.ndarray, *, mat: bool
) -> RetinalImage:
    """A saved image; raises, before there is a mosaic, if it does not hold the mosaic's field.

    Nor if the eye looks beyond it, and with `mat` if ISETBio cannot have it.
    """
    image = RetinalImage.load(source)
    if mat:
        from isetcl.retina.isetbio import check_image

        check_image(image)
    left, right, bottom, top = image.extent_deg
    half = 0.5 * wanted["fov_deg"]
    (x, y), slack = wanted["centre_deg"], 1e-6
    low, high = gaze_deg.min(axis=0), gaze_deg.max(axis=0)
    if not (
        left <= x + low[0] - half + slack
        and x + high[0] + half <= right + slack
        and bottom <= y + low[1] - half + slack
        and y + high[1] + half <= top + slack
    ):
        moves = np.abs(gaze_deg).max()
        raise InvalidInputError(
            f"a mosaic of {wanted['fov_deg']:g} deg at ({x:g}, {y:g}) deg reaches beyond the image "
            f"{source!r}, which spans x {left:.4g} to {right:.4g} and y {bottom:.4g} to {top:.4g} "
            + (f"deg, as the gaze moves by up to {moves:.2g} " if moves > 0 else "")
            + "deg; choose another --fov or --centre"
        )
    return image


def _mosaic(wanted: dict[str, Any], seed: int, device: str | None) -> ConeMosaic:
    from isetcl.cones.generate import mosaic

    return mosaic(
        wanted["fov_deg"],
        wanted["centre_deg"],
        density=wanted["density"],
        seed=seed,
        device=device,
    )


def _scene(
    source: str, eye: str, pupil: float, focus: float | str, allow_outside: bool
) -> tuple[Scene, Eye]:
    """What is looked at, and by which eye."""
    seen = inputs.lit(inputs.read_scene(source, allow_outside=allow_outside), None)
    return seen, inputs.accommodated(eye, pupil, focus, seen)


def _view(mosaic: ConeMosaic, reach_deg: float, size: int | None) -> dict[str, Any]:
    """Where an image around the mosaic lies, and its pixels."""
    low, high = mosaic.extent_deg
    field = 2.0 * reach_deg
    if size is None:
        finest = float(mosaic.aperture_deg.min()) / _PIXELS_PER_APERTURE
        size = min(_MOST_PIXELS, max(2, math.ceil(field / finest)))
    middle = (0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]))
    return {"fov_deg": field, "resolution": size, "centre_deg": middle}


def _rendered(seen: tuple[Scene, Eye], options: dict[str, Any]) -> RetinalImage:
    from isetcl.render.render import render as trace

    return trace(*seen, **options)


def _at_the_cones(
    seen: tuple[Scene, Eye], mosaic: ConeMosaic, wanted: dict[str, Any], options: dict[str, Any]
) -> IrradianceAtPlaces:
    """The light in the apertures, behind the lens."""
    from isetcl.render.render import render as trace

    lens = wanted["lens"]
    return trace(*seen, at=mosaic, media=None if lens is None else lens.medium, **options)


def _lit(image: RetinalImage, wanted: dict[str, Any]) -> RetinalImage:
    """The image behind the lens, at the illuminance asked for."""
    has_lens = any(step.label == "media" for step in image.steps)
    if wanted["lens"] is not None and not has_lens:
        image = image.through(wanted["lens"])
    if wanted["lux"] is not None:
        image = image.scale_to_mean_illuminance(wanted["lux"])
    return image


def _gazes(movie_ms: float, time_ms: float, seed: int) -> np.ndarray:
    """Where the eye looks from frame to frame, (frames, 2), degrees."""
    from isetcl.cones.eye_movements import eye_movements

    path = eye_movements(1e-3 * movie_ms, 1e-3 * time_ms, seed=seed, centre="mean").path()
    return np.clip(path, -_MOST_GAZE_DEG, _MOST_GAZE_DEG)


def _write(
    found: Excitations,
    mosaic: ConeMosaic,
    light: RetinalImage | IrradianceAtPlaces,
    folder: Path,
    *,
    mat: bool,
) -> list[Path]:
    """The data first, then pictures of them."""
    found.dataset.attrs["command"] = shlex.join(["isetcl", *sys.argv[1:]])
    written = [found.save(folder / "excitations.nc"), mosaic.save(folder / "mosaic.nc")]
    if isinstance(light, RetinalImage):
        written.append(light.save(folder / "retina.nc"))
        if mat:
            written.append(light.to_isetbio(folder / "opticalimage.mat"))
            written.append(mosaic.to_isetbio(folder / "mosaic.mat", image=light))
    else:
        written.append(light.save(folder / "light.nc"))
    return written + _pictures(found, mosaic, folder)


def _pictures(found: Excitations, mosaic: ConeMosaic, folder: Path) -> list[Path]:
    from matplotlib.figure import Figure

    from isetcl.output import write_file

    middle = 0.5 * (mosaic.extent_deg[0][1] + mosaic.extent_deg[1][1])
    drawings: dict[str, Any] = {
        "mosaic.png": lambda axes: mosaic.plot(axes),
        "excitations.png": lambda axes: found.plot(axes, shown="counts"),
        "profile.png": lambda axes: found.plot_profile(axes, y_deg=middle),
    }
    written = []
    for name, draw in drawings.items():
        figure = Figure(figsize=(7.5, 5.6), layout="constrained")
        draw(figure.subplots())
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=120)
        written.append(write_file(folder / name, buffer.getvalue()))
    return written


def table(found: Excitations, mosaic: ConeMosaic) -> Table:
    """Means by type, and the noise of a single cone and integration time."""
    from rich.table import Table

    shown = Table(title=f"Excitations in {1e3 * found.integration_time_s:g} ms")
    for name in ("type", "cones", "mean", "least", "most", "noise (s.d.)"):
        shown.add_column(name, justify="left" if name == "type" else "right")
    for kind, count in mosaic.counts.items():
        if count == 0:
            continue
        mean = found.of(kind).values.astype(np.float64)
        noise = math.sqrt(mean.mean())
        shown.add_row(
            kind,
            str(count),
            *(f"{value:.4g}" for value in (mean.mean(), mean.min(), mean.max(), noise)),
        )
    return shown


def _report(found: Excitations, mosaic: ConeMosaic, written: list[Path]) -> None:
    from rich.console import Console

    console = Console()
    console.print(table(found, mosaic))
    if found.standard_error is not None:
        share = float(np.sqrt(np.mean(found.standard_error.values**2)) / found.mean.values.mean())
        console.print(f"error of the means {100 * share:.2g} %", highlight=False)
    names = ", ".join(path.name for path in written)
    console.print(f"{names} in {written[0].parent}/", highlight=False, soft_wrap=True)
