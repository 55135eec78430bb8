"""Materials that mirror and refract: metals, glass, mirrors, polished or rough.

Rough surfaces are made of microfacets with the GGX distribution (Trowbridge & Reitz 1975; Walter et
al. 2007, EGSR) of width `roughness` = alpha, from 0 (smooth) to 1.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from isetcl.errors import InvalidInputError, check_between, check_type
from isetcl.eye.media import Medium
from isetcl.scene.complex_index import ComplexIndex
from isetcl.scene.texture import TEXTURES, Texture
from isetcl.spectrum import Spectrum

Level: TypeAlias = "float | Texture"
"""A number between 0 and 1, or a grey texture of such."""


def check_level(name: str, level: Level) -> None:
    """Refuse what is neither a number from 0 to 1 nor a grey texture of such.

    Raises
    ------
    InvalidInputError
    """
    if not isinstance(level, TEXTURES):
        check_between(name, level, 0.0, 1.0)
    elif level.channels != 1:
        raise InvalidInputError(
            f"{name} must be a grey texture, got one of {level.channels} channels; pass one channel"
        )
    elif level.largest > 1.0:
        raise InvalidInputError(f"{name} must be <= 1 everywhere, got {level.largest:g}")


def level_digest(level: Level) -> str:
    """A hash of a level, for provenance."""
    return level.digest() if isinstance(level, TEXTURES) else repr(float(level))


@dataclass(frozen=True, eq=False)
class Mirror:
    """A mirror that reflects alike at all angles.

    Parameters
    ----------
    reflectance
        Spectral reflectance, 0 to 1.
    roughness
        GGX width alpha, 0 (smooth) to 1, or a grey texture of it.

    Raises
    ------
    InvalidInputError
        If the reflectance exceeds 1.
    """

    reflectance: Spectrum
    roughness: Level = 0.0

    texture = None

    def __post_init__(self) -> None:
        check_type("mirror: reflectance", self.reflectance, Spectrum)
        largest = float(np.max(self.reflectance.values))
        if largest > 1.0 + 1e-5:
            raise InvalidInputError(
                f"mirror: reflectance must be <= 1, got {largest:.4g}; lower it"
            )
        check_level("mirror: roughness", self.roughness)

    def spectra(self) -> tuple[Spectrum, ...]:
        """Spectral reflectance."""
        return (self.reflectance,)

    def digest(self) -> str:
        """A hash, for provenance."""
        return _digest("Mirror", self.reflectance.digest(), self.roughness)


@dataclass(frozen=True, eq=False)
class Conductor:
    """A metal, which reflects by Fresnel's equations.

    Parameters
    ----------
    index
        Complex refractive index against wavelength.
    roughness
        GGX width alpha, 0 (polished) to 1, or a grey texture of it.
    """

    index: ComplexIndex
    roughness: Level = 0.0

    texture = None

    def __post_init__(self) -> None:
        check_type("conductor: index", self.index, ComplexIndex)
        check_level("conductor: roughness", self.roughness)

    def spectra(self) -> tuple[Spectrum, ...]:
        """None: it has an index."""
        return ()

    def digest(self) -> str:
        """A hash, for provenance."""
        return _digest("Conductor", self.index.digest(), self.roughness)


@dataclass(frozen=True, eq=False)
class Dielectric:
    """The surface of a clear body, such as glass or water, in air.

    The body lies behind the surface: on the side from which the normal points away. Wavelengths are
    bent apart (dispersion) as finely as the image has bands.

    Parameters
    ----------
    index
        The medium of the body.
    roughness
        GGX width alpha, 0 (polished) to 1, or a grey texture of it.
    """

    index: Medium
    roughness: Level = 0.0

    texture = None

    def __post_init__(self) -> None:
        check_type("dielectric: index", self.index, Medium)
        check_level("dielectric: roughness", self.roughness)

    def spectra(self) -> tuple[Spectrum, ...]:
        """None: it has an index."""
        return ()

    def digest(self) -> str:
        """A hash, for provenance."""
        return _digest("Dielectric", repr(self.index), self.roughness)


def _digest(kind: str, of: str, roughness: Level) -> str:
    return hashlib.sha256(f"{kind} {of} {level_digest(roughness)}".encode()).hexdigest()[:16]
