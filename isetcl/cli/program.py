"""The program `isetcl`: its commands, and how their errors are shown."""

from __future__ import annotations

import sys

import typer

from isetcl.cli.compare import compare
from isetcl.cli.cones import cones
from isetcl.cli.eye import eye, mtf
from isetcl.cli.figures import figures
from isetcl.cli.machine import devices, info
from isetcl.cli.render import render
from isetcl.cli.validate import validate
from isetcl.errors import IsetclError

app = typer.Typer(
    name="isetcl",
    help="Retinal images by ray tracing through model eyes, and by PSF convolution.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

for command in (compare, render, cones, eye, mtf, figures, devices, info):
    app.command()(command)
app.add_typer(validate)


def main() -> None:
    """Run the command line; isetcl's own errors are printed without a traceback, exit status 2."""
    try:
        app()
    except IsetclError as error:
        print(f"isetcl: {error}", file=sys.stderr)
        sys.exit(2)
