"""What the command line makes of words: a scene to look at, a place for the eye, its focus."""

from __future__ import annotations

import dataclasses
import difflib
import math
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from isetcl.errors import FileError, FocusError, InvalidInputError, check_choice, check_positive

if TYPE_CHECKING:
    from isetcl.eye.model import Eye
    from isetcl.scene.model import Scene
    from isetcl.spectrum import Spectrum

TARGETS = {
    "chess_set": 30.0,
    "cornell_box": 40.0,
    "letters_at_depth": 18.0,
    "macbeth_chart": 34.0,
    "numbers_at_depth": 30.0,
    "point_grid": 24.0,
    "point_source": 0.5,
    "siemens_star": 6.0,
    "slanted_edge": 2.0,
    "snellen_chart": 5.5,
    "tca_grid": 40.0,
    "textured_plane": 40.0,
    "two_planes": 2.0,
    "uniform": 10.0,
}
"""Targets that need no arguments, and the field of view that shows them, degrees."""

WIDEST_FOV_DEG = 40.0
"""Field of view, unless asked for, of scenes that are wider."""

NARROWEST_FOV_DEG = 0.5
"""Field of view, unless asked for, of scenes that are narrower."""

SKY_CD_M2 = 100.0
"""Luminance of the sky around a scene without any light."""

_HEADROOM = 3.0
"""Illuminance shown as white, times what a quarter of the lit part of the image exceeds."""
_DARK = 0.002
"""Illuminance of parts that are not lit, times the brightest."""

_WORDS = ("relaxed", "centre")
_METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}


def note(text: str) -> None:
    """Tell the user something that is no result."""
    print(f"isetcl: note: {text}", file=sys.stderr)


def read_scene(name: str, *, allow_outside: bool) -> Scene:
    """The scene of a file or a target.

    Raises
    ------
    InvalidInputError, FileError
        If there is neither a file nor a target of that name, or the file cannot be read.
    """
    import isetcl.scene.load as load

    path = Path(name)
    if _target_of(name) is not None and not path.exists():
        return _target(_target_of(name) or name)
    if not path.suffix and not path.exists() and path.name == name:
        try:
            check_choice("target", name.replace("-", "_").lower(), TARGETS)
        except InvalidInputError as error:
            raise InvalidInputError(f"{error}; a scene file has a suffix, such as .glb") from None
    if not path.exists():
        raise FileError(f"scene file {name!r} does not exist{_near_files(path)}")
    try:
        scene = load.load_scene(path, allow_outside=allow_outside)
    except FileError as error:
        raise FileError(str(error).replace("allow_outside=True", "--allow-outside")) from error
    if not scene.objects:
        note(f"scene {scene.name!r} holds no objects: all that is seen is its background")
    return scene


def _target_of(name: str) -> str | None:
    folded = name.replace("-", "_").lower()
    return folded if folded in TARGETS else None


def _target(name: str) -> Scene:
    from isetcl.scene import targets
    from isetcl.scene.texture import Checkerboard

    if name == "textured_plane":
        return targets.textured_plane(Checkerboard(8, 8, bright=1.0, dark=0.05))
    scene: Scene = getattr(targets, name)()
    return scene


def _near_files(path: Path) -> str:
    """Files of the folder with a similar name, as a question."""
    try:
        names = sorted(p.name for p in path.parent.iterdir() if p.is_file())
    except OSError:
        return f": there is no folder {str(path.parent)!r}"
    near = difflib.get_close_matches(path.name, names, n=3, cutoff=0.6)
    return f"; did you mean {' or '.join(str(path.parent / n) for n in near)}?" if near else ""


