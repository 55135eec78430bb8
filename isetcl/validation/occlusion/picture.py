"""The figure of an occlusion study: errors by method and setting, and profiles across the edge."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np

from isetcl.validation.log_axis import plain_ticks

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from isetcl.validation.occlusion.study import OcclusionStudy

_STRIP_COLOUR = "#f2c14e"
_MOST_PROFILES = 5
_LEAST_PERCENT = 1e-2
_COLOURS = ("#1f4e79", "#c0392b", "#2e8b57", "#8e44ad", "#d2691e")
_SETTINGS = ("near_m", "far_m", "focus", "pupil_mm", "contrast", "frequency_cpd")
_LABELS = {
    "near_m": "near plane (m)",
    "far_m": "far plane (m)",
    "focus": "focus (plane, or 1/m)",
    "pupil_mm": "entrance pupil (mm)",
    "contrast": "contrast of the checks",
    "frequency_cpd": "checks (cycles/degree)",
    "wavelength": "wavelength (nm)",
}


def draw(study: OcclusionStudy, wavelength_nm: float | None) -> Figure:
    """Above the error of every method over all cells, and profiles of one; below by settings."""
    from matplotlib.figure import Figure

    known = study.dataset["wavelength"].values
    wanted = known[len(known) // 2] if wavelength_nm is None else wavelength_nm
    data = study.dataset.sel(wavelength=wanted, method="nearest")
    varied = [name for name in _LABELS if study.dataset.sizes[name] > 1]
    height = max(4.2, 1.6 + 0.34 * data.sizes["kind"])
    figure = Figure(figsize=(12.5, height + (2.9 if varied else 0.0)), layout="constrained")
    rows = figure.subfigures(2 if varied else 1, 1, height_ratios=[height, 2.9][: 1 + bool(varied)])
    parts = list(np.ravel(np.array(rows, dtype=object)))
    left, right = parts[0].subplots(1, 2, width_ratios=(1.0, 1.25))
    _draw_errors(data, left)
    colours = _draw_profiles(data, right)
    if varied:
        panels = parts[1].subplots(1, len(varied), sharey=True, squeeze=False)[0]
        for ax, name in zip(panels, varied, strict=True):
            _draw_by(study.dataset if name == "wavelength" else data, name, colours, ax)
        panels[0].set_ylabel("in the strip (%)\nmean over the rest")
    lens = "a thin lens" if study.provenance["thin_lens"] else "ray tracing"
    figure.suptitle(f"PSF methods against {lens} at a depth edge, {float(data['wavelength']):g} nm")
    return figure


def _draw_errors(data: xarray.Dataset, ax: Axes) -> None:
    """One mark for every cell: in the strip filled, away from the edge hollow.

    Where no error is found, the one that there may be, with an arrow to what is less.
    """
    kinds = data["kind"].values.tolist()
    regions = {
        "strip": ("in the strip", "#c0392b", "#c0392b", -0.14),
        "away": ("away from the edge; an arrow: at most", "white", "#1f4e79", 0.14),
    }
    for name, (label, fill, colour, shift) in regions.items():
        for i, kind in enumerate(kinds):
            own = data.sel(kind=kind)
            found, low, high = (
                100.0 * own[f"{name}_{which}"].values.ravel()
                for which in ("rms", "rms_low", "rms_high")
            )
            is_found = low > 0.0
            for mask, values, mark in ((is_found, found, "o"), (~is_found, high, "<")):
                values = np.maximum(values[mask & np.isfinite(values)], _LEAST_PERCENT)
                ax.plot(values, np.full(len(values), i + shift), mark, ms=5, mec=colour, mfc=fill)
        ax.plot([], [], "o", ms=5, mec=colour, mfc=fill, label=label)
    ax.set_yticks(range(len(kinds)), [k.replace("_", " ") for k in kinds])
    ax.invert_yaxis()
    ax.set_xscale("log")
    plain_ticks(ax.xaxis)
    ax.set_xlabel("root mean square error (% of an even field)")
    ax.set_title("every cell of the grid", fontsize=10)
    ax.grid(axis="x", alpha=0.3)
    ax.legend(loc="upper center", bbox_to_anchor=(0.4, -0.13), ncols=2, fontsize=9, frameon=False)


def _draw_profiles(data: xarray.Dataset, ax: Axes) -> dict[str, str]:
    """A few methods from the worst to the best, in the worst cell of those with the widest strip.

    Returns the colours of the methods drawn.
    """
    # One PSF for all depths is wrong everywhere, and would hide the others.
    others = np.flatnonzero(data["kind"].values != "single")
    data = data.isel(kind=others) if len(others) else data
    wrong = data["strip_rms"].mean("kind")
    widths = data["half_width_arcmin"].where(wrong.notnull())
    worst = wrong.where(widths >= widths.max() * (1.0 - 1e-9)).fillna(-1.0)
    first = np.unravel_index(int(np.argmax(worst.values)), worst.shape)
    place = {k: int(v) for k, v in zip(_SETTINGS, first, strict=True)}
    cell = data.isel(place)
    half = float(cell["half_width_arcmin"])
    order = np.argsort(-cell["strip_rms"].values)
    # The worst, the best, and some between.
    picked = np.unique(np.linspace(0, len(order) - 1, _MOST_PROFILES).round().astype(int))
    ax.axvspan(-half, half, color=_STRIP_COLOUR, alpha=0.3, lw=0)
    colours: dict[str, str] = {}
    for n, colour in zip(order[picked], itertools.cycle(_COLOURS)):
        own = cell.isel(kind=int(n))
        kind = str(own["kind"].item())
        colours[kind] = colour
        label = kind.replace("_", " ")
        ax.plot(own["offset"] * half, 100.0 * own["profile_rms"], lw=1.6, label=label, color=colour)
    ax.set_title(
        f"{_described({k: cell[k].item() for k in _SETTINGS})}\n"
        f"shaded: {half:.3g} arcmin each side, a |D1 - D2|",
        fontsize=9,
    )
    ax.set_xlabel("distance from the edge (arcmin); near plane at the left")
    ax.set_ylabel("root mean square error of a column (%)")
    ax.set_ylim(bottom=0.0)
    ax.legend(fontsize=9, frameon=False)
    return colours


def _draw_by(data: xarray.Dataset, name: str, colours: dict[str, str], ax: Axes) -> None:
    """Error in the strip of the methods drawn above, by one setting: mean over all others.

    Where no error is found, the one that there may be, with an arrow to what is less.
    """
    rest = [d for d in data["strip_rms"].dims if d not in (name, "kind")]
    found, low, high = (
        100.0 * np.sqrt((data[f"strip_{which}"] ** 2).mean(rest, skipna=True))
        for which in ("rms", "rms_low", "rms_high")
    )
    values = data[name].values
    is_number = np.issubdtype(values.dtype, np.number)
    places = values if is_number else np.arange(len(values))
    for kind, colour in colours.items():
        is_found = low.sel(kind=kind).values > 0.0
        shown = np.where(is_found, found.sel(kind=kind), high.sel(kind=kind))
        shown = np.maximum(shown, _LEAST_PERCENT)
        ax.plot(places, shown, lw=1.3, color=colour)
        for mask, mark in ((is_found, "o"), (~is_found, "v")):
            ax.plot(places[mask], shown[mask], mark, ms=5, color=colour)
    if not is_number:
        ax.set_xticks(places, [str(v) for v in values])
        ax.margins(x=0.2)
    ax.set_yscale("log")
    plain_ticks(ax.yaxis)
    ax.set_xlabel(_LABELS[name])
    ax.grid(alpha=0.3)


def _described(cell: dict[str, Any]) -> str:
    focus = cell["focus"]
    focused = f"focus {focus}" if focus in ("near", "far") else f"focus {focus} dpt"
    checks = f"checks of contrast {cell['contrast']:g}, {cell['frequency_cpd']:g} cycles/degree"
    texture = checks if cell["contrast"] > 0 else "uniform planes"
    return (
        f"planes at {cell['near_m']:g} and {cell['far_m']:g} m, {focused}, "
        f"pupil {cell['pupil_mm']:g} mm, {texture}"
    )
