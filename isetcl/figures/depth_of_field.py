"""Figure 7: a chess set through pupils of three sizes."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from isetcl.eye import catalog
from isetcl.figures.blur import ObjectBlur
from isetcl.figures.deep_blur import deep_blurs, deep_view
from isetcl.figures.pictures import blank, finish, letter, show_image
from isetcl.figures.result import FigureResult, Row, states
from isetcl.scene import targets
from isetcl.scene.targets.chess import SQUARE_M

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from isetcl.figures.quality import Quality
    from isetcl.scene.model import Scene

NUMBER = 7
TITLE = "Depth of field by pupil size"

FOCUS_M = 0.28
PUPILS_MM = (2.0, 4.0, 6.0)
PAWN = "white pawn e4"
PIECES = (PAWN, "white queen d1", "black knight f6", "black king e8")
"""In focus, nearer, farther and farthest."""

_POSITION = "r1bqkb1r/pppp1ppp/2n2n2/4p3/2B1P3/5N2/PPPP1PPP/RNBQ1RK1"
_EYE_ABOVE_BOARD_M = 0.0881
_PAWN_MIDDLE_M = 0.0116
_FILE_AND_RANK = {name: ("abcdefgh".index(name[-2]), int(name[-1]) - 1) for name in PIECES}
_MOST_BLUR_ARCMIN = 90.0


def scene_and_distances() -> tuple[Scene, dict[str, float]]:
    """The chess set seen by an eye that looks at the pawn, and the pieces' distances, m.

    The distances are measured along the axis of the eye.
    """
    below = _EYE_ABOVE_BOARD_M - _PAWN_MIDDLE_M
    file, rank = _FILE_AND_RANK[PAWN]
    aside = (file - 3.5) * SQUARE_M
    away = math.sqrt(FOCUS_M**2 - below**2 - aside**2)
    board = away + (3.5 - rank) * SQUARE_M
    gaze = np.array([aside, -below, -away]) / FOCUS_M
    scene = targets.chess_set(board, _POSITION, eye_height_m=_EYE_ABOVE_BOARD_M)
    distances = {}
    for name, (file, rank) in _FILE_AND_RANK.items():
        place = [(file - 3.5) * SQUARE_M, -below, (3.5 - rank) * SQUARE_M - board]
        distances[name] = float(gaze @ np.array(place))
    return scene.seen_from((0.0, 0.0, 0.0), look_at_m=tuple(gaze * FOCUS_M)), distances


def draw(folder: Path, quality: Quality) -> FigureResult:
    """The three images, and how blurred pieces before and behind the pawn are in each."""
    scene, distances = scene_and_distances()
    view: dict[str, Any] = {
        "fov_deg": (30.0, 22.5),
        "resolution": quality.pick((144, 108), (400, 300)),
    }
    spp, finer = quality.pick((10, 2), (32, 2))
    eyes = {pupil: catalog.navarro(pupil, 1.0 / FOCUS_M) for pupil in PUPILS_MM}
    deep = deep_view(quality, scene, eyes[4.0], finer, spp=max(2, spp // finer**2), **view)
    picture = blank(13.0, 3.9)
    panels = picture.subplots(1, 3)
    blurs: dict[float, list[ObjectBlur]] = {}
    for i, (pupil, eye) in enumerate(eyes.items()):
        image = quality.render(scene, eye, spp=spp, **view)
        blurs[pupil] = deep_blurs(image, deep, eye, distances, _MOST_BLUR_ARCMIN)
        show_image(panels[i], image, f"pupil {pupil:g} mm", has_y_label=i == 0)
        _frame(panels[i], deep.sharp.masks[PAWN], image.extent_deg)
        letter(panels[i], "ABC"[i])
    rows = [found.row(f"pupil {pupil:g} mm") for pupil, row in blurs.items() for found in row]
    rows += _statements(blurs)
    numbers = {
        "distances_m": distances,
        "blur_arcmin": {
            f"{pupil:g} mm": {found.name: found.found_arcmin for found in row}
            for pupil, row in blurs.items()
        },
        "tolerance_arcmin": {
            f"{pupil:g} mm": {found.name: found.tolerance_arcmin for found in row}
            for pupil, row in blurs.items()
        },
    }
    return finish(folder, NUMBER, TITLE, quality, picture, tuple(rows), numbers)


def _frame(ax: Axes, mask: np.ndarray, extent: tuple[float, float, float, float]) -> None:
    """A red box around the pixels of a mask."""
    from matplotlib.patches import Rectangle

    rows, columns = np.nonzero(mask)
    left, right, low, high = extent
    width, height = (right - left) / mask.shape[1], (high - low) / mask.shape[0]
    corner = (left + width * (columns.min() - 2), high - height * (rows.max() + 3))
    size = width * (np.ptp(columns) + 5), height * (np.ptp(rows) + 5)
    ax.add_patch(Rectangle(corner, *size, fill=False, edgecolor="red", lw=1.2))


def _statements(blurs: dict[float, list[ObjectBlur]]) -> list[Row]:
    sizes = {p: {found.name: found.found_arcmin for found in row} for p, row in blurs.items()}
    king = [sizes[pupil][PIECES[-1]] for pupil in PUPILS_MM]
    pawn = [sizes[pupil][PAWN] for pupil in PUPILS_MM]
    ratio = [
        min(size[name] for name in PIECES if name != PAWN) / size[PAWN] for size in sizes.values()
    ]
    return [
        states(
            f"blur of the {PIECES[-1]}, by pupil",
            ", ".join(f"{size:.1f}" for size in king) + " arcmin",
            "depth of field decreases as pupil size increases",
            "caption of Figure 7",
            king[0] < king[1] < king[2],
        ),
        states(
            "the pawn's blur, and the least other one over it",
            ", ".join(f"{s:.1f} arcmin ({r:.1f}x)" for s, r in zip(pawn, ratio, strict=True)),
            "the pawn remains in focus, what is before and behind is not",
            "caption of Figure 7",
            all(r > 1.0 for r in ratio[1:]),
        ),
    ]
