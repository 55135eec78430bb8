"""Surfaces that PBRT's materials make, and what the reader asks of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from isetcl.scene.complex_index import ComplexIndex
from isetcl.scene.material import Diffuse, Mix, Scattering, TwoSided
from isetcl.scene.specular import Dielectric
from isetcl.scene.texture import TEXTURES, Checkerboard, Image, Texture
from isetcl.spectrum import Spectrum

Level = float | Texture


@dataclass(frozen=True, eq=False)
class Surface:
    """A material (None: a mere boundary between media), and how much of the light meets it."""

    material: Scattering | None
    opacity: Level = 1.0


def roughness_to_alpha(roughness: float, version: int) -> float:
    """GGX width of PBRT's perceptual roughness, 0 to 1.

    Version 3: polynomial in ln(roughness), roughness at least 1e-3; version 4: the square root.

    Source: Pharr, Jakob & Humphreys, Physically Based Rendering, 3rd edition 2016, section 8.4.2
    (TrowbridgeReitzDistribution::RoughnessToAlpha); 4th edition 2023, section 9.6.1.
    """
    if version >= 4:
        return float(np.sqrt(min(1.0, max(0.0, roughness))))
    x = float(np.log(max(roughness, 1e-3)))
    alpha = 1.62142 + 0.819955 * x + 0.1734 * x**2 + 0.0171201 * x**3 + 0.000640711 * x**4
    return min(1.0, max(0.0, alpha))


def mapped(value: Level, function: Callable[[float], float]) -> Level:
    """A level with its numbers changed."""
    if isinstance(value, Checkerboard):
        return dataclasses.replace(value, bright=function(value.bright), dark=function(value.dark))
    if isinstance(value, Image):
        table = np.vectorize(function, otypes=[np.float32])(np.unique(value.texels))
        texels = table[np.unique(value.texels, return_inverse=True)[1]]
        return dataclasses.replace(value, texels=texels.reshape(value.texels.shape))
    return function(float(value))  # type: ignore[arg-type]


def clipped(value: Level) -> Level:
    """A level between 0 and 1."""
    return mapped(value, lambda x: min(1.0, max(0.0, x)))


def has_sides(material: Scattering | None) -> bool:
    """Whether a material tells the front of its surface from the back."""
    if isinstance(material, Mix):
        return has_sides(material.first) or has_sides(material.second)  # type: ignore[arg-type]
    return isinstance(material, (Dielectric, TwoSided))


def has_texture(material: Scattering | None) -> bool:
    """Whether a material needs texture coordinates."""
    if isinstance(material, Mix):
        parts = has_texture(material.first) or has_texture(material.second)  # type: ignore[arg-type]
        return parts or isinstance(material.weight, TEXTURES)
    if material is None:
        return False
    level_of = getattr(material, "roughness", 0.0)
    return material.texture is not None or isinstance(level_of, TEXTURES)


def is_black(material: Scattering | None) -> bool:
    """Whether a material scatters nothing."""
    if material is None:
        return True
    plain = isinstance(material, Diffuse) and material.transmittance is None
    return plain and not any(s.values.any() for s in material.spectra())


def index_of_reflectance(reflectance: Spectrum) -> ComplexIndex:
    """The index, of real part 1, of a metal with a reflectance r of perpendicular light.

    k = 2 sqrt(r / (1 - r)), r at most 0.9999.

    Source: Pharr, Jakob & Humphreys, Physically Based Rendering, 4th edition 2023, section 10.5
    (conductor "reflectance").
    """
    r = np.clip(reflectance.values, 0.0, 0.9999)
    grid = reflectance.wavelengths_nm
    k = 2.0 * np.sqrt(r) / np.sqrt(1.0 - r)
    return ComplexIndex(grid, np.ones_like(grid), k, reflectance.name)
