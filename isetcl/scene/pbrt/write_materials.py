"""Materials and textures of isetcl as PBRT 4 text."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from isetcl.eye.media import ConstantIndex, Medium
from isetcl.scene.colour import reflectance_primaries
from isetcl.scene.material import Coated, Diffuse, Mix, Scattering, TwoSided
from isetcl.scene.pbrt.pictures import write_pfm
from isetcl.scene.pbrt.places import Notes
from isetcl.scene.pbrt.tabulated import tabulated
from isetcl.scene.pbrt.text import number, numbers, spectral, spectrum, texture
from isetcl.scene.specular import Conductor, Dielectric, Mirror
from isetcl.scene.texture import TEXTURES, Checkerboard, Grid, Image, Texture
from isetcl.spectrum import Spectrum

Level = float | Texture
RASTER = 2048


class MaterialWriter:
    """Collects named textures and materials, each written once.

    Parameters
    ----------
    folder, stem
        Where pictures go, and how their names begin.
    notes
        Takes what PBRT cannot say.
    """

    def __init__(self, folder: Path, stem: str, notes: Notes) -> None:
        self._folder = folder
        self._stem = stem
        self._notes = notes
        self._names: dict[object, str] = {}
        self._pictures = 0
        self.lines: list[str] = []

    def _new(self, kind: str) -> str:
        return f"{kind}-{len(self._names)}"

    def material(self, material: Scattering) -> str:
        """The name of a material, which is defined by then."""
        key = material.digest()
        if key not in self._names:
            body = self._body(material)
            self._names[key] = self._new("material")
            name = self._names[key]
            self.lines.append(f'MakeNamedMaterial "{name}"\n  ' + "\n  ".join(body))
        return self._names[key]

    def _body(self, material: Scattering) -> list[str]:
        if isinstance(material, Diffuse):
            return self._diffuse(material)
        if isinstance(material, Coated):
            return [
                '"string type" "coateddiffuse"',
                self.reflectance(material.spectra(), material.texture),
                self._index(material.index),
                *self._roughness(material.roughness),
            ]
        if isinstance(material, Mirror):
            self._notes.add("mirrors written as metals of that reflectance", "Mirror")
            return [
                '"string type" "conductor"',
                spectral("reflectance", material.reflectance),
                *self._roughness(material.roughness),
            ]
        if isinstance(material, Conductor):
            index = material.index
            return [
                '"string type" "conductor"',
                spectrum("eta", index.wavelengths_nm, index.n),
                spectrum("k", index.wavelengths_nm, index.k),
                *self._roughness(material.roughness),
            ]
        if isinstance(material, Dielectric):
            roughness = self._roughness(material.roughness)
            return ['"string type" "dielectric"', self._index(material.index), *roughness]
        if isinstance(material, Mix):
            first = self.material(material.first)  # type: ignore[arg-type]
            second = self.material(material.second)  # type: ignore[arg-type]
            names = f'"string materials" [ "{first}" "{second}" ]'
            return ['"string type" "mix"', names, self.level("amount", material.weight)]
        assert isinstance(material, TwoSided)
        self._notes.add("materials whose sides differ, their front on both sides", "TwoSided")
        return self._body(material.front)  # type: ignore[arg-type]

    def _diffuse(self, material: Diffuse) -> list[str]:
        reflectance = self.reflectance(material.spectra(), material.texture)
        if material.transmittance is None:
            return ['"string type" "diffuse"', reflectance]
        return [
            '"string type" "diffusetransmission"',
            reflectance,
            spectral("transmittance", material.transmittance),
        ]

    def _index(self, medium: Medium) -> str:
        if isinstance(medium.dispersion, ConstantIndex):
            return number("eta", medium.dispersion.n)
        return spectrum("eta", *tabulated(medium))

    def _roughness(self, roughness: Level) -> list[str]:
        return ['"bool remaproughness" false', self.level("roughness", roughness)]

    def level(self, name: str, value: Level) -> str:
        """A float parameter, or a float texture."""
        if not isinstance(value, TEXTURES):
            return number(name, value)
        return texture(name, self.grey(value))

    def grey(self, pattern: Texture) -> str:
        """The name of a grey texture."""
        return self._named("grey", pattern.digest(), lambda name: self._grey(name, pattern))

    def _named(self, kind: str, key: str, define: Callable[[str], str]) -> str:
        whole = (kind, key)
        if whole not in self._names:
            name = self._new(kind)
            self._names[whole] = name
            self.lines.append(define(name))
        return self._names[whole]

    def _grey(self, name: str, pattern: Texture) -> str:
        head = f'Texture "{name}" "float"'
        if isinstance(pattern, Checkerboard):
            return "\n  ".join(
                [
                    f'{head} "checkerboard"',
                    number("uscale", 2.0 * pattern.periods_u),
                    number("vscale", 2.0 * pattern.periods_v),
                    number("tex1", pattern.bright),
                    number("tex2", pattern.dark),
                ]
            )
        return f'{head} "imagemap"\n  ' + "\n  ".join(self._image(pattern))

    def _image(self, pattern: Texture) -> list[str]:
        image = self._raster(pattern) if isinstance(pattern, (Grid, Checkerboard)) else pattern
        return [
            f'"string filename" "{self.picture(image.texels)}"',
            f'"string wrap" "{image.wrap}"',
            number("uscale", image.repeats[0]),
            number("vscale", image.repeats[1]),
            number("udelta", image.offset[0]),
            number("vdelta", image.offset[1]),
        ]

    def _raster(self, pattern: Grid | Checkerboard) -> Image:
        kind = type(pattern).__name__
        self._notes.add("patterns written as pictures, their edges blurred", kind)
        centres = (np.arange(RASTER) + 0.5) / RASTER
        return Image(pattern.weights(*np.meshgrid(centres, 1.0 - centres))[..., 0])

    def picture(self, texels: np.ndarray) -> str:
        """The name of a file that holds texels as they are."""
        name = f"{self._stem}-{self._pictures}.pfm"
        self._pictures += 1
        write_pfm(self._folder / name, texels)
        return name

    def reflectance(
        self, spectra: tuple[Spectrum, ...], pattern: Texture | None, name: str = "reflectance"
    ) -> str:
        """A parameter of a reflectance: a spectrum, or a spectrum texture."""
        if pattern is None:
            return spectral(name, spectra[0])
        return texture(name, self._coloured(spectra, pattern))

    def _coloured(self, spectra: tuple[Spectrum, ...], pattern: Texture) -> str:
        key = " ".join([pattern.digest(), *(s.digest() for s in spectra)])
        if isinstance(pattern, Image) and self._is_rgb(spectra, pattern):
            body = "\n  ".join(self._image(pattern)) if ("rgb", key) not in self._names else ""
            return self._named(
                "rgb", key, lambda name: f'Texture "{name}" "spectrum" "imagemap"\n  {body}'
            )
        channels = _channels(pattern)
        # A mix halves what it adds: what is mixed deepest is written larger.
        factors = [2.0 ** min(len(channels) - 1, len(channels) - i) for i in range(len(channels))]
        names = [
            self._product(s, channel, factor)
            for s, channel, factor in zip(spectra, channels, factors, strict=True)
        ]
        name = names[0]
        for other in names[1:]:
            name = self._half(name, other)
        return name

    def _is_rgb(self, spectra: tuple[Spectrum, ...], pattern: Image) -> bool:
        """Whether the channels stand for the spectra that RGB pictures are read with."""
        if pattern.channels != 3 or len(spectra) != 3:
            return False
        return all(
            np.array_equal(a.wavelengths_nm, b.wavelengths_nm)
            and np.array_equal(a.values, b.values)
            for a, b in zip(spectra, reflectance_primaries(), strict=True)
        )

    def _product(self, of: Spectrum, pattern: Texture, factor: float) -> str:
        """A spectrum times a grey texture times a factor."""
        constant = self._named(
            "spectrum",
            f"{of.digest()} {factor}",
            lambda name: (
                f'Texture "{name}" "spectrum" "constant"\n  '
                + spectral("value", of if factor == 1.0 else of.scaled(factor))
            ),
        )
        grey = self.grey(pattern)
        return self._named(
            "product",
            f"{constant} {grey}",
            lambda name: (
                f'Texture "{name}" "spectrum" "scale"\n  '
                f'"texture tex" "{constant}" "texture scale" "{grey}"'
            ),
        )

    def _half(self, first: str, second: str) -> str:
        return self._named(
            "sum",
            f"{first} {second}",
            lambda name: (
                f'Texture "{name}" "spectrum" "mix"\n  '
                f'"texture tex1" "{first}" "texture tex2" "{second}" "float amount" 0.5'
            ),
        )


def _channels(pattern: Texture) -> list[Texture]:
    if not isinstance(pattern, Image) or pattern.channels == 1:
        return [pattern]
    return [
        Image(pattern.texels[..., i], pattern.name, pattern.wrap, pattern.repeats, pattern.offset)
        for i in range(pattern.channels)
    ]


__all__ = ["MaterialWriter", "numbers"]