def placed(scene: Scene, eye_at: str | None, look_at: str | None) -> Scene:
    """The scene in the frame of an eye at a point that looks at another, each 'x,y,z' or None.

    An eye that looks straight up or down has -z on top.

    Raises
    ------
    InvalidInputError
        If a point is none, or both are the same.
    """
    start, target = point("--from", eye_at), point("--look-at", look_at)
    if start is None and target is None:
        return scene
    place = (0.0, 0.0, 0.0) if start is None else start
    if target is None:
        return scene.seen_from(place)
    x, _, z = np.subtract(target, place)
    is_upright = math.hypot(x, z) > 1e-6 * math.dist(target, place)
    if target == place:
        raise InvalidInputError(
            f"--look-at must be another point than --from, got {look_at!r} for both"
        )
    return scene.seen_from(place, target, up=(0, 1, 0) if is_upright else (0, 0, -1))


def point(option: str, text: str | None) -> tuple[float, float, float] | None:
    """A point from 'x,y,z' in metres.

    Raises
    ------
    InvalidInputError
        If it is not three finite numbers.
    """
    if text is None:
        return None
    try:
        x, y, z = (float(part) for part in text.strip("()").split(","))
    except ValueError:
        x = y = z = math.nan
    if not all(map(math.isfinite, (x, y, z))):
        raise InvalidInputError(
            f"{option} must be three numbers in metres with commas, such as 0,1.6,-2, got {text!r}"
        )
    return x, y, z


def pixels(text: str) -> tuple[int, int]:
    """Columns and rows from '256' or '320x200'.

    Raises
    ------
    InvalidInputError
        If it is neither.
    """
    match = re.fullmatch(r"(\d+)(?:[x,*](\d+))?", text.strip().lower())
    if match is None:
        raise InvalidInputError(
            f"--size must be a number of pixels, such as 256, or columns x rows, such as 320x200, "
            f"got {text!r}"
        )
    columns, rows = match.group(1), match.group(2)
    return int(columns), int(rows or columns)


def vergence(text: str) -> float | str:
    """Dioptres from '2', '2dpt' or '0.5m'; words are returned as they are.

    Raises
    ------
    InvalidInputError
        If it is none of these.
    """
    folded = text.strip().lower()
    if folded in _WORDS or folded == "center":
        return "centre" if folded == "center" else folded
    match = re.fullmatch(r"([-+0-9.e]+)\s*(m|cm|mm|dpt|d)?", folded)
    try:
        value = float(match.group(1)) if match else math.nan
    except ValueError:
        value = math.nan
    unit = match.group(2) if match else None
    if not math.isfinite(value):
        raise InvalidInputError(
            "--accommodation must be dioptres (2), a distance (0.5m), 'relaxed' or 'centre', got "
            f"{text!r}"
        )
    if unit in _METRES:
        return 1.0 / check_positive("--accommodation (distance)", value * _METRES[unit], "m")
    return value


def accommodated(name: str, pupil: float, wanted: float | str, scene: Scene) -> Eye:
    """The model eye; "centre" focuses it on what stands on its axis, as far as it can.

    Raises
    ------
    InvalidInputError
        If the eye is unknown, or cannot focus where it was asked to.
    """
    from isetcl.eye import catalog
    from isetcl.scene.extent import middle_ahead_m

    relaxed = catalog.by_name(name, pupil)
    if wanted == "relaxed" or (wanted == "centre" and relaxed.accommodation_model is None):
        return relaxed
    if wanted != "centre":
        return catalog.by_name(name, pupil, float(wanted))
    distance = middle_ahead_m(scene)
    if math.isinf(distance):
        note("nothing stands in the middle of the image: the eye is relaxed")
        return relaxed
    what = f"what stands in the middle of the image, {distance:.3g} m away"
    try:
        eye = catalog.by_name(name, pupil, 1.0 / distance)
    except FocusError:
        far_point = relaxed.focus_vergence_dpt()
        limit = "too near" if 1.0 / distance > far_point else "beyond its far point"
        note(f"the eye is relaxed: {what}, is {limit}")
        return relaxed
    note(f"the eye is focused on {what}")
    return eye


