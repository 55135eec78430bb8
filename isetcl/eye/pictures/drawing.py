"""The section of an eye on matplotlib axes; nothing here computes a result.

matplotlib is imported only when something is drawn.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye
from isetcl.eye.object_point import ObjectPoint
from isetcl.eye.pictures.picture_parts import FIELD_COLOURS, GREY, axes_or_new
from isetcl.eye.pictures.ray_fan import half_chord_mm
from isetcl.eye.sequential import trace_elements
from isetcl.eye.surface import Surface

if TYPE_CHECKING:
    from matplotlib.axes import Axes

OPTIONS = ("fields_deg", "wavelength_nm", "rays", "object_distance_m")
"""Keyword arguments of `draw_eye`."""

_LEAD_MM = 4.0
_LONGEST_LEAD_MM = 10.0
_DENSE_INDEX = 1.35
_RIM: dict[str, Any] = {"color": GREY, "lw": 0.8}


def draw_eye(
    eye: Eye,
    ax: Axes | None = None,
    *,
    fields_deg: Sequence[float] = (0.0,),
    wavelength_nm: float = REFERENCE_WAVELENGTH_NM,
    rays: int = 7,
    object_distance_m: float = math.inf,
) -> Axes:
    """The section of an eye in the plane x = 0, with rays; returns the axes.

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
    object_distance_m
        Distance of the objects from the corneal vertex, m.
    """
    axes = axes_or_new(ax)
    sections = [_section(surface) for surface in eye.surfaces]
    for section in sections:
        axes.plot(*section, color=GREY, lw=1.4)
    _fill_tissue(axes, eye, sections, wavelength_nm)
    _draw_stop(axes, eye)
    axes.plot(*_retina_outline(eye), color=GREY, lw=1.4)
    for field, colour in zip(fields_deg, FIELD_COLOURS * len(fields_deg), strict=False):
        for z, y in _ray_paths(eye, float(field), wavelength_nm, rays, object_distance_m):
            axes.plot(z, y, color=colour, lw=0.7)
    axes.set_aspect("equal")
    axes.set_xlabel("z (mm)")
    axes.set_ylabel("y (mm)")
    axes.set_title(eye.name)
    return axes


def _section(surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    """(z, y) along the meridian of a surface that lies nearest to the plane x = 0."""
    height = np.linspace(-surface.semi_diameter_mm, surface.semi_diameter_mm, 201)
    placement = surface.placement
    if placement is None:
        return surface.vertex_z_mm + surface.sag_mm(0.0, height), height
    up = placement.rotation[1, :2]
    x, y = height * up[:, None] / np.linalg.norm(up)
    own = np.stack([x, y, surface.sag_mm(x, y)], axis=1)
    point = own @ placement.rotation.T
    return surface.vertex_z_mm + point[:, 2], placement.decentre_mm[1] + point[:, 1]


def _fill_tissue(
    axes: Axes, eye: Eye, sections: list[tuple[np.ndarray, np.ndarray]], wavelength_nm: float
) -> None:
    """Tint what is denser than aqueous and vitreous: cornea, lens, lenses in front."""
    index = eye.indices(wavelength_nm)
    for i, (front, back) in enumerate(itertools.pairwise(sections)):
        if index[i + 1] > _DENSE_INDEX:
            z = np.concatenate([front[0], back[0][::-1]])
            y = np.concatenate([front[1], back[1][::-1]])
            axes.fill(z, y, color=FIELD_COLOURS[0], alpha=0.1, lw=0)
            for rim in (0, -1):
                axes.plot([front[0][rim], back[0][rim]], [front[1][rim], back[1][rim]], **_RIM)


def _draw_stop(axes: Axes, eye: Eye) -> None:
    """The two halves of the iris."""
    widest = max(surface.semi_diameter_mm for surface in eye.surfaces)
    middle, half = eye.stop.decentre_mm[1], half_chord_mm(eye.stop, 1)
    for side in (-1, 1):
        blade = [middle + side * half, middle + side * max(widest, 1.2 * half)]
        axes.plot([eye.stop.z_mm] * 2, blade, color="black", lw=3, solid_capstyle="butt")


def _ray_paths(
    eye: Eye, field_deg: float, wavelength_nm: float, count: int, object_distance_m: float
) -> list[tuple[np.ndarray, np.ndarray]]:
    """(z, y) along rays of one field angle, from in front of the cornea to the retina."""
    source = ObjectPoint(eye, field_deg, wavelength_nm, object_distance_m)
    stop = np.tile(eye.stop.decentre_mm, (count, 1))
    stop[:, 1] += half_chord_mm(eye.stop, 1) * np.linspace(-0.999, 0.999, count)
    points, found = source.aim(stop)
    origins, directions = source.launch(points)
    rays = trace_elements(source.sequence, origins, directions, "retina", record_hits=True)
    assert rays.hits_mm is not None
    # Up to a plane in front of the eye, but no long way from the side.
    depth = (rays.hits_mm[0, :, 2:] + _LEAD_MM) / np.maximum(directions[:, 2:], 0.1)
    first = rays.hits_mm[0] - directions * np.clip(depth, 0.0, _LONGEST_LEAD_MM)
    paths = np.concatenate([first[None], rays.hits_mm])
    kept = np.flatnonzero(found & rays.passed)
    return [(paths[:, i, 2], paths[:, i, 1]) for i in kept]


def _retina_outline(eye: Eye) -> tuple[np.ndarray, np.ndarray]:
    """(z, y) of the retina as far as chief rays reach."""
    chief = eye.field_map()
    field = np.linspace(-chief.max_field_deg, chief.max_field_deg, 201)
    points = chief.retinal_point_mm(np.zeros_like(field), field)
    return points[:, 2], points[:, 1]
