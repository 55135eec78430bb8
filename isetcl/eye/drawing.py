"""The section of an eye on matplotlib axes; nothing here computes a result.

matplotlib is imported only when something is drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye
from isetcl.eye.object_point import ObjectPoint
from isetcl.eye.picture_parts import FIELD_COLOURS, GREY, axes_or_new
from isetcl.eye.sequential import trace_elements

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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
    axes = axes_or_new(ax)
    for surface in eye.surfaces:
        y = np.linspace(-surface.semi_diameter_mm, surface.semi_diameter_mm, 201)
        axes.plot(surface.vertex_z_mm + surface.sag_mm(np.abs(y)), y, color=GREY, lw=1.4)
    widest = max(surface.semi_diameter_mm for surface in eye.surfaces)
    for side in (-1, 1):
        blade = [side * eye.stop.radius_mm, side * widest]
        axes.plot([eye.stop.z_mm] * 2, blade, color="black", lw=3)
    axes.plot(*_retina_outline(eye), color=GREY, lw=1.4)
    for field, colour in zip(fields_deg, FIELD_COLOURS * len(fields_deg), strict=False):
        for z, y in _ray_paths(eye, float(field), wavelength_nm, rays):
            axes.plot(z, y, color=colour, lw=0.6)
    axes.set_aspect("equal")
    axes.set_xlabel("z (mm)")
    axes.set_ylabel("y (mm)")
    axes.set_title(eye.name)
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