def lit(scene: Scene, sky: float | None) -> Scene:
    """The scene under an even sky, where one is asked for or there is no other light.

    Raises
    ------
    InvalidInputError
        If the luminance is not positive.
    """
    from isetcl.spectrum import Spectrum

    luminance = None if sky is None else check_positive("--sky", sky, "cd/m^2")
    if luminance is None:
        if light_spectra(scene):
            return scene
        luminance = SKY_CD_M2
        note(
            f"scene {scene.name!r} has no light: an even sky of {luminance:g} cd/m^2 lights it; "
            "choose another with --sky"
        )
    elif scene.background is not None:
        note(f"an even sky of {luminance:g} cd/m^2 replaces the background of {scene.name!r}")
    white = Spectrum.illuminant("D65", luminance)
    return dataclasses.replace(scene, background=white)


def light_spectra(scene: Scene) -> list[Spectrum]:
    """Spectra of everything that sends out light."""
    from isetcl.scene.light import Environment, light_spectrum
    from isetcl.scene.material import UnlitReflectance

    spectra = [light_spectrum(light) for light in scene.lights]
    if isinstance(scene.background, Environment):
        spectra += scene.background.spectra()
    elif scene.background is not None:
        spectra.append(scene.background)
    for item in scene.objects:
        if isinstance(item.emitted, UnlitReflectance):
            spectra.append(item.emitted.white)
        elif item.emitted is not None:
            spectra += item.emitted.spectra()
    return [spectrum for spectrum in spectra if np.any(spectrum.values > 0)]


def white_point(scene: Scene) -> str:
    """The illuminant, "E" or "D65", that is nearer to the colour of a scene's light."""
    import colour

    observer = "CIE 1931 2 Degree Standard Observer"
    matching = colour.MSDS_CMFS[observer]
    total = np.zeros(3)
    for spectrum in light_spectra(scene):
        values = np.interp(
            matching.wavelengths, spectrum.wavelengths_nm, spectrum.values, left=0, right=0
        )
        total += values @ matching.values
    if not np.any(total > 0):
        return "D65"
    chromaticity = total[:2] / total.sum()
    whites = colour.CCS_ILLUMINANTS[observer]
    return min(
        ("E", "D65"), key=lambda name: float(np.linalg.norm(chromaticity - np.array(whites[name])))
    )


def exposure_lux(scene: Scene, illuminance_lux: np.ndarray) -> float:
    """The illuminance to show as white.

    The brightest of the image; in scenes that scatter light less, so that a lamp in sight does not
    leave the room dark.
    """
    brightest = float(np.percentile(illuminance_lux, 99.5))
    lit_parts = illuminance_lux[illuminance_lux > _DARK * brightest]
    if not scene.has_reflection or lit_parts.size == 0:
        return brightest
    return min(brightest, _HEADROOM * float(np.percentile(lit_parts, 75)))


def field_of_view(name: str, scene: Scene, asked: float | None) -> float:
    """The width of the image in degrees: as asked, of the target, or what shows the scene."""
    from isetcl.scene.extent import width_deg

    if asked is not None:
        return check_positive("--fov", asked, "deg")
    target = _target_of(name)
    if target is not None and not Path(name).exists():
        return TARGETS[target]
    return min(WIDEST_FOV_DEG, max(NARROWEST_FOV_DEG, 1.05 * width_deg(scene)))


def where(scene: Scene) -> str:
    """Where a scene lies and from where it would be seen whole, as advice."""
    from isetcl.scene.extent import box_m

    box = box_m(scene)
    if box is None:
        return "the scene holds no objects"
    (x, y, z), (i, j, k) = box
    middle = box.mean(axis=0)
    away = max(1.5 * float(np.linalg.norm(box[1] - box[0])), 0.11)
    eye = f"{_short(middle[0])},{_short(middle[1])},{_short(middle[2] + away)}"
    target = ",".join(_short(m) for m in middle)
    return (
        f"objects lie in x {x:.3g} to {i:.3g}, y {y:.3g} to {j:.3g}, z {z:.3g} to {k:.3g} m; "
        f"to see them whole: --from {eye} --look-at {target}"
    )


def _short(number: float) -> str:
    return f"{round(number, 4) + 0.0:.4g}"
