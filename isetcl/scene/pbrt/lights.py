"""PBRT's lights as those of isetcl."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.scene.display import display_primaries
from isetcl.scene.light import DistantLight, Environment, Light, PointLight, SpotLight
from isetcl.scene.material import Emission
from isetcl.scene.pbrt.geometry import SPHERE_AXES, triple
from isetcl.scene.pbrt.parameters import Parameters
from isetcl.scene.pbrt.pictures import latitude_longitude, octahedral_directions
from isetcl.scene.pbrt.places import Notes, located, wrong
from isetcl.scene.pbrt.spectra import SPECTRAL, SpectrumReader, common_grid
from isetcl.scene.pbrt.textures import TextureReader
from isetcl.scene.pbrt.transforms import points_through, similarity_scale
from isetcl.scene.texture import Image
from isetcl.spectrum import Spectrum

LEFT_OUT = "lights left out"
APPROXIMATED = "lights approximated"
_QUIET = ("samples", "nsamples", "power", "illuminance", "portal", "imageFile", "preservespectra")

# Luminance of linear sRGB primaries. Source: IEC 61966-2-1.
_LUMINANCE_OF_RGB = np.array([0.2126, 0.7152, 0.0722])


@dataclass
class Sky:
    """Light from infinitely far away, gathered from the lights that send it."""

    even: list[Spectrum] = field(default_factory=list)
    map: Environment | None = None

    def background(self) -> Spectrum | Environment | None:
        """What a scene has behind it."""
        even = _added(self.even) if self.even else None
        if self.map is None or even is None:
            return self.map if even is None else even
        assert self.map.texture is not None
        texels = self.map.texture.texels
        ones = np.ones((*texels.shape[:2], 1), dtype=np.float32)
        stacked = np.concatenate([texels.reshape(*texels.shape[:2], -1), ones], axis=-1)
        image = Image(stacked, self.map.texture.name, self.map.texture.wrap)
        return Environment((*self.map.spectra(), even), image, self.map.rotation)


class LightReader:
    """Makes lights of LightSource and AreaLightSource directives."""

    def __init__(
        self, spectra: SpectrumReader, textures: TextureReader, notes: Notes, version: int
    ) -> None:
        self._spectra = spectra
        self._textures = textures
        self._notes = notes
        self._version = version
        self._emissions: dict[int, Emission] = {}
        self.sky = Sky()

    def read(
        self, kind: str, parameters: Parameters, matrix: np.ndarray, unit_m: float
    ) -> list[Light]:
        """The lights of a LightSource (light from afar goes to `sky`).

        Parameters
        ----------
        kind, parameters
            Of the directive.
        matrix
            From the light's coordinates to the eye's.
        unit_m
            What a unit of the file is in metres: intensities of points are per steradian, so that
            irradiances stay when lengths change.
        """
        with located(parameters.place):
            if kind == "infinite" or kind == "exinfinite":
                self._infinite(parameters, matrix)
                return []
            if kind in ("point", "goniometric"):
                return [self._point(kind, parameters, matrix, unit_m)]
            if kind == "spot":
                return [self._spot(parameters, matrix, unit_m)]
            if kind == "distant":
                return [self._distant(parameters, matrix)]
        self._notes.add(LEFT_OUT, kind, parameters.place)
        parameters.ignore(p.name for p in parameters.unused())
        return []

    def _scaled(self, parameters: Parameters, name: str, factor: float = 1.0) -> Spectrum:
        """A light's spectrum times its scale and a factor."""
        spectrum = self._spectra.light(parameters, name)
        if parameters.type_of("scale") in SPECTRAL:
            scale = parameters.get("scale", *SPECTRAL)
            assert scale is not None
            if scale.type == "rgb" and len(scale.values) == 3 and len(set(scale.values)) == 1:
                return spectrum.scaled(float(scale.values[0]) * factor)
            colour = self._spectra.unbounded(scale)
            grid = common_grid((spectrum, colour))
            return Spectrum(grid, spectrum.at(grid) * colour.at(grid) * factor, spectrum.name)
        return _scaled(spectrum, parameters.number("scale", 1.0) * factor)

    def _power(self, parameters: Parameters, per_unit: float) -> float:
        """What version 4's "power" (lumen) adds to the scale; per_unit is what scale 1 gives."""
        power = parameters.number("power", -1.0)
        if power <= 0:
            return 1.0
        if self._version < 4:
            # A white of scale 1 has the luminance of a flat spectrum there.
            per_unit *= self._spectra.white_cd_m2()
        if not per_unit > 0:
            raise InvalidInputError("power needs a light that shines on something")
        return power / per_unit

    def _point(
        self, kind: str, parameters: Parameters, matrix: np.ndarray, unit_m: float
    ) -> PointLight:
        if kind == "goniometric":
            self._notes.add(
                APPROXIMATED, "goniometric light shining alike all around", parameters.place
            )
            parameters.ignore(("filename", "mapname"))
        factor = self._power(parameters, 4.0 * math.pi) * unit_m**2
        intensity = self._scaled(parameters, "I", factor)
        place = points_through(matrix, parameters.vector("from", (0.0, 0.0, 0.0))[None])[0]
        return PointLight(triple(place), intensity)

    def _spot(self, parameters: Parameters, matrix: np.ndarray, unit_m: float) -> SpotLight:
        cone = parameters.number("coneangle", 30.0)
        penumbra = parameters.number("conedeltaangle", 5.0)
        if self._version < 4:
            self._notes.add(
                APPROXIMATED, "the edge of spot lights falls as in version 4", parameters.place
            )
        inner, outer = (math.cos(math.radians(a)) for a in (cone - penumbra, cone))
        lumen = 2.0 * math.pi * ((1.0 - inner) + (inner - outer) / 2.0)
        intensity = self._scaled(parameters, "I", self._power(parameters, lumen) * unit_m**2)
        start = parameters.vector("from", (0.0, 0.0, 0.0))
        end = parameters.vector("to", (0.0, 0.0, 1.0))
        place = points_through(matrix, start[None])[0]
        direction = matrix[:3, :3] @ (end - start)
        return SpotLight(triple(place), triple(direction), intensity, cone, penumbra)

    def _distant(self, parameters: Parameters, matrix: np.ndarray) -> DistantLight:
        lux = parameters.number("illuminance", -1.0)
        factor = 1.0 if lux <= 0 else lux / self._spectra.white_cd_m2()
        irradiance = self._scaled(parameters, "L", factor)
        start = parameters.vector("from", (0.0, 0.0, 0.0))
        end = parameters.vector("to", (0.0, 0.0, 1.0))
        towards = matrix[:3, :3] @ (start - end)
        length = float(np.linalg.norm(towards))
        exact = np.allclose(matrix, np.eye(4), atol=0) and not end.any()
        if not exact and 0 < length < math.inf:
            towards = towards / length
        return DistantLight(triple(towards), irradiance)

    def _infinite(self, parameters: Parameters, matrix: np.ndarray) -> None:
        if "portal" in parameters:
            self._notes.add("portals of lights left out", "infinite", parameters.place)
            parameters.ignore(("portal",))
        octahedral = "filename" in parameters
        name = "filename" if octahedral else "mapname"
        if name not in parameters or not parameters.text(name):
            lux = parameters.number("illuminance", -1.0)
            factor = 1.0 if lux <= 0 else lux / math.pi / self._spectra.white_cd_m2()
            self.sky.even.append(self._scaled(parameters, "L", factor))
            return
        texels = self._textures.picture(parameters, name)
        if self.sky.map is not None:
            self._notes.add(LEFT_OUT, "infinite light beside another with a map", parameters.place)
            parameters.ignore(("L", "scale", "illuminance"))
            return
        tint = self._tint(parameters)
        if octahedral:
            tint = tint * self._illuminance_factor(parameters, texels)
            if texels.shape[0] != texels.shape[1]:
                raise wrong(
                    parameters.place_of(name),
                    "a map of an infinite light must be an equal-area square in version 4, got "
                    f"{texels.shape[1]} by {texels.shape[0]}; convert it with imgtool makeequiarea",
                )
            texels = latitude_longitude(texels)
        self.sky.map = self._environment(parameters, name, texels, tint, matrix)

    def _environment(
        self,
        parameters: Parameters,
        name: str,
        texels: np.ndarray,
        factor: np.ndarray,
        matrix: np.ndarray,
    ) -> Environment:
        white = self._spectra.white_cd_m2()
        primaries = display_primaries(white)
        if texels.ndim == 2:
            texels = np.repeat(texels[..., None], 3, axis=-1)
        linear = matrix[:3, :3]
        scale = similarity_scale(matrix)
        if scale is None:
            self._notes.add(
                APPROXIMATED, "a stretched infinite light, turned only", parameters.place
            )
            u, _, vt = np.linalg.svd(linear)
            turned = u @ vt
        else:
            turned = linear / scale
        image = Image(texels, parameters.text(name))
        spectra = tuple(p.scaled(float(f)) for p, f in zip(primaries, factor, strict=True))
        return Environment(spectra, image, turned @ SPHERE_AXES.T)

    def _tint(self, parameters: Parameters) -> np.ndarray:
        """Factors of red, green and blue that L and scale put on a map."""
        factor = np.ones(3)
        for name in ("L", "scale"):
            kind = parameters.type_of(name)
            if kind in ("float", "integer"):
                factor = factor * parameters.number(name, 1.0)
            elif kind == "rgb":
                values = parameters.numbers(name, "rgb")
                if values is None or len(values) != 3:
                    raise wrong(parameters.place_of(name), f"rgb {name!r} must be three numbers")
                factor = factor * values
            elif kind is not None:
                spectrum = self._spectra.light(parameters, name)
                white = self._spectra.white_cd_m2()
                factor = factor * (spectrum.luminance_cd_m2() / white)
                self._notes.add(
                    APPROXIMATED, f"{name} of a light with a map as grey", parameters.place
                )
        if not np.isfinite(factor).all() or np.any(factor < 0):
            raise InvalidInputError("L and scale of a light must be finite and >= 0")
        return factor

    def _illuminance_factor(self, parameters: Parameters, texels: np.ndarray) -> float:
        """What version 4's "illuminance" (lux on an upward patch of z) makes of the scale."""
        lux = parameters.number("illuminance", -1.0)
        if lux <= 0:
            return 1.0
        n = texels.shape[0]
        up = np.maximum(octahedral_directions(n)[..., 2], 0.0)
        luminance = texels if texels.ndim == 2 else texels @ _LUMINANCE_OF_RGB
        present = float((luminance * up).sum()) * 4.0 * math.pi / n**2
        if not present > 0:
            raise InvalidInputError("illuminance needs a map with light in its upper half")
        return lux / present / self._spectra.white_cd_m2()

    def emission(self, parameters: Parameters, kind: str, area: float) -> Emission | None:
        """What an AreaLightSource makes a shape of an area send out."""
        if kind not in ("diffuse", "area"):
            self._notes.add(LEFT_OUT, f"area light {kind!r}", parameters.place)
            return None
        with located(parameters.place):
            parameters.is_needed = True
            key = id(parameters)
            if "power" in parameters or key not in self._emissions:
                self._emissions[key] = self._emission(parameters, area)
            return self._emissions[key]

    def _emission(self, parameters: Parameters, area: float) -> Emission:
        both = parameters.flag("twosided", False)
        sides = 2.0 if both else 1.0
        parameters.ignore(_QUIET)
        name = "filename"
        if name not in parameters:
            factor = self._power(parameters, sides * area * math.pi)
            spectrum = self._scaled(parameters, "L", factor)
            return Emission(spectrum, sides="both" if both else "front")
        if "L" in parameters:
            raise InvalidInputError("an area light must have L or filename, not both")
        texels = self._textures.picture(parameters, name)
        if texels.ndim == 2:
            texels = np.repeat(texels[..., None], 3, axis=-1)
        mean = float((texels.mean(axis=(0, 1)) * _LUMINANCE_OF_RGB).sum())
        factor = self._power(parameters, sides * area * math.pi * mean)
        factor *= parameters.number("scale", 1.0)
        primaries = tuple(
            _scaled(p, factor) if factor != 1.0 else p
            for p in display_primaries(self._spectra.white_cd_m2())
        )
        if self._version >= 4 and factor > 0 and math.isfinite(factor):
            primaries = display_primaries(factor)
        image = Image(texels, parameters.text(name))
        return Emission(primaries, image, "both" if both else "front")


def _scaled(spectrum: Spectrum, factor: float) -> Spectrum:
    if factor == 1.0:
        return spectrum
    if not (math.isfinite(factor) and factor >= 0):
        raise InvalidInputError(f"the scale of a light must be finite and >= 0, got {factor:g}")
    with np.errstate(over="ignore"):
        return spectrum.scaled(factor)


def _added(spectra: list[Spectrum]) -> Spectrum:
    if len(spectra) == 1:
        return spectra[0]
    grid = common_grid(tuple(spectra))
    return Spectrum(grid, np.asarray(sum(s.at(grid) for s in spectra)), "infinite lights")
