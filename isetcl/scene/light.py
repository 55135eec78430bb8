"""Lights without a surface: points, spots, distant ones, and what surrounds a scene."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_between, check_type
from isetcl.scene.texture import Image
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


@dataclass(frozen=True, eq=False)
class SpotLight:
    """A point that shines into a cone.

    Parameters
    ----------
    position_m
        Where it is, metres.
    direction
        Axis of the cone, any length.
    intensity
        Spectral radiant intensity on the axis, W sr^-1 nm^-1.
    cone_deg
        Half the angle of the cone.
    penumbra_deg
        Width of the outer part of the cone in which the intensity falls to 0, as the smooth step
        3 t^2 - 2 t^3 of the cosine.
    """

    position_m: tuple[float, float, float]
    direction: tuple[float, float, float]
    intensity: Spectrum
    cone_deg: float = 30.0
    penumbra_deg: float = 5.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "position_m", _three("spot light: position_m", self.position_m))
        object.__setattr__(self, "direction", _three("spot light: direction", self.direction))
        if not any(self.direction):
            raise InvalidInputError("spot light: direction must not be zero, got (0, 0, 0)")
        check_type("spot light: intensity", self.intensity, Spectrum)
        check_between("spot light: cone_deg", self.cone_deg, 1e-3, 90.0, "deg")
        check_between("spot light: penumbra_deg", self.penumbra_deg, 0.0, self.cone_deg, "deg")

    def digest(self) -> str:
        """A hash, for provenance."""
        place = (*self.position_m, *self.direction, self.cone_deg, self.penumbra_deg)
        return _digest(place, self.intensity)


@dataclass(frozen=True, eq=False)
class Environment:
    """Light from all around, from infinitely far away.

    Parameters
    ----------
    radiance
        Spectral radiance, W m^-2 sr^-1 nm^-1: one spectrum, or one a channel of the image.
    texture
        Weights of the radiance by direction, an image of longitude and latitude; None is 1. A
        direction (x, y, z) is looked up at u = atan2(x, z) / 2 pi (0 to 1, so that +z lies at
        u = 0 and +x at 1/4) and v = 1/2 + asin(y) / pi.
    rotation
        Matrix (3, 3) from directions of the image to directions of the world; None turns nothing.

    Raises
    ------
    InvalidInputError
        If the number of spectra is not that of the channels, or the matrix is no rotation.
    """

    radiance: Spectrum | tuple[Spectrum, ...]
    texture: Image | None = None
    rotation: np.ndarray | None = None

    def __post_init__(self) -> None:
        for spectrum in self.spectra():
            check_type("environment: radiance", spectrum, Spectrum)
        if self.texture is not None:
            check_type("environment: texture", self.texture, Image)
        channels = 1 if self.texture is None else self.texture.channels
        if len(self.spectra()) != channels:
            raise InvalidInputError(
                f"environment: an image of {channels} channel(s) needs as many spectra, got "
                f"{len(self.spectra())}; pass one spectrum, or those of red, green and blue"
            )
        if self.rotation is not None:
            matrix = check_array("environment: rotation", self.rotation)
            if matrix.shape != (3, 3) or not np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-6):
                raise InvalidInputError("environment: rotation must be an orthogonal matrix (3, 3)")
            object.__setattr__(self, "rotation", matrix)

    def spectra(self) -> tuple[Spectrum, ...]:
        """Spectral radiance of each channel."""
        single = isinstance(self.radiance, Spectrum)
        return (self.radiance,) if single else tuple(self.radiance)  # type: ignore[return-value, arg-type]

    def coordinates(self, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Image coordinates (u, v) of world directions, unit vectors (..., 3)."""
        local = directions if self.rotation is None else directions @ self.rotation
        u = np.arctan2(local[..., 0], local[..., 2]) / (2.0 * np.pi) % 1.0
        return u, 0.5 + np.arcsin(np.clip(local[..., 1], -1.0, 1.0)) / np.pi

    def digest(self) -> str:
        """A hash, for provenance."""
        parts = [spectrum.digest() for spectrum in self.spectra()]
        parts.append(self.texture.digest() if self.texture else "plain")
        parts.append("as it is" if self.rotation is None else str(self.rotation.tolist()))
        return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]


Light = PointLight | SpotLight | DistantLight
LIGHTS = (PointLight, SpotLight, DistantLight)
"""The kinds of light without a surface."""


def light_spectrum(light: Light) -> Spectrum:
    """The spectrum of a light: irradiance of a distant one, intensity of the others."""
    return light.irradiance if isinstance(light, DistantLight) else light.intensity


def _digest(place: tuple[float, ...], spectrum: Spectrum) -> str:
    return hashlib.sha256(f"{place} {spectrum.digest()}".encode()).hexdigest()[:16]
