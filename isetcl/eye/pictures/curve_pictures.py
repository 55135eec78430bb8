"""Pictures of curves: MTF, through focus, chromatic aberration, field curvature and astigmatism.

Nothing here computes a result.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from isetcl.eye.aberrations.mtf_table import LIGHTS, MtfTable
from isetcl.eye.aberrations.refraction_error import FocusMetric, ObliqueFoci
from isetcl.eye.pictures.picture_parts import (
    FIELD_COLOURS,
    GREY,
    PALE,
    axes_or_new,
    dress,
    field_colour,
    field_name,
)
from isetcl.eye.waves.otf import OpticalTransfer

if TYPE_CHECKING:
    from matplotlib.axes import Axes

METRIC_LABELS: dict[FocusMetric, str] = {
    "strehl": "Strehl ratio",
    "rms": "RMS wavefront error (µm)",
    "mtf": "MTF",
}


def draw_mtf(
    transfers: Sequence[OpticalTransfer],
    fields_deg: Sequence[tuple[float, float] | float],
    ax: Axes | None = None,
    *,
    largest_cpd: float = 60.0,
) -> Axes:
    """MTF of field angles along their tangential and sagittal directions; returns the axes.

    Tangential is for stripes at right angles to the field angle, sagittal for those along it. On
    the axis they are horizontal and vertical stripes. The grey line is the first one without
    aberrations.
    """
    axes = axes_or_new(ax)
    frequency = np.linspace(0.0, largest_cpd, 121)
    ideal = transfers[0]
    row = int(np.argmin(np.abs(ideal.y_cpd)))
    half = ideal.x_cpd >= 0
    limit = np.interp(frequency, ideal.x_cpd[half], ideal.without_aberrations[row][half], right=0.0)
    axes.fill_between(frequency, limit, color=PALE, alpha=0.12, lw=0)
    axes.plot(frequency, limit, color=PALE, lw=1.2, label="diffraction limit")
    for i, (transfer, field) in enumerate(zip(transfers, fields_deg, strict=True)):
        x, y = (0.0, float(field)) if np.ndim(field) == 0 else field  # type: ignore[arg-type,misc]
        along = math.degrees(math.atan2(y, x)) if (x, y) != (0.0, 0.0) else 90.0
        name = field_name((x, y))
        for turn, style, section in ((0.0, "-", "tangential"), (90.0, "--", "sagittal")):
            values = transfer.mtf(frequency, along + turn)
            colour = field_colour(i)
            label = f"{name} {section}"
            axes.plot(frequency, values, color=colour, ls=style, lw=1.6, label=label)
    dress(axes, "spatial frequency (cycles/degree)", "modulation transfer")
    axes.set(xlim=(0.0, largest_cpd), ylim=(0.0, 1.0))
    axes.legend(fontsize="small", frameon=False)
    return axes


def draw_mtf_table(table: MtfTable, ax: Axes | None = None) -> Axes:
    """MTF in light of one wavelength and in photopic light, by both models; returns the axes."""
    axes = axes_or_new(ax)
    for light, model, section, values in table.curves():
        if values is not None:
            axes.plot(
                table.frequency_cpd,
                values,
                color=field_colour(LIGHTS.index(light)),
                ls="--" if section == "sagittal" else "-",
                lw=2.0 if model == "diffraction" else 1.0,
                label=table.label(light, model, section),
            )
    dress(axes, "spatial frequency (cycles/degree)", "modulation transfer")
    axes.set(xlim=(0.0, float(np.max(table.frequency_cpd))), ylim=(0.0, 1.0))
    axes.set_title(field_name(table.field_deg), fontsize="medium")
    axes.legend(fontsize="small", frameon=False)
    return axes


def draw_through_focus(
    vergences_dpt: np.ndarray,
    values: np.ndarray,
    ax: Axes | None = None,
    *,
    label: str = "Strehl ratio",
    best_dpt: float | None = None,
) -> Axes:
    """A curve of `refraction_error.through_focus`, its best focus marked; returns the axes."""
    axes = axes_or_new(ax)
    axes.plot(vergences_dpt, values, color=FIELD_COLOURS[0], lw=1.8)
    if best_dpt is not None:
        axes.axvline(best_dpt, color=FIELD_COLOURS[1], lw=1.2, ls="--")
        axes.set_title(f"best focus {best_dpt:+.2f} dpt", fontsize="medium")
    dress(axes, "vergence of the object (dpt)", label)
    axes.set_xlim(float(np.min(vergences_dpt)), float(np.max(vergences_dpt)))
    axes.set_ylim(bottom=0.0)
    return axes


def draw_lca(wavelengths_nm: np.ndarray, lca_dpt: np.ndarray, ax: Axes | None = None) -> Axes:
    """Longitudinal chromatic aberration against wavelength; returns the axes.

    Where it is 0 at all wavelengths the picture says that the eye has no dispersion.
    """
    axes = axes_or_new(ax)
    axes.axhline(0.0, color=PALE, lw=0.8)
    axes.plot(wavelengths_nm, lca_dpt, color=FIELD_COLOURS[0], lw=1.8)
    dress(axes, "wavelength (nm)", "refraction, relative (dpt)")
    axes.set_xlim(float(wavelengths_nm[0]), float(wavelengths_nm[-1]))
    if len(wavelengths_nm) > 1 and not np.any(lca_dpt):
        axes.set_title("no dispersion published", fontsize="medium")
        axes.set_ylim(-1.0, 1.0)
        return axes
    span = f"{wavelengths_nm[0]:g} to {wavelengths_nm[-1]:g} nm"
    axes.set_title(f"LCA {abs(lca_dpt[-1] - lca_dpt[0]):.3g} dpt, {span}", fontsize="medium")
    return axes


def draw_oblique_foci(foci: ObliqueFoci, ax: Axes | None = None) -> Axes:
    """Tangential, sagittal and mean refraction against the field angle; returns the axes."""
    axes = axes_or_new(ax)
    axes.axhline(0.0, color=PALE, lw=0.8)
    mean = (foci.tangential_dpt + foci.sagittal_dpt) / 2.0
    lines = (
        (foci.tangential_dpt, FIELD_COLOURS[0], "-", "tangential"),
        (foci.sagittal_dpt, FIELD_COLOURS[1], "--", "sagittal"),
        (mean, GREY, ":", "mean (field curvature)"),
    )
    for values, colour, style, label in lines:
        axes.plot(foci.field_deg, values, color=colour, ls=style, lw=1.8, label=label)
    dress(axes, "field angle (°)", "refraction (dpt)")
    axes.set_xlim(float(foci.field_deg[0]), float(foci.field_deg[-1]))
    axes.legend(fontsize="small", frameon=False)
    return axes
