"""The figure of an occlusion study: error by method in and outside the strip, and profiles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from isetcl.validation.occlusion.study import OcclusionStudy

_STRIP_COLOUR = "#f2c14e"
_MOST_PROFILES = 5
_SETTINGS = ("near_m", "far_m", "focus", "pupil_mm", "contrast", "frequency_cpd")


def draw(study: OcclusionStudy, wavelength_nm: float | None) -> Figure:
    """At the left the error of every method over all cells, at the right profiles of one cell."""
    from matplotlib.figure import Figure

    known = study.dataset["wavelength"].values
    wanted = known[len(known) // 2] if wavelength_nm is None else wavelength_nm
    data = study.dataset.sel(wavelength=wanted, method="nearest")
    height = max(4.2, 1.6 + 0.34 * data.sizes["kind"])
    figure = Figure(figsize=(12.5, height), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.25))
    _draw_errors(data, left)
    _draw_profiles(data, right)
    lens = "a thin lens" if study.provenance["thin_lens"] else "ray tracing"
    figure.suptitle(f"PSF methods against {lens} at a depth edge, {float(data['wavelength']):g} nm")
    return figure


def _draw_errors(data: xarray.Dataset, ax: Axes) -> None:
    """One dot for every cell: in the strip filled, outside hollow."""
    kinds = data["kind"].values.tolist()
    for name, colour, shift in (("strip", "#c0392b", -0.12), ("outside", "#1f4e79", 0.12)):
        for i, kind in enumerate(kinds):
            values = 100.0 * data[f"{name}_rms"].sel(kind=kind).values.ravel()
            values = np.maximum(values[np.isfinite(values)], 1e-2)
            fill = colour if name == "strip" else "white"
            label = {"strip": "in the strip", "outside": "outside it"}[name] if i == 0 else None
            ax.plot(
                values,
                np.full(len(values), i + shift),
                "o",
                ms=5,
                mec=colour,
                mfc=fill,
                label=label,
            )
    ax.set_yticks(range(len(kinds)), [k.replace("_", " ") for k in kinds])
    ax.invert_yaxis()
    ax.set_xscale("log")
    ax.set_xlabel("root mean square error (% of an even field)")
    ax.set_title("every cell of the grid", fontsize=10)
    ax.grid(axis="x", alpha=0.3)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=2, fontsize=9, frameon=False)


def _draw_profiles(data: xarray.Dataset, ax: Axes) -> None:
    """A few methods from the worst to the best, in the first cell of the widest strip."""
    widths = data["half_width_arcmin"].fillna(0.0)
    first = np.unravel_index(int(np.argmax(widths.values)), widths.shape)
    place = {k: int(v) for k, v in zip(_SETTINGS, first, strict=True)}
    # One PSF for all depths is wrong everywhere, and would hide the others.
    data = data.isel(kind=np.flatnonzero(data["kind"].values != "single"))
    cell = data.isel(place)
    half = float(cell["half_width_arcmin"])
    order = np.argsort(-cell["strip_rms"].values)
    # The worst, the best, and some between.
    picked = np.unique(np.linspace(0, len(order) - 1, _MOST_PROFILES).round().astype(int))
    ax.axvspan(-half, half, color=_STRIP_COLOUR, alpha=0.3, lw=0)
    for n in order[picked]:
        own = cell.isel(kind=int(n))
        label = str(own["kind"].item()).replace("_", " ")
        ax.plot(own["offset"] * half, 100.0 * own["profile_rms"], lw=1.6, label=label)
    settings = ", ".join(f"{k} {v}" for k, v in ((k, cell[k].item()) for k in _SETTINGS))
    ax.set_title(f"{settings}\nshaded: {half:.3g} arcmin each side, a |D1 - D2|", fontsize=9)
    ax.set_xlabel("distance from the edge (arcmin); near plane at the left")
    ax.set_ylabel("root mean square error of a column (%)")
    ax.set_ylim(bottom=0.0)
    ax.legend(fontsize=9, frameon=False)
