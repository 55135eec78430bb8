"""Who makes the Fourier transforms: scipy on the host, or whatever the caller passes.

This package knows no devices. A caller that has one passes an object with the two functions of
`RealFft`, such as `isetcl.device_fft()`.
"""

from __future__ import annotations

import os
from typing import Protocol, runtime_checkable

import numpy as np

from isetcl.errors import InvalidInputError

WORKERS = min(8, os.cpu_count() or 1)


@runtime_checkable
class RealFft(Protocol):
    """Fourier transforms of real images over their last two axes; threads may share one."""

    def rfft2(self, image: np.ndarray, size: tuple[int, int]) -> np.ndarray:
        """Transform of an image with zeros up to a size, (..., rows, columns // 2 + 1), complex64.

        As scipy's: the sum over samples, not divided by their number.
        """

    def irfft2(self, spectrum: np.ndarray, size: tuple[int, int]) -> np.ndarray:
        """The image of a size whose transform this is, float32; the inverse of `rfft2`."""


class ScipyFft:
    """Transforms by scipy, in the threads of whoever calls."""

    def rfft2(self, image: np.ndarray, size: tuple[int, int]) -> np.ndarray:
        """See `RealFft`."""
        from scipy import fft

        return np.asarray(fft.rfft2(image, size))

    def irfft2(self, spectrum: np.ndarray, size: tuple[int, int]) -> np.ndarray:
        """See `RealFft`."""
        from scipy import fft

        return np.asarray(fft.irfft2(spectrum, size))

    def __str__(self) -> str:
        return "scipy"


SCIPY = ScipyFft()


def fft_of(value: str | RealFft) -> RealFft:
    """The argument `fft`: "scipy", or an object that makes transforms.

    Raises
    ------
    InvalidInputError
        If it is neither.
    """
    if isinstance(value, str):
        if value == "scipy":
            return SCIPY
        raise InvalidInputError(
            f"fft must be 'scipy' or an object with rfft2 and irfft2, got {value!r}; for an OpenCL "
            "device pass fft=isetcl.device_fft()"
        )
    if not isinstance(value, RealFft) or isinstance(value, type):
        raise InvalidInputError(
            f"fft must be 'scipy' or an object with rfft2 and irfft2, got {value!r}"
        )
    return value
