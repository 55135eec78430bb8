"""The command `isetcl render`: the retinal image of a scene file or a procedural target."""

from __future__ import annotations

import contextlib
import io
import shlex
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from isetcl.cli import inputs
from isetcl.cli.interrupt import end_interrupted
from isetcl.errors import InvalidInputError

if TYPE_CHECKING:
    from isetcl.eye.model import Eye
    from isetcl.retina.image import RetinalImage
    from isetcl.scene.model import Scene

DEFAULT_ERROR = 0.02
DEFAULT_TIME_S = 60.0

_SCENE_HELP = (
    "A file (.pbrt, .glb, .gltf, .obj, .ply, .stl, ...) or the name of a target: "
    f"{', '.join(inputs.TARGETS)}."
)
_FOCUS_HELP = (
    "Dioptres ('2'), a distance ('0.5m'), 'relaxed', or 'centre': what stands in the middle of the "
    "image."
)
_FROM_HELP = (
    "Place of the eye, metres (default: the origin; in a PBRT file it is where the camera stands)."
)
_FOV_HELP = "Width of the image, degrees (default: what shows the scene, 40 at most)."
_TIME_HELP = (
    "Stop after about so many seconds (without --spp, --error and --time: at an error of 2 %, or "
    "after 60 s)."
)
_DIFFRACTION_HELP = (
    "At the stop: none, airy (the exact pattern), hurb, iset3d (the paper's HURB), or auto (what "
    "comes nearest, where it can be seen)."
)
_SCATTER_HELP = (
    "Add the light scattered in an eye of this age, years, after the CIE general glare function."
)
_SKY_HELP = (
    "Luminance of an even sky around the scene, cd/m^2 (default: 100 where a scene has no light "
    "at all)."
)


def render(
    scene: Annotated[str, typer.Argument(metavar="SCENE", help=_SCENE_HELP)],
    eye: Annotated[
        str, typer.Option(help="Model eye (navarro, arizona, atchison ...) or its file.")
    ] = "navarro",
    pupil: Annotated[float, typer.Option(help="Diameter of the stop (iris), mm.")] = 4.0,
    accommodation: Annotated[str, typer.Option(help=_FOCUS_HELP)] = "centre",
    fov: Annotated[float | None, typer.Option(help=_FOV_HELP)] = None,
    size: Annotated[str, typer.Option(help="Pixels: 256 for a square, or 320x200.")] = "256",
    spp: Annotated[
        int | None, typer.Option(help="Samples a pixel, instead of --error or --time.")
    ] = None,
    error: Annotated[
        str | None,
        typer.Option(
            help="Stop at this relative error; 0.02 is 2 %. Or cone_noise:0.1, a tenth of the "
            "noise of foveal cones within 5 ms."
        ),
    ] = None,
    time: Annotated[float | None, typer.Option(help=_TIME_HELP)] = None,
    max_bounces: Annotated[int, typer.Option(help="Times light may be scattered.")] = 8,
    diffraction: Annotated[str, typer.Option(help=_DIFFRACTION_HELP)] = "none",
    scatter: Annotated[float | None, typer.Option(metavar="AGE", help=_SCATTER_HELP)] = None,
    eye_at: Annotated[
        str | None,
        typer.Option("--from", metavar="X,Y,Z", help=_FROM_HELP),
    ] = None,
    look_at: Annotated[
        str | None,
        typer.Option(metavar="X,Y,Z", help="Point the eye looks at, metres (default: along -z)."),
    ] = None,
    sky: Annotated[float | None, typer.Option(help=_SKY_HELP)] = None,
    layers: Annotated[
        bool, typer.Option("--layers", help="Also write depth, objects and normals.")
    ] = False,
    explain: Annotated[
        bool, typer.Option("--explain", help="Only print what would be compiled, and why.")
    ] = False,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the results.")] = Path(
        "isetcl-render"
    ),
    allow_outside: Annotated[
        bool,
        typer.Option("--allow-outside", help="The scene may read files outside of its folder."),
    ] = False,
    seed: Annotated[int, typer.Option(help="Seed of the samples.")] = 0,
    device: Annotated[
        str | None, typer.Option(help="OpenCL device: 'platform:device' or part of its name.")
    ] = None,
) -> None:
    """Render a scene file or a target; write retina.nc and retina.png.

    Ctrl-C ends a render early and keeps the image so far.
    """
    from isetcl.eye.people.scatter import ScatterModel

    try:
        with as_notes():
            goal = goal_of(spp, error, time)
            focus, columns_and_rows = inputs.vergence(accommodation), inputs.pixels(size)
            loaded = inputs.read_scene(scene, allow_outside=allow_outside)
            seen = inputs.lit(inputs.placed(loaded, eye_at, look_at), sky)
            view = {
                "fov_deg": inputs.field_of_view(scene, seen, fov),
                "resolution": columns_and_rows,
                "max_bounces": max_bounces,
                "diffraction": diffraction,
                "scatter": None if scatter is None else ScatterModel(scatter),
                "device": device,
            }
            model = inputs.accommodated(eye, pupil, focus, seen)
            if explain:
                _explain(seen, model, view)
                return
            image = _traced(seen, model, view | goal | {"layers": layers, "seed": seed}, output)
            written = _write(image, seen, output, layers=layers)
    except KeyboardInterrupt:
        end_interrupted(" before there was an image to write")
    _report(image, seen, loaded, written)


