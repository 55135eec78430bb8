"""Import of ISET3d's lens files of human eyes (.dat), with their files of refractive indices.

A file has comments (#), one number that nobody uses (a focal length) and rows of seven numbers: the
radii in x and y, the thickness to the next surface, the number of the medium behind it, the
semi-diameter, and the conic constants in x and y. Lengths in mm. A row of zero radii is the stop. A
radius is positive where its centre lies on the scene's side, so that corneas are negative. The
retina stands in no file. A medium i is a table ior<i>...spd of wavelengths (nm) and indices.

Source: ISET3d functions navarroLensCreate, navarroWrite and the pbrt camera "humaneye".
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from isetcl.errors import FileError, InvalidInputError, check_finite
from isetcl.eye.files.text import read_text
from isetcl.eye.media import AIR, Medium, TabulatedDispersion
from isetcl.eye.model import Eye
from isetcl.eye.retina import Retina
from isetcl.eye.shapes.biconic import Biconic
from isetcl.eye.stop import Stop
from isetcl.eye.surface import Surface

RETINA_DISTANCE_MM = 16.32
"""From the back of the lens to the retina, mm, where none is given: ISET3d's Navarro eye."""
RETINA_RADIUS_MM = -12.0
"""Radius of the retina, mm, where none is given: ISET3d's default."""

COLUMNS = 7
MOST_MEDIA = 6
"""Tables of indices that ISET3d's camera takes."""
MEDIA = {"1": "cornea", "2": "aqueous", "3": "lens", "4": "vitreous"}


@dataclass(frozen=True)
class _Row:
    line: int
    radii_mm: tuple[float, float]
    thickness_mm: float
    medium: int
    semi_diameter_mm: float
    conics: tuple[float, float]

    @property
    def is_stop(self) -> bool:
        return self.radii_mm == (0.0, 0.0)


def iset3d_eye(
    path: Path,
    media: Mapping[str, Medium],
    stop_diameter_mm: float | None,
    *,
    retina_distance_mm: float,
    retina_radius_mm: float,
) -> Eye:
    """The eye of an ISET3d lens file; see `load_eye`.

    Raises
    ------
    FileError
        If a file is missing or breaks the format; the message names the line.
    """
    where = f"lens file {str(path)!r}"
    rows = _rows(path, where)
    stops = [i for i, row in enumerate(rows) if row.is_stop]
    if len(stops) != 1 or len(rows) < 2:
        raise FileError(
            f"{where}: must have one row of zero radii (the stop) and a surface, got {len(stops)} "
            f"stops in {len(rows)} rows"
        )
    surfaces: list[Surface] = []
    stop = None
    z = 0.0
    for row in rows:
        try:
            if row.is_stop:
                size = 2.0 * row.semi_diameter_mm if stop_diameter_mm is None else stop_diameter_mm
                stop = Stop(z, size)
            else:
                medium = _medium(row.medium, path, media)
                surfaces.append(_surface(row, z, medium))
        except InvalidInputError as error:
            raise FileError(f"{where}, line {row.line}: {error}") from error
        z += row.thickness_mm
    try:
        retina = Retina.from_radius(z + retina_distance_mm, retina_radius_mm)
        assert stop is not None
        return Eye(path.stem, tuple(surfaces), stop, retina)
    except InvalidInputError as error:
        raise FileError(f"{where}: {error}") from error


def _rows(path: Path, where: str) -> list[_Row]:
    """The rows of the file; the focal length in front of them is left out."""
    rows: list[_Row] = []
    is_first = True
    for number, line in enumerate(read_text(path, "lens file").splitlines(), start=1):
        words = line.partition("#")[0].replace(",", " ").split()
        if not words:
            continue
        try:
            values = [check_finite("number", float(word)) for word in words]
        except ValueError as error:
            raise FileError(f"{where}, line {number}: must be numbers ({error})") from error
        if is_first and len(values) == 1:
            is_first = False
            continue
        is_first = False
        if len(values) != COLUMNS or values[3] not in range(MOST_MEDIA + 1):
            raise FileError(
                f"{where}, line {number}: must be {COLUMNS} numbers (radii in x and y, thickness, "
                f"number of the medium from 0 to {MOST_MEDIA}, semi-diameter, conic constants in "
                f"x and y), got "
                f"{line.strip()[:60]!r}"
            )
        if values[2] < 0:
            raise FileError(f"{where}, line {number}: thickness must be >= 0, got {values[2]:g}")
        first, second = (values[0], values[1]), (values[5], values[6])
        rows.append(_Row(number, first, values[2], int(values[3]), values[4], second))
    return rows


def _surface(row: _Row, z_mm: float, medium: Medium) -> Surface:
    in_x, in_y = (0.0 if radius == 0 else -1.0 / radius for radius in row.radii_mm)
    same = in_x == in_y and row.conics[0] == row.conics[1]
    return Surface(
        name=f"surface before the {medium.name}",
        vertex_z_mm=z_mm,
        curvature=in_y,
        conic=row.conics[1],
        semi_diameter_mm=row.semi_diameter_mm,
        medium_after=medium,
        shape=None if same else Biconic(in_x, row.conics[0]),
    )


def _medium(number: int, path: Path, media: Mapping[str, Medium]) -> Medium:
    """The medium of a number: given, air (0), or the table ior<number>...spd beside the file."""
    key = str(number)
    if key in media:
        return media[key]
    if number == 0:
        return AIR
    tail = path.stem.rpartition("-")[2]
    folder = path.parent
    named = [folder / f"ior{key}-{tail}.spd", folder / f"ior{key}.spd"]
    found = [file for file in named if file.is_file()][:1] or sorted(folder.glob(f"ior{key}*.spd"))
    if len(found) != 1:
        listed = ", ".join(file.name for file in found[:4]) if found else "none"
        raise InvalidInputError(
            f"medium {key} must have one table ior{key}.spd beside the lens file, got {listed}; "
            f"pass media={{{key!r}: Medium(...)}}"
        )
    return Medium(MEDIA.get(key, f"medium {key}"), _table(found[0]))


def _table(file: Path) -> TabulatedDispersion:
    """Two columns, wavelength in nm and index."""
    pairs: list[tuple[float, float]] = []
    for number, line in enumerate(read_text(file, "index file").splitlines(), start=1):
        words = line.partition("#")[0].replace(",", " ").split()
        if not words:
            continue
        try:
            wavelength, index = (float(word) for word in words)
        except ValueError as error:
            raise InvalidInputError(
                f"index file {str(file)!r}, line {number}: must be a wavelength (nm) and an index, "
                f"got {line.strip()[:60]!r}"
            ) from error
        pairs.append((wavelength, index))
    try:
        return TabulatedDispersion(tuple(p[0] for p in pairs), tuple(p[1] for p in pairs))
    except InvalidInputError as error:
        raise InvalidInputError(f"index file {str(file)!r}: {error}") from error
