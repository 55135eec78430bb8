"""Drawings of an eye and of its image quality on matplotlib axes; nothing here computes a result.

matplotlib is imported only when something is drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.eye.diffraction_psf import DiffractionPsf
from isetcl.eye.geometric import Spot
from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye
from isetcl.eye.object_point import ObjectPoint
from isetcl.eye.otf import OpticalTransfer
from isetcl.eye.sequential import trace_elements
from isetcl.eye.wavefront import Wavefront

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_RAY_COLOURS = ("#1f4e79", "#c0392b", "#2e8b57", "#8e44ad")
_GREY = "0.25"
_LEAD_MM = 4.0


def draw_eye(
    eye: Eye,
    ax: Axes | None = None,
    *,
    fields_deg: Sequence[float] = (0.0,),
    wavelength_nm: float = REFERENCE_WAVELENGTH_NM,
    rays: int = 7,
) -> Axes:
    """The section of an eye in the plane x = 0, with rays from infinity; returns the axes.

    Parameters
    ----------
    ax
        Matplotlib axes; None makes a new figure.
    fields_deg
        Field angles whose rays are drawn, upwards, degrees.
    wavelength_nm
        Wavelength of the rays, nm.
    rays
        Rays of each field angle, evenly over the stop.
    """
    axes = _axes(ax)
    for surface in eye.surfaces:
        y = np.linspace(-surface.semi_diameter_mm, surface.semi_diameter_mm, 201)
        axes.plot(surface.vertex_z_mm + surface.sag_mm(np.abs(y)), y, color=_GREY, lw=1.4)
    widest = max(surface.semi_diameter_mm for surface in eye.surfaces)
    for side in (-1, 1):
        blade = [side * eye.stop.radius_mm, side * widest]
        axes.plot([eye.stop.z_mm] * 2, blade, color="black", lw=3)
    axes.plot(*_retina_outline(eye), color=_GREY, lw=1.4)
    for field, colour in zip(fields_deg, _RAY_COLOURS * len(fields_deg), strict=False):
        for z, y in _ray_paths(eye, float(field), wavelength_nm, rays):
            axes.plot(z, y, color=colour, lw=0.6)
    axes.set_aspect("equal")
    axes.set_xlabel("z (mm)")
    axes.set_ylabel("y (mm)")
    axes.set_title(eye.name)
    return axes


def draw_opd(front: Wavefront, ax: Axes | None = None) -> Axes:
    """The wavefront error over the pupil, um; returns the axes."""
    axes = _axes(ax)
    limit = float(np.nanmax(np.abs(front.opd_um), initial=1e-12))
    drawn = axes.imshow(
        front.opd_um,
        extent=_extent(front.x_cpd, front.y_cpd),
        cmap="RdBu_r",
        vmin=-limit,
        vmax=limit,
    )
    axes.figure.colorbar(drawn, ax=axes, label="wavefront error (um)")
    axes.set_xlabel("pupil, x (cycles/degree)")
    axes.set_ylabel("pupil, y (cycles/degree)")
    axes.set_title(f"RMS {front.rms_um:.3g} um, {front.wavelength_nm:g} nm")
    return axes


def draw_psf(psf: DiffractionPsf, ax: Axes | None = None, *, decades: float | None = None) -> Axes:
    """A point spread function, linear or over some decades below its peak; returns the axes."""
    axes = _axes(ax)
    values = psf.relative
    label = "relative to the peak without aberrations"
    if decades is not None:
        values = np.log10(np.maximum(values, values.max() * 10.0**-decades))
        label = "log10, " + label
    drawn = axes.imshow(values, extent=_extent(psf.x_arcmin, psf.y_arcmin), cmap="inferno")
    axes.figure.colorbar(drawn, ax=axes, label=label)
    axes.set_xlabel("x (arcmin)")
    axes.set_ylabel("y (arcmin)")
    return axes


def draw_mtf(
    transfer: OpticalTransfer, ax: Axes | None = None, *, largest_cpd: float = 60.0
) -> Axes:
    """MTF across vertical and horizontal stripes, and without aberrations; returns the axes."""
    axes = _axes(ax)
    frequency = np.linspace(0.0, largest_cpd, 121)
    for orientation, label in ((0.0, "vertical stripes"), (90.0, "horizontal stripes")):
        axes.plot(frequency, transfer.mtf(frequency, orientation), label=label)
    row = int(np.argmin(np.abs(transfer.y_cpd)))
    shown = (transfer.x_cpd >= 0) & (transfer.x_cpd <= largest_cpd)
    ideal = transfer.without_aberrations[row][shown]
    axes.plot(transfer.x_cpd[shown], ideal, color="0.6", ls="--", label="without aberrations")
    axes.set_xlabel("spatial frequency (cycles/degree)")
    axes.set_ylabel("modulation transfer")
    axes.set_ylim(0.0, 1.0)
    axes.legend()
    return axes


def draw_spot(spot: Spot, ax: Axes | None = None) -> Axes:
    """A spot diagram; returns the axes."""
    axes = _axes(ax)
    axes.plot(spot.x_arcmin, spot.y_arcmin, ".", ms=1.5, color=_RAY_COLOURS[0])
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x (arcmin)")
    axes.set_ylabel("y (arcmin)")
    axes.set_title(f"RMS {spot.rms_arcmin:.3g} arcmin, {spot.wavelength_nm:g} nm")
    return axes


def draw_ray_fan(
    eye: Eye,
    ax: Axes | None = None,
    *,
    field_deg: float = 0.0,
    wavelength_nm: float = REFERENCE_WAVELENGTH_NM,
) -> Axes:
    """Where rays of the two principal sections land, against where they enter; returns the axes.

    The field is upwards: the tangential section is that of y.
    """
    from isetcl.eye.visual_angle import retinal_scale, visual_angle_deg

    axes = _axes(ax)
    source = ObjectPoint(eye, field_deg, wavelength_nm)
    chief = source.chief()
    scale = retinal_scale(eye.retina, source.map, source.field_deg)
    height = eye.stop.radius_mm * np.linspace(-1.0, 1.0, 81)
    for column, label in ((1, "tangential"), (0, "sagittal")):
        stop = np.zeros((len(height), 2))
        stop[:, column] = height
        points, found = source.aim(stop)
        rays = source.trace(points)
        used = found & rays.passed
        seen = 60.0 * visual_angle_deg(rays.point_mm - chief.point_mm[0], scale)[used, column]
        axes.plot((points - chief.entrance_mm[0])[used, column], seen, label=label)
    axes.set_xlabel("height in the entrance pupil (mm)")
    axes.set_ylabel("ray error (arcmin)")
    axes.legend()
    return axes


def draw_through_focus(
    vergences_dpt: np.ndarray, values: np.ndarray, ax: Axes | None = None, *, label: str = "strehl"
) -> Axes:
    """A curve of `refraction_error.through_focus`; returns the axes."""
    axes = _axes(ax)
    axes.plot(vergences_dpt, values, label=label)
    axes.set_xlabel("vergence of the object (dpt)")
    axes.set_ylabel(label)
    return axes


def _ray_paths(
    eye: Eye, field_deg: float, wavelength_nm: float, count: int
) -> list[tuple[np.ndarray, np.ndarray]]:
    """(z, y) along rays of one field angle, from in front of the cornea to the retina."""
    source = ObjectPoint(eye, field_deg, wavelength_nm)
    stop = np.zeros((count, 2))
    stop[:, 1] = eye.stop.radius_mm * np.linspace(-0.999, 0.999, count)
    points, found = source.aim(stop)
    origins, directions = source.launch(points)
    rays = trace_elements(source.sequence, origins, directions, "retina", record_hits=True)
    assert rays.hits_mm is not None
    first = rays.hits_mm[0] - directions * (
        (rays.hits_mm[0, :, 2:] + _LEAD_MM) / np.maximum(directions[:, 2:], 0.1)
    )
    paths = np.concatenate([first[None], rays.hits_mm])
    kept = np.flatnonzero(found & rays.passed)
    return [(paths[:, i, 2], paths[:, i, 1]) for i in kept]


def _retina_outline(eye: Eye) -> tuple[np.ndarray, np.ndarray]:
    """(z, y) of the retina as far as chief rays reach."""
    chief = eye.field_map()
    field = np.linspace(-chief.max_field_deg, chief.max_field_deg, 201)
    points = chief.retinal_point_mm(np.zeros_like(field), field)
    return points[:, 2], points[:, 1]


def _extent(x: np.ndarray, y: np.ndarray) -> tuple[float, float, float, float]:
    half = abs(float(x[1] - x[0])) / 2.0
    return (float(x[0]) - half, float(x[-1]) + half, float(y[-1]) - half, float(y[0]) + half)


def _axes(ax: Axes | None) -> Axes:
    import matplotlib.pyplot as plt

    if ax is not None and not hasattr(ax, "imshow"):
        raise InvalidInputError(f"ax must be matplotlib axes, got {type(ax).__name__}")
    return plt.subplots()[1] if ax is None else ax
