"""Figure 8: numerals at their distances in millimetres, by accommodation."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from isetcl.errors import FocusError
from isetcl.eye import catalog
from isetcl.figures.blur import ObjectBlur, object_blurs, sharp_view
from isetcl.figures.pictures import blank, finish, letter, show_image
from isetcl.figures.result import FigureResult, Row, states
from isetcl.scene import targets
from isetcl.spectrum import Spectrum

if TYPE_CHECKING:
    from isetcl.eye.model import Eye
    from isetcl.figures.quality import Quality
    from isetcl.retina.image import RetinalImage

NUMBER = 8
TITLE = "Accommodation"

NUMERALS_M = {"100": 0.1, "200": 0.2, "300": 0.3}
_PUPIL_MM = 4.0
_LARGEST_PARAMETER = 10.0
_RED_NM = np.arange(610.0, 651.0, 10.0)
_GREEN_NM = np.arange(500.0, 541.0, 10.0)
_MOST_BLUR_ARCMIN = 150.0


def accommodated(distance_m: float) -> Eye:
    """Navarro's eye, in focus at a distance, or as near to it as the model's formulas go."""
    try:
        return catalog.navarro(_PUPIL_MM, 1.0 / distance_m)
    except FocusError:
        return catalog.navarro(_PUPIL_MM, accommodation_parameter=_LARGEST_PARAMETER)


def redness(image: RetinalImage) -> tuple[np.ndarray, np.ndarray]:
    """Long wavelengths less as much of middle ones as greys in the light of D65 have of both.

    Only the red numerals have any: what stands behind them drops out, and so
    does its noise, which all wavelengths share. With its standard error, each (rows, columns).
    """
    lamp = Spectrum.illuminant("D65").at(image.wavelengths_nm)
    long = np.isin(image.wavelengths_nm, _RED_NM)
    middle = np.isin(image.wavelengths_nm, _GREEN_NM)
    share = lamp[long].sum() / lamp[middle].sum()
    value, error = (
        np.asarray(part.values[long].sum(axis=0) - share * part.values[middle].sum(axis=0))
        for part in (image.irradiance, image.standard_error)
    )
    return value, np.abs(error)


def draw(folder: Path, quality: Quality) -> FigureResult:
    """The eye accommodated to each of three numerals, and how blurred each of them is."""
    scene = targets.numbers_at_depth()
    view: dict[str, Any] = {
        "fov_deg": (30.0, 30.0),
        "resolution": quality.pick(96, 240),
        "spp": quality.pick(16, 64),
    }
    picture = blank(12.5, 4.9)
    panels = picture.subplots(1, 3)
    blurs: dict[str, list[ObjectBlur]] = {}
    for i, (focus, distance) in enumerate(NUMERALS_M.items()):
        eye = accommodated(distance)
        image = quality.render(scene, eye, **view)
        # The eye grows a little as it accommodates: each view has its own sharp one.
        sharp = sharp_view(quality, scene, eye, redness, **view)
        blurs[focus] = object_blurs(
            redness(image)[0], sharp, eye, NUMERALS_M, _MOST_BLUR_ARCMIN, _RED_NM
        )
        title = f"accommodated to {focus} mm"
        show_image(panels[i], image, title, white_point="D65", has_y_label=i == 0)
        letter(panels[i], "ABC"[i])
    rows = [found.row(f"focus {focus} mm") for focus, row in blurs.items() for found in row]
    rows += [_statement(focus, row) for focus, row in blurs.items()]
    numbers = {
        focus: {found.name: found.found_arcmin for found in row} for focus, row in blurs.items()
    }
    return finish(
        folder, NUMBER, TITLE, quality, picture, tuple(rows), {"blur_arcmin_by_focus_mm": numbers}
    )


def _statement(focus: str, blurs: list[ObjectBlur]) -> Row:
    sizes = {found.name: found.found_arcmin for found in blurs}
    return states(
        f"blur of 100, 200, 300, focus {focus} mm",
        ", ".join(f"{size:.0f}" for size in sizes.values()) + " arcmin",
        f"{focus} is in focus, the others are not",
        "caption of Figure 8",
        min(sizes, key=lambda name: sizes[name]) == focus,
    )
