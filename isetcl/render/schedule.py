"""How samples are divided into replicates, and how many are needed.

Owen-scrambled points lose their gain in short pieces, so a replicate has at least 32 samples, and
64 where there are enough; the standard error needs at least two replicates. On a checkerboard with
256 samples two replicates leave an error of 0.56 %, four 0.61 %, eight 0.68 %.
"""

from __future__ import annotations

import math

MIN_REPLICATE_SPP = 32
MAX_REPLICATES = 8
PILOT_REPLICATES = 2

LONG_REPLICATE_SPP = 256
"""Replicates from this length on are preceded by a short pilot."""

DARK_SPP = 1024
"""Samples a pixel after which a `target_error` gives up on an image without any light."""

_DEGREES_OF_FREEDOM = 32

_ERROR_EXPONENT = 0.6
"""Measured fall of the error with samples on scenes with edges: N^-0.6."""


def split(spp: int) -> list[int]:
    """Sizes of the replicates of a render with a fixed number of samples a pixel, spp >= 2."""
    replicates = min(max(spp // (2 * MIN_REPLICATE_SPP), 2), MAX_REPLICATES)
    size, rest = divmod(spp, replicates)
    return [size + (i < rest) for i in range(replicates)]


def replicates_for(pixels: int) -> int:
    """Replicates before the error of an image may be trusted to stop a render.

    The error is a mean over pixels of variances that have one degree of freedom less than there are
    replicates; of a few pixels a small one may be luck.
    """
    return max(PILOT_REPLICATES, 1 + math.ceil(_DEGREES_OF_FREEDOM / pixels))


def replicate_size_for(spp: float, replicates: int = MAX_REPLICATES) -> int:
    """Size of equal replicates for a render expected to need `spp` samples a pixel."""
    return max(MIN_REPLICATE_SPP, math.ceil(spp / max(replicates, MAX_REPLICATES)))


def samples_for_error(spp: int, error: float, target: float) -> float:
    """Samples a pixel expected to bring the error to its target, from the error at `spp`."""
    return spp * max(1.0, error / target) ** (1.0 / _ERROR_EXPONENT)
