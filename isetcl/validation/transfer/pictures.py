"""Pictures of the transfer of a slanted edge, alone and beside others."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from isetcl.eye.people.human_mtf import diffraction_mtf, watson_2013_mtf
from isetcl.eye.pictures.picture_parts import (
    FIELD_COLOURS,
    PALE,
    axes_or_new,
    dress,
    wavelength_colour,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from isetcl.validation.transfer.population_band import PopulationBand
    from isetcl.validation.transfer.result import SlantedEdgeMtf
    from isetcl.validation.transfer.three_mtfs import ThreeMtfs

_WATSON_MM = (2.0, 6.0)
_PEOPLE = "#d68910"


def draw_slanted_edge(found: SlantedEdgeMtf, ax: Axes | None = None) -> Axes:
    """Photopic transfer with a band of two standard errors; wavelengths as thin lines."""
    axes = axes_or_new(ax)
    if found.frequency_cpd is not None:
        frequency, unit = found.frequency_cpd, "cycles/degree"
    else:
        assert found.frequency_cpmm is not None
        frequency, unit = found.frequency_cpmm, "cycles/mm"
    if found.wavelengths_nm is not None and len(found.mtf) > 1:
        for nm, values in zip(found.wavelengths_nm, found.mtf, strict=True):
            axes.plot(frequency, values, color=wavelength_colour(float(nm)), lw=0.7, alpha=0.6)
    label = "photopic" if len(found.mtf) > 1 else "slanted edge"
    mtf, error = found.photopic_mtf, found.photopic_standard_error
    axes.fill_between(
        frequency, mtf - 2 * error, mtf + 2 * error, color=FIELD_COLOURS[0], alpha=0.2, lw=0
    )
    axes.plot(frequency, mtf, color=FIELD_COLOURS[0], lw=2.0, label=label)
    if np.isfinite(found.mtf50_cpd):
        axes.plot([found.mtf50_cpd], [0.5], "o", color=FIELD_COLOURS[1], ms=5)
        axes.annotate(
            f" {found.mtf50_cpd:.3g}", (found.mtf50_cpd, 0.5), color=FIELD_COLOURS[1], va="bottom"
        )
    dress(axes, f"spatial frequency ({unit})", "modulation transfer")
    axes.set(xlim=(0.0, float(frequency[-1])), ylim=(0.0, 1.05))
    axes.legend(fontsize="small", frameon=False)
    return axes


def draw_three_mtfs(found: ThreeMtfs, ax: Axes | None = None) -> Axes:
    """Transfer from the rendered edge with a band of two standard errors, rays and wavefront."""
    axes = axes_or_new(ax)
    f, error = found.frequency_cpd, 2.0 * found.slanted_edge_error
    axes.fill_between(
        f,
        found.slanted_edge - error,
        found.slanted_edge + error,
        color=FIELD_COLOURS[0],
        alpha=0.25,
        lw=0,
    )
    names = {
        "geometric": ("slanted edge, rendered", "line spread of rays", "wavefront, its normals"),
        "diffraction": (
            "slanted edge, rendered with bent rays",
            "line spread of rays x diffraction",
            "wavefront",
        ),
    }[found.model]
    axes.plot(f, found.slanted_edge, color=FIELD_COLOURS[0], lw=3.0, alpha=0.75, label=names[0])
    axes.plot(f, found.line_spread, color=FIELD_COLOURS[1], lw=1.6, ls="--", label=names[1])
    axes.plot(f, found.wavefront, color="black", lw=1.1, ls=":", label=names[2])
    dress(axes, "spatial frequency (cycles/degree)", "modulation transfer")
    axes.set(xlim=(0.0, float(f[-1])), ylim=(0.0, 1.05))
    axes.set_title(found.light, fontsize="medium")
    axes.legend(fontsize="small", frameon=False)
    return axes


def draw_with_people(
    found: ThreeMtfs,
    pupil_diameter_mm: float,
    band: PopulationBand | None = None,
    ax: Axes | None = None,
) -> Axes:
    """The three curves of an eye, its diffraction limit, and what people's eyes do.

    Parameters
    ----------
    found
        Three transfers of an eye.
    pupil_diameter_mm
        Diameter of its entrance pupil, for the limit and for the mean eye of Watson 2013, which is
        left out beyond its 2 to 6 mm.
    band
        Percentiles of other eyes; None leaves them out.
    """
    axes = axes_or_new(ax)
    f = np.linspace(0.0, float(found.frequency_cpd[-1]), 121)
    if band is not None:
        low, mean, high = band.at(f)
        name = f"{band.name}: 5th to 95th percentile, mean"
        axes.fill_between(f, low, high, color=_PEOPLE, alpha=0.18, lw=0)
        axes.plot(f, mean, color=_PEOPLE, lw=1.2, label=name)
    limit = diffraction_mtf(f, pupil_diameter_mm, 555.0)
    name = f"diffraction limit, 555 nm, {pupil_diameter_mm:.3g} mm entrance pupil"
    axes.plot(f, limit, color=PALE, lw=1.2, label=name)
    if _WATSON_MM[0] <= pupil_diameter_mm <= _WATSON_MM[1]:
        name = f"mean eye, Watson 2013, {pupil_diameter_mm:.3g} mm"
        watson = watson_2013_mtf(f, pupil_diameter_mm)
        axes.plot(f, watson, color=FIELD_COLOURS[2], lw=1.8, ls="-.", label=name)
    return draw_three_mtfs(found, axes)
