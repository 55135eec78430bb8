"""Import of sequential Zemax prescriptions (.zmx)."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from isetcl.errors import FileError, InvalidInputError, check_between
from isetcl.eye import paraxial
from isetcl.eye.clear_apertures import uncrossed, widest_mm
from isetcl.eye.files.zmx_frames import Frame, broken, onward, start
from isetcl.eye.files.zmx_shapes import form_of
from isetcl.eye.files.zmx_text import ZmxFile, ZmxSurface, read_zmx
from isetcl.eye.media import AIR, AbbeDispersion, ConstantIndex, Medium
from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye
from isetcl.eye.models.parts import CORNEA_SEMI_DIAMETERS_MM, LENS_SEMI_DIAMETER_MM
from isetcl.eye.retina import Retina
from isetcl.eye.stop import Stop
from isetcl.eye.surface import Surface

_SAME_PLANE_MM = 1e-9


@dataclass(frozen=True)
class _Placed:
    """A surface of the file, its frame and the media on both sides of it."""

    record: ZmxSurface
    frame: Frame
    before: Medium
    after: Medium


def zmx_eye(path: Path, media: Mapping[str, Medium], stop_diameter_mm: float | None) -> Eye:
    """The eye of a sequential Zemax file; see `load_eye`.

    Raises
    ------
    FileError
        If the file is missing, is no sequential lens file, or holds what isetcl cannot trace; the
        message names line, surface and type.
    """
    where = f"zmx file {str(path)!r}"
    found = read_zmx(path)
    placed = _placed(found, media, where)
    image = placed[-1]
    refracting = [p for p in placed[:-1] if p.before != p.after]
    if not refracting:
        raise FileError(f"{where}: must have a refracting surface (a GLAS line), found none")
    origin_z = float(refracting[0].frame.origin_mm[2])
    stop = _stop(placed, found, origin_z, stop_diameter_mm, where)
    surfaces = _surfaces(refracting, found.unit_mm, stop.z_mm, origin_z, where)
    try:
        form = form_of(image.record, found.unit_mm)
        z = float(image.frame.origin_mm[2]) - origin_z
        retina = Retina(vertex_z_mm=z, placement=image.frame.placement(), **form)
    except InvalidInputError as error:
        raise FileError(f"{where}, {image.record.label}: {error}") from error
    try:
        eye = Eye(found.name if found.name else path.stem, surfaces, stop, retina)
        if stop_diameter_mm is None and found.entrance_pupil is not None:
            eye = _with_entrance_pupil(eye, found)
    except InvalidInputError as error:
        raise FileError(f"{where}: {error}") from error
    return eye


def _placed(found: ZmxFile, media: Mapping[str, Medium], where: str) -> list[_Placed]:
    """All real surfaces behind the object in one frame, the image last."""
    frame, medium = start(), AIR
    placed = []
    for record in found.surfaces[1:]:
        try:
            if record.kind == "COORDBRK":
                frame = broken(frame, record, found.unit_mm)
            else:
                form_of(record, found.unit_mm)
                is_image = record is found.surfaces[-1]
                after = medium if is_image else _medium(_with_picked_glass(record, found), media)
                placed.append(_Placed(record, frame, medium, after))
                medium = after
            if record is not found.surfaces[-1]:
                frame = onward(frame, record, found.unit_mm)
        except InvalidInputError as error:
            raise FileError(f"{where}, {record.label}: {error}") from error
    if not placed or placed[-1].record is not found.surfaces[-1]:
        last = found.surfaces[-1].label
        raise FileError(f"{where}, {last}: the image must be a surface, not a coordinate break")
    return placed


def _with_picked_glass(record: ZmxSurface, found: ZmxFile) -> ZmxSurface:
    """The surface with the glass of an earlier one where it picks it up (GLAS name 2 number)."""
    for _ in found.surfaces:
        if len(record.glass) < 3 or record.glass[1] != "2":
            return record
        numbers = {str(earlier.number): earlier for earlier in found.surfaces[: record.number]}
        if record.glass[2] not in numbers:
            raise InvalidInputError(
                f"the glass (line {record.glass_line}) must be picked up from an earlier surface, "
                f"got {record.glass[2]!r}"
            )
        source = numbers[record.glass[2]]
        record = dataclasses.replace(record, glass=source.glass, glass_line=source.glass_line)
    return record


def _medium(record: ZmxSurface, media: Mapping[str, Medium]) -> Medium:
    """What lies behind a surface: air, a given medium or a model glass (n_d and Abbe number)."""
    if not record.glass:
        return AIR
    name = record.glass[0]
    by_name = {known.upper(): medium for known, medium in media.items()}
    for key in (record.comment.upper(), name.upper()):
        if key and key in by_name:
            return by_name[key]
    if name.upper() == "MIRROR":
        raise InvalidInputError("an eye has no mirrors (GLAS MIRROR)")
    if not name.startswith("___"):
        raise InvalidInputError(
            f"glass {name!r} (line {record.glass_line}) stands in a catalogue that the file does "
            f"not hold; pass media={{{name!r}: Medium(...)}}, or make it a model glass"
        )
    try:
        index, abbe_number = float(record.glass[3]), float(record.glass[4])
    except (IndexError, ValueError):
        raise InvalidInputError(
            f"a model glass (line {record.glass_line}) must have an index and an Abbe number as "
            f"its 4th and 5th values, got {' '.join(record.glass)[:60]!r}"
        ) from None
    check_between(f"the index of a model glass (line {record.glass_line})", index, 1.0, 5.0)
    if abbe_number != 0:  # zero stands for no dispersion
        check_between(f"the Abbe number (line {record.glass_line})", abbe_number, 5.0, 1000.0)
    dispersion = AbbeDispersion(index, abbe_number) if abbe_number else ConstantIndex(index)
    return Medium(f"glass {index:g} {abbe_number:g}", dispersion)


def _stop(
    placed: list[_Placed],
    found: ZmxFile,
    origin_z: float,
    diameter_mm: float | None,
    where: str,
) -> Stop:
    """The stop of the file: the plane of the vertex of its stop surface."""
    marked = [p for p in placed[:-1] if p.record.is_stop]
    if len(marked) != 1:
        raise FileError(f"{where}: must have one stop surface (STOP), got {len(marked)}")
    record, frame = marked[0].record, marked[0].frame
    try:
        if frame.is_tilted:
            raise InvalidInputError("the stop must not be tilted; tilt the surfaces instead")
        if marked[0].before == marked[0].after and record.curvature != 0:
            raise InvalidInputError("a stop that does not refract must be plane (CURV 0)")
        size, aspect, axis = _hole(record, frame)
        if diameter_mm is not None:
            size = diameter_mm
        elif found.entrance_pupil is not None:
            size = found.entrance_pupil * found.unit_mm
        else:
            size *= found.unit_mm
        if size == 0:
            raise InvalidInputError("the stop must have a semi-diameter; pass pupil_diameter_mm")
        decentre = (float(frame.origin_mm[0]), float(frame.origin_mm[1]))
        minor = None if aspect == 1.0 else aspect * size
        return Stop(float(frame.origin_mm[2]) - origin_z, size, decentre, minor, axis)
    except InvalidInputError as error:
        raise FileError(f"{where}, {record.label}: {error}") from error


def _hole(record: ZmxSurface, frame: Frame) -> tuple[float, float, float]:
    """Longer diameter in the file's unit, aspect and axis in degrees of the stop's opening."""
    if record.aperture is None:
        return 2.0 * record.semi_diameter, 1.0, 0.0
    keyword, first, second = record.aperture
    if keyword != "ELAP":
        if first != 0:
            raise InvalidInputError(f"the stop must have no obstruction inside, got {first:g}")
        return 2.0 * second, 1.0, 0.0
    # Half widths in x and in y; a turn about z is all that the axes of a stop can have.
    axis = math.degrees(math.atan2(frame.axes[1, 0], frame.axes[0, 0]))
    long, short = max(first, second), min(first, second)
    if not short > 0:
        raise InvalidInputError(f"ELAP must have half widths > 0, got {first:g} and {second:g}")
    return 2.0 * long, short / long, axis if first >= second else axis + 90.0


def _surfaces(
    refracting: list[_Placed], unit_mm: float, stop_z: float, origin_z: float, where: str
) -> tuple[Surface, ...]:
    """The refracting surfaces, with semi-diameters where the file fixes none."""
    surfaces: list[Surface] = []
    fixed = []
    for p in refracting:
        record = p.record
        try:
            z = float(p.frame.origin_mm[2]) - origin_z
            form = form_of(record, unit_mm)
            semi_diameter = _fixed_semi_diameter_mm(record, unit_mm)
            fixed.append(semi_diameter is not None)
            if semi_diameter is None:
                is_cornea = z < stop_z - _SAME_PLANE_MM
                wanted = CORNEA_SEMI_DIAMETERS_MM[0] if is_cornea else LENS_SEMI_DIAMETER_MM
                semi_diameter = widest_mm(form, max(wanted, record.semi_diameter * unit_mm))
            surface = Surface(
                name=record.comment if record.comment else f"surface {record.number}",
                vertex_z_mm=z,
                semi_diameter_mm=semi_diameter,
                medium_after=p.after,
                placement=p.frame.placement(),
                **form,
            )
            if surfaces and z < surfaces[-1].vertex_z_mm:
                raise InvalidInputError(
                    f"the thickness in front of it runs backwards: it lies at {z:g} mm, "
                    f"{surfaces[-1].name!r} at {surfaces[-1].vertex_z_mm:g} mm"
                )
        except InvalidInputError as error:
            raise FileError(f"{where}, {record.label}: {error}") from error
        surfaces.append(surface)
    return uncrossed(surfaces, fixed)


def _fixed_semi_diameter_mm(record: ZmxSurface, unit_mm: float) -> float | None:
    """The radius of the aperture of a surface, or its fixed semi-diameter; None for neither."""
    if record.aperture is not None and not record.is_stop:
        keyword, inner, outer = record.aperture
        if keyword == "ELAP" or inner != 0:
            raise InvalidInputError(
                f"the aperture of a surface must be a circle without a hole, got {keyword} "
                f"{inner:g} {outer:g}"
            )
        return outer * unit_mm
    if record.is_fixed and not record.is_stop:
        return record.semi_diameter * unit_mm
    return None


def _with_entrance_pupil(eye: Eye, found: ZmxFile) -> Eye:
    """The eye with the entrance pupil of the file (ENPD), at its primary wavelength."""
    wavelength_nm = found.primary_nm
    if wavelength_nm is None:
        wavelength_nm = REFERENCE_WAVELENGTH_NM
    pupil = paraxial.entrance_pupil(eye, wavelength_nm)
    size = eye.stop.diameter_mm / abs(pupil.magnification)
    minor = None if eye.stop.minor_diameter_mm is None else size * eye.stop.aspect
    stop = dataclasses.replace(eye.stop, diameter_mm=size, minor_diameter_mm=minor)
    return dataclasses.replace(eye, stop=stop)
