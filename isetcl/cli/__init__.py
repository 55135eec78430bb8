"""The command line: `isetcl compare`, `render`, `cones`, `eye`, `mtf`, `validate` and others."""

from isetcl.cli.program import app, main

__all__ = ["app", "main"]
