"""Pictures of excitations: maps over the mosaic and profiles along a line."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from isetcl.cones.excitations import Excitations
from isetcl.cones.pictures import COLOURS, add_discs, axes_or_new, name_of, name_types
from isetcl.cones.receptors import APERTURE_TO_SPACING, ReceptorType
from isetcl.errors import (
    InvalidInputError,
    check_choice,
    check_count,
    check_finite,
    check_positive,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import Collection

Shown = Literal["mean", "counts"]
Colour = Literal["excitation", "type"]

GROUND = "#2b2f3a"
"""Colour between receptors: no grey, so that it is not taken for excitations."""

_DARKEST = 0.06  # of a type's colour: where nothing is excited the receptor is still seen
_MARKERS = {ReceptorType.L: "o", ReceptorType.M: "^", ReceptorType.S: "s", ReceptorType.ROD: "."}


def plot_excitations(
    excitations: Excitations,
    ax: Axes | None = None,
    *,
    frame: int = 0,
    shown: Shown = "mean",
    colour: Colour = "excitation",
    most: float | None = None,
) -> Axes:
    """Draw the mosaic with every receptor coloured by its excitations; returns the axes.

    Parameters
    ----------
    ax
        Matplotlib axes; None makes a new figure.
    frame
        Which frame.
    shown
        ``"mean"``, or ``"counts"`` for the noisy instance.
    colour
        ``"excitation"``, one scale of grey for all receptors; ``"type"``, the colour of the type,
        brighter where more of them are excited, each type relative to its own largest.
    most
        Excitations shown brightest; None is the largest of the frame. For one scale only.
    """
    values = values_of(excitations, shown)[check_frame(excitations, frame)]
    check_choice("colour", colour, ("excitation", "type"))
    axes = axes_or_new(ax)
    drawn = add_receptors(axes, excitations)
    if colour == "type":
        drawn.set_facecolor(_type_colours(excitations, values).tolist())
        kinds = [ReceptorType(kind) for kind in np.unique(excitations.types)]
        most_of = {kind: values[excitations.types == kind].max() for kind in kinds}
        name_types(axes, {k: f"{name_of(k)}, up to {most_of[k]:.3g}" for k in kinds})
    else:
        drawn.set_array(values)
        drawn.set_cmap("gray")
        largest = float(values.max()) if most is None else check_positive("most", most)
        drawn.set_clim(0.0, largest or 1.0)
        axes.figure.colorbar(drawn, ax=axes, label=label_of(excitations), shrink=0.85)
    return axes


def plot_profile(
    excitations: Excitations,
    ax: Axes | None = None,
    *,
    y_deg: float = 0.0,
    width_deg: float | None = None,
    frame: int = 0,
    shown: Shown = "counts",
) -> Axes:
    """Draw the excitations of receptors along a horizontal line, by type; returns the axes.

    As in Figure 11C of Lian et al. 2019, J Vision 19(12):23.

    Parameters
    ----------
    ax
        Matplotlib axes; None makes a new figure.
    y_deg, width_deg
        Height of the line and its width, degrees; None takes a line of receptors, 1.3 of the median
        aperture to both sides.
    frame, shown
        As in `plot_excitations`; noisy by default, with the means as fine dots.
    """
    number = check_frame(excitations, frame)
    values = values_of(excitations, shown)[number]
    on_line = line(excitations, y_deg, width_deg)
    axes = axes_or_new(ax)
    x = excitations.dataset["x_deg"].values
    mean = excitations.mean.values[number]
    for kind in ReceptorType:
        own = on_line & (excitations.types == kind)
        if not np.any(own):
            continue
        order = np.flatnonzero(own)[np.argsort(x[own])]
        marker = _MARKERS[kind]
        axes.plot(x[order], values[order], marker, ms=5, color=COLOURS[kind], label=kind.name)
        if shown == "counts":
            axes.plot(x[order], mean[order], ".", ms=2.5, color="k", alpha=0.6)
    if shown == "counts":
        axes.plot([], [], ".", ms=2.5, color="k", label="mean")
    axes.set(xlabel="visual field, x (deg)", ylabel=label_of(excitations), ylim=(0, None))
    axes.grid(True, lw=0.4, alpha=0.7)
    axes.legend(frameon=False)
    return axes


def line(
    excitations: Excitations, y_deg: float = 0.0, width_deg: float | None = None
) -> np.ndarray:
    """Which receptors lie on a horizontal line, (receptor,), bool.

    Raises
    ------
    InvalidInputError
        If none does.
    """
    check_finite("y_deg", y_deg, "deg")
    if width_deg is None:
        width = 2.6 * float(np.median(_diameters(excitations)))
    else:
        width = check_positive("width_deg", width_deg, "deg")
    y = excitations.dataset["y_deg"].values
    chosen = np.abs(y - y_deg) <= 0.5 * width
    if not np.any(chosen):
        raise InvalidInputError(
            f"no receptor lies within {width / 2:.3g} deg of y = {y_deg:g} deg; they span "
            f"{y.min():.4g} to {y.max():.4g} deg"
        )
    return np.asarray(chosen)


def check_frame(excitations: Excitations, frame: int) -> int:
    """The number of a frame; raise InvalidInputError where there is none."""
    return check_count("frame", frame, 0, len(excitations.mean) - 1)


def values_of(excitations: Excitations, shown: Shown) -> np.ndarray:
    """Means or a noisy instance, (frame, receptor)."""
    check_choice("shown", shown, ("mean", "counts"))
    found = excitations.mean if shown == "mean" else excitations.counts
    return np.asarray(found.values, dtype=np.float64)


def label_of(excitations: Excitations) -> str:
    """What the numbers are, for an axis."""
    return f"excitations in {1e3 * excitations.integration_time_s:g} ms"


def _type_colours(excitations: Excitations, values: np.ndarray) -> np.ndarray:
    """Colour of the type, brighter with more excitations, (receptor, 3)."""
    from matplotlib.colors import to_rgb

    colours = np.zeros((len(values), 3))
    for kind in np.unique(excitations.types):
        own = excitations.types == kind
        share = values[own] / (values[own].max() or 1.0)
        bright = _DARKEST + (1.0 - _DARKEST) * share
        colours[own] = bright[:, None] * np.array(to_rgb(COLOURS[ReceptorType(kind)]))
    return colours


def _diameters(excitations: Excitations) -> np.ndarray:
    if "aperture_deg" not in excitations.dataset.coords:
        raise InvalidInputError(
            "these excitations do not tell the apertures; make them anew (a profile can do with "
            "width_deg)"
        )
    return np.asarray(excitations.dataset["aperture_deg"].values)


def add_receptors(axes: Axes, excitations: Excitations) -> Collection:
    """Receptors without colours, on a dark ground."""
    data = excitations.dataset
    places = np.stack([data["x_deg"].values, data["y_deg"].values], axis=1)
    # About as wide as the receptors are apart, so that the map has no gaps.
    width = _diameters(excitations) / APERTURE_TO_SPACING
    axes.set_facecolor(GROUND)
    return add_discs(axes, places, width, "visual field, {} (deg)")
