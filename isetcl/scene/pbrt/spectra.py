"""Spectra as PBRT states them: numbers, colours, black bodies, files and names."""

from __future__ import annotations

import functools
from typing import Literal

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.eye.media import ConstantIndex, Medium, SellmeierDispersion
from isetcl.scene.colour import (
    blackbody,
    load_spd,
    radiance_of_rgb,
    reflectance_of_rgb,
    spectrum_of_xyz,
)
from isetcl.scene.complex_index import ComplexIndex
from isetcl.scene.glass import glass
from isetcl.scene.pbrt.files import SceneFiles
from isetcl.scene.pbrt.parameters import Parameters
from isetcl.scene.pbrt.parser import Parameter
from isetcl.scene.pbrt.places import Notes, located, wrong
from isetcl.scene.tabulated_index import TabulatedIndex
from isetcl.spectrum import Spectrum

Role = Literal["reflectance", "light", "other"]
SPECTRAL = ("rgb", "xyz", "blackbody", "spectrum")

_COLOUR_SPACES = {
    "srgb": "sRGB",
    "dci-p3": "P3-D65",
    "rec2020": "ITU-R BT.2020",
    "aces2065-1": "ACES2065-1",
}

# Source: SCHOTT optical glass catalogue, 2017-01-20 (SF5, N-FK51A, N-LASF9, N-BAF10); the others
# are those of isetcl.scene.glass. PBRT 4 lists SF5, SF10 and SF11 without their S.
_MORE_GLASSES = {
    "F5": (
        (1.46141885, 0.247713019, 0.949995832),
        (0.0111826126, 0.0508594669, 112.041888),
    ),
    "FK51A": (
        (0.971247817, 0.216901417, 0.904651666),
        (0.00472301995, 0.0153575612, 168.68133),
    ),
    "LASF9": (
        (2.00029547, 0.298926886, 1.80691843),
        (0.0121426017, 0.0538736236, 156.530829),
    ),
    "BAF10": (
        (1.5851495, 0.143559385, 1.08521269),
        (0.00926681282, 0.0424489805, 105.613573),
    ),
}
_GLASS_NAMES = {"F10": "SF10", "F11": "SF11"}
_METALS = {"Ag": "Ag", "Al": "Al", "Au": "Au", "Cu": "Cu", "CuZn": "Cu"}
_OXIDES = {"MgO": 1.737, "TiO2": 2.614}
"""Index at 589 nm of periclase and of rutile (ordinary ray), without dispersion.

Source: Stephens & Malitson 1952, J Res NBS 49:249; DeVore 1951, J Opt Soc Am 41:416."""


def named_glass(name: str) -> Medium | None:
    """The glass of a PBRT name such as "glass-BK7", if there is one."""
    short = name.removeprefix("glass-")
    if short == name:
        return None
    bare = short.removeprefix("S") if short in ("SF5",) else short
    if bare in _MORE_GLASSES:
        b, c = _MORE_GLASSES[bare]
        return Medium(name, SellmeierDispersion(b, c, 370.0, 2300.0))
    try:
        return glass(_GLASS_NAMES.get(short, short))
    except InvalidInputError:
        return None


def is_named(name: str) -> bool:
    """Whether a string names a spectrum that PBRT 4 knows, not a file."""
    known = name.startswith(("glass-", "metal-", "stdillum-", "illum-"))
    return known and "/" not in name and "." not in name


@functools.cache
def _illuminant(name: str) -> Spectrum | None:
    """A standard illuminant of colour-science under PBRT's name."""
    short = name.partition("-")[2]
    if name.startswith("stdillum-F"):
        short = "FL" + short[1:]
    if name == "illum-acesD60":
        short = "D60"
    try:
        return Spectrum.illuminant(short)
    except InvalidInputError:
        return None


