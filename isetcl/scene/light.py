"""Lights without a surface: points and distant ones."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_type
from isetcl.spectrum import Spectrum


def _three(name: str, value: tuple[float, float, float]) -> tuple[float, float, float]:
    array = check_array(name, value)
    if array.shape != (3,) or not np.all(np.isfinite(array)):
        raise InvalidInputError(f"{name} must be three finite numbers, got {value!r}")
    return float(array[0]), float(array[1]), float(array[2])


@dataclass(frozen=True, eq=False)
class PointLight:
    """A point that shines alike in all directions.

    Parameters
    ----------
    position_m
        Where it is, metres.
    intensity
        Spectral radiant intensity, W sr^-1 nm^-1.
    """

    position_m: tuple[float, float, float]
    intensity: Spectrum

    def __post_init__(self) -> None:
        object.__setattr__(self, "position_m", _three("point light: position_m", self.position_m))
        check_type("point light: intensity", self.intensity, Spectrum)

    def digest(self) -> str:
        """A hash, for provenance."""
        return _digest(self.position_m, self.intensity)


@dataclass(frozen=True, eq=False)
class DistantLight:
    """Parallel light from far away.

    Parameters
    ----------
    towards
        Direction to the light, any length.
    irradiance
        Spectral irradiance on a surface that faces it, W m^-2 nm^-1.
    """

    towards: tuple[float, float, float]
    irradiance: Spectrum

    def __post_init__(self) -> None:
        object.__setattr__(self, "towards", _three("distant light: towards", self.towards))
        if not any(self.towards):
            raise InvalidInputError("distant light: towards must not be zero, got (0, 0, 0)")
        check_type("distant light: irradiance", self.irradiance, Spectrum)

    def digest(self) -> str:
        """A hash, for provenance."""
        return _digest(self.towards, self.irradiance)


Light = PointLight | DistantLight


def _digest(place: tuple[float, float, float], spectrum: Spectrum) -> str:
    return hashlib.sha256(f"{place} {spectrum.digest()}".encode()).hexdigest()[:16]
