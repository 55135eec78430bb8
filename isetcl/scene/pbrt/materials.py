"""PBRT's materials as those of isetcl."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.eye.media import ConstantIndex, Medium
from isetcl.scene.material import Coated, Diffuse, Mix, Scattering
from isetcl.scene.pbrt.parameters import Parameters
from isetcl.scene.pbrt.patterns import Make, Pattern, constant, level, surface
from isetcl.scene.pbrt.places import Notes, located, wrong
from isetcl.scene.pbrt.spectra import SpectrumReader
from isetcl.scene.pbrt.surfaces import (
    Level,
    Surface,
    clipped,
    index_of_reflectance,
    mapped,
    roughness_to_alpha,
)
from isetcl.scene.pbrt.textures import TextureReader
from isetcl.scene.specular import Conductor, Dielectric, Mirror
from isetcl.scene.texture import TEXTURES
from isetcl.spectrum import Spectrum

APPROXIMATED = "materials approximated"
REPLACED = "materials replaced by a grey matt surface"
_RELIEF = ("bumpmap", "displacement", "normalmap")
_QUIET = ("type", "maxdepth", "nsamples", "thickness", "g", "albedo", "twosided")


class MaterialReader:
    """Makes materials of Material and MakeNamedMaterial directives."""

    def __init__(
        self, spectra: SpectrumReader, textures: TextureReader, notes: Notes, version: int
    ) -> None:
        self._spectra = spectra
        self._textures = textures
        self._notes = notes
        self._version = version
        self._named: dict[str, tuple[str, Parameters]] = {}
        self._made: dict[int, Surface] = {}
        self._being_made: list[str] = []

    def name(self, name: str, kind: str, parameters: Parameters) -> None:
        """Keep a named material, to be made when it is used."""
        self._named[name] = (kind, parameters)

    def named(self, name: str, asked: Parameters) -> Surface:
        """The material of a name."""
        if name not in self._named:
            raise wrong(
                asked.place, f"material {name!r} is not defined; use MakeNamedMaterial first"
            )
        if name in self._being_made or len(self._being_made) > 64:
            raise wrong(asked.place, f"material {name!r} must not be mixed of itself")
        self._being_made.append(name)
        try:
            kind, parameters = self._named[name]
            return self.make(kind, parameters)
        finally:
            self._being_made.pop()

    def make(self, kind: str, parameters: Parameters) -> Surface:
        """The material of a kind; the same directive gives the same object."""
        parameters.is_needed = True
        key = id(parameters)
        if key not in self._made:
            self._made[key] = self._make(kind, parameters)
        return self._made[key]

    def default(self, parameters: Parameters) -> Surface:
        """What PBRT gives shapes without a material: a grey matt surface."""
        return Surface(Diffuse(Spectrum.constant(0.5)))

    def _make(self, kind: str, parameters: Parameters) -> Surface:
        makers: dict[str, Callable[[Parameters], Surface]] = {
            "matte": self._matte,
            "diffuse": self._matte,
            "plastic": self._plastic,
            "coateddiffuse": self._coated,
            "coatedconductor": self._coated_conductor,
            "uber": self._uber,
            "mirror": self._mirror,
            "glass": self._glass,
            "dielectric": self._glass,
            "thindielectric": self._thin,
            "metal": self._metal,
            "conductor": self._metal,
            "substrate": self._plastic,
            "mix": self._mix,
            "translucent": self._translucent,
            "diffusetransmission": self._diffuse_transmission,
            "disney": self._disney,
            "kdsubsurface": self._subsurface,
            "subsurface": self._subsurface,
        }
        for name in _RELIEF:
            if name in parameters:
                self._notes.add("reliefs left out", name, parameters.place_of(name))
        parameters.ignore((*_RELIEF, *_QUIET))
        if kind in ("", "none", "interface"):
            parameters.ignore(p.name for p in parameters.unused())
            return Surface(None)
        if kind not in makers:
            self._notes.add(REPLACED, kind, parameters.place)
            parameters.ignore(p.name for p in parameters.unused())
            return Surface(Diffuse(Spectrum.constant(0.5)))
        with located(parameters.place):
            return makers[kind](parameters)

    def _colour(self, parameters: Parameters, name: str, default: float) -> Pattern:
        pattern = self._textures.coloured(parameters, name, default)
        assert pattern is not None
        return pattern

    def _surface(self, pattern: Pattern, make: Make, *, textured: bool = True) -> Scattering:
        return surface(pattern, make, self._notes, textured=textured)

    def _amount(self, parameters: Parameters, name: str, default: float) -> float:
        """The mean of a coloured parameter, as one number."""
        pattern = self._colour(parameters, name, default)
        return float(
            sum(
                float(np.mean(t.value.values if isinstance(t.value, Spectrum) else t.value))
                * float(np.prod([f.mean for f in t.factors]))
                for t in pattern.terms
            )
        )

    def _level(self, parameters: Parameters, name: str, default: float | None) -> Level | None:
        pattern = self._textures.grey(parameters, name, default)
        if pattern is None:
            return None
        return clipped(level(pattern, self._notes, parameters.place_of(name)))

    def _alpha(self, parameters: Parameters, default: float, prefix: str = "") -> Level:
        """GGX width from roughness, or from the mean of those along u and v."""
        names = [f"{prefix}{name}" for name in ("uroughness", "vroughness", "roughness")]
        along_u, along_v = (self._level(parameters, name, None) for name in names[:2])
        both = self._level(parameters, names[2], None)
        remap = parameters.flag("remaproughness", True)

        def alpha(roughness: float) -> float:
            return roughness_to_alpha(roughness, self._version) if remap else roughness

        u, v = (each if each is not None else both for each in (along_u, along_v))
        u, v = (default if each is None else each for each in (u, v))
        if isinstance(u, TEXTURES) or isinstance(v, TEXTURES):
            return self._smooth_or(parameters, u, v, alpha)
        if u != v:
            self._notes.add(
                "roughness that differs along u and v, its mean taken", "material", parameters.place
            )
        if max(u, v) == 0.0:
            # Roughness 0 is a smooth surface in version 3, whatever its polynomial gives.
            return 0.0
        return clipped((alpha(u) + alpha(v)) / 2.0)

    def _smooth_or(
        self, parameters: Parameters, u: Level, v: Level, alpha: Callable[[float], float]
    ) -> Level:
        if u is not v:
            self._notes.add(
                "roughness that differs along u and v, that along u taken",
                "material",
                parameters.place,
            )
        return clipped(mapped(u, alpha))

    def _matte(self, parameters: Parameters) -> Surface:
        sigma = self._level(parameters, "sigma", 0.0)
        if sigma != 0.0:
            self._notes.add(APPROXIMATED, "matte with sigma by Lambert's law", parameters.place)
        name = "Kd" if "Kd" in parameters or self._version < 4 else "reflectance"
        pattern = self._colour(parameters, name, 0.5)
        return Surface(self._surface(pattern, lambda s, t: Diffuse(s, t)))

    def _plastic(self, parameters: Parameters) -> Surface:
        """Version 3's plastic and substrate: matt below a coat of index 1.5."""
        pattern = self._colour(parameters, "Kd", 0.25)
        gloss = self._amount(parameters, "Ks", 0.25)
        alpha = self._alpha(parameters, 0.1)
        if gloss == 0.0:
            return Surface(self._surface(pattern, lambda s, t: Diffuse(s, t)))
        self._notes.add(
            APPROXIMATED,
            "plastic and substrate by a matt surface under a clear coat of index 1.5",
            parameters.place,
        )
        return Surface(self._surface(pattern, lambda s, t: Coated(s, t, roughness=alpha)))

    def _coated(self, parameters: Parameters) -> Surface:
        for name in ("albedo", "g"):
            if name in parameters:
                self._notes.add("scattering inside coats left out", name, parameters.place)
        pattern = self._colour(parameters, "reflectance", 0.5)
        index = self._spectra.medium(parameters, "eta")
        alpha = self._alpha(parameters, 0.0)
        return Surface(
            self._surface(pattern, lambda s, t: Coated(s, t, index=index, roughness=alpha))
        )

    def _coated_conductor(self, parameters: Parameters) -> Surface:
        self._notes.add(APPROXIMATED, "coatedconductor without its coat", parameters.place)
        parameters.ignore(
            ("interface.roughness", "interface.uroughness", "interface.vroughness", "interface.eta")
        )
        return self._metal(parameters, "conductor.")

    def _metal(self, parameters: Parameters, prefix: str = "") -> Surface:
        alpha = self._alpha(parameters, 0.01 if self._version < 4 else 0.0, prefix)
        name = (
            "reflectance" if not prefix or "reflectance" in parameters else f"{prefix}reflectance"
        )
        if name in parameters:
            pattern = self._colour(parameters, name, 1.0)
            return Surface(
                self._surface(
                    pattern,
                    lambda s, t: Conductor(index_of_reflectance(_only(s)), roughness=alpha),
                    textured=False,
                )
            )
        for part in ("eta", "k"):
            if parameters.type_of(prefix + part) == "texture":
                raise wrong(
                    parameters.place_of(prefix + part), f"textures of {part} are not read; use rgb"
                )
        index = self._spectra.complex_index(parameters, f"{prefix}eta", f"{prefix}k")
        return Surface(Conductor(index, roughness=alpha))

    def _mirror(self, parameters: Parameters) -> Surface:
        pattern = self._colour(parameters, "Kr", 0.9)
        return Surface(self._surface(pattern, lambda s, t: Mirror(_only(s)), textured=False))

    def _medium(self, parameters: Parameters) -> Medium:
        name = "index" if "index" in parameters and "eta" not in parameters else "eta"
        if parameters.type_of(name) == "texture":
            raise wrong(
                parameters.place_of(name), "textures of an index are not read; use a number"
            )
        medium = self._spectra.medium(parameters, name)
        if isinstance(medium.dispersion, ConstantIndex) and medium.dispersion.n == 1.0:
            self._notes.add("glass of index 1, which is invisible", "eta", parameters.place)
        return medium

    def _glass(self, parameters: Parameters) -> Surface:
        shares = [
            self._amount(parameters, name, 1.0) for name in ("Kr", "Kt") if name in parameters
        ]
        if any(abs(share - 1.0) > 1e-6 for share in shares):
            self._notes.add(APPROXIMATED, "glass with Kr or Kt by clear glass", parameters.place)
        return Surface(Dielectric(self._medium(parameters), self._alpha(parameters, 0.0)))

    def _thin(self, parameters: Parameters) -> Surface:
        """A pane: both faces together reflect 2 R / (1 + R), the rest goes straight on."""
        medium = self._medium(parameters)
        n = float(np.mean(medium.index(np.array([550.0]))))
        face = ((n - 1.0) / (n + 1.0)) ** 2
        self._notes.add(
            APPROXIMATED, "thindielectric by a part mirror of perpendicular light", parameters.place
        )
        return Surface(Mirror(Spectrum.constant(1.0)), opacity=2.0 * face / (1.0 + face))

    def _uber(self, parameters: Parameters) -> Surface:
        pattern = self._colour(parameters, "Kd", 0.25)
        gloss = self._amount(parameters, "Ks", 0.25)
        mirror = self._amount(parameters, "Kr", 0.0)
        passed = min(1.0, self._amount(parameters, "Kt", 0.0))
        opacity = min(1.0, self._amount(parameters, "opacity", 1.0))
        alpha = self._alpha(parameters, 0.1)
        index = self._medium(parameters)
        self._notes.add(
            APPROXIMATED,
            "uber by a matt surface, coated if Ks or Kr, mixed with glass if Kt",
            parameters.place,
        )
        if gloss == 0.0 and mirror == 0.0:
            base = self._surface(pattern, lambda s, t: Diffuse(s, t))
        else:
            rough = alpha if gloss > 0 else 0.0
            base = self._surface(pattern, lambda s, t: Coated(s, t, index=index, roughness=rough))
        if passed > 0:
            base = Mix(base, Dielectric(index), passed)
        return Surface(base, opacity)

    def _mix(self, parameters: Parameters) -> Surface:
        """Version 3: amount is the share of the first material; version 4: of the second."""
        names: list[str] = []
        given = parameters.get("materials", "string")
        if given is not None:
            names = [str(name) for name in given.values]
        else:
            for name in ("namedmaterial1", "namedmaterial2"):
                if name in parameters:
                    names.append(parameters.text(name))
        if len(names) != 2:
            raise InvalidInputError(f"mix must name two materials, got {len(names)}")
        first, second = (self.named(name, parameters) for name in names)
        if given is None:
            amount = self._v3_amount(parameters)
            share: Level = mapped(amount, lambda a: 1.0 - a)
        else:
            found = self._level(parameters, "amount", 0.5)
            share = 0.5 if found is None else found
        if first.material is None or second.material is None:
            self._notes.add(APPROXIMATED, "mix with interface, its other part", parameters.place)
            return second if first.material is None else first
        if first.opacity != 1.0 or second.opacity != 1.0:
            self._notes.add(APPROXIMATED, "mix of cut-out materials as opaque", parameters.place)
        return Surface(Mix(first.material, second.material, share))

    def _v3_amount(self, parameters: Parameters) -> Level:
        """Version 3's amount: a spectrum, of which the mean is taken, or a texture."""
        if parameters.type_of("amount") == "texture":
            pattern = self._colour(parameters, "amount", 0.5)
            if len(pattern.terms) == 1 and len(pattern.terms[0].factors) == 1:
                term = pattern.terms[0]
                value = (
                    float(np.mean(term.value.values))
                    if isinstance(term.value, Spectrum)
                    else float(term.value)
                )
                scale = constant(value, pattern.place)
                grey = dataclasses.replace(
                    pattern, terms=(dataclasses.replace(term, value=1.0),)
                ).times(scale)
                return clipped(level(grey, self._notes, parameters.place))
        return min(1.0, max(0.0, self._amount(parameters, "amount", 0.5)))

    def _translucent(self, parameters: Parameters) -> Surface:
        pattern = self._colour(parameters, "Kd", 0.25)
        reflect = self._amount(parameters, "reflect", 0.5)
        passed = self._amount(parameters, "transmit", 0.5)
        gloss = self._amount(parameters, "Ks", 0.25)
        self._alpha(parameters, 0.1)
        if gloss > 0:
            self._notes.add(APPROXIMATED, "translucent without its gloss Ks", parameters.place)
        return Surface(
            self._translucent_surface(
                pattern.times(constant(reflect, pattern.place)),
                pattern.times(constant(passed, pattern.place)),
            )
        )

    def _diffuse_transmission(self, parameters: Parameters) -> Surface:
        scale = constant(parameters.number("scale", 1.0), parameters.place)
        reflected = self._colour(parameters, "reflectance", 0.25).times(scale)
        passed = self._colour(parameters, "transmittance", 0.25).times(scale)
        return Surface(self._translucent_surface(reflected, passed))

    def _translucent_surface(self, reflected: Pattern, passed: Pattern) -> Scattering:
        through = _mean_spectrum(passed)
        if not passed.is_constant:
            self._notes.add(
                "textures of transmittance, replaced by their mean", "mean", passed.place
            )
        return self._surface(reflected, lambda s, t: Diffuse(s, t, through))

    def _disney(self, parameters: Parameters) -> Surface:
        pattern = self._colour(parameters, "color", 0.5)
        metallic = self._amount_of_grey(parameters, "metallic", 0.0)
        rough = self._amount_of_grey(parameters, "roughness", 0.5)
        alpha = max(0.0, min(1.0, rough**2))
        self._notes.add(
            APPROXIMATED,
            "disney by metal (metallic above 0.5) or a coated matt surface",
            parameters.place,
        )
        index = self._medium(parameters)
        parameters.ignore(p.name for p in parameters.unused())
        if metallic > 0.5:
            return Surface(
                self._surface(pattern, lambda s, t: Mirror(_only(s), alpha), textured=False)
            )
        return Surface(
            self._surface(pattern, lambda s, t: Coated(s, t, index=index, roughness=alpha))
        )

    def _amount_of_grey(self, parameters: Parameters, name: str, default: float) -> float:
        pattern = self._textures.grey(parameters, name, default)
        assert pattern is not None
        return pattern.mean()

    def _subsurface(self, parameters: Parameters) -> Surface:
        name = "Kd" if "Kd" in parameters else "reflectance"
        pattern = self._colour(parameters, name, 0.5)
        alpha = self._alpha(parameters, 0.0)
        index = self._medium(parameters)
        self._notes.add(APPROXIMATED, "subsurface by a coated matt surface", parameters.place)
        parameters.ignore(p.name for p in parameters.unused())
        return Surface(
            self._surface(pattern, lambda s, t: Coated(s, t, index=index, roughness=alpha))
        )


def _only(spectra: Spectrum | tuple[Spectrum, ...]) -> Spectrum:
    assert isinstance(spectra, Spectrum)
    return spectra


def _mean_spectrum(pattern: Pattern) -> Spectrum:
    """A pattern with every texture replaced by its mean."""
    from isetcl.scene.pbrt.patterns import Term, _product, _sum

    terms = tuple(
        Term(_product(term.value, float(np.prod([f.mean for f in term.factors]))))
        for term in pattern.terms
    )
    return _sum(terms)