def goal_of(spp: int | None, error: str | float | None, time: float | None) -> dict[str, Any]:
    """When to stop, as arguments of `isetcl.render`."""
    from isetcl.render.goal import Goal

    if spp is None and error is None and time is None:
        error, time = DEFAULT_ERROR, DEFAULT_TIME_S
    if isinstance(error, str):
        # What is no number is another unit, which `Goal` knows or refuses.
        with contextlib.suppress(ValueError):
            error = float(error)
    if spp is not None and (error is not None or time is not None):
        raise InvalidInputError(
            "give --spp, or --error and --time, not both: a number of samples leaves nothing else "
            "to decide"
        )
    if isinstance(error, float) and error >= 1.0:
        raise InvalidInputError(
            f"--error must be a share below 1, got {error:g}; 0.02 stands for 2 %"
        )
    Goal(spp, time, error, 0.0)
    return {"spp": spp, "time_budget_s": time, "target_error": error}


def _explain(scene: Scene, eye: Eye, view: dict[str, Any]) -> None:
    from isetcl.render.plan import plan

    print(plan(scene, eye, **view).explain())


def _traced(scene: Scene, eye: Eye, options: dict[str, Any], output: Path) -> RetinalImage:
    """The image; refuses an output folder that cannot be written before any work."""
    from isetcl.output import check_folder
    from isetcl.render.render import render as trace

    check_folder(output)
    image = trace(scene, eye, **options)
    image.dataset.attrs["command"] = shlex.join(["isetcl", *sys.argv[1:]])
    return image


def _write(image: RetinalImage, scene: Scene, folder: Path, *, layers: bool) -> list[Path]:
    """The data first, then pictures of them."""
    from isetcl import plots
    from isetcl.output import write_file
    from isetcl.report import png

    written = [image.save(folder / "retina.nc")]
    white = inputs.exposure_lux(scene, image.illuminance_lux.values)
    pixels = image.to_srgb(white or None, inputs.white_point(scene))
    written.append(write_file(folder / "retina.png", png(pixels)))
    if layers:
        names = [item.name for item in scene.objects]
        figures = {
            "depth": plots.depth_map(image),
            "object": plots.object_map(image, names),
            "normal": plots.normal_map(image),
        }
        for name, figure in figures.items():
            buffer = io.BytesIO()
            figure.savefig(buffer, format="png", dpi=120, bbox_inches="tight")
            written.append(write_file(folder / f"{name}.png", buffer.getvalue()))
    return written


def _report(image: RetinalImage, seen: Scene, loaded: Scene, written: list[Path]) -> None:
    """A line about the image, advice where it shows nothing, and the status after Ctrl-C."""
    from isetcl.scene.extent import is_in_view

    details = image.provenance
    if seen.objects and not is_in_view(seen, details["grid"]["fov_deg"]):
        inputs.note(f"no object is in sight: {inputs.where(loaded)}")
    elif seen.objects and not image.irradiance.values.any():
        inputs.note(f"does the eye stand inside an object? {inputs.where(loaded)}")
    names = ", ".join(path.name for path in written)
    print(
        f"{details['elapsed_s']:.1f} s on {details['device']}; error "
        f"{100 * image.relative_error:.2g} %; {names} in {written[0].parent}/"
    )
    if not details["is_complete"]:
        end_interrupted("; the image holds what was finished")


@contextmanager
def as_notes() -> Iterator[None]:
    """Warnings as lines for a reader of the terminal, without places in the code."""
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_, **__: inputs.note(str(message))
        yield
