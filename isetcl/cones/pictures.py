"""Pictures of mosaics."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from isetcl.cones.mosaic import ConeMosaic
from isetcl.cones.receptors import ReceptorType
from isetcl.errors import InvalidInputError, check_choice, check_type

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = {
    ReceptorType.L: "#d1495b",
    ReceptorType.M: "#3c9d5d",
    ReceptorType.S: "#3056c9",
    ReceptorType.ROD: "#9a9a9a",
}
"""Colours of the types in all pictures."""

MOST_DISCS = 30000
"""Receptors: with more of them apertures are smaller than a pixel, and middles are drawn."""


def plot_mosaic(
    mosaic: ConeMosaic, ax: Axes | None = None, *, units: str = "deg", legend: bool = True
) -> Axes:
    """Draw the receptors coloured by type; returns the axes.

    Apertures are drawn to scale; of more than 30 000 receptors only their middles.

    Parameters
    ----------
    ax
        Matplotlib axes; None makes a new figure.
    units
        ``"deg"``, the visual field as the eye sees it, or ``"mm"``, the retina.
    legend
        Whether types and their numbers are named.
    """
    check_choice("units", units, ("deg", "mm"))
    check_type("legend", legend, bool)
    axes = axes_or_new(ax)
    places = mosaic.positions_deg if units == "deg" else mosaic.positions_mm
    for kind in ReceptorType:
        own = mosaic.types == kind
        if not np.any(own):
            continue
        label = f"{kind.name.lower() if kind is ReceptorType.ROD else kind.name} ({own.sum()})"
        if len(mosaic) > MOST_DISCS:
            size = float(np.clip(2e5 / len(mosaic), 0.05, 4.0))
            x, y = places[own].T
            axes.scatter(x, y, s=size, c=COLOURS[kind], lw=0, label=label)
        else:
            diameter = mosaic.aperture_deg if units == "deg" else 1e-3 * mosaic.aperture_um
            _add_discs(axes, places[own], diameter[own], COLOURS[kind], label)
    axes.set_aspect("equal")
    low, high = places.min(axis=0), places.max(axis=0)
    margin = 0.02 * float((high - low).max()) or 0.01
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    what = "visual field" if units == "deg" else "retina"
    axes.set_xlabel(f"{what}, x ({units})")
    axes.set_ylabel(f"{what}, y ({units})")
    if legend:
        shown = axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)
        for handle in shown.legend_handles:
            if handle is not None and hasattr(handle, "set_sizes"):
                handle.set_sizes([40.0])
    return axes


def axes_or_new(ax: Axes | None) -> Axes:
    """The axes, or those of a new figure; raise InvalidInputError if they are none."""
    if ax is None:
        import matplotlib.pyplot as plt

        return plt.subplots(layout="constrained")[1]
    if not hasattr(ax, "add_collection"):
        raise InvalidInputError(f"ax must be matplotlib axes, got {type(ax).__name__}")
    return ax


def _add_discs(
    axes: Axes, places: np.ndarray, diameter: np.ndarray, colour: str, label: str
) -> None:
    from matplotlib.collections import EllipseCollection

    discs = EllipseCollection(
        diameter,
        diameter,
        np.zeros(len(places)),
        units="xy",
        offsets=places,
        offset_transform=axes.transData,
        facecolor=colour,
        linewidth=0,
    )
    axes.add_collection(discs)
    axes.scatter([], [], s=40, c=colour, lw=0, label=label)
