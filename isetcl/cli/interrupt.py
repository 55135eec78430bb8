"""What a command says after Ctrl-C, and its exit status."""

from __future__ import annotations

import sys
from typing import NoReturn

import typer

INTERRUPTED = 130
"""Exit status after Ctrl-C: 128 plus the number of SIGINT, as shells have it."""


def end_interrupted(words: str) -> NoReturn:
    """End a command after Ctrl-C; `words` follow "isetcl: interrupted"."""
    print(f"isetcl: interrupted{words}", file=sys.stderr)
    raise typer.Exit(INTERRUPTED) from None