class SpectrumReader:
    """Turns parameters into spectra.

    Lights are absolute: in version 4, a light of scale 1 has 1 cd/m^2 (a white of 1 cd/m^2 for
    rgb), as PBRT 4 scales them; in version 3, numbers are W m^-2 sr^-1 nm^-1, and rgb (1, 1, 1)
    is D65 as luminous as a radiance of 1 at all wavelengths.
    """

    def __init__(self, files: SceneFiles, notes: Notes, version: int) -> None:
        self._files = files
        self._notes = notes
        self.version = version
        self.colour_space = "srgb"

    def light(self, parameters: Parameters, name: str) -> Spectrum:
        """Radiance, intensity or irradiance of a light before its scale."""
        parameter = parameters.get(name, *SPECTRAL, "float")
        if parameter is None:
            return radiance_of_rgb((1.0, 1.0, 1.0), self.white_cd_m2())
        with located(parameter.place):
            return self._light(parameter)

    def white_cd_m2(self) -> float:
        """Luminance of rgb (1, 1, 1), cd/m^2."""
        return 1.0 if self.version >= 4 else _flat_luminance()

    def _light(self, parameter: Parameter) -> Spectrum:
        if parameter.type == "rgb":
            return radiance_of_rgb(self._srgb(parameter), self.white_cd_m2())
        if parameter.type == "float":
            return Spectrum.constant(_one(parameter)).scaled(1.0)
        if parameter.type == "xyz":
            return spectrum_of_xyz(_three(parameter)).scaled(_flat_luminance())
        spectrum = self._raw(parameter, "light")
        if self.version < 4:
            return spectrum
        luminance = spectrum.luminance_cd_m2()
        if not luminance > 0:
            raise InvalidInputError(
                "a light must have visible energy: PBRT 4 scales it by its luminance, got "
                f"{parameter.name!r} of 0 cd/m^2"
            )
        return spectrum.scaled(1.0 / luminance)

    def reflectance(self, parameter: Parameter) -> Spectrum:
        """A spectrum between 0 and 1; what lies above 1 is clipped and noted."""
        with located(parameter.place):
            if parameter.type == "float":
                spectrum = Spectrum.constant(_one(parameter))
            elif parameter.type == "rgb":
                rgb = self._srgb(parameter)
                if np.any(rgb > 1.0):
                    self._clipped(parameter)
                return reflectance_of_rgb(np.minimum(rgb, 1.0))
            elif parameter.type == "xyz":
                return spectrum_of_xyz(_three(parameter), kind="reflectance")
            else:
                spectrum = self._raw(parameter, "reflectance")
            if np.any(spectrum.values > 1.0):
                self._clipped(parameter)
                values = np.minimum(spectrum.values, 1.0)
                return Spectrum(spectrum.wavelengths_nm, values, spectrum.name)
            return spectrum

    def _clipped(self, parameter: Parameter) -> None:
        self._notes.add("reflectances above 1, taken as 1", parameter.name, parameter.place)

    def unbounded(self, parameter: Parameter) -> Spectrum:
        """A spectrum of any size, such as an index."""
        with located(parameter.place):
            if parameter.type == "float":
                return Spectrum.constant(_one(parameter))
            if parameter.type == "rgb":
                rgb = self._srgb(parameter)
                largest = max(float(rgb.max()), 1e-300)
                return reflectance_of_rgb(rgb / largest).scaled(largest)
            if parameter.type == "xyz":
                values = _three(parameter)
                largest = max(float(values.max()), 1e-300)
                return spectrum_of_xyz(values / (2 * largest), kind="reflectance").scaled(
                    2 * largest
                )
            return self._raw(parameter, "other")

    def medium(self, parameters: Parameters, name: str, default: float = 1.5) -> Medium:
        """The clear medium that an index stands for."""
        parameter = parameters.get(name, *SPECTRAL, "float")
        if parameter is None:
            return Medium(f"index {default:g}", ConstantIndex(default))
        with located(parameter.place):
            if parameter.type == "float":
                return Medium(f"index {_one(parameter):g}", ConstantIndex(_one(parameter)))
            values = parameter.values
            if isinstance(values, tuple):
                known = named_glass(str(values[0]))
                if known is not None:
                    return known
            spectrum = self.unbounded(parameter)
            if np.all(spectrum.values == spectrum.values[0]):
                value = float(spectrum.values[0])
                return Medium(f"index {value:g}", ConstantIndex(value))
            table = TabulatedIndex(
                tuple(spectrum.wavelengths_nm.tolist()), tuple(spectrum.values.tolist())
            )
            return Medium(spectrum.name, table)

    def complex_index(self, parameters: Parameters, eta: str, k: str) -> ComplexIndex:
        """The index of a metal; copper where none is given."""
        first = parameters.get(eta, *SPECTRAL, "float")
        second = parameters.get(k, *SPECTRAL, "float")
        copper = ComplexIndex.named("copper")
        if first is None and second is None:
            return copper
        with located(parameters.place):
            n = _part(copper, "n") if first is None else self.unbounded(first)
            extinction = _part(copper, "k") if second is None else self.unbounded(second)
            grid = common_grid((n, extinction))
            return ComplexIndex(grid, n.at(grid), extinction.at(grid), n.name)

    def _raw(self, parameter: Parameter, role: Role) -> Spectrum:
        """A spectrum from a list, a black body, a name or a file, as it is."""
        values = parameter.values
        if parameter.type == "blackbody":
            return self._blackbody(parameter, role)
        if isinstance(values, np.ndarray):
            return _listed(parameter.name, values)
        if len(values) != 1:
            raise InvalidInputError(f"spectrum {parameter.name!r} must be one name or file")
        name = str(values[0])
        if is_named(name):
            return self._named(name, parameter)
        path = self._files.find(name, parameter.place)
        if path is None:
            raise wrong(parameter.place, f"spectrum file {name!r} does not exist")
        return load_spd(path)

    def _blackbody(self, parameter: Parameter, role: Role) -> Spectrum:
        """Planck's law: relative to its peak (version 3 adds a scale), as both versions have it."""
        values = np.asarray(parameter.values, dtype=np.float64)
        if len(values) not in (1, 2):
            raise InvalidInputError(
                f"blackbody {parameter.name!r} must be a temperature (K), and in version 3 a "
                f"scale; got {len(values)} numbers"
            )
        kelvin = float(values[0])
        raw = blackbody(kelvin)
        # Wien's displacement law, b = 2.897771955e-3 m K (CODATA 2018).
        peak_nm = 2.897771955e6 / kelvin
        peak = float(_planck_shape(np.array([peak_nm]), kelvin)[0])
        here = _planck_shape(raw.wavelengths_nm, kelvin)
        if not peak > 0 or not np.any(here > 0):
            raise InvalidInputError(
                f"blackbody {parameter.name!r} of {kelvin:g} K is dark in the visible range"
            )
        scale = float(values[1]) if len(values) == 2 else 1.0
        return Spectrum(raw.wavelengths_nm, here / peak * scale, raw.name)

    def _named(self, name: str, parameter: Parameter) -> Spectrum:
        kind, _, rest = name.partition("-")
        if kind == "glass":
            medium = named_glass(name)
            if medium is not None:
                grid = np.arange(max(360.0, medium.dispersion.range_nm[0]), 831.0, 5.0)
                return Spectrum(grid, medium.index(grid), name)
        if kind == "metal":
            metal, _, part = rest.rpartition("-")
            if metal in _OXIDES and part in ("eta", "k"):
                self._notes.add("spectra approximated", f"{name} without dispersion", None)
                return Spectrum.constant(_OXIDES[metal] if part == "eta" else 0.0, name)
            if metal in _METALS and part in ("eta", "k"):
                if metal == "CuZn":
                    self._notes.add("spectra approximated", f"{name} by copper", parameter.place)
                index = ComplexIndex.named(_METALS[metal])
                return _part(index, "n" if part == "eta" else "k")
        if kind in ("stdillum", "illum"):
            illuminant = _illuminant(name)
            if illuminant is not None:
                return illuminant
        raise wrong(
            parameter.place,
            f"unknown spectrum {name!r} of {parameter.name!r}; known are stdillum-A, -D50, -D65, "
            "-F1 to -F12, metal-Ag, -Al, -Au, -Cu (-eta, -k), glass-BK7, -BAF10, -FK51A, -LASF9, "
            "-F5, -F10, -F11, or the name of an .spd file",
        )

    def _srgb(self, parameter: Parameter) -> np.ndarray:
        """Linear sRGB from the colour space that holds."""
        values = _three(parameter)
        if self.colour_space == "srgb":
            return values
        rgb = _to_srgb(self.colour_space) @ values
        if np.any(rgb < -1e-6 * max(1.0, float(np.abs(rgb).max()))):
            self._notes.add(
                "colours outside sRGB, clipped", f"{self.colour_space} rgb", parameter.place
            )
        clipped: np.ndarray = np.maximum(rgb, 0.0)
        return clipped

    def set_colour_space(self, name: str) -> bool:
        """Read rgb from now on as of a colour space; False where it is unknown."""
        if name.lower() not in _COLOUR_SPACES:
            return False
        self.colour_space = name.lower()
        return True


