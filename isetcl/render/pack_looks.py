"""The records of what surfaces look like: spectra, textures and materials."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from isetcl.device.layout import Member, Precision, Struct, real_dtype
from isetcl.eye.media import Medium
from isetcl.retina.bands import Band
from isetcl.scene.light_field import LightField
from isetcl.scene.material import Coated, Diffuse, Material, Mix, TwoSided
from isetcl.scene.specular import Conductor, Dielectric, Level, Mirror
from isetcl.scene.texture import TEXTURES, Checkerboard, Grid, Image, Texture
from isetcl.spectrum import Spectrum


class TextureKind(IntEnum):
    """What a texture is. The same numbers are compiled into the kernels."""

    CHECKERBOARD = 0
    GRID = 1
    IMAGE = 2
    LIGHT_FIELD = 3


class SubstanceKind(IntEnum):
    """What a material is. The same numbers are compiled into the kernels."""

    DIFFUSE = 0
    MIRROR = 1
    CONDUCTOR = 2
    DIELECTRIC = 3
    COATED = 4
    MIX = 5
    TWO_SIDED = 6


MOST_LEVELS = 16
"""Levels of a picture, each half as wide as the one before."""

SMALLEST_LEVEL = 8
"""Texels across the smallest level."""

TEXTURE = Struct(
    "texture_t",
    (
        Member("kind", "int"),
        Member("first", "int"),
        Member("channels", "int"),
        Member("width", "int"),
        Member("height", "int"),
        Member("repeats", "int"),
        Member("views_x", "int"),
        Member("views_y", "int"),
        Member("periods_u"),
        Member("periods_v"),
        Member("offset_u"),
        Member("offset_v"),
        Member("bright"),
        Member("dark"),
        Member("line_width"),
        Member("levels", "int"),
        Member("level_first", "int", length=MOST_LEVELS),
    ),
)
SUBSTANCE = Struct(
    "substance_t",
    (
        Member("kind", "int"),
        Member("is_polished", "int"),
        Member("row", "int"),
        Member("other_row", "int"),
        Member("index_row", "int"),
        Member("texture", "int"),
        Member("roughness_texture", "int"),
        Member("weight_texture", "int"),
        Member("first", "int"),
        Member("second", "int"),
        Member("roughness"),
        Member("weight"),
    ),
)


def inner_reflectance(index: np.ndarray) -> np.ndarray:
    """Share of diffuse light under a surface of an index that is sent back, shape of the input.

    The integral of 2 cos F over the cosine, by Gauss-Legendre quadrature within the cone that
    escapes; everything outside it is reflected.
    """
    nodes, weights = np.polynomial.legendre.leggauss(64)
    index = np.asarray(index, dtype=np.float64)[..., None]
    # Cosines from the critical angle (0) to the normal; squared spacing tames the root at the edge.
    low = np.sqrt(np.maximum(1.0 - 1.0 / index**2, 0.0))
    t = 0.5 * (nodes + 1.0)
    cosine = low + (1.0 - low) * t**2
    step = (1.0 - low) * 2.0 * t * 0.5 * weights
    out = np.sqrt(np.maximum(1.0 - index**2 * (1.0 - cosine**2), 0.0))
    along = (cosine - index * out) / (cosine + index * out)
    across = (index * cosine - out) / (index * cosine + out)
    fresnel = 0.5 * (along**2 + across**2)
    return np.sum(2.0 * cosine * fresnel * step, axis=-1) + low[..., 0] ** 2


def _planes(image: Image) -> np.ndarray:
    """Texels, one channel behind the other."""
    return image.texels.reshape(*image.shape, image.channels).transpose(2, 0, 1)


def _levels(image: Image) -> list[Image]:
    """A picture and its averages, down to about SMALLEST_LEVEL texels across."""
    count = int(np.log2(max(1.0, max(image.shape) / SMALLEST_LEVEL)))
    return [image.halved(times) for times in range(min(count + 1, MOST_LEVELS))]


class Looks:
    """Collects spectra, textures and materials; what is the same is stored once."""

    def __init__(
        self,
        images: dict[str, Image],
        wavelengths_nm: np.ndarray,
        bands: tuple[Band, ...],
        precision: Precision,
    ) -> None:
        self._images = images
        self._wavelengths = wavelengths_nm
        self._bands = np.array([band.wavelength_nm for band in bands])
        self._precision = precision
        self._rows: list[np.ndarray] = []
        self._row_of: dict[str, int] = {}
        self._texels: list[np.ndarray] = []
        self._n_texels = 0
        self._texture_of: dict[str, int] = {}
        self._substance_of: dict[str, int] = {}
        self.substances: list[np.ndarray] = []
        self.textures: list[np.ndarray] = []

    def rows(self, spectra: tuple[Spectrum, ...]) -> int:
        """The first of neighbouring rows that hold spectra."""
        key = " ".join(spectrum.digest() for spectrum in spectra)
        if key not in self._row_of:
            self._row_of[key] = len(self._rows)
            self._rows += [spectrum.at(self._wavelengths) for spectrum in spectra]
        return self._row_of[key]

    def values(self, *rows: np.ndarray) -> int:
        """The first of neighbouring rows that hold values, by wavelength or by band."""
        self._rows += [np.asarray(row, dtype=np.float64) for row in rows]
        return len(self._rows) - len(rows)

    def table(self, values: np.ndarray) -> int:
        """Where numbers lie among the texels."""
        self._texels.append(np.ascontiguousarray(values, dtype=np.float32).ravel())
        self._n_texels += values.size
        return self._n_texels - values.size

    def level(self, level: Level) -> tuple[float, int]:
        """A number and -1, or 0 and the number of a texture."""
        if isinstance(level, TEXTURES):
            return 0.0, self.texture(level)
        return float(level), -1

    def light_field(self, field: LightField, edge_u_m: float, edge_v_m: float) -> int:
        """The number of a light field on a quad with edges of given lengths.

        Its slopes are in units of the outermost; the kernels measure directions along u and v in
        edges.
        """
        record = np.zeros(1, dtype=TEXTURE.dtype(self._precision))
        record["kind"], record["channels"] = TextureKind.LIGHT_FIELD, field.channels
        record["height"], record["width"] = field.shape
        record["views_y"], record["views_x"] = field.views
        record["periods_u"] = edge_u_m / field.slopes[0]
        record["periods_v"] = edge_v_m / field.slopes[1]
        texels = field.texels.reshape(*field.shape, *field.views, field.channels)
        record["first"] = self.table(np.moveaxis(texels, 4, 0))
        self.textures.append(record)
        return len(self.textures) - 1

    def texture(self, texture: Texture | None) -> int:
        """The number of a texture; -1 for none."""
        if texture is None:
            return -1
        key = texture.digest()
        if key not in self._texture_of:
            self._texture_of[key] = len(self.textures)
            self.textures.append(self._texture(self._images.get(key, texture)))
        return self._texture_of[key]

    def _texture(self, texture: Texture) -> np.ndarray:
        record = np.zeros(1, dtype=TEXTURE.dtype(self._precision))
        record["channels"] = 1
        if isinstance(texture, Checkerboard):
            record["kind"] = TextureKind.CHECKERBOARD
            record["periods_u"], record["periods_v"] = 2 * texture.periods_u, 2 * texture.periods_v
            record["bright"], record["dark"] = texture.bright, texture.dark
        elif isinstance(texture, Grid):
            record["kind"] = TextureKind.GRID
            record["periods_u"], record["periods_v"] = texture.periods_u, texture.periods_v
            record["bright"], record["dark"] = texture.line, texture.ground
            record["line_width"] = texture.width
        else:
            record["kind"] = TextureKind.IMAGE
            record["channels"] = texture.channels
            record["height"], record["width"] = texture.shape
            record["repeats"] = texture.wrap == "repeat"
            record["periods_u"], record["periods_v"] = texture.repeats
            record["offset_u"], record["offset_v"] = texture.offset
            firsts = [self.table(_planes(level)) for level in _levels(texture)]
            record["first"], record["levels"] = firsts[0], len(firsts)
            record["level_first"][0, : len(firsts)] = firsts
        return record

    def substance(self, material: Material) -> int:
        """The number of a material that scatters light."""
        key = material.digest()
        if key not in self._substance_of:
            # Parts of a combined material come first.
            self._substance_of[key] = self._add(material)
        return self._substance_of[key]

    def _add(self, material: Material) -> int:
        record = np.zeros(1, dtype=SUBSTANCE.dtype(self._precision))
        for name in ("other_row", "index_row", "texture", "roughness_texture", "weight_texture"):
            record[name] = -1
        if isinstance(material, Mix):
            record["kind"] = SubstanceKind.MIX
            record["first"] = self.substance(material.first)
            record["second"] = self.substance(material.second)
            record["weight"], record["weight_texture"] = self.level(material.weight)
        elif isinstance(material, TwoSided):
            record["kind"] = SubstanceKind.TWO_SIDED
            record["first"] = self.substance(material.front)
            record["second"] = self.substance(material.back)
        else:
            self._scatterer(record, material)
        self.substances.append(record)
        return len(self.substances) - 1

    def _scatterer(self, record: np.ndarray, material: Material) -> None:
        if isinstance(material, Diffuse):
            record["kind"] = SubstanceKind.DIFFUSE
            if material.transmittance is not None:
                record["other_row"] = self.rows((material.transmittance,))
        elif isinstance(material, Mirror):
            record["kind"] = SubstanceKind.MIRROR
        elif isinstance(material, Conductor):
            record["kind"] = SubstanceKind.CONDUCTOR
            record["row"] = self.values(*material.index.at(self._wavelengths))
            record["other_row"] = record["row"] + 1
        elif isinstance(material, Dielectric):
            record["kind"] = SubstanceKind.DIELECTRIC
            record["index_row"] = self._index_rows(material.index)
        elif isinstance(material, Coated):
            record["kind"] = SubstanceKind.COATED
            record["index_row"] = self._index_rows(material.index)
        if isinstance(material, (Diffuse, Coated, Mirror)):
            record["row"] = self.rows(material.spectra())
            record["texture"] = self.texture(material.texture)
        if isinstance(material, (Mirror, Conductor, Dielectric, Coated)):
            record["roughness"], record["roughness_texture"] = self.level(material.roughness)
            record["is_polished"] = isinstance(material.roughness, (int, float)) and (
                material.roughness == 0
            )

    def _index_rows(self, medium: Medium) -> int:
        """Index at the bands' wavelengths, and what diffuse light below it is sent back."""
        index = medium.index(self._bands)
        return self.values(index, inner_reflectance(index))

    def packed_texels(self) -> np.ndarray:
        """All texels and tables, float32."""
        return np.concatenate(self._texels) if self._texels else np.zeros(1, dtype=np.float32)

    def packed_spectra(self, more: int) -> np.ndarray:
        """All rows, (rows, wavelengths + more), the last value repeated."""
        columns = max(len(self._wavelengths), len(self._bands))
        table = np.zeros((max(1, len(self._rows)), columns + more))
        for row, values in zip(table, self._rows, strict=False):
            row[: len(values)] = values
            row[len(values) :] = values[-1]
        return np.ascontiguousarray(table, dtype=real_dtype(self._precision))
