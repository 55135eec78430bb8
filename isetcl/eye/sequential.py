"""The float64 ray tracer on the host: oracle of the OpenCL kernels, engine of the PSF baseline.

The formulation differs from the kernels' on purpose (unit directions and angles of incidence here,
directions scaled to the index there), so that agreement means something.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from isetcl.errors import check_choice, check_vectors
from isetcl.eye.gradient_path import PlacedGradient, propagate
from isetcl.eye.model import Eye
from isetcl.eye.prescription import Element, ElementKind, elements
from isetcl.eye.quadric import Quadric
from isetcl.eye.rays import RayBundle, RayStatus
from isetcl.eye.shapes.shape import SurfaceShape
from isetcl.eye.surface import Surface, form_quadric

Towards = Literal["retina", "scene"]

_NEWTON_STEPS = 24
_LANDED_MM = 1e-13
_LANDINGS = 12
_NEAR_MM = 1e-9  # so short a way in a gradient is straight
_ON_SURFACE_MM = 1e-10  # a ray that Newton's method leaves farther off a surface misses it


def trace(
    eye: Eye,
    origins_mm: np.ndarray,
    directions: np.ndarray,
    wavelength_nm: float,
    *,
    towards: Towards = "retina",
    record_hits: bool = False,
) -> RayBundle:
    """Rays traced through an eye in float64.

    Parameters
    ----------
    eye
        The eye.
    origins_mm
        Start points, (n, 3), mm, eye frame: in front of the eye, or in the vitreous.
    directions
        Directions, (n, 3), any non-zero length.
    wavelength_nm
        Wavelength of all rays, nm.
    towards
        ``"retina"``: through the eye onto the retina. ``"scene"``: from the vitreous out of the
        cornea; the end point is on the cornea.
    record_hits
        Also return the hits on every element.

    Raises
    ------
    InvalidInputError
        If shapes are wrong or the wavelength lies outside the range of a medium.
    """
    check_choice("towards", towards, ("retina", "scene"))
    origins = check_vectors("origins_mm", origins_mm)
    sequence = elements(eye, wavelength_nm)
    if towards == "scene":
        sequence = tuple(e for e in reversed(sequence) if e.kind is not ElementKind.RETINA)
    return trace_elements(
        sequence, origins, check_vectors("directions", directions), towards, record_hits
    )


def trace_elements(
    sequence: tuple[Element, ...],
    origins_mm: np.ndarray,
    directions: np.ndarray,
    towards: Towards,
    record_hits: bool = False,
) -> RayBundle:
    """Rays traced through elements in the order given; see `trace`."""
    sense = 1.0 if towards == "retina" else -1.0
    position, direction, bad = normalise_rays(*np.broadcast_arrays(origins_mm, directions))
    status = np.zeros(len(position), dtype=np.uint8)
    surface = np.full(len(position), -1, dtype=np.int32)
    status[bad] = RayStatus.INVALID
    opl = np.zeros(len(position))
    hits = []
    for i, element in enumerate(sequence):
        inside, beyond = element.gradient_before, element.gradient_after
        n_in, n_out = element.n_before, element.n_after
        if sense < 0:
            inside, beyond = beyond, inside
            n_in, n_out = n_out, n_in
        alive = status == RayStatus.OK
        if inside is None:
            crossing = intersect(position, direction, element, sense)
            here = Arrival(crossing, direction, n_in * crossing.length, n_in)
        else:
            here = _through_gradient(inside, position, direction, alive, element, sense)
        crossing = here.crossing
        _lose(status, surface, crossing.missed, RayStatus.MISSED, i)
        alive = status == RayStatus.OK
        position = np.where(alive[:, None], crossing.position, position)
        direction = np.where(alive[:, None], here.direction, direction)
        opl = np.where(alive, opl + here.path, opl)
        across = crossing.local[:, 1] / element.aspect
        outside = crossing.local[:, 0] ** 2 + across**2 > element.semi_diameter_mm**2
        reason = RayStatus.STOPPED if element.kind is ElementKind.STOP else RayStatus.OUTSIDE
        _lose(status, surface, outside, reason, i)
        if element.is_bending:
            n_there = n_out if beyond is None else beyond.index_at(position)
            bent, reflected = _refract(direction, crossing, here.index, n_there, sense)
            _lose(status, surface, reflected, RayStatus.REFLECTED, i)
            direction = np.where((status == RayStatus.OK)[:, None], bent, direction)
        if record_hits:
            hits.append(position)
    return RayBundle(
        position,
        direction,
        status,
        surface,
        tuple(e.name for e in sequence),
        opl,
        np.array(hits) if record_hits else None,
    )


@dataclass(frozen=True, eq=False)
class Arrival:
    """How n rays come to an element: unit directions (n, 3), optical path (n,) mm and index there.

    In a homogeneous medium the direction is that at the start, and the index one number.
    """

    crossing: Crossing
    direction: np.ndarray
    path: np.ndarray
    index: np.ndarray | float


@dataclass(frozen=True, eq=False)
class Crossing:
    """Where n rays cross an element.

    Attributes
    ----------
    position, local : ndarray, (n, 3)
        The points in the eye frame and in the element's own, mm.
    length : ndarray, (n,)
        From where the rays were, mm.
    gradient : ndarray, (n, 3)
        Slope g of the surface there, eye frame; towards +z.
    cosine : ndarray, (n,)
        |cos| of incidence.
    missed : ndarray of bool, (n,)
        Rays that do not cross it in their direction of travel.
    """

    position: np.ndarray
    local: np.ndarray
    length: np.ndarray
    gradient: np.ndarray
    cosine: np.ndarray
    missed: np.ndarray


def intersect(
    position: np.ndarray, direction: np.ndarray, element: Element, sense: float
) -> Crossing:
    """Where rays, (n, 3) points in mm and unit directions of the eye frame, cross an element."""
    start, heading = element.enter(position, direction)
    quadric = form_quadric(element.curvature, element.conic, element.shape)
    length, missed = quadric.intersect(start, heading, sense)
    shape = element.shape
    if shape is None or shape.is_quadric(element.curvature, element.conic):
        local = start + length[:, None] * heading
        _, gradient = quadric.implicit(*local.T)
    else:
        form = _Form(shape, element.curvature, element.conic, quadric)
        length, local, gradient, missed = form.intersect(start, heading, length, missed, sense)
    along = np.einsum("ij,ij->i", gradient, heading)
    cosine = np.abs(along) / np.linalg.norm(gradient, axis=1)
    hit, gradient = element.leave(local, gradient)
    return Crossing(hit, local, length, gradient, cosine, missed)


def _through_gradient(
    placed: PlacedGradient,
    position: np.ndarray,
    direction: np.ndarray,
    alive: np.ndarray,
    element: Element,
    sense: float,
) -> Arrival:
    """Rays followed through a gradient onto the element behind it.

    The way along a straight line to the element is taken as the length to integrate; what is then
    left of the way is taken the same way, until it is so short that it is straight.
    """
    points, unit = placed.enter(position, direction)
    points = np.where(alive[:, None], points, 0.0)
    rays = unit * placed.profile.index(*points.T)[:, None]
    path = np.zeros(len(points))
    crossing, steps = intersect(position, direction, element, sense), placed.steps
    size = None
    for _ in range(_LANDINGS):
        to_plane = element.enter(*placed.leave(points, rays))
        plane = -to_plane[0][:, 2] / np.where(to_plane[1][:, 2] == 0.0, 1.0, to_plane[1][:, 2])
        speed = np.linalg.norm(rays, axis=1)
        span = np.where(crossing.missed, plane, crossing.length / speed)
        usable = alive & np.isfinite(span) & (np.abs(span) < _LONGEST_STEP_MM)
        span = np.where(usable, span, 0.0)
        longest = float(np.max(np.abs(span), initial=0.0))
        if longest < _NEAR_MM:
            break
        size = longest / steps if size is None else size
        part = min(max(1, math.ceil(longest / size)), 4 * steps)
        points, rays, piece = propagate(placed.profile, points, rays, span, part)
        path = path + piece
        unit = rays / np.linalg.norm(rays, axis=1, keepdims=True)
        finite = np.isfinite(points).all(axis=1) & np.isfinite(unit).all(axis=1)
        points, alive = np.where(finite[:, None], points, 0.0), alive & finite
        unit = np.where(finite[:, None], unit, np.array([0.0, 0.0, 1.0]))
        rays = np.where(finite[:, None], rays, unit)
        crossing = intersect(*placed.leave(points, unit), element, sense)
    return _land(placed, points, rays, path, crossing, alive)


def _land(
    placed: PlacedGradient,
    points: np.ndarray,
    rays: np.ndarray,
    path: np.ndarray,
    crossing: Crossing,
    alive: np.ndarray,
) -> Arrival:
    """The last, straight step onto an element, and what was lost on the way to it."""
    squared, force = placed.profile.squared_and_half_gradient(*points.T)
    speed2 = np.einsum("ij,ij->i", rays, rays)
    span = crossing.length / np.sqrt(speed2)
    lost = crossing.missed | ~alive | ~(np.abs(crossing.length) < _NEAR_MM)
    rays = rays + np.where(lost, 0.0, span)[:, None] * force
    unit = placed.leave(points, rays / np.linalg.norm(rays, axis=1, keepdims=True))[1]
    crossing = dataclasses.replace(crossing, missed=lost)
    return Arrival(crossing, unit, path + squared * span, placed.index_at(crossing.position))


@dataclass(frozen=True, eq=False)
class _Form:
    """A surface that is met by Newton's method, in its own frame."""

    shape: SurfaceShape
    curvature: float
    conic: float
    quadric: Quadric

    def intersect(
        self,
        start: np.ndarray,
        heading: np.ndarray,
        length: np.ndarray,
        missed: np.ndarray,
        sense: float,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Length, point, g and misses, from the lengths to the quadric."""
        # Where the quadric is missed, the plane of the vertex is as good a start as any.
        to_plane = -start[:, 2] / np.where(heading[:, 2] == 0.0, 1.0, heading[:, 2])
        length = np.where(missed, to_plane, length)
        for _ in range(_NEWTON_STEPS):
            value, gradient = self._implicit(start + length[:, None] * heading)
            with np.errstate(divide="ignore", invalid="ignore"):
                step = value / (2.0 * np.einsum("ij,ij->i", gradient, heading))
            step = np.where(np.isfinite(step), step, 0.0)
            length = length + np.clip(step, -_LONGEST_STEP_MM, _LONGEST_STEP_MM)
            if np.max(np.abs(step), initial=0.0) < _LANDED_MM:
                break
        local = start + length[:, None] * heading
        value, gradient = self._implicit(local)
        along = np.einsum("ij,ij->i", gradient, heading)
        exists = np.isfinite(self.shape.sag_mm(self.curvature, self.conic, *local.T[:2]))
        landed = exists & (np.abs(value) < _ON_SURFACE_MM) & (sense * along >= 0.0)
        # Missing rays keep finite numbers.
        gradient = np.where(landed[:, None], gradient, np.array([0.0, 0.0, 1.0]))
        return length, local, gradient, ~landed

    def _implicit(self, local: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            return self.shape.implicit(self.curvature, self.conic, *local.T)


_LONGEST_STEP_MM = 20.0


def heights_mm(surface: Surface, x_mm: np.ndarray, y_mm: np.ndarray) -> np.ndarray:
    """z of a surface in its place over points (x, y) of the eye frame, mm; NaN where it ends."""
    x, y = np.broadcast_arrays(x_mm, y_mm)
    element = Element(
        ElementKind.REFRACT,
        surface.name,
        surface.vertex_z_mm,
        surface.curvature,
        surface.conic,
        surface.semi_diameter_mm,
        1.0,
        1.0,
        surface.shape,
        surface.placement,
    )
    origins = np.stack([x.ravel(), y.ravel(), np.full(x.size, surface.vertex_z_mm)], axis=1)
    crossing = intersect(origins, np.broadcast_to([0.0, 0.0, 1.0], origins.shape), element, 1.0)
    rho2 = crossing.local[:, 0] ** 2 + crossing.local[:, 1] ** 2
    ended = crossing.missed | (rho2 > surface.semi_diameter_mm**2)
    return np.where(ended, np.nan, crossing.position[:, 2]).reshape(x.shape)


def meets_far_side(
    sequence: tuple[Element, ...], origins_mm: np.ndarray, directions: np.ndarray, towards: Towards
) -> np.ndarray:
    """Rays that cross some element beyond its equator, where the other root is the right one, (n,).

    A lost ray counts up to where it is lost.
    """
    sense = 1.0 if towards == "retina" else -1.0
    far = np.zeros(len(origins_mm), dtype=bool)
    for i, element in enumerate(sequence):
        rays = trace_elements(sequence[:i], origins_mm, directions, towards)
        local, heading = element.enter(rays.positions_mm, rays.directions)
        local = local - np.einsum("ij,ij->i", local, heading)[:, None] * heading
        q = element.quadric
        scale = np.array([q.curvature_x, q.curvature_y, q.axial])
        f = heading[:, 2] - np.einsum("ij,ij->i", local * scale, heading)
        far |= rays.passed & (sense * f < 0.0)
    return far


def _refract(
    direction: np.ndarray,
    crossing: Crossing,
    n_in: np.ndarray | float,
    n_out: np.ndarray | float,
    sense: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Snell's law in vector form; returns unit directions (n, 3) and total reflection (n,)."""
    normal_part = n_in * crossing.cosine
    radicand = normal_part**2 + (n_out**2 - n_in**2)
    reflected = ~(radicand >= 0.0)
    root = np.sqrt(np.where(reflected, 0.0, radicand))
    bend = (n_out**2 - n_in**2) / np.where(root + normal_part > 0, root + normal_part, 1.0)
    gradient = crossing.gradient
    normal = sense * gradient / np.linalg.norm(gradient, axis=1, keepdims=True)
    bent = np.asarray(n_in)[..., None] * direction + bend[:, None] * normal
    return bent / np.linalg.norm(bent, axis=1, keepdims=True), reflected


def normalise_rays(
    position: np.ndarray, direction: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Origins, unit directions, and which rays were unusable and replaced by a harmless one."""
    with np.errstate(over="ignore", invalid="ignore"):
        length = np.linalg.norm(direction, axis=1)
    bad = ~(np.isfinite(position).all(axis=1) & np.isfinite(length) & (length > 0))
    position = np.where(bad[:, None], 0.0, position)
    unit = direction / np.where(bad, 1.0, length)[:, None]
    return position, np.where(bad[:, None], np.array([0.0, 0.0, 1.0]), unit), bad


def _lose(
    status: np.ndarray, surface: np.ndarray, lost: np.ndarray, reason: RayStatus, index: int
) -> None:
    """Mark rays that are lost at element `index`, unless they were lost before."""
    newly = lost & (status == RayStatus.OK)
    status[newly] = reason
    surface[newly] = index
