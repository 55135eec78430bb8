"""The text of a Zemax lens file (.zmx) as records, without its optical meaning.

A file is lines of a keyword and values. "SURF n" begins a surface, to which the lines after it
belong; what stands before the first one is about the whole system. Keywords that say nothing about
where rays go are skipped. The program indents the lines of a surface: behind those, what is not
indented is about merit functions, tolerances and configurations, whose words may be the same.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from isetcl.errors import FileError, InvalidInputError, check_choice
from isetcl.eye.files.text import read_text

UNITS_MM = {"MM": 1.0, "CM": 10.0, "IN": 25.4, "METER": 1000.0, "M": 1000.0}

MOST_SURFACES = 1000

_INFINITE = 1e10  # what Zemax writes for an infinite thickness, or more

_APERTURES = {"CLAP": 2, "FLAP": 2, "ELAP": 2}
_UNSUPPORTED_APERTURES = ("SQAP", "SPID", "OBSC", "SQOB", "ELOB", "UDAP", "USAP", "UOBS")


@dataclass
class ZmxSurface:
    """One "SURF" of a file; lengths in the file's unit, numbers by their index."""

    number: int
    line: int
    kind: str = "STANDARD"
    curvature: float = 0.0
    conic: float = 0.0
    thickness: float = 0.0
    glass: tuple[str, ...] = ()
    glass_line: int = 0
    semi_diameter: float = 0.0
    is_fixed: bool = False
    aperture: tuple[str, float, float] | None = None
    is_stop: bool = False
    comment: str = ""
    parameters: dict[int, float] = field(default_factory=dict)
    extra: dict[int, float] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """For messages: "line 12: surface 3 (EVENASPH)"."""
        return f"line {self.line}: surface {self.number} ({self.kind})"


@dataclass
class ZmxFile:
    """A whole file; the unit in mm, wavelengths in nm."""

    name: str = ""
    unit_mm: float = 1.0
    entrance_pupil: float | None = None
    wavelengths_nm: dict[int, float] = field(default_factory=dict)
    primary: int = 1
    surfaces: list[ZmxSurface] = field(default_factory=list)
    has_indents: bool = False

    @property
    def primary_nm(self) -> float | None:
        """The primary wavelength, nm; None if the file names none."""
        return self.wavelengths_nm.get(self.primary)


def read_zmx(path: Path) -> ZmxFile:
    """The records of a file.

    Raises
    ------
    FileError
        If the file is missing or no sequential lens file, or a line is wrong; the message names it.
    """
    found = ZmxFile()
    where = f"zmx file {str(path)!r}"
    for number, line in enumerate(read_text(path, "zmx file").splitlines(), start=1):
        words = line.split()
        if words:
            _record(found, _Line(where, number, words[0].upper(), words[1:], line))
    if len(found.surfaces) < 3:
        raise FileError(
            f"{where}: must have an object, a refracting surface and an image (SURF lines), got "
            f"{len(found.surfaces)} surfaces"
        )
    return found


@dataclass(frozen=True)
class _Line:
    where: str
    number: int
    keyword: str
    words: list[str]
    text: str

    def fail(self, rule: str) -> FileError:
        return FileError(f"{self.where}, line {self.number}: {self.keyword} {rule}")

    def number_at(self, i: int) -> float:
        """The i-th value; "INFINITY" and numbers beyond 1e10 are infinite."""
        try:
            word = self.words[i]
        except IndexError:
            raise self.fail(f"needs {i + 1} values, got {len(self.words)}") from None
        if word.upper() in ("INFINITY", "INF"):
            return math.inf
        try:
            value = float(word)
        except ValueError:
            raise self.fail(f"needs a number, got {word[:40]!r}") from None
        if math.isnan(value):
            raise self.fail("needs a number, got NaN")
        if value <= -_INFINITE:
            raise self.fail(f"must be > {-_INFINITE:g}, got {value:g}")
        return math.inf if value >= _INFINITE else value

    def finite_at(self, i: int) -> float:
        value = self.number_at(i)
        if not math.isfinite(value):
            raise self.fail("must be finite, got infinity")
        return value

    def index_at(self, i: int) -> int:
        value = self.finite_at(i)
        if value != int(value) or not 0 <= value <= 10000:
            raise self.fail(f"needs a whole number, got {self.words[i]!r}")
        return int(value)


