"""PBRT's textures as patterns."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from isetcl.scene.colour import reflectance_primaries
from isetcl.scene.pbrt.files import SceneFiles
from isetcl.scene.pbrt.parameters import Parameters
from isetcl.scene.pbrt.patterns import Pattern, Term, constant
from isetcl.scene.pbrt.pictures import read_picture
from isetcl.scene.pbrt.places import Notes, Place, located, wrong
from isetcl.scene.pbrt.spectra import SPECTRAL, SpectrumReader
from isetcl.scene.texture import Checkerboard, Image
from isetcl.spectrum import Spectrum

_MAPPING = "texture mappings other than uv, read as uv"
_SAMPLING = ("filter", "maxanisotropy", "trilinear", "aamode")


class TextureReader:
    """Keeps the textures that a scene defines, and looks up what parameters mean by them."""

    def __init__(self, files: SceneFiles, spectra: SpectrumReader, notes: Notes) -> None:
        self._files = files
        self._spectra = spectra
        self._notes = notes
        self._grey: dict[str, Pattern] = {}
        self._coloured: dict[str, Pattern] = {}
        self._pictures: dict[tuple[str, str], np.ndarray] = {}

    def define(self, name: str, kind: str, form: str, parameters: Parameters) -> None:
        """Read a Texture directive."""
        if kind not in ("float", "spectrum", "color"):
            raise wrong(parameters.place, f"texture {name!r} must be float or spectrum, got {kind}")
        grey = kind == "float"
        makers = {
            "constant": self._constant,
            "scale": self._scale,
            "mix": self._mix,
            "checkerboard": self._checkerboard,
            "imagemap": self._imagemap,
        }
        with located(parameters.place):
            if form in makers:
                pattern = makers[form](parameters, grey)
            else:
                self._notes.add(
                    "textures left out, their mean 0.5 taken instead", form, parameters.place
                )
                pattern = constant(0.5, parameters.place)
                parameters.ignore(p.name for p in parameters.unused())
        (self._grey if grey else self._coloured)[name] = pattern

    def grey(self, parameters: Parameters, name: str, default: float | None) -> Pattern | None:
        """A grey pattern that a parameter states; a constant one, or None, where it does not."""
        kind = parameters.type_of(name)
        if kind is None:
            return None if default is None else constant(default, parameters.place)
        if kind == "texture":
            return self._named(parameters, name, self._grey)
        if kind in SPECTRAL:
            parameter = parameters.get(name, *SPECTRAL)
            assert parameter is not None
            values = self._spectra.unbounded(parameter).values
            self._notes.add(
                "spectra where a number must be, their mean taken", name, parameter.place
            )
            return constant(float(np.mean(values)), parameter.place)
        return constant(parameters.number(name, 0.0), parameters.place_of(name))

    def coloured(self, parameters: Parameters, name: str, default: float | None) -> Pattern | None:
        """A pattern of reflectances that a parameter states; a constant, or None, without it."""
        kind = parameters.type_of(name)
        if kind is None:
            return None if default is None else _even(default, parameters.place)
        if kind == "texture":
            return self._named(parameters, name, self._coloured)
        parameter = parameters.get(name, *SPECTRAL, "float")
        assert parameter is not None
        return constant(self._spectra.reflectance(parameter), parameter.place)

    def _named(self, parameters: Parameters, name: str, known: dict[str, Pattern]) -> Pattern:
        parameter = parameters.get(name, "texture")
        assert parameter is not None
        texture = str(parameter.values[0])
        if texture not in known:
            kind = "float" if known is self._grey else "spectrum"
            raise wrong(
                parameter.place,
                f"{kind} texture {texture!r} of {name!r} is not defined above; define it with "
                "Texture first",
            )
        return dataclasses.replace(known[texture], place=parameter.place)

    def _either(self, parameters: Parameters, name: str, default: float, grey: bool) -> Pattern:
        pattern = (self.grey if grey else self.coloured)(parameters, name, default)
        assert pattern is not None
        return pattern

    def _constant(self, parameters: Parameters, grey: bool) -> Pattern:
        parameter = None if grey else parameters.get("value", "texture", *SPECTRAL, "float")
        if parameter is None or parameter.type == "texture":
            return self._either(parameters, "value", 1.0, grey)
        # May exceed 1: what it is scaled by later brings it down.
        return constant(self._spectra.unbounded(parameter), parameter.place)

    def _scale(self, parameters: Parameters, grey: bool) -> Pattern:
        """Version 4: "tex" times "scale"; version 3: "tex1" times "tex2"."""
        if "tex1" in parameters or "tex2" in parameters:
            first = self._either(parameters, "tex1", 1.0, grey)
            return first.times(self._either(parameters, "tex2", 1.0, grey))
        first = self._either(parameters, "tex", 1.0, grey)
        scale = self.grey(parameters, "scale", 1.0)
        assert scale is not None
        return first.times(scale)

    def _mix(self, parameters: Parameters, grey: bool) -> Pattern:
        first = self._either(parameters, "tex1", 0.0, grey)
        second = self._either(parameters, "tex2", 1.0, grey)
        amount = self.grey(parameters, "amount", 0.5)
        assert amount is not None
        rest = amount.complement()
        if rest is None:
            mean = min(1.0, max(0.0, amount.mean()))
            self._notes.add(
                "amounts of mixed textures, replaced by their mean", "mix", parameters.place
            )
            amount = constant(mean, parameters.place)
            rest = constant(1.0 - mean, parameters.place)
        return first.times(rest).plus(second.times(amount))

    def _checkerboard(self, parameters: Parameters, grey: bool) -> Pattern:
        if parameters.whole("dimension", 2) != 2:
            self._notes.add(
                "three-dimensional checkerboards, read as flat ones", "texture", parameters.place
            )
        parameters.ignore(_SAMPLING)
        repeats, offset = self._mapping(parameters)
        first = self._either(parameters, "tex1", 1.0, grey)
        second = self._either(parameters, "tex2", 0.0, grey)
        swapped = False
        periods = []
        for scale, shift in zip(repeats, offset, strict=True):
            if shift != round(shift):
                self._notes.add(
                    "shifts of checkerboards by part of a field, left out",
                    f"{shift:g}",
                    parameters.place,
                )
            # Fields of negative scale start on the other side of zero.
            swapped ^= bool(round(shift) % 2) ^ (scale < 0)
            periods.append(max(abs(scale) / 2.0, 1e-12))
        if swapped:
            first, second = second, first
        on = Checkerboard(periods[0], periods[1], 1.0, 0.0)
        off = Checkerboard(periods[0], periods[1], 0.0, 1.0)
        both = (first, second)
        if all(len(p.terms) == 1 and p.is_constant for p in both):
            return _two_fields(both, (periods[0], periods[1]), parameters.place)
        return first.times(Pattern((Term(1.0, (on,)),), parameters.place)).plus(
            second.times(Pattern((Term(1.0, (off,)),), parameters.place))
        )

    def _mapping(self, parameters: Parameters) -> tuple[tuple[float, float], tuple[float, float]]:
        kind = parameters.text("mapping", "uv")
        if kind != "uv":
            self._notes.add(_MAPPING, kind, parameters.place_of("mapping"))
            parameters.ignore(("v1", "v2"))
        scale = (parameters.number("uscale", 1.0), parameters.number("vscale", 1.0))
        shift = (parameters.number("udelta", 0.0), parameters.number("vdelta", 0.0))
        for value in (*scale, *shift):
            if not abs(value) < 1e9:
                raise wrong(
                    parameters.place, f"scales and shifts must be < 1e9 in size, got {value:g}"
                )
        return scale, shift

    def _imagemap(self, parameters: Parameters, grey: bool) -> Pattern:
        parameters.ignore(_SAMPLING)
        repeats, offset = self._mapping(parameters)
        wrap = parameters.text("wrap", "repeat")
        if wrap not in ("clamp", "repeat"):
            self._notes.add("textures beyond their border, clamped", wrap, parameters.place)
        texels = self.picture(parameters, "filename") * np.float32(parameters.number("scale", 1.0))
        if parameters.flag("invert", False):
            texels = np.maximum(1.0 - texels, 0.0)
        if not np.isfinite(texels).all() or np.any(texels < 0):
            raise wrong(parameters.place, "the scale of an image must leave it finite and >= 0")
        name = parameters.text("filename")
        image = Image(texels, name, "clamp" if wrap != "repeat" else "repeat", repeats, offset)
        if grey:
            return Pattern((Term(1.0, (_grey_image(image),)),), parameters.place)
        if image.largest > 1.0:
            self._notes.add("reflectances above 1, taken as 1", name, parameters.place)
            image = dataclasses.replace(image, texels=np.minimum(image.texels, 1.0))
        if image.channels == 1:
            return Pattern((Term(Spectrum.constant(1.0), (image,)),), parameters.place)
        colours = reflectance_primaries()
        terms = tuple(
            Term(colours[i], (dataclasses.replace(image, texels=image.texels[..., i]),))
            for i in range(3)
        )
        return Pattern(terms, parameters.place)

    def picture(self, parameters: Parameters, name: str) -> np.ndarray:
        """The texels of a picture file that a parameter names."""
        filename = parameters.text(name)
        place = parameters.place_of(name)
        path = self._files.find(filename, place)
        if path is None:
            raise wrong(place, f"the picture {filename!r} does not exist")
        encoding = parameters.text("encoding", "sRGB")
        if "gamma" in parameters and parameters.type_of("gamma") == "bool":
            encoding = "sRGB" if parameters.flag("gamma", True) else "linear"
        elif "gamma" in parameters:
            encoding = f"gamma {parameters.number('gamma', 2.2):g}"
        key = (str(path), encoding)
        if key not in self._pictures:
            with located(place):
                self._pictures[key] = read_picture(path, encoding)
        return self._pictures[key]


def _even(value: float, place: Place) -> Pattern:
    return constant(Spectrum.constant(value), place)


def _grey_image(image: Image) -> Image:
    if image.channels == 1:
        return image
    return dataclasses.replace(image, texels=image.texels.mean(axis=-1))


def _two_fields(
    both: tuple[Pattern, Pattern], periods: tuple[float, float], place: Place
) -> Pattern:
    """A checkerboard of two constants: one term where they are numbers, else one a field."""
    first, second = (pattern.terms[0].value for pattern in both)
    if not isinstance(first, Spectrum) and not isinstance(second, Spectrum):
        largest = max(first, second)
        if min(first, second) < 0 or not math.isfinite(largest):
            raise wrong(place, f"values of a checkerboard must be >= 0, got {first}, {second}")
        return Pattern((Term(1.0, (Checkerboard(*periods, first, second),)),), place)
    return Pattern(
        (
            Term(first, (Checkerboard(*periods, 1.0, 0.0),)),
            Term(second, (Checkerboard(*periods, 0.0, 1.0),)),
        ),
        place,
    )
