"""How all figures look, and how they are written."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from isetcl.figures.result import FigureResult, Row, write_json
from isetcl.units import ARCMIN_PER_DEG

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from isetcl.figures.quality import Quality
    from isetcl.retina.image import RetinalImage

DEGREES = "visual angle (deg)"
ARCMINUTES = "visual angle (arcmin)"
BAND_COLOUR = "0.85"


def blank(width_in: float, height_in: float) -> Figure:
    """An empty figure."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width_in, height_in), layout="constrained")


def show_image(
    ax: Axes,
    image: RetinalImage,
    title: str,
    *,
    white_point: str = "E",
    white_lux: float | None = None,
    arcmin: bool = False,
    has_y_label: bool = True,
) -> None:
    """A retinal image as sRGB, upright, with axes in degrees or arcmin."""
    scale = ARCMIN_PER_DEG if arcmin else 1.0
    left, right, low, high = (scale * value for value in image.extent_deg)
    ax.imshow(
        image.to_srgb(white_lux, white_point),
        extent=(left, right, low, high),
        interpolation="nearest",
    )
    ax.set_title(title, fontsize="medium")
    label = ARCMINUTES if arcmin else DEGREES
    ax.set_xlabel(label)
    if has_y_label:
        ax.set_ylabel(label)
    else:
        ax.tick_params(labelleft=False)


def letter(ax: Axes, name: str) -> None:
    """The letter of a panel, above its upper left corner."""
    ax.set_title(name, loc="left", fontweight="bold")


def finish(
    folder: Path,
    number: int,
    title: str,
    quality: Quality,
    picture: Figure,
    rows: tuple[Row, ...],
    numbers: Mapping[str, Any],
) -> FigureResult:
    """Write the picture and the numbers of a figure.

    Raises
    ------
    FileError
        If a file cannot be written.
    """
    from isetcl.output import write_file

    picture.suptitle(f"Figure {number}. {title}")
    buffer = io.BytesIO()
    picture.savefig(buffer, format="png", dpi=quality.pick(100, 160))
    stem = f"figure_{number:02d}"
    image = write_file(folder / f"{stem}.png", buffer.getvalue())
    record = write_json(folder / f"{stem}.json", number, title, quality.name, rows, numbers)
    return FigureResult(number, title, (image, record), rows, numbers)
