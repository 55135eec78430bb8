"""How much memory there is, and refusing what would not fit before anything is allocated."""

from __future__ import annotations

import math
from collections.abc import Callable

from isetcl.errors import OutOfMemoryError


def check_memory(what: str, needed_bytes: float, remedy: Callable[[float], str]) -> None:
    """Raise OutOfMemoryError if something needs more memory than is free.

    Parameters
    ----------
    what
        What needs it, for the message.
    needed_bytes
        How much, bytes.
    remedy
        The end of the message, given by how much each side of the image must shrink to fit.
    """
    available = available_bytes()
    if needed_bytes > available:
        raise OutOfMemoryError(
            f"{what} needs {needed_bytes / 2**30:.3g} GiB, {available / 2**30:.3g} GiB are free; "
            + remedy(math.sqrt(available / needed_bytes))
        )


def available_bytes() -> int:
    """Free physical memory, or a large number where it cannot be known."""
    try:
        with open("/proc/meminfo", encoding="ascii") as lines:
            for line in lines:
                if line.startswith("MemAvailable:"):
                    return int(line.split()[1]) * 1024
    except OSError:
        pass
    return 1 << 62
