"""Direction numbers of the Sobol' sequence for the kernels."""

from __future__ import annotations

import functools

import numpy as np

DIMENSIONS = 8
"""Exit pupil (2), pixel (2), diffraction (2), scatter (2)."""

# Degree, coefficients and first direction integers of the primitive polynomials of dimensions 2
# to 8. Source: Joe & Kuo 2008, SIAM J Sci Comput 30:2635, file new-joe-kuo-6.
_JOE_KUO = (
    (1, 0, (1,)),
    (2, 1, (1, 3)),
    (3, 1, (1, 3, 1)),
    (3, 2, (1, 1, 1)),
    (4, 1, (1, 1, 3, 3)),
    (4, 4, (1, 3, 5, 13)),
    (5, 2, (1, 1, 5, 5, 17)),
)
_BITS = 32
_GOLDEN_WORD = 0x9E3779B9


@functools.cache
def directions() -> tuple[int, ...]:
    """Bit-reversed direction numbers, 32 for each dimension in turn.

    Bit-reversed, because Owen scrambling permutes a digit by a hash of the digits before it, which
    is cheap when the first digit is the lowest bit.
    """
    words: list[int] = [1 << i for i in range(_BITS)]
    for degree, coefficients, first in _JOE_KUO[: DIMENSIONS - 1]:
        v = [m << (_BITS - 1 - i) for i, m in enumerate(first)]
        for i in range(degree, _BITS):
            word = v[i - degree] ^ (v[i - degree] >> degree)
            for k in range(1, degree):
                if (coefficients >> (degree - 1 - k)) & 1:
                    word ^= v[i - k]
            v.append(word)
        words += [_reversed(word) for word in v]
    return tuple(words)


def _reversed(word: int) -> int:
    return int(f"{word:0{_BITS}b}"[::-1], 2)


def mix_bits(word: int) -> int:
    """The kernels' hash of a 32-bit word (lib/sobol.cl), on the host."""
    x = np.array(word & 0xFFFFFFFF, dtype=np.uint64)
    mask = np.uint64(0xFFFFFFFF)
    x ^= x >> np.uint64(16)
    x = (x * np.uint64(0x7FEB352D)) & mask
    x ^= x >> np.uint64(15)
    x = (x * np.uint64(0x846CA68B)) & mask
    return int(x ^ (x >> np.uint64(16)))


def stream(seed: int, replicate: int) -> int:
    """The word that tells the samples of a replicate from all others.

    The hash maps 0 to 0, which would leave the first pixel of seed 0 unscrambled; hence the offset.
    """
    word = mix_bits((seed & 0xFFFFFFFF) + _GOLDEN_WORD) + (seed >> 32)
    return mix_bits(word + replicate * _GOLDEN_WORD)
