"""Pictures of mosaics."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from isetcl.cones.mosaic import ConeMosaic
from isetcl.cones.receptors import ReceptorType
from isetcl.errors import InvalidInputError, check_choice, check_type
from isetcl.units import UM_PER_MM

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import Collection

COLOURS = {
    ReceptorType.L: "#d1495b",
    ReceptorType.M: "#3c9d5d",
    ReceptorType.S: "#3056c9",
    ReceptorType.ROD: "#9a9a9a",
}
"""Colours of the types in all pictures."""

_LEAST_MARGIN = 0.02  # of the field, around it


def plot_mosaic(
    mosaic: ConeMosaic, ax: Axes | None = None, *, units: str = "deg", legend: bool = True
) -> Axes:
    """Draw the apertures to scale, coloured by type; returns the axes.

    Parameters
    ----------
    ax
        Matplotlib axes; None makes a new figure.
    units
        ``"deg"``, the visual field as the eye sees it, or ``"mm"``, the retina.
    legend
        Whether types and their numbers are named, above the axes.
    """
    from matplotlib.colors import to_rgb

    check_choice("units", units, ("deg", "mm"))
    check_type("legend", legend, bool)
    axes = axes_or_new(ax)
    is_deg = units == "deg"
    drawn = add_discs(
        axes,
        mosaic.positions_deg if is_deg else mosaic.positions_mm,
        mosaic.aperture_deg if is_deg else mosaic.aperture_um / UM_PER_MM,
        f"{'visual field' if is_deg else 'retina'}, {{}} ({units})",
    )
    colours = np.array([to_rgb(COLOURS[kind]) for kind in ReceptorType])
    drawn.set_facecolor(colours[mosaic.types].tolist())
    if legend:
        counts = {kind: int(np.sum(mosaic.types == kind)) for kind in ReceptorType}
        name_types(axes, {kind: f"{name_of(kind)} ({n})" for kind, n in counts.items() if n})
    return axes


def axes_or_new(ax: Axes | None) -> Axes:
    """The axes, or those of a new figure; raise InvalidInputError if they are none."""
    if ax is None:
        import matplotlib.pyplot as plt

        return plt.subplots(layout="constrained")[1]
    if not hasattr(ax, "add_collection"):
        raise InvalidInputError(f"ax must be matplotlib axes, got {type(ax).__name__}")
    return ax


def add_discs(axes: Axes, places: np.ndarray, diameter: np.ndarray, label: str) -> Collection:
    """Discs without colours, to scale, in axes that hold them all and are labelled so.

    One collection, so that where discs are smaller than a pixel no type hides the others.
    """
    from matplotlib.collections import EllipseCollection

    discs = EllipseCollection(
        diameter,
        diameter,
        np.zeros(len(places)),
        units="xy",
        offsets=places,
        offset_transform=axes.transData,
        linewidth=0,
    )
    axes.add_collection(discs)
    axes.set_aspect("equal")
    low, high = places.min(axis=0), places.max(axis=0)
    margin = max(_LEAST_MARGIN * float((high - low).max()), 0.55 * float(diameter.max()))
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    axes.set_xlabel(label.format("x"))
    axes.set_ylabel(label.format("y"))
    return discs


def name_types(axes: Axes, texts: dict[ReceptorType, str]) -> None:
    """A legend of types above the axes."""
    for kind, text in texts.items():
        axes.scatter([], [], s=40, c=COLOURS[kind], lw=0, label=text)
    axes.legend(
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=len(texts),
        frameon=False,
        columnspacing=1.2,
        handletextpad=0.2,
    )


def name_of(kind: ReceptorType) -> str:
    """L, M, S or rod."""
    return kind.name.lower() if kind is ReceptorType.ROD else kind.name
