"""Pictures of a wavefront, its Zernike coefficients and its point spread function.

Nothing here computes a result.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from isetcl.errors import check_between, check_positive
from isetcl.eye.pictures.picture_parts import (
    FIELD_COLOURS,
    axes_or_new,
    dress,
    field_name,
    figure_or_new,
    round_length,
    scale_bar,
)
from isetcl.eye.waves.diffraction_psf import DiffractionPsf
from isetcl.eye.waves.wavefront import Wavefront, without_plane
from isetcl.eye.waves.zernike import ZernikeFit, osa_nm

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from isetcl.eye.pictures.picture_parts import AnyFigure

TERM_NAMES = {
    (2, 0): "defocus",
    (2, -2): "astigmatism, oblique",
    (2, 2): "astigmatism",
    (3, -3): "trefoil, vertical",
    (3, -1): "coma, vertical",
    (3, 1): "coma, horizontal",
    (3, 3): "trefoil, oblique",
    (4, 0): "spherical aberration",
    (4, -2): "2nd astigmatism, oblique",
    (4, 2): "2nd astigmatism",
    (4, -4): "quadrafoil, oblique",
    (4, 4): "quadrafoil",
}
"""Usual names of Zernike polynomials (n, m) (Thibos et al. 2002)."""

_CONTOURS = 9


def draw_opd(front: Wavefront, ax: Axes | None = None) -> Axes:
    """The wavefront error without piston and tilt, um, with contours; returns the axes.

    The grid is even in the direction of travel at the retina; mm of the entrance pupil are its mean
    scale.
    """
    axes = axes_or_new(ax)
    values = _without_tilt(front)
    limit = float(np.nanmax(np.abs(values), initial=1e-12))
    x, y = _pupil_mm(front)
    drawn = axes.imshow(values, extent=_extent(x, y), cmap="RdBu_r", vmin=-limit, vmax=limit)
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    if high - low > 1e-9:
        levels = np.linspace(low, high, _CONTOURS + 2)[1:-1]
        axes.contour(x, y, values, levels=levels, colors="black", linewidths=0.5, alpha=0.5)
    axes.figure.colorbar(drawn, ax=axes, label="wavefront error (µm)", shrink=0.85)
    axes.set_xlabel("entrance pupil, x (mm)")
    axes.set_ylabel("entrance pupil, y (mm)")
    name = field_name(front.field_deg)
    title = f"{name}: RMS {front.rms_um:.3g} µm, {front.wavelength_nm:g} nm"
    axes.set_title(title, fontsize="medium")
    return axes


def _without_tilt(front: Wavefront) -> np.ndarray:
    """W less its plane, which only moves the image, um, (n, n)."""
    used = front.inside
    x, y = np.meshgrid(front.x_cpd, front.y_cpd)
    values = np.full(used.shape, np.nan)
    values[used] = without_plane(front.opd_um[used], x[used], y[used], front.flux[used])
    return values


def _pupil_mm(front: Wavefront) -> tuple[np.ndarray, np.ndarray]:
    """The grid in mm of the entrance pupil, by its mean scale about the chief ray."""
    used = front.inside
    columns, rows = np.meshgrid(front.x_cpd, front.y_cpd)
    scaled = []
    for axis, grid, line in ((0, columns, front.x_cpd), (1, rows, front.y_cpd)):
        slope, start = np.polyfit(grid[used], front.entrance_mm[used][:, axis], 1)
        scaled.append(start + slope * line)
    return scaled[0], scaled[1]


def draw_zernikes(fit: ZernikeFit, ax: Axes | None = None, *, lowest_order: int = 2) -> Axes:
    """Zernike coefficients from a radial order on, as bars, um; returns the axes."""
    axes = axes_or_new(ax)
    shown = [j for j in range(len(fit.coefficients_um)) if osa_nm(j)[0] >= lowest_order]
    values = fit.coefficients_um[shown]
    places = np.arange(len(shown))
    axes.barh(places, values, color=FIELD_COLOURS[0], height=0.7)
    axes.axvline(0.0, color="black", lw=0.8)
    names = [f"Z({n}, {m})  {TERM_NAMES.get((n, m), '')}".rstrip() for n, m in map(osa_nm, shown)]
    axes.set_yticks(places, names, fontsize="small")
    axes.invert_yaxis()
    dress(axes, "coefficient (µm)", "", f"Zernike terms, radius {fit.radius_mm:.3g} mm")
    axes.title.set_fontsize("medium")
    axes.grid(False, axis="y")
    return axes


def draw_wavefront(
    front: Wavefront, figure: AnyFigure | None = None, *, fit: ZernikeFit | None = None
) -> AnyFigure:
    """The wavefront error, and beside it the bars of a Zernike fit unless that is None."""
    chosen = figure_or_new(figure, 5.2 if fit is None else 10.0, 4.4)
    if fit is None:
        draw_opd(front, chosen.subplots())
        return chosen
    left, right = chosen.subplots(1, 2, width_ratios=(1.25, 1.0))
    draw_opd(front, left)
    draw_zernikes(fit, right)
    return chosen


def draw_psf(
    psf: DiffractionPsf,
    ax: Axes | None = None,
    *,
    decades: float | None = None,
    share: float | None = None,
) -> Axes:
    """A point spread function with a scale bar; returns the axes.

    Parameters
    ----------
    psf
        What to draw.
    ax
        Matplotlib axes; None makes a new figure.
    decades
        None draws it linearly; a number draws its logarithm down to so many decades below the peak.
    share
        Shows only the square about the middle of the light that holds this share of it, 0 to 1.
    """
    axes = axes_or_new(ax)
    values, label = psf.relative, "relative to a perfect peak"
    if decades is not None:
        reach = check_positive("decades", decades)
        values = np.log10(np.maximum(values, values.max() * 10.0**-reach))
        label = "log10, " + label
    drawn = axes.imshow(values, extent=_extent(psf.x_arcmin, psf.y_arcmin), cmap="inferno")
    width = psf.pitch_arcmin * len(psf.x_arcmin)
    if share is not None:
        x, y, half = _middle(psf, check_between("share", share, 0.0, 1.0))
        axes.set(xlim=(x - half, x + half), ylim=(y - half, y + half))
        axes.set_facecolor("black")
        width = 2.0 * half
    scale_bar(axes, round_length(width / 3.0), "white")
    axes.set_xticks([])
    axes.set_yticks([])
    axes.figure.colorbar(drawn, ax=axes, label=label, shrink=0.85)
    title = f"peak {psf.relative.max():.3g}, {psf.wavelength_nm:g} nm"
    axes.set_title(title, fontsize="medium")
    return axes


def _middle(psf: DiffractionPsf, share: float) -> tuple[float, float, float]:
    """Centre of the light and half the side of the square about it that holds a share, arcmin."""
    x, y = np.meshgrid(psf.x_arcmin, psf.y_arcmin)
    weight = psf.density_per_arcmin2 / np.sum(psf.density_per_arcmin2)
    middle = float(np.sum(weight * x)), float(np.sum(weight * y))
    distance = np.maximum(np.abs(x - middle[0]), np.abs(y - middle[1])).ravel()
    order = np.argsort(distance)
    held = np.cumsum(weight.ravel()[order])
    last = min(int(np.searchsorted(held, share)), len(order) - 1)
    return *middle, float(distance[order[last]])


def _extent(x: np.ndarray, y: np.ndarray) -> tuple[float, float, float, float]:
    half_x, half_y = abs(float(x[1] - x[0])) / 2.0, abs(float(y[1] - y[0])) / 2.0
    return float(x[0]) - half_x, float(x[-1]) + half_x, float(y[-1]) - half_y, float(y[0]) + half_y
