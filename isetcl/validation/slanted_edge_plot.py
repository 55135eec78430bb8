"""The picture of a slanted edge's transfer."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from isetcl.eye.pictures.picture_parts import FIELD_COLOURS, axes_or_new, dress, wavelength_colour

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from isetcl.validation.slanted_edge import SlantedEdgeMtf
    from isetcl.validation.three_mtfs import ThreeMtfs


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
