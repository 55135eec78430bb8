"""The commands `isetcl validate ...`: what isetcl gets right, measured here and now."""

from __future__ import annotations

import json
import os
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

from isetcl.cli.interrupt import end_interrupted
from isetcl.errors import FileError, InvalidInputError, check_choice

if TYPE_CHECKING:
    from rich.progress import Progress

    from isetcl.device.layout import Precision
    from isetcl.validation.stability import Outcome, Report

validate = typer.Typer(
    name="validate",
    help="Measure what isetcl gets right, on the devices present.",
)

FAILED = 1


@validate.callback(invoke_without_command=True)
def _validate(
    context: typer.Context,
    report: Annotated[
        Path | None,
        typer.Option(help="Write report.html and report.json with everything into this folder."),
    ] = None,
    part: Annotated[
        list[str] | None,
        typer.Option(
            help="Only this part of the report: stability, mtf, occlusion, work-precision or "
            "figures; may be given again."
        ),
    ] = None,
    draft: Annotated[
        bool, typer.Option("--draft", help="Few samples: a report of minutes.")
    ] = False,
    device: Annotated[str | None, typer.Option(help="'platform:device' or part of a name.")] = None,
) -> None:
    """Measure what isetcl gets right, on the devices present; exit status 1 if something fails."""
    if context.invoked_subcommand is not None:
        if report is not None or part or draft or device is not None:
            raise InvalidInputError(
                f"options of the report stand without a command; leave out "
                f"{context.invoked_subcommand!r}, or put its own options behind it"
            )
        return
    if report is None:
        if part or draft or device is not None:
            raise InvalidInputError(
                "--part, --draft and --device are those of the report; add --report FOLDER"
            )
        typer.echo(context.get_help())
        raise typer.Exit(2)
    _write_report(report, part, draft, device)


def _write_report(
    folder: Path, parts: list[str] | None, is_draft: bool, device: str | None
) -> None:
    """Write the report with a progress bar, and say what failed."""
    from rich.console import Console

    from isetcl.validation_report import write_validation_report

    try:
        with _progress() as bar:
            task = bar.add_task("", total=1.0)
            found = write_validation_report(
                folder,
                parts=parts or None,
                is_draft=is_draft,
                device=device,
                command=shlex.join(["isetcl", *sys.argv[1:]]),
                on_step=lambda what, done: bar.update(task, description=what, completed=done),
            )
    except KeyboardInterrupt:
        end_interrupted(" before a part of the report was finished")
    console = Console()
    for path in found.files:
        console.print(str(path), highlight=False, soft_wrap=True)
    for name, failures in found.failures.items():
        for words in failures:
            console.print(f"{name}: {words}", highlight=False, soft_wrap=True)
    if not found.is_complete:
        end_interrupted("; the report holds the parts that were finished")
    if found.failures:
        raise typer.Exit(FAILED)


@validate.command()
def stability(
    device: Annotated[
        str | None,
        typer.Option(help="'platform:device' or part of a name; every device without it."),
    ] = None,
    precision: Annotated[
        str | None, typer.Option(help="'single' or 'double'; both without it.")
    ] = None,
    case: Annotated[
        list[int] | None, typer.Option(help="Run this case only; may be given again.")
    ] = None,
    full: Annotated[
        bool, typer.Option("--full", help="Run the longest cases at full size.")
    ] = False,
    json_file: Annotated[
        Path | None, typer.Option("--json", help="Write the outcomes to a JSON file.")
    ] = None,
    markdown_file: Annotated[
        Path | None, typer.Option("--markdown", help="Write the tables to a Markdown file.")
    ] = None,
) -> None:
    """Run the extreme cases in float32 and float64; exit status 1 if one fails."""
    from isetcl.output import write_file
    from isetcl.validation.stability import cases, markdown, run

    if precision is not None:
        check_choice("--precision", precision, ("single", "double"))
    _check_writable("--json", json_file)
    _check_writable("--markdown", markdown_file)
    try:
        with _progress() as bar:
            task = bar.add_task("building kernels", total=None)

            def show(name: str, outcome: Outcome) -> None:
                bar.update(
                    task, description=f"{name[:40]}: case {outcome.case.number} {outcome.verdict}"
                )

            reports = run(
                device,
                cast("Precision | None", precision),
                numbers=case or None,
                full=full,
                on_outcome=show,
            )
    except KeyboardInterrupt:
        end_interrupted(" before the last case")
    _print(reports, len(cases()))
    if json_file is not None:
        text = json.dumps([r.record() for r in reports], indent=1)
        write_file(json_file, f"{text}\n".encode())
    if markdown_file is not None:
        write_file(markdown_file, markdown(reports).encode())
    if any(r.failures for r in reports):
        raise typer.Exit(FAILED)


def _progress() -> Progress:
    """A bar on stderr that leaves nothing behind; none where nobody looks."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True, quiet=not sys.stderr.isatty())
    return Progress(console=console, transient=True)


def _check_writable(option: str, path: Path | None) -> None:
    if path is None:
        return
    folder = path.absolute().parent
    if path.is_dir():
        reason = "it is a folder"
    elif not folder.is_dir():
        reason = f"folder {str(folder)!r} does not exist"
    elif not os.access(folder, os.W_OK):
        reason = f"folder {str(folder)!r} cannot be written to"
    else:
        return
    raise FileError(f"{option}: cannot write {str(path)!r}: {reason}; choose another")


def _print(reports: tuple[Report, ...], known: int) -> None:
    from rich.console import Console
    from rich.table import Table

    from isetcl.validation.stability.suite import PRECISIONS, by_case

    console = Console()
    for report in reports:
        of = report.device
        table = Table(title=f"{of['platform']}: {of['device']}")
        table.add_column("case", justify="right", min_width=4)
        table.add_column("input", ratio=1)
        shown = [p for p in PRECISIONS if any(p in of_case for of_case in by_case(report))]
        for precision in shown:
            name = {"single": "float32", "double": "float64"}[precision]
            table.add_column(f"{name} (allowed)", justify="right", no_wrap=True, min_width=17)
        for of_case in by_case(report):
            case = next(iter(of_case.values())).case
            cells = [_cell(of_case.get(precision)) for precision in shown]
            table.add_row(str(case.number), case.title, *cells)
        console.print(table)
        for o in report.failures:
            console.print(
                f"case {o.case.number}, {o.precision}: {o.case.title}: {o.verdict}; expected "
                f"{o.case.expected}, measured {o.value:.3g} {o.case.unit} {o.note}",
                highlight=False,
                soft_wrap=True,
            )
        count = len({o.case.number for o in report.outcomes})
        seconds = sum(o.seconds for o in report.outcomes)
        verdict = f"{len(report.failures)} failed" if report.failures else "all pass"
        console.print(f"{count} of {known} cases in {seconds:.0f} s: {verdict}", highlight=False)


def _cell(outcome: Outcome | None) -> str:
    """A measured value beside its tolerance, in the colour of the verdict."""
    from isetcl.validation.stability.suite import number

    if outcome is None or outcome.verdict == "not applicable":
        return "[dim]–[/dim]"
    text = f"{number(outcome.value)} ({number(outcome.case.tolerance(outcome.precision))})"
    colour = "red" if outcome.failed else "green"
    return f"[{colour}]{'FAILS ' if outcome.failed else ''}{text}[/{colour}]"
