"""Outlines of letters, from the fonts that matplotlib finds; and text as a picture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_between,
    check_choice,
    check_count,
    check_finite,
    check_positive,
    check_type,
)
from isetcl.scene.texture import Image

if TYPE_CHECKING:
    from matplotlib.font_manager import FontProperties
    from matplotlib.path import Path as MatplotlibPath

DEFAULT_FONT = "DejaVu Sans"
"""The font that comes with matplotlib, so that a scene is the same on every machine."""

_CURVE_PIECES = 8


def text_outline(
    text: str,
    height_m: float,
    *,
    font: str = DEFAULT_FONT,
    weight: str = "normal",
) -> list[np.ndarray]:
    """Closed loops (n, 2) of a line of text, centred on the origin, metres.

    Parameters
    ----------
    text
        One line with something to see in it.
    height_m
        Height of the ink: from the lowest to the highest point of this text.
    font
        Family of an installed font.
    weight
        ``"normal"`` or ``"bold"``.

    Raises
    ------
    InvalidInputError
        If the text is empty or not one line, the font is not installed or lacks a letter, or the
        height is not positive.
    """
    height = check_positive("height_m", height_m, "m")
    loops = _loops(_glyph_path(text, font, weight))
    low = np.min([loop.min(axis=0) for loop in loops], axis=0)
    high = np.max([loop.max(axis=0) for loop in loops], axis=0)
    scale = height / (high[1] - low[1])
    return [(loop - (low + high) / 2.0) * scale for loop in loops]


def text_image(
    text: str,
    rows: int = 128,
    *,
    font: str = DEFAULT_FONT,
    weight: str = "normal",
    margin: float = 0.1,
    ink: float = 0.0,
    paper: float = 1.0,
) -> Image:
    """A line of text as a picture: each texel is the share of its area that the ink covers.

    Parameters
    ----------
    text
        One line with something to see in it.
    rows
        Texels from the top to the bottom; there are as many columns as the text needs.
    font, weight
        Family of an installed font; ``"normal"`` or ``"bold"``.
    margin
        Empty border on each side, a share of the picture's height.
    ink, paper
        Weights of the letters and of the ground, >= 0.

    Raises
    ------
    InvalidInputError
        If the text or the font serves for nothing, or a number breaks its rule.
    """
    from matplotlib.backends.backend_agg import RendererAgg
    from matplotlib.transforms import Affine2D

    count = check_count("rows", rows, 4, 16384)
    border = check_between("margin", margin, 0.0, 0.45) * count
    weights = [check_finite(name, value) for name, value in (("ink", ink), ("paper", paper))]
    if min(weights) < 0:
        raise InvalidInputError(f"ink and paper must be >= 0, got {ink:g} and {paper:g}")
    path = _glyph_path(text, font, weight)
    box = path.get_extents()
    scale = (count - 2.0 * border) / box.height
    columns = max(4, round(box.width * scale + 2.0 * border))
    place = Affine2D().translate(-box.x0 - box.width / 2, -box.y0 - box.height / 2)
    place = place.scale(scale).translate(columns / 2.0, count / 2.0)
    agg: Any = RendererAgg
    canvas = agg(columns, count, 72.0)
    pen = canvas.new_gc()
    pen.set_linewidth(0.0)
    pen.set_snap(False)
    canvas.draw_path(pen, path, place, (0.0, 0.0, 0.0, 1.0))
    cover = np.asarray(canvas.buffer_rgba())[..., 3] / 255.0
    return Image(weights[1] + (weights[0] - weights[1]) * cover, f"text {text!r}")


def _glyph_path(text: str, font: str, weight: str) -> MatplotlibPath:
    """The outlines of a line of text in the font's own units."""
    from matplotlib.path import Path
    from matplotlib.textpath import TextToPath

    check_type("text", text, str)
    if not text.strip() or not text.isprintable():
        raise InvalidInputError(f"text must be one line with letters, got {text!r}")
    vertices, codes = TextToPath().get_text_path(_properties(text, font, weight), text)
    return Path(vertices, codes)


def _properties(text: str, font: str, weight: str) -> FontProperties:
    """Font properties for a text, after a check that the font has all of its letters."""
    from matplotlib import font_manager

    check_type("font", font, str)
    check_choice("weight", weight, ("normal", "bold"))
    properties = font_manager.FontProperties(family=font, weight=weight)
    try:
        file = font_manager.findfont(properties, fallback_to_default=False)
    except ValueError:
        raise InvalidInputError(
            f"font {font!r} is not installed; {DEFAULT_FONT!r} always is"
        ) from None
    known = font_manager.get_font(file).get_charmap()
    lacking = sorted({letter for letter in text if ord(letter) not in known})
    if lacking:
        raise InvalidInputError(f"font {font!r} has no letter {', '.join(map(repr, lacking))}")
    return properties


def _loops(path: MatplotlibPath) -> list[np.ndarray]:
    """Closed loops of a path, its curves in straight pieces."""
    loops: list[list[np.ndarray]] = []
    t = (np.arange(_CURVE_PIECES) + 1.0)[:, None] / _CURVE_PIECES
    for points, code in path.iter_segments(simplify=False, curves=True):
        corners = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        if code == path.MOVETO:
            loops.append([corners])
        elif code == path.LINETO:
            loops[-1].append(corners)
        elif code in (path.CURVE3, path.CURVE4):
            pieces = np.concatenate([loops[-1][-1][-1:], corners])[:, None]
            while len(pieces) > 1:
                # De Casteljau's scheme: means of neighbours until one point is left.
                pieces = (1.0 - t) * pieces[:-1] + t * pieces[1:]
            loops[-1].append(pieces[0])
    closed = [np.concatenate(loop) for loop in loops]
    return [loop[:-1] if np.array_equal(loop[0], loop[-1]) else loop for loop in closed]
