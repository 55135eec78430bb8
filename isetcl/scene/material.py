"""What surfaces do with light: send it out by themselves, or scatter what falls on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError, check_type
from isetcl.scene.texture import Checkerboard, Image, Texture
from isetcl.spectrum import Spectrum


def _check_material(name: str, spectra: object, texture: object) -> None:
    """Refuse what is no spectrum, or tuple of them, and what is no texture."""
    for spectrum in spectra if isinstance(spectra, (tuple, list)) else (spectra,):
        check_type(name, spectrum, Spectrum)
    if texture is not None:
        check_type(f"{name.split(':')[0]}: texture", texture, (Checkerboard, Image))


@dataclass(frozen=True, eq=False)
class Emission:
    """A surface that sends out light by itself, alike in all directions and from both sides.

    Parameters
    ----------
    radiance
        Spectral radiance, W m^-2 sr^-1 nm^-1: one spectrum, or three (the primaries) for a
        coloured image.
    texture
        Weights of the radiance over the shape; None is 1 everywhere.

    Raises
    ------
    InvalidInputError
        If the number of spectra is not the number of channels of the texture.
    """

    radiance: Spectrum | tuple[Spectrum, ...]
    texture: Texture | None = None

    def __post_init__(self) -> None:
        _check_material("emission: radiance", self.radiance, self.texture)
        channels = 1 if self.texture is None else self.texture.channels
        if len(self.spectra()) != channels:
            raise InvalidInputError(
                f"emission: a texture of {channels} channel(s) needs as many spectra, got "
                f"{len(self.spectra())}; pass one spectrum, or the three display primaries"
            )

    def spectra(self) -> tuple[Spectrum, ...]:
        """Spectral radiance of each channel."""
        return (self.radiance,) if isinstance(self.radiance, Spectrum) else tuple(self.radiance)


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


def _largest_sum(spectra: tuple[Spectrum, ...]) -> float:
    """The largest sum of spectra over the wavelengths that all of them know."""
    low = max(s.wavelengths_nm[0] for s in spectra)
    high = min(s.wavelengths_nm[-1] for s in spectra)
    grid = np.unique(np.concatenate([s.wavelengths_nm for s in spectra]))
    grid = grid[(grid >= low) & (grid <= high)]
    return float(np.max(sum(s.at(grid) for s in spectra))) if len(grid) else 0.0


@dataclass(frozen=True, eq=False)
class Diffuse:
    """A matt surface (Lambert's law), alike on both sides.

    Parameters
    ----------
    reflectance
        Spectral reflectance, 0 to 1: one spectrum, or three (of the channels) for a coloured image.
    texture
        Weights of the reflectance over the shape; None is 1 everywhere.

    Raises
    ------
    InvalidInputError
        If the surface could send back more light than it receives, or the number of spectra is not
        that of the channels.
    """

    reflectance: Spectrum | tuple[Spectrum, ...]
    texture: Texture | None = None

    def __post_init__(self) -> None:
        _check_material("diffuse: reflectance", self.reflectance, self.texture)
        spectra = self.spectra()
        channels = 1 if self.texture is None else self.texture.channels
        if len(spectra) != channels:
            raise InvalidInputError(
                f"diffuse: a texture of {channels} channel(s) needs as many spectra, got "
                f"{len(spectra)}; pass one reflectance, or those of red, green and blue"
            )
        texture_largest = 1.0 if self.texture is None else self.texture.largest
        largest = texture_largest * _largest_sum(spectra)
        # Published bases for RGB sum to 1 within 1e-6.
        if largest > 1.0 + 1e-5:
            raise InvalidInputError(
                f"diffuse: reflectance times texture must be <= 1, got {largest:.4g}; lower one"
            )

    def spectra(self) -> tuple[Spectrum, ...]:
        """Spectral reflectance of each channel."""
        single = isinstance(self.reflectance, Spectrum)
        return (self.reflectance,) if single else tuple(self.reflectance)  # type: ignore[return-value, arg-type]


Material = Emission | UnlitReflectance | Diffuse
