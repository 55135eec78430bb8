"""The command `isetcl figures`: the paper's figures, each beside the paper's numbers."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from isetcl.cli.interrupt import end_interrupted

if TYPE_CHECKING:
    from rich.table import Table

    from isetcl.figures.result import FigureResult

UNEXPLAINED = 1
"""Exit status if a number differs from the paper's without a known reason."""


def figures(
    numbers: Annotated[
        list[int] | None,
        typer.Argument(metavar="[N]...", help="Numbers of figures, 2 to 12 (default: all)."),
    ] = None,
    output: Annotated[
        Path, typer.Option("--output", "--out", "-o", help="Folder for the pictures.")
    ] = Path("isetcl-figures"),
    draft: Annotated[
        bool, typer.Option("--draft", help="Fewer pixels and samples: seconds a figure.")
    ] = False,
    seed: Annotated[int, typer.Option(help="Seed of the samples.")] = 0,
    device: Annotated[
        str | None, typer.Option(help="OpenCL device: 'platform:device' or part of its name.")
    ] = None,
) -> None:
    """Draw the figures of Lian et al. 2019 and print isetcl's numbers beside the paper's.

    Of each figure a picture and a JSON file are written. The exit status is 1 if a number differs
    from the paper's and no reason is known.
    """
    from rich.console import Console

    from isetcl.device.choose import find_device
    from isetcl.figures import Quality, figures_of
    from isetcl.output import check_folder

    wanted = figures_of([] if numbers is None else numbers)
    quality = Quality(draft, device, seed)
    find_device(device)
    check_folder(output)
    console = Console()
    open_questions = 0
    for figure in wanted:
        start = time.perf_counter()
        try:
            with console.status(f"Figure {figure.number}. {figure.title}"):
                result = figure.draw(output, quality)
        except KeyboardInterrupt:
            end_interrupted(f" while figure {figure.number} was drawn")
        console.print(_table(result))
        seconds = time.perf_counter() - start
        console.print(f"{result.files[0]} ({seconds:.0f} s)\n", highlight=False, soft_wrap=True)
        open_questions += len(result.unexplained)
    if open_questions:
        noun = "number differs" if open_questions == 1 else "numbers differ"
        console.print(f"{open_questions} {noun} from the paper without a known reason.")
        raise typer.Exit(UNEXPLAINED)


def _table(result: FigureResult) -> Table:
    from rich.table import Table

    table = Table(
        title=f"Figure {result.number}. {result.title}", title_justify="left", title_style="bold"
    )
    table.add_column("quantity", ratio=4)
    table.add_column("isetcl", ratio=3)
    table.add_column("paper or reference", ratio=3)
    table.add_column("source", ratio=3)
    table.add_column("verdict", ratio=4)
    for row in result.rows:
        verdict = row.verdict if not row.reason else f"{row.verdict}: {row.reason}"
        table.add_row(row.quantity, row.isetcl, row.paper, row.source, verdict)
    return table
