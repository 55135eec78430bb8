"""Reading an eye from a file, by its suffix."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from isetcl.errors import (
    FileError,
    InvalidInputError,
    check_choice,
    check_finite,
    check_positive,
    check_type,
)
from isetcl.eye.catalog import FILE_SUFFIXES
from isetcl.eye.files import iset3d, zmx
from isetcl.eye.files.json_file import eye_from_json
from isetcl.eye.media import Medium
from isetcl.eye.model import Eye, PupilPlane


def load_eye(
    path: str | Path,
    *,
    pupil_diameter_mm: float | None = None,
    pupil_plane: PupilPlane = "stop",
    media: Mapping[str, Medium] | None = None,
    retina_distance_mm: float | None = None,
    retina_radius_mm: float | None = None,
) -> Eye:
    """The eye of a file: isetcl's JSON, a sequential Zemax prescription, an ISET3d lens file.

    Parameters
    ----------
    path
        A file whose suffix is .json (`Eye.to_json`), .zmx (Zemax, UTF-8 or UTF-16) or .dat (ISET3d,
        with its tables ior1.spd ... beside it).

        Of a .zmx file these surfaces are read: STANDARD, BICONICX, TOROIDAL (without polynomials),
        EVENASPH, SZERNSAG and COORDBRK; model glasses with index and Abbe number (see
        `AbbeDispersion` for the curve through them); the stop, as a plane at the vertex of its
        surface; fixed semi-diameters and circular apertures. Automatic semi-diameters clip nothing
        in Zemax, so such surfaces are made as wide as they can be. The last surface is the retina.
        Fields, solves, coatings and the distance of the object are not read.
    pupil_diameter_mm, pupil_plane
        Another pupil than the file's; see `Eye.with_pupil`.
    media
        Media by the name of a glass or the comment of its surface (.zmx), or by number (.dat),
        instead of those of the file.
    retina_distance_mm, retina_radius_mm
        Of .dat files only, which hold no retina: its distance behind the last surface and its
        radius (negative), mm; 16.32 and -12 unless given.

    Raises
    ------
    FileError
        If a file is missing or breaks its format, or holds a surface that isetcl cannot trace; the
        message names the line.
    InvalidInputError
        If an argument breaks its rule.
    """
    check_type("path", path, (str, Path))
    file = Path(path)
    given = {} if media is None else dict(media)
    for name, medium in given.items():
        check_type(f"media[{name!r}]", medium, Medium)
    if pupil_diameter_mm is not None:
        check_positive("pupil_diameter_mm", pupil_diameter_mm, "mm")
    check_choice("pupil_plane", pupil_plane, ("stop", "entrance"))
    suffix = file.suffix.lower()
    if suffix not in FILE_SUFFIXES:
        raise FileError(
            f"eye file {str(path)!r} has no known suffix (known: {', '.join(FILE_SUFFIXES)}); "
            "rename it"
        )
    _refuse_unused(suffix, given, retina_distance_mm, retina_radius_mm)
    if suffix == ".json":
        eye = eye_from_json(file)
    elif suffix == ".zmx":
        eye = zmx.zmx_eye(file, given, pupil_diameter_mm)
    else:
        distance, radius = iset3d.RETINA_DISTANCE_MM, iset3d.RETINA_RADIUS_MM
        if retina_distance_mm is not None:
            distance = check_positive("retina_distance_mm", retina_distance_mm, "mm")
        if retina_radius_mm is not None:
            radius = check_finite("retina_radius_mm", retina_radius_mm, "mm")
        eye = iset3d.iset3d_eye(
            file, given, pupil_diameter_mm, retina_distance_mm=distance, retina_radius_mm=radius
        )
    return eye if pupil_diameter_mm is None else eye.with_pupil(pupil_diameter_mm, pupil_plane)


def _refuse_unused(
    suffix: str,
    media: dict[str, Medium],
    retina_distance_mm: float | None,
    retina_radius_mm: float | None,
) -> None:
    """Refuse arguments that would do nothing for this kind of file."""
    if suffix != ".dat" and not (retina_distance_mm is None and retina_radius_mm is None):
        raise InvalidInputError(
            "retina_distance_mm and retina_radius_mm must be left out for a file that holds a "
            f"retina ({suffix}); change the eye with Eye.with_axial_length"
        )
    if suffix == ".json" and media:
        raise InvalidInputError("media must be left out for a .json file, which holds its media")
