"""Ctrl-C between launches instead of in the middle of a sum."""

from __future__ import annotations

import signal
from types import FrameType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from isetcl.retina.image import RetinalImage


def check_complete(image: RetinalImage) -> None:
    """Raise KeyboardInterrupt if Ctrl-C ended the render of an image.

    `render` answers Ctrl-C with the image so far. Work that goes on from it must end instead.
    """
    if not image.provenance["is_complete"]:
        raise KeyboardInterrupt


class DeferredInterrupt:
    """A context in which the first Ctrl-C waits for `check`; a second one is immediate.

    Outside the main thread, or where the program handles Ctrl-C in its own way, nothing changes.
    """

    def __init__(self) -> None:
        self._is_requested = False
        self._is_installed = False

    def __enter__(self) -> DeferredInterrupt:
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            try:
                signal.signal(signal.SIGINT, self._note)
                self._is_installed = True
            except ValueError:
                # Only the main thread may set handlers; no other receives Ctrl-C.
                pass
        return self

    def __exit__(self, *details: Any) -> None:
        if self._is_installed:
            signal.signal(signal.SIGINT, signal.default_int_handler)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self._is_requested:
            raise KeyboardInterrupt
        self._is_requested = True

    def check(self) -> None:
        """Raise KeyboardInterrupt if Ctrl-C was pressed."""
        if self._is_requested:
            raise KeyboardInterrupt
