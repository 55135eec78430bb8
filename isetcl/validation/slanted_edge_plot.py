"""The picture of a slanted edge's transfer."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from isetcl.eye.pictures.picture_parts import FIELD_COLOURS, axes_or_new, dress, wavelength_colour

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from isetcl.validation.slanted_edge import SlantedEdgeMtf


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
