"""Pictures of rays: spot diagrams and ray fans. Nothing here computes a result."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from isetcl.eye.aberrations.geometric import Spot
from isetcl.eye.pictures.picture_parts import (
    PALE,
    dress,
    figure_or_new,
    legend_below,
    wavelength_colour,
)
from isetcl.eye.pictures.ray_fan import RayFan
from isetcl.units import ARCMIN_PER_DEG

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from isetcl.eye.pictures.picture_parts import AnyFigure

_AIRY = 1.2196698912665045  # first zero of J1 over pi
_DOT_AREA = 900.0  # of all dots of a spot together, points^2


def draw_spots(
    spots: Sequence[Sequence[Spot]],
    fields_deg: Sequence[float],
    figure: AnyFigure | None = None,
    *,
    airy: Spot | None = None,
) -> AnyFigure:
    """Spot diagrams: a panel for each field angle, its wavelengths in colour; one scale.

    The area of a dot is the flux of its ray.

    Parameters
    ----------
    spots
        For each field angle the spots of all wavelengths, about one point.
    fields_deg
        Field angles, degrees.
    figure
        A matplotlib figure; None makes a new one.
    airy
        The spot among those of a field angle whose wavelength gives the Airy ring; None takes the
        middle one.
    """
    from matplotlib.figure import Figure

    count = len(spots)
    chosen = figure_or_new(figure, 1.2 + 2.9 * count, 4.4)
    panels = chosen.subplots(1, count, squeeze=False)[0]
    boxes = []
    for ax, row, field in zip(panels, spots, fields_deg, strict=True):
        for spot in row:
            _draw_dots(ax, spot)
        middle = row[len(row) // 2] if airy is None else airy
        ring = _airy_ring(middle)
        ax.plot(*ring, color="black", lw=1.2, label=f"Airy ring, {middle.wavelength_nm:g} nm")
        boxes.append(_box(row, ring))
        rms = ", ".join(f"{spot.rms_arcmin:.2g}" for spot in row)
        ax.set_title(f"{field:g}°\nRMS {rms} arcmin", fontsize="medium")
        ax.set_box_aspect(1.0)
        ax.set_xlabel("x (arcmin)")
        ax.grid(True, lw=0.3, alpha=0.6)
    half = 0.54 * max(float(np.max(high - low)) for low, high in boxes)
    for ax, (low, high) in zip(panels, boxes, strict=True):
        x, y = (low + high) / 2.0
        ax.set(xlim=(x - half, x + half), ylim=(y - half, y + half))
    panels[0].set_ylabel("y (arcmin)")
    legend_below(chosen, panels[0])
    if isinstance(chosen, Figure):
        # Square axes need one more pass of the layout than a figure takes by itself.
        chosen.draw_without_rendering()
    return chosen


def _draw_dots(ax: Axes, spot: Spot) -> None:
    colour = wavelength_colour(spot.wavelength_nm)
    sizes = _DOT_AREA * spot.weights
    ax.scatter(spot.x_arcmin, spot.y_arcmin, s=sizes, color=colour, lw=0, alpha=0.8)
    ax.plot([], [], ".", color=colour, label=f"{spot.wavelength_nm:g} nm")


def _box(row: Sequence[Spot], ring: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest (x, y) of what a panel shows."""
    shown = [np.stack([spot.x_arcmin, spot.y_arcmin]) for spot in row] + [np.stack(ring)]
    together = np.concatenate(shown, axis=1)
    return together.min(axis=1), together.max(axis=1)


def _airy_ring(spot: Spot) -> tuple[np.ndarray, np.ndarray]:
    """The first dark ring of the pupil without aberrations, an ellipse, about the chief ray."""
    offset = spot.entrance_mm - spot.weights @ spot.entrance_mm
    # An even ellipse is four standard deviations wide.
    width = 4.0 * np.sqrt(spot.weights @ offset**2)
    radius = np.degrees(_AIRY * spot.wavelength_nm * 1e-6 / width) * ARCMIN_PER_DEG
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    return radius[0] * np.cos(turn), radius[1] * np.sin(turn)


def draw_fans(fans: Sequence[Sequence[RayFan]], figure: AnyFigure | None = None) -> AnyFigure:
    """Ray fans: a row for each field angle, its two sections side by side.

    Parameters
    ----------
    fans
        For each field angle the fans of all wavelengths, about one point.
    figure
        A matplotlib figure; None makes a new one.
    """
    chosen = figure_or_new(figure, 8.0, 1.2 + 2.3 * len(fans))
    panels = chosen.subplots(len(fans), 2, sharex=True, sharey="row", squeeze=False)
    for i, (pair, row) in enumerate(zip(panels, fans, strict=True)):
        for ax, section in zip(pair, ("tangential", "sagittal"), strict=True):
            ax.axhline(0.0, color=PALE, lw=0.8)
            ax.axvline(0.0, color=PALE, lw=0.8)
            for fan in row:
                ax.plot(
                    fan.pupil,
                    getattr(fan, f"{section}_arcmin"),
                    color=wavelength_colour(fan.wavelength_nm),
                    lw=1.6,
                    label=f"{fan.wavelength_nm:g} nm",
                )
            dress(ax, "", "", section if i == 0 else "")
        pair[0].set_ylabel(f"{row[0].field_deg:g}°: error (arcmin)")
    for ax in panels[-1]:
        ax.set_xlabel("pupil coordinate")
    legend_below(chosen, panels[0, 0])
    return chosen
