"""Materials, textures and lights of glTF files."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from isetcl.scene.assets import Assets, Picture
from isetcl.scene.colour import radiance_of_rgb, reflectance_of_rgb
from isetcl.scene.light import DistantLight, Light, PointLight, SpotLight
from isetcl.scene.mesh import Mesh
from isetcl.scene.specular import Level, Mirror
from isetcl.scene.surface import (
    Paint,
    Placement,
    Surface,
    glass_of,
    level,
    metallic_roughness,
    plain,
    squared,
)

if TYPE_CHECKING:
    from isetcl.scene.gltf import Document

Json = dict[str, Any]

KNOWN_OF_MATERIALS = {
    "EXT_texture_webp",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_texture_transform",
}
_CLAMP, _MIRROR, _REPEAT = 33071, 33648, 10497
_DARK, _BRIGHT = 0.04, 0.2


class Looks:
    """The looks of a document, made once each."""

    def __init__(self, document: Document, assets: Assets, luminance_of_white_cd_m2: float) -> None:
        self.coloured: dict[tuple[int, int], tuple[Surface, Mesh]] = {}
        self._document = document
        self._assets = assets
        self._white = luminance_of_white_cd_m2
        self._made: dict[int | None, Surface] = {}

    def _material(self, index: int | None) -> Json:
        return {} if index is None else self._document.item("materials", index)

    def surface(self, index: int | None) -> tuple[Surface, bool]:
        """The look of a material, and whether vertex colours may be its picture."""
        material = self._material(index)
        if index not in self._made:
            # Nothing is stated of a mesh without a material: matt grey, as in other formats.
            made = plain() if index is None else self._surface(material, None)
            self._made[index] = made
        return self._made[index], _base_texture(material) is None

    def with_picture(self, index: int | None, texels: np.ndarray) -> Surface:
        """The look of a material with vertex colours as the picture of its base colour."""
        if index is None:
            return plain(Paint(picture=texels, placement=Placement("clamp")))
        return self._surface(self._material(index), texels)

    def _surface(self, material: Json, baked: np.ndarray | None) -> Surface:
        base = _base(material)
        name = str(material.get("name", "without a name"))
        self._note(material, name)
        info = _base_texture(material)
        picture, placement = self._texture(info, name)
        colour = None if picture is None else picture.colour()
        if baked is not None:
            colour, placement = baked, Placement("clamp")
        red, green, blue = (min(max(float(x), 0.0), 1.0) for x in base[:3])
        paint = Paint((red, green, blue), colour, placement)
        opacity = self._opacity(material, base[3], picture, placement)
        emission = self._emission(material, name).emission(self._white)
        extensions = material.get("extensions", {})
        if "KHR_materials_unlit" in extensions:
            unlit = paint.emission(self._white)
            if unlit is not None:
                return Surface(unlit, None, opacity)
        if "KHR_materials_pbrSpecularGlossiness" in extensions:
            old = extensions["KHR_materials_pbrSpecularGlossiness"]
            return Surface(_specular_glossiness(paint, old), emission, opacity)
        return self._metallic(material, name, paint, emission, opacity)

    def _metallic(
        self, material: Json, name: str, paint: Paint, emission: Any, opacity: Level
    ) -> Surface:
        """A look with the metallic-roughness model."""
        pbr = material.get("pbrMetallicRoughness", {})
        extensions = material.get("extensions", {})
        both, place = self._texture(pbr.get("metallicRoughnessTexture"), name)
        # Roughness is the green channel, metallic the blue one; both are stored linear.
        rough = level(
            float(pbr.get("roughnessFactor", 1.0)), None if both is None else both.channel(1), place
        )
        metallic = level(
            float(pbr.get("metallicFactor", 1.0)), None if both is None else both.channel(2), place
        )
        if paint.picture is not None and metallic != 0.0:
            self._assets.note("pictures on metals are replaced by their mean colour", name)
        index = float(extensions.get("KHR_materials_ior", {}).get("ior", 1.5))
        passing = extensions.get("KHR_materials_transmission", {})
        share = min(max(float(passing.get("transmissionFactor", 0.0)), 0.0), 1.0)
        if share > 0.0:
            if "transmissionTexture" in passing:
                self._assets.note("transmission textures are left out", name)
            volume = extensions.get("KHR_materials_volume", {})
            if float(volume.get("thicknessFactor", 0.0)) > 0.0:
                self._assets.note("glass has no colour of its own", name)
                return Surface(glass_of(index, squared(rough)), emission, opacity)
            self._assets.note("thin glass is shown as a surface with holes", name)
            opacity = opacity * (1.0 - share) if isinstance(opacity, (int, float)) else opacity
        mixed = metallic_roughness(paint, metallic, squared(rough), index=index)
        return Surface(mixed, emission, opacity)

    def _note(self, material: Json, name: str) -> None:
        """Note what a material asks for in vain."""
        for key in ("normalTexture", "occlusionTexture"):
            if key in material:
                self._assets.note(f"{key} is left out", name)

    def _opacity(
        self, material: Json, alpha: float, picture: Picture | None, placement: Placement
    ) -> Level:
        mode = material.get("alphaMode", "OPAQUE")
        if mode == "OPAQUE":
            return 1.0
        texels = picture.channel(3) if picture is not None and picture.has_alpha else None
        if mode == "MASK":
            cutoff = float(material.get("alphaCutoff", 0.5))
            if texels is None:
                return 1.0 if alpha >= cutoff else 0.0
            return level(1.0, (texels * alpha >= cutoff).astype(np.float32), placement)
        return level(alpha, texels, placement)

    def _emission(self, material: Json, name: str) -> Paint:
        """What a material sends out, 1 for white."""
        strength = (
            material.get("extensions", {})
            .get("KHR_materials_emissive_strength", {})
            .get("emissiveStrength", 1.0)
        )
        factor = [
            max(float(x), 0.0) * float(strength)
            for x in material.get("emissiveFactor", (0.0, 0.0, 0.0))
        ]
        if max(factor) <= 0.0:
            return Paint((0.0, 0.0, 0.0))
        picture, placement = self._texture(material.get("emissiveTexture"), name)
        colour = None if picture is None else picture.colour()
        return Paint((factor[0], factor[1], factor[2]), colour, placement)

    def _texture(self, info: Json | None, name: str) -> tuple[Picture | None, Placement]:
        """A picture and where it lies."""
        if info is None:
            return None, Placement()
        transform = info.get("extensions", {}).get("KHR_texture_transform", {})
        if transform.get("texCoord", info.get("texCoord", 0)) != 0:
            self._assets.note("second texture coordinates are left out, the first are used", name)
        if transform.get("rotation", 0.0):
            self._assets.note("rotations of textures are left out", name)
        (su, sv), (ou, ov) = transform.get("scale", (1.0, 1.0)), transform.get("offset", (0.0, 0.0))
        texture = self._document.item("textures", info["index"])
        sampler: Json = {}
        if "sampler" in texture:
            sampler = self._document.item("samplers", texture["sampler"])
        wraps = [sampler.get(key, _REPEAT) for key in ("wrapS", "wrapT")]
        mirrored = _MIRROR in wraps
        wrap = "clamp" if wraps == [_CLAMP, _CLAMP] else "repeat"
        # glTF transforms its own v, which runs down: 1 - (sv (1 - v) + ov).
        offset = (float(ou), 1.0 - float(sv) - float(ov))
        placement = Placement(wrap, (float(su), float(sv)), offset, mirrored)
        return self._document.picture(info["index"]), placement

    def lights(self, node: Json, matrix: np.ndarray) -> list[Light]:
        """The light of a node (KHR_lights_punctual): candela and lux of the colour."""
        reference = node.get("extensions", {}).get("KHR_lights_punctual")
        if reference is None:
            return []
        defined = self._document.json["extensions"]["KHR_lights_punctual"]["lights"]
        light = defined[reference["light"]]
        intensity = float(light.get("intensity", 1.0))
        colour = [min(max(float(x), 0.0), 1.0) for x in light.get("color", (1.0, 1.0, 1.0))]
        if intensity <= 0.0 or max(colour) <= 0.0:
            return []
        if "range" in light:
            self._assets.note("ranges of lights are left out", str(light.get("name", "")))
        # White of one candela (lux) has the spectrum of white of one cd/m^2.
        spectrum = radiance_of_rgb(colour, intensity)
        x, y, z = (float(p) for p in matrix[:3, 3])
        dx, dy, dz = (float(p) for p in matrix[:3, :3] @ [0.0, 0.0, -1.0])
        if light["type"] == "directional":
            return [DistantLight((-dx, -dy, -dz), spectrum)]
        if light["type"] == "point":
            return [PointLight((x, y, z), spectrum)]
        spot = light.get("spot", {})
        outer = math.degrees(float(spot.get("outerConeAngle", math.pi / 4.0)))
        inner = math.degrees(float(spot.get("innerConeAngle", 0.0)))
        return [
            SpotLight((x, y, z), (dx, dy, dz), spectrum, cone_deg=outer, penumbra_deg=outer - inner)
        ]


def _base(material: Json) -> list[float]:
    """Base colour and alpha of a material."""
    old = material.get("extensions", {}).get("KHR_materials_pbrSpecularGlossiness")
    if old is not None:
        factor = old.get("diffuseFactor", (1.0, 1.0, 1.0, 1.0))
    else:
        factor = material.get("pbrMetallicRoughness", {}).get("baseColorFactor", (1.0,) * 4)
    red, green, blue, alpha = (float(x) for x in factor)
    return [red, green, blue, alpha]


def _base_texture(material: Json) -> Json | None:
    old = material.get("extensions", {}).get("KHR_materials_pbrSpecularGlossiness")
    if old is not None:
        return old.get("diffuseTexture")
    return material.get("pbrMetallicRoughness", {}).get("baseColorTexture")


def _specular_glossiness(paint: Paint, old: Json) -> Any:
    """A plastic, or a metal where the matt colour is black and the highlight is bright."""
    rough = 1.0 - min(max(float(old.get("glossinessFactor", 1.0)), 0.0), 1.0)
    specular = [min(max(float(x), 0.0), 1.0) for x in old.get("specularFactor", (1.0, 1.0, 1.0))]
    if max(paint.mean()) < _DARK and max(specular) > _BRIGHT:
        return Mirror(reflectance_of_rgb(specular), roughness=squared(rough))
    return metallic_roughness(paint, 0.0, squared(rough))