def common_grid(spectra: tuple[Spectrum, ...]) -> np.ndarray:
    """All wavelengths of some spectra at which all of them are known.

    Raises
    ------
    InvalidInputError
        If their ranges do not overlap.
    """
    low = max(s.wavelengths_nm[0] for s in spectra)
    high = min(s.wavelengths_nm[-1] for s in spectra)
    grid = np.unique(np.concatenate([s.wavelengths_nm for s in spectra]))
    grid = grid[(grid >= low) & (grid <= high)]
    if len(grid) == 0:
        names = " and ".join(repr(s.name) for s in spectra[:3])
        raise InvalidInputError(f"spectra {names} must overlap in wavelength")
    return grid


def _part(index: ComplexIndex, part: Literal["n", "k"]) -> Spectrum:
    return Spectrum(index.wavelengths_nm, getattr(index, part), f"{index.name} {part}")


def _listed(name: str, values: np.ndarray) -> Spectrum:
    """A spectrum from wavelengths and values in turn, in any order of wavelengths."""
    if len(values) < 2 or len(values) % 2:
        raise InvalidInputError(
            f"spectrum {name!r} must be pairs of wavelength (nm) and value, got {len(values)} "
            "numbers"
        )
    order = np.argsort(values[0::2], kind="stable")
    return Spectrum(values[0::2][order], values[1::2][order], name)


