"""The looks that 3-D files describe, as isetcl's materials.

Files speak of colours and of a few numbers between 0 and 1; here they become spectra and physical
materials. Colours are linear sRGB.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from isetcl.eye.media import ConstantIndex, Medium
from isetcl.scene.colour import (
    radiance_of_rgb,
    reflectance_of_rgb,
    reflectance_primaries,
)
from isetcl.scene.display import display_primaries
from isetcl.scene.material import CLEAR_COAT, Coated, Diffuse, Emission, Mix, Scattering
from isetcl.scene.model import SceneObject
from isetcl.scene.specular import Dielectric, Level, Mirror
from isetcl.scene.texture import Image
from isetcl.spectrum import Spectrum

GREY = (0.5, 0.5, 0.5)
"""Colour of a surface whose file states none."""
Rgb = tuple[float, float, float]


@dataclass(frozen=True)
class Placement:
    """Where a texture lies: an `Image`'s wrap, repeats and offset."""

    wrap: str = "repeat"
    repeats: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    mirrored: bool = False

    def image(self, texels: np.ndarray, name: str) -> Image:
        """The texture; one that is mirrored at its borders is stored with its mirror images."""
        repeats, offset = self.repeats, self.offset
        if self.mirrored:
            wide = np.concatenate([texels, texels[:, ::-1]], axis=1)
            texels = np.concatenate([wide[::-1], wide], axis=0)
            repeats = (repeats[0] / 2.0, repeats[1] / 2.0)
            offset = (offset[0] / 2.0, offset[1] / 2.0)
        wrap = "clamp" if self.wrap == "clamp" and not self.mirrored else "repeat"
        return Image(texels, name, wrap=wrap, repeats=repeats, offset=offset)  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False)
class Paint:
    """A colour, or a picture of colours between 0 and 1 that it multiplies."""

    rgb: Rgb = (1.0, 1.0, 1.0)
    picture: np.ndarray | None = None
    placement: Placement = Placement()

    def mean(self) -> Rgb:
        """The mean colour, between 0 and 1."""
        mean = np.array(self.rgb)
        if self.picture is not None:
            mean = mean * self.picture.reshape(-1, 3).mean(axis=0)
        red, green, blue = np.clip(mean, 0.0, 1.0).tolist()
        return red, green, blue

    def reflectance(self) -> tuple[Spectrum | tuple[Spectrum, ...], Image | None]:
        """Spectral reflectances and the texture that weights them."""
        if self.picture is None:
            return reflectance_of_rgb(self.mean()), None
        texels = np.clip(self.picture * np.array(self.rgb, np.float32), 0.0, 1.0)
        grey = texels[..., 0]
        if np.array_equal(grey, texels[..., 1]) and np.array_equal(grey, texels[..., 2]):
            return reflectance_of_rgb((1.0, 1.0, 1.0)), self.placement.image(grey, "grey")
        return reflectance_primaries(), self.placement.image(texels, "colour")

    def emission(self, luminance_of_white_cd_m2: float) -> Emission | None:
        """The paint as light of a display; None if it is black."""
        largest = max(self.rgb)
        if largest <= 0.0 or (self.picture is not None and not self.picture.any()):
            return None
        if self.picture is None:
            return Emission(radiance_of_rgb(self.rgb, luminance_of_white_cd_m2))
        texels = self.picture * (np.array(self.rgb, np.float32) / np.float32(largest))
        white = luminance_of_white_cd_m2 * largest
        return Emission(display_primaries(white), self.placement.image(texels, "emission"))


@dataclass(frozen=True, eq=False)
class Surface:
    """A look: what it scatters, what it sends out, and how much of it is there.

    Attributes
    ----------
    material
        What the surface does with light.
    emission
        Light of its own besides; None for none.
    opacity
        Share of the surface that is there.
    """

    material: Scattering | Emission
    emission: Emission | None = None
    opacity: Level = 1.0

    def object(self, name: str, shape: object) -> SceneObject:
        """A scene object with this look."""
        emission = None if isinstance(self.material, Emission) else self.emission
        return SceneObject(name, shape, self.material, emission=emission, opacity=self.opacity)  # type: ignore[arg-type]


def plain(paint: Paint | None = None) -> Surface:
    """A matt surface; grey where no colour is stated."""
    reflectance, texture = (paint if paint is not None else Paint(GREY)).reflectance()
    return Surface(Diffuse(reflectance, texture))


def level(factor: float, picture: np.ndarray | None, placement: Placement) -> Level:
    """A number between 0 and 1 times a grey picture; a number where the picture is even."""
    if picture is None:
        return min(max(factor, 0.0), 1.0)
    texels = np.clip(picture * np.float32(factor), 0.0, 1.0)
    if float(np.ptp(texels)) < 0.5 / 255.0:
        return float(texels.flat[0])
    return placement.image(texels, "level")


def squared(roughness: Level) -> Level:
    """GGX alpha = roughness^2.

    Source: glTF 2.0 specification, appendix B.3.3.
    """
    if isinstance(roughness, Image):
        return dataclasses.replace(roughness, texels=roughness.texels**2)
    return float(roughness) ** 2  # type: ignore[arg-type]


def clear_coat(index: float) -> Medium:
    """The medium of a coat of an index."""
    return CLEAR_COAT if index == 1.5 else Medium("clear coat", ConstantIndex(max(index, 1.0)))


def metallic_roughness(
    paint: Paint, metallic: Level, alpha: Level, *, index: float = 1.5
) -> Scattering:
    """A plastic, a metal, or both side by side.

    The dielectric part is a matt surface of the colour under a coat; the metal is a mirror of the
    colour, of the mean colour where that is a picture.

    Source: the metallic-roughness material of glTF 2.0, section 3.9.2.
    """
    metal = Mirror(reflectance_of_rgb(paint.mean()), roughness=alpha)
    if isinstance(metallic, (int, float)) and metallic >= 1.0:
        return metal
    reflectance, texture = paint.reflectance()
    # An index of 1 is glTF's way to switch the coat off.
    coated: Scattering = (
        Diffuse(reflectance, texture)
        if index <= 1.0
        else Coated(reflectance, texture, index=clear_coat(index), roughness=alpha)
    )
    if isinstance(metallic, (int, float)) and metallic <= 0.0:
        return coated
    return Mix(coated, metal, metallic)


def glass_of(index: float, alpha: Level) -> Dielectric:
    """A clear body of one index."""
    return Dielectric(Medium("clear body", ConstantIndex(max(index, 1.0))), roughness=alpha)
