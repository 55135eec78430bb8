"""What surfaces do with light: send it out by themselves, or scatter what falls on them.

The front of a surface is the side its normal points to: edge u x edge v of a quad, outwards on a
sphere, by winding (right hand) on a mesh.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Literal

import numpy as np

from isetcl.errors import InvalidInputError, check_choice, check_type
from isetcl.eye.media import ConstantIndex, Medium
from isetcl.scene.light_field import LightField
from isetcl.scene.specular import (
    Conductor,
    Dielectric,
    Level,
    Mirror,
    check_level,
    level_digest,
)
from isetcl.scene.texture import TEXTURES, Texture
from isetcl.spectrum import Spectrum

EmittingSides = Literal["both", "front"]

CLEAR_COAT = Medium("clear coat", ConstantIndex(1.5))
"""What paints and plastics are coated with, about (Mitsuba and PBRT assume the same)."""


def _check_material(
    name: str, spectra: object, texture: object, kinds: tuple[type, ...] = TEXTURES
) -> None:
    """Refuse what is no spectrum, or tuple of them, and what is no texture."""
    for spectrum in spectra if isinstance(spectra, (tuple, list)) else (spectra,):
        check_type(name, spectrum, Spectrum)
    if texture is not None:
        check_type(f"{name.split(':')[0]}: texture", texture, kinds)


@dataclass(frozen=True, eq=False)
class Emission:
    """A surface that sends out light by itself, alike in all directions.

    Parameters
    ----------
    radiance
        Spectral radiance, W m^-2 sr^-1 nm^-1: one spectrum, or one a channel (the primaries) for a
        coloured image.
    texture
        Weights of the radiance over the shape; None is 1 everywhere. A `LightField` sends out
        different light in different directions, from the front only.
    sides
        ``"both"``, or ``"front"`` for the side the normal points to.
    is_additive
        Whether light from behind passes unhindered, as through one plane of a multi-plane display.

    Raises
    ------
    InvalidInputError
        If the number of spectra is not the number of channels of the texture.
    """

    radiance: Spectrum | tuple[Spectrum, ...]
    texture: Texture | LightField | None = None
    sides: EmittingSides = "both"
    is_additive: bool = False

    def __post_init__(self) -> None:
        kinds = (*TEXTURES, LightField)
        _check_material("emission: radiance", self.radiance, self.texture, kinds)
        check_choice("emission: sides", self.sides, ("both", "front"))
        check_type("emission: is_additive", self.is_additive, bool)
        channels = 1 if self.texture is None else self.texture.channels
        if len(self.spectra()) != channels:
            raise InvalidInputError(
                f"emission: a texture of {channels} channel(s) needs as many spectra, got "
                f"{len(self.spectra())}; pass one spectrum, or the three display primaries"
            )

    def spectra(self) -> tuple[Spectrum, ...]:
        """Spectral radiance of each channel."""
        return (self.radiance,) if isinstance(self.radiance, Spectrum) else tuple(self.radiance)

    def digest(self) -> str:
        """A hash, for provenance."""
        extra = f"{self.sides} {self.is_additive}"
        return _digest("Emission", self.spectra(), self.texture, extra)


@dataclass(frozen=True, eq=False)
class UnlitReflectance:
    """A matt surface under an even light of its own, as if painted in that light.

    Parameters
    ----------
    reflectance
        Spectral reflectance, 0 to 1: one spectrum, or three for a coloured image.
    white
        Spectral radiance of a perfect white there, W m^-2 sr^-1 nm^-1.
    texture
        Weights of the reflectance over the shape; None is 1 everywhere.

    Raises
    ------
    InvalidInputError
        If a reflectance exceeds 1, or the number of spectra is not that of the channels.
    """

    reflectance: Spectrum | tuple[Spectrum, ...]
    white: Spectrum
    texture: Texture | None = None

    def __post_init__(self) -> None:
        _check_material("unlit reflectance: reflectance", self.reflectance, self.texture)
        check_type("unlit reflectance: white", self.white, Spectrum)
        for spectrum in self._reflectances():
            if np.any(spectrum.values > 1.0):
                raise InvalidInputError(
                    f"reflectance {spectrum.name!r} must be <= 1, got {spectrum.values.max():g}"
                )
        Emission(self.spectra(), self.texture)

    def _reflectances(self) -> tuple[Spectrum, ...]:
        single = isinstance(self.reflectance, Spectrum)
        return (self.reflectance,) if single else tuple(self.reflectance)  # type: ignore[return-value, arg-type]

    def spectra(self) -> tuple[Spectrum, ...]:
        """Spectral radiance of each channel: reflectance times white, on the finer of the grids."""
        products = []
        for reflectance in self._reflectances():
            grid = np.union1d(reflectance.wavelengths_nm, self.white.wavelengths_nm)
            low = max(reflectance.wavelengths_nm[0], self.white.wavelengths_nm[0])
            high = min(reflectance.wavelengths_nm[-1], self.white.wavelengths_nm[-1])
            grid = grid[(grid >= low) & (grid <= high)]
            name = f"{reflectance.name} under {self.white.name}"
            products.append(Spectrum(grid, reflectance.at(grid) * self.white.at(grid), name))
        return tuple(products)

    def digest(self) -> str:
        """A hash, for provenance."""
        return _digest("UnlitReflectance", self.spectra(), self.texture)


def _largest_sum(spectra: tuple[Spectrum, ...]) -> float:
    """The largest sum of spectra over the wavelengths that all of them know."""
    low = max(s.wavelengths_nm[0] for s in spectra)
    high = min(s.wavelengths_nm[-1] for s in spectra)
    grid = np.unique(np.concatenate([s.wavelengths_nm for s in spectra]))
    grid = grid[(grid >= low) & (grid <= high)]
    return float(np.max(sum(s.at(grid) for s in spectra))) if len(grid) else 0.0


def _check_reflectances(
    name: str, spectra: tuple[Spectrum, ...], texture: Texture | None, other: float = 0.0
) -> None:
    """Refuse what sends back more light than it receives, or lacks spectra for its texture."""
    channels = 1 if texture is None else texture.channels
    if len(spectra) != channels:
        raise InvalidInputError(
            f"{name}: a texture of {channels} channel(s) needs as many spectra, got "
            f"{len(spectra)}; pass one reflectance, or those of red, green and blue"
        )
    largest = (1.0 if texture is None else texture.largest) * _largest_sum(spectra) + other
    # Published bases for RGB sum to 1 within 1e-6.
    if largest > 1.0 + 1e-5:
        raise InvalidInputError(
            f"{name}: reflectance times texture must be <= 1, got {largest:.4g}; lower one"
        )


@dataclass(frozen=True, eq=False)
class Diffuse:
    """A matt surface (Lambert's law), alike on both sides.

    Parameters
    ----------
    reflectance
        Spectral reflectance, 0 to 1: one spectrum, or one a channel for a coloured image.
    texture
        Weights of the reflectance over the shape; None is 1 everywhere.
    transmittance
        Spectral transmittance of a thin translucent sheet, scattered by Lambert's law behind it.

    Raises
    ------
    InvalidInputError
        If the surface could send on more light than it receives, or the number of spectra is not
        that of the channels.
    """

    reflectance: Spectrum | tuple[Spectrum, ...]
    texture: Texture | None = None
    transmittance: Spectrum | None = None

    def __post_init__(self) -> None:
        _check_material("diffuse: reflectance", self.reflectance, self.texture)
        passed = 0.0
        if self.transmittance is not None:
            check_type("diffuse: transmittance", self.transmittance, Spectrum)
            passed = float(np.max(self.transmittance.values))
        _check_reflectances("diffuse", self.spectra(), self.texture, passed)

    def spectra(self) -> tuple[Spectrum, ...]:
        """Spectral reflectance of each channel."""
        single = isinstance(self.reflectance, Spectrum)
        return (self.reflectance,) if single else tuple(self.reflectance)  # type: ignore[return-value, arg-type]

    def digest(self) -> str:
        """A hash, for provenance."""
        passed = self.transmittance.digest() if self.transmittance else "opaque"
        return _digest("Diffuse", self.spectra(), self.texture, passed)


@dataclass(frozen=True, eq=False)
class Coated:
    """A matt surface under a clear coat: plastic, paint, varnished wood.

    Light enters the coat, is scattered below it as often as the coat sends it back down, and
    leaves; the rest is reflected by the coat.

    Parameters
    ----------
    reflectance, texture
        Of the matt surface, as for `Diffuse`.
    index
        Refractive index of the coat.
    roughness
        GGX width alpha of the coat, 0 (smooth) to 1, or a grey texture of it.

    Raises
    ------
    InvalidInputError
        As for `Diffuse`.
    """

    reflectance: Spectrum | tuple[Spectrum, ...]
    texture: Texture | None = None
    index: Medium = CLEAR_COAT
    roughness: Level = 0.0

    def __post_init__(self) -> None:
        _check_material("coated: reflectance", self.reflectance, self.texture)
        _check_reflectances("coated", self.spectra(), self.texture)
        check_type("coated: index", self.index, Medium)
        check_level("coated: roughness", self.roughness)

    def spectra(self) -> tuple[Spectrum, ...]:
        """Spectral reflectance of each channel."""
        single = isinstance(self.reflectance, Spectrum)
        return (self.reflectance,) if single else tuple(self.reflectance)  # type: ignore[return-value, arg-type]

    def digest(self) -> str:
        """A hash, for provenance."""
        extra = f"{self.index!r} {level_digest(self.roughness)}"
        return _digest("Coated", self.spectra(), self.texture, extra)


@dataclass(frozen=True, eq=False)
class Mix:
    """Two materials side by side, too fine to tell apart.

    Parameters
    ----------
    first, second
        The materials; both must scatter light.
    weight
        Share of the second, 0 to 1, or a grey texture of it.
    """

    first: Material
    second: Material
    weight: Level = 0.5

    texture = None

    def __post_init__(self) -> None:
        for name in ("first", "second"):
            check_type(f"mix: {name}", getattr(self, name), SCATTERING)
        check_level("mix: weight", self.weight)

    def spectra(self) -> tuple[Spectrum, ...]:
        """Nothing of its own."""
        return ()

    def digest(self) -> str:
        """A hash, for provenance."""
        parts = f"{self.first.digest()} {self.second.digest()} {level_digest(self.weight)}"
        return _digest("Mix", (), None, parts)


@dataclass(frozen=True, eq=False)
class TwoSided:
    """A surface whose sides differ: `front` on the side the normal points to."""

    front: Material
    back: Material

    texture = None

    def __post_init__(self) -> None:
        for name in ("front", "back"):
            check_type(f"two-sided: {name}", getattr(self, name), SCATTERING)

    def spectra(self) -> tuple[Spectrum, ...]:
        """Nothing of its own."""
        return ()

    def digest(self) -> str:
        """A hash, for provenance."""
        return _digest("TwoSided", (), None, f"{self.front.digest()} {self.back.digest()}")


Scattering = Diffuse | Coated | Mirror | Conductor | Dielectric | Mix | TwoSided
Material = Emission | UnlitReflectance | Scattering
SCATTERING = (Diffuse, Coated, Mirror, Conductor, Dielectric, Mix, TwoSided)
"""Materials that scatter the light that falls on them."""
EMITTING = (Emission, UnlitReflectance)
"""Materials that send out light of their own, and scatter none."""


def _digest(
    kind: str,
    spectra: tuple[Spectrum, ...],
    texture: Texture | LightField | None,
    extra: str = "",
) -> str:
    parts = [kind, texture.digest() if texture else "plain", extra]
    parts += [spectrum.digest() for spectrum in spectra]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]