def _one(parameter: Parameter) -> float:
    if len(parameter.values) != 1:
        raise InvalidInputError(f"{parameter.name!r} must be one number")
    return float(parameter.values[0])


def _three(parameter: Parameter) -> np.ndarray:
    values = np.asarray(parameter.values, dtype=np.float64)
    if len(values) != 3:
        raise InvalidInputError(
            f"{parameter.type} {parameter.name!r} must be three numbers, got {len(values)}"
        )
    return values


def _planck_shape(wavelengths_nm: np.ndarray, kelvin: float) -> np.ndarray:
    """Planck's law up to a factor: 1 / (l^5 (exp(c2 / (l T)) - 1)), c2 = 1.438776877e-2 m K."""
    quanta = 1.438776877e7 / (wavelengths_nm * kelvin)
    relative = (560.0 / wavelengths_nm) ** 5 / np.expm1(np.minimum(quanta, 700.0))
    shape: np.ndarray = np.where(quanta < 700.0, relative, 0.0)
    return shape


@functools.cache
def _flat_luminance() -> float:
    """Luminance of a radiance of 1 W m^-2 sr^-1 nm^-1 at all wavelengths, cd/m^2."""
    return Spectrum.constant(1.0).luminance_cd_m2()


@functools.cache
def _to_srgb(space: str) -> np.ndarray:
    """Matrix from linear RGB of a colour space to linear sRGB, whites matched (Bradford)."""
    import colour

    spaces = colour.RGB_COLOURSPACES
    matrix = colour.matrix_RGB_to_RGB(
        spaces[_COLOUR_SPACES[space]], spaces["sRGB"], chromatic_adaptation_transform="Bradford"
    )
    return np.asarray(matrix)
