"""Showing how far a render is and how good it already is."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Any

from isetcl.errors import InvalidInputError


@dataclass(frozen=True)
class Progress:
    """The state of a render.

    Attributes
    ----------
    fraction
        Work done, 0 to 1, as far as it can be foreseen.
    error
        Current relative standard error of the image; NaN before two replicates.
    elapsed_s
        Seconds since the render began.
    """

    fraction: float
    error: float
    elapsed_s: float


ProgressCallback = Callable[[Progress], None]


class ProgressBar:
    """A Rich progress bar on standard error with the current error; a context manager."""

    def __init__(self, title: str) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
        from rich.progress import Progress as RichProgress

        self._bar = RichProgress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.percentage:>3.0f} %"),
            TextColumn("{task.fields[error]}"),
            TimeRemainingColumn(),
            console=Console(stderr=True),
            transient=True,
        )
        self._task = self._bar.add_task(title, total=1.0, error="")

    def __enter__(self) -> ProgressBar:
        self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._bar.stop()

    def __call__(self, progress: Progress) -> None:
        """Show a state."""
        if progress.error == progress.error:
            # Until the next one is known, the last error is that of the image Ctrl-C would keep.
            self._bar.update(self._task, error=f"error {100 * progress.error:.2g} %")
        self._bar.update(self._task, completed=progress.fraction)


class Silence:
    """A progress display that shows nothing; a context manager."""

    def __enter__(self) -> Silence:
        return self

    def __exit__(self, *details: Any) -> None:
        return None

    def __call__(self, progress: Progress) -> None:
        """Ignore a state."""


class Calls:
    """A progress display that calls a function; a context manager."""

    def __init__(self, function: ProgressCallback) -> None:
        self._function = function

    def __enter__(self) -> Calls:
        return self

    def __exit__(self, *details: Any) -> None:
        return None

    def __call__(self, progress: Progress) -> None:
        """Pass a state on."""
        self._function(progress)


def display(wanted: bool | ProgressCallback | None, title: str) -> ProgressBar | Silence | Calls:
    """The display for the `progress` argument of `render`; None is a bar on a terminal."""
    if callable(wanted):
        return Calls(wanted)
    if wanted is not None and not isinstance(wanted, bool):
        raise InvalidInputError(f"progress must be True, False, None or a function, got {wanted!r}")
    if wanted or (wanted is None and sys.stderr.isatty()):
        return ProgressBar(title)
    return Silence()
