"""Figure 4: letters at three distances through three model eyes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from isetcl.eye import catalog
from isetcl.figures.blur import ObjectBlur, brightness, object_blurs, sharp_view
from isetcl.figures.pictures import blank, finish, letter, show_image
from isetcl.figures.result import FigureResult, Row, states
from isetcl.scene import targets

if TYPE_CHECKING:
    from isetcl.eye.model import Eye
    from isetcl.figures.quality import Quality

NUMBER = 4
TITLE = "Retinal irradiance through three schematic eyes"

DISTANCES_M = {"A": 1.0 / 1.4, "B": 1.0, "C": 1.0 / 0.6}
_FIELDS_DEG = (-1.5, 0.0, 1.0)
_HEIGHT_M = 0.035
_PUPIL_MM = 4.0
_LE_GRAND = (
    "spherical aberration: at 4 mm the relaxed Le Grand eye has its smallest spot for an object at "
    "1.5 dpt, although its paraxial focus is at infinity"
)
_MOST_BLUR_ARCMIN = 40.0


def eyes() -> dict[str, Eye]:
    """The three eyes, relaxed, with the paper's pupil."""
    return {
        "Arizona": catalog.arizona(_PUPIL_MM),
        "Navarro": catalog.navarro(_PUPIL_MM),
        "Le Grand": catalog.legrand(_PUPIL_MM),
    }


def draw(folder: Path, quality: Quality) -> FigureResult:
    """The three images, and how blurred every letter is in each."""
    scene = targets.letters_at_depth(
        "ABC", tuple(DISTANCES_M.values()), _FIELDS_DEG, height_m=_HEIGHT_M
    )
    view: dict[str, Any] = {
        "fov_deg": (5.0, 3.75),
        "resolution": quality.pick((96, 72), (320, 240)),
        "spp": quality.pick(32, 96),
    }
    picture = blank(11.5, 3.6)
    panels = picture.subplots(1, 3)
    blurs: dict[str, list[ObjectBlur]] = {}
    for i, (name, eye) in enumerate(eyes().items()):
        image = quality.render(scene, eye, **view)
        sharp = sharp_view(quality, scene, eye, **view)
        blurs[name] = object_blurs(brightness(image)[0], sharp, eye, DISTANCES_M, _MOST_BLUR_ARCMIN)
        show_image(panels[i], image, f"{name} eye", has_y_label=i == 0)
        letter(panels[i], "ABC"[i])
    rows = [found.row(f"{name} eye") for name, row in blurs.items() for found in row]
    rows += _statements(blurs)
    numbers = {
        name: {
            "focus_dpt": eye.focus_vergence_dpt(),
            "blur_arcmin": {found.name: found.found_arcmin for found in blurs[name]},
        }
        for name, eye in eyes().items()
    }
    return finish(folder, NUMBER, TITLE, quality, picture, tuple(rows), numbers)


def _statements(blurs: dict[str, list[ObjectBlur]]) -> list[Row]:
    sizes = {name: [found.found_arcmin for found in row] for name, row in blurs.items()}
    rows = [
        states(
            f"sharpness of the letters, {name} eye",
            "A {:.1f}, B {:.1f}, C {:.1f} arcmin".format(*size),
            "focused at infinity (so C, 0.6 dpt, should be sharpest, A least)",
            "caption of Figure 4",
            size[2] < size[1] < size[0],
            known=_LE_GRAND if name == "Le Grand" else "",
        )
        for name, size in sizes.items()
    ]
    middle = {name: float(np.mean(size)) for name, size in sizes.items()}
    rows.append(
        states(
            "the eyes differ",
            ", ".join(f"{name} {size:.1f}" for name, size in middle.items()) + " arcmin, mean",
            "sharpness and depth of field differ between the eyes",
            "caption of Figure 4",
            max(middle.values()) > 1.1 * min(middle.values()),
        )
    )
    return rows
