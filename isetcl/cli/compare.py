"""`isetcl compare`: two planes by ray tracing and by PSF methods, side by side."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from isetcl.cli.interrupt import end_interrupted
from isetcl.errors import InvalidInputError

if TYPE_CHECKING:
    from isetcl.eye.model import Eye
    from isetcl.scene.model import Scene

PAPER_FOV_DEG = 2.0
PHOTOGRAPH_FOV_DEG = 8.0


def compare(
    near_image: Annotated[
        Path | None, typer.Option(help="Photograph for the near plane (left half of the field).")
    ] = None,
    far_image: Annotated[Path | None, typer.Option(help="Photograph for the far plane.")] = None,
    near: Annotated[float, typer.Option(help="Distance of the near plane, metres.")] = 0.5,
    far: Annotated[float, typer.Option(help="Distance of the far plane, metres.")] = 2.0,
    eye: Annotated[
        str, typer.Option(help="Model eye (navarro, arizona, atchison ...) or its file.")
    ] = "navarro",
    pupil: Annotated[float, typer.Option(help="Diameter of the stop (iris), mm.")] = 4.0,
    accommodation: Annotated[
        str,
        typer.Option(help="Dioptres, or 'near', 'far' (the planes), or 'relaxed'."),
    ] = "near",
    fov: Annotated[
        float | None,
        typer.Option(help="Field of view, degrees (2, or 8 with photographs)."),
    ] = None,
    size: Annotated[int, typer.Option(help="Pixels along each side.")] = 384,
    spp: Annotated[int, typer.Option(help="Samples a pixel of the longest trial.")] = 256,
    methods: Annotated[
        str,
        typer.Option(help="PSF methods: names or M0 to M10 with commas between them, or 'all'."),
    ] = "layered_sum,layered_over",
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the results.")] = Path(
        "isetcl-compare"
    ),
    seed: Annotated[int, typer.Option(help="Seed of the samples.")] = 0,
    device: Annotated[
        str | None, typer.Option(help="OpenCL device: 'platform:device' or part of its name.")
    ] = None,
) -> None:
    """Render two planes by ray tracing and by PSF methods; write images, errors and a report.

    Without photographs this is the scene of the paper's Figure 12: checkerboards at 0.5 and 2 m,
    seen by an eye accommodated to the near one.
    """
    from rich.console import Console

    from isetcl.output import check_folder
    from isetcl.report import write_report
    from isetcl.validation import compare as run

    field = _field(fov, near_image is not None)
    scene, edge_angle, white_point = _two_planes(near_image, far_image, near, far, field)
    model = _model_eye(eye, pupil, accommodation, near, far)
    samples = _trial_samples(spp)
    check_folder(output)
    try:
        with _StepBar() as bar:
            comparison = run(
                scene,
                model,
                fov_deg=field,
                resolution=size,
                methods="all" if methods == "all" else [m.strip() for m in methods.split(",")],
                samples=samples,
                reference_spp=4 * spp,
                seed=seed,
                device=device,
                on_step=bar,
            )
            bar("writing the report", 1.0)
            write_report(
                comparison,
                output,
                edge_angle_deg=edge_angle,
                white_point=white_point,
                command=shlex.join(["isetcl", *sys.argv[1:]]),
            )
    except KeyboardInterrupt:
        end_interrupted(" before there was a report to write")
    console = Console()
    console.print(_table(comparison))
    if comparison.verdicts:
        text = "; ".join(comparison.verdicts.values())
        console.print(f"Predicted: {text}.", highlight=False, soft_wrap=True)
    console.print(
        f"{comparison.total_s:.0f} s on {comparison.reference.provenance['device']}; "
        f"results in {output}/, start with {output / 'report.html'}",
        highlight=False,
        soft_wrap=True,
    )
    if not comparison.is_complete:
        end_interrupted("; the report holds what was finished")


def _field(fov: float | None, has_photographs: bool) -> float:
    if fov is None:
        return PHOTOGRAPH_FOV_DEG if has_photographs else PAPER_FOV_DEG
    return fov


def _two_planes(
    near_image: Path | None, far_image: Path | None, near: float, far: float, fov: float
) -> tuple[Scene, float, str]:
    """The scene, the lean of its depth edge in degrees, and the white point to show it with."""
    from isetcl.scene import targets
    from isetcl.scene.texture import load_image

    if (near_image is None) != (far_image is None):
        raise InvalidInputError(
            "give both --near-image and --far-image, or neither, got only "
            f"{'--near-image' if near_image else '--far-image'}"
        )
    if near_image is None or far_image is None:
        return targets.two_planes(near, far), 45.0, "E"
    pictures = load_image(near_image), load_image(far_image)
    scene = targets.image_planes(*pictures, near, far, fov)
    return scene, 0.0, "D65" if any(p.channels == 3 for p in pictures) else "E"


def _model_eye(name: str, pupil: float, accommodation: str, near: float, far: float) -> Eye:
    """The model eye with its accommodation in words or dioptres."""
    from isetcl.eye import catalog

    if accommodation == "relaxed":
        return catalog.by_name(name, pupil)
    if accommodation == "near":
        return catalog.by_name(name, pupil, 1.0 / near)
    if accommodation == "far":
        return catalog.by_name(name, pupil, 1.0 / far)
    try:
        dioptres = float(accommodation)
    except ValueError:
        raise InvalidInputError(
            f"--accommodation must be a number of dioptres, 'near', 'far' or 'relaxed', "
            f"got {accommodation!r}"
        ) from None
    return catalog.by_name(name, pupil, dioptres)


def _trial_samples(spp: int) -> list[int]:
    """Sample counts of the trials: the longest and up to three shorter ones, each a quarter."""
    if spp < 2:
        raise InvalidInputError(f"--spp must be >= 2, got {spp}")
    samples = [spp]
    while len(samples) < 4 and samples[0] // 4 >= 2:
        samples.insert(0, samples[0] // 4)
    return samples


class _StepBar:
    """A Rich progress bar with one line of text for what is being done."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        self._bar = Progress(
            BarColumn(),
            TextColumn("{task.percentage:>3.0f} %"),
            TimeElapsedColumn(),
            TextColumn("{task.description}"),
            console=Console(stderr=True),
            transient=True,
        )
        self._task = self._bar.add_task("", total=1.0)

    def __enter__(self) -> _StepBar:
        return self

    def __exit__(self, *details: object) -> None:
        self._bar.stop()

    def __call__(self, text: str, fraction: float) -> None:
        # Started late, so that a refusal of the arguments is not preceded by an empty bar.
        self._bar.start()
        self._bar.update(self._task, completed=fraction, description=text)


def _table(comparison: object) -> object:
    from rich.table import Table

    from isetcl.report import TABLE_HEAD, table_rows
    from isetcl.validation import Comparison

    assert isinstance(comparison, Comparison)
    table = Table(title="Photopic error against an independent ray-traced reference")
    for i, name in enumerate(TABLE_HEAD):
        table.add_column(name, justify="left" if i == 0 else "right")
    for row in table_rows(comparison):
        table.add_row(*row)
    return table
