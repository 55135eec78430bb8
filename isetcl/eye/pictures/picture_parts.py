"""What all pictures of an eye share: colours, axes, and how they are dressed.

matplotlib is imported only when something is drawn.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from isetcl.errors import InvalidInputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

    AnyFigure = Figure | SubFigure

FIELD_COLOURS = ("#1f4e79", "#c0392b", "#2e8b57", "#8e44ad", "#d68910", "#117a8b")
"""Colours of field angles, in turn; the first is that of rays elsewhere."""

GREY = "0.25"
PALE = "0.6"

_PAD_IN = 0.08
_VIOLET_NM, _RED_NM = 400.0, 700.0


def field_name(field_deg: tuple[float, float] | float) -> str:
    """A field angle as text: 5° upwards, or (3, 4)°."""
    x, y = (0.0, float(field_deg)) if isinstance(field_deg, (int, float)) else field_deg
    return f"{y:g}°" if x == 0 else f"({x:g}, {y:g})°"


def field_colour(i: int) -> str:
    """The colour of the field angle number i."""
    return FIELD_COLOURS[i % len(FIELD_COLOURS)]


def wavelength_colour(wavelength_nm: float) -> tuple[float, float, float]:
    """A colour, dark enough for white paper, that reminds of a wavelength in nm."""
    from matplotlib import colormaps

    place = np.clip((wavelength_nm - _VIOLET_NM) / (_RED_NM - _VIOLET_NM), 0.0, 1.0)
    red, green, blue, _ = colormaps["turbo"](0.08 + 0.86 * float(place))
    return 0.85 * red, 0.75 * green, 0.9 * blue


def axes_or_new(ax: Axes | None) -> Axes:
    """The axes given, or those of a new figure.

    Raises
    ------
    InvalidInputError
        If they are none of matplotlib.
    """
    if ax is None:
        import matplotlib.pyplot as plt

        return plt.subplots(layout="constrained")[1]
    if not hasattr(ax, "imshow"):
        raise InvalidInputError(f"ax must be matplotlib axes, got {type(ax).__name__}")
    return ax


def figure_or_new(figure: AnyFigure | None, width: float, height: float) -> AnyFigure:
    """The figure given, or a new one of a size in inches.

    Raises
    ------
    InvalidInputError
        If it is none of matplotlib.
    """
    if figure is None:
        import matplotlib.pyplot as plt
        from matplotlib.layout_engine import ConstrainedLayoutEngine

        new = plt.figure(figsize=(width, height), layout="constrained")
        engine = new.get_layout_engine()
        assert isinstance(engine, ConstrainedLayoutEngine)
        engine.set(w_pad=_PAD_IN, h_pad=_PAD_IN)
        return new
    if not hasattr(figure, "subplots"):
        raise InvalidInputError(
            f"figure must be a matplotlib figure, got {type(figure).__name__}; pass axes as ax "
            "where there is one plot only"
        )
    return figure


def dress(ax: Axes, x_label: str, y_label: str, title: str = "") -> Axes:
    """Labels and a faint grid, for curves."""
    ax.set_xlabel(x_label)
    ax.set_ylabel(y_label)
    if title:
        ax.set_title(title)
    ax.grid(True, lw=0.4, alpha=0.7)
    ax.set_axisbelow(True)
    return ax


def legend_below(figure: AnyFigure, ax: Axes) -> None:
    """What lines of some axes mean, below all axes of a figure."""
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="outside lower center",
        ncols=len(labels),
        frameon=False,
        fontsize="small",
    )


def scale_bar(ax: Axes, length_arcmin: float, colour: str) -> None:
    """A bar of a length in arcmin in the lower left corner of an image in arcmin."""
    left, right = ax.get_xlim()
    low, high = ax.get_ylim()
    x = left + 0.06 * (right - left)
    y = low + 0.06 * (high - low)
    ax.plot([x, x + length_arcmin], [y, y], color=colour, lw=3, solid_capstyle="butt")
    ax.text(
        x + length_arcmin / 2.0,
        y + 0.02 * (high - low),
        f"{length_arcmin:g} arcmin",
        color=colour,
        ha="center",
        va="bottom",
    )


def round_length(about: float) -> float:
    """The largest of 1, 2, 5, times a power of ten, that is at most `about` > 0."""
    power = 10.0 ** np.floor(np.log10(about))
    return float(
        power * max(step for step in (1.0, 2.0, 5.0) if step * power <= about * (1 + 1e-9))
    )