def _record(found: ZmxFile, line: _Line) -> None:
    if line.keyword == "SURF":
        number = line.index_at(0)
        if number != len(found.surfaces) or number >= MOST_SURFACES:
            raise line.fail(f"must count from 0 up by 1 to {MOST_SURFACES}, got {number}")
        found.surfaces.append(ZmxSurface(number, line.number))
    elif found.surfaces:
        is_indented = line.text[:1].isspace()
        found.has_indents = found.has_indents or is_indented
        if is_indented or not found.has_indents:
            _surface_record(found.surfaces[-1], line)
    else:
        _system_record(found, line)


def _system_record(found: ZmxFile, line: _Line) -> None:
    if line.keyword == "MODE" and line.words[:1] != ["SEQ"]:
        raise line.fail(f"must be SEQ (sequential), got {' '.join(line.words)[:20]!r}")
    if line.keyword == "NAME":
        found.name = line.text.strip()[4:].strip()
    elif line.keyword == "UNIT":
        try:
            unit = check_choice("unit", "".join(line.words[:1]), UNITS_MM)
        except InvalidInputError as error:
            raise line.fail(f"names an {error}") from error
        found.unit_mm = UNITS_MM[unit]
    elif line.keyword == "ENPD":
        found.entrance_pupil = line.finite_at(0)
    elif line.keyword == "WAVM":
        found.wavelengths_nm[line.index_at(0)] = 1000.0 * line.finite_at(1)
    elif line.keyword == "PWAV":
        found.primary = line.index_at(0)


def _surface_record(surface: ZmxSurface, line: _Line) -> None:
    keyword = line.keyword
    if keyword in _READERS:
        _READERS[keyword](surface, line)
    elif keyword in _APERTURES:
        surface.aperture = (keyword, line.finite_at(0), line.finite_at(1))
    elif keyword in _UNSUPPORTED_APERTURES:
        raise line.fail(
            f"is an aperture that cannot be read (known: {', '.join(_APERTURES)}); make it circular"
        )


def _kind(surface: ZmxSurface, line: _Line) -> None:
    if not line.words:
        raise line.fail("needs a surface type")
    surface.kind = line.words[0].upper()
    surface.line = line.number


def _curvature(surface: ZmxSurface, line: _Line) -> None:
    surface.curvature = line.finite_at(0)


def _conic(surface: ZmxSurface, line: _Line) -> None:
    surface.conic = line.finite_at(0)


def _thickness(surface: ZmxSurface, line: _Line) -> None:
    surface.thickness = line.number_at(0)


def _glass(surface: ZmxSurface, line: _Line) -> None:
    if not line.words:
        raise line.fail("needs a name")
    surface.glass = tuple(line.words)
    surface.glass_line = line.number


def _diameter(surface: ZmxSurface, line: _Line) -> None:
    surface.semi_diameter = line.finite_at(0)
    surface.is_fixed = len(line.words) > 1 and line.finite_at(1) != 0


def _stop(surface: ZmxSurface, line: _Line) -> None:
    surface.is_stop = True


def _comment(surface: ZmxSurface, line: _Line) -> None:
    surface.comment = " ".join(line.words)


def _parameter(surface: ZmxSurface, line: _Line) -> None:
    surface.parameters[line.index_at(0)] = line.finite_at(1)


def _aperture_decentre(surface: ZmxSurface, line: _Line) -> None:
    if any(line.finite_at(i) != 0 for i in range(len(line.words))):
        raise line.fail(
            f"shifts the aperture of surface {surface.number}, which cannot be read; decentre the "
            "surface with coordinate breaks"
        )


def _surface_tilt(surface: ZmxSurface, line: _Line) -> None:
    # Three flags, then decentres and tilts before the surface, an order flag, and those after it.
    if any(line.finite_at(i) != 0 for i in range(3, len(line.words))):
        raise line.fail(
            f"tilts or decentres surface {surface.number} in its properties, which cannot be read; "
            "use coordinate breaks"
        )


def _extra(surface: ZmxSurface, line: _Line) -> None:
    surface.extra[line.index_at(0)] = line.finite_at(1)


_READERS: dict[str, Callable[[ZmxSurface, _Line], None]] = {
    "TYPE": _kind,
    "CURV": _curvature,
    "CONI": _conic,
    "DISZ": _thickness,
    "GLAS": _glass,
    "DIAM": _diameter,
    "STOP": _stop,
    "COMM": _comment,
    "PARM": _parameter,
    "XDAT": _extra,
    "OBDC": _aperture_decentre,
    "SCBD": _surface_tilt,
}
