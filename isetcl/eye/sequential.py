"""The float64 ray tracer on the host: oracle of the OpenCL kernels, engine of the PSF baseline.

The formulation differs from the kernels' on purpose (unit directions and angles of incidence here,
directions scaled to the index there), so that agreement means something.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from isetcl.errors import check_choice, check_vectors
from isetcl.eye.model import Eye
from isetcl.eye.prescription import Element, ElementKind, elements
from isetcl.eye.rays import RayBundle, RayStatus

Towards = Literal["retina", "scene"]


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
        hit, length, cosine, gradient, missed = intersect_conic(position, direction, element, sense)
        _lose(status, surface, missed, RayStatus.MISSED, i)
        n_in, n_out = element.n_before, element.n_after
        if sense < 0:
            n_in, n_out = n_out, n_in
        alive = status == RayStatus.OK
        position = np.where(alive[:, None], hit, position)
        opl = np.where(alive, opl + n_in * length, opl)
        outside = hit[:, 0] ** 2 + hit[:, 1] ** 2 > element.semi_diameter_mm**2
        reason = RayStatus.STOPPED if element.kind is ElementKind.STOP else RayStatus.OUTSIDE
        _lose(status, surface, outside, reason, i)
        if element.kind is ElementKind.REFRACT:
            bent, reflected = _refract(direction, gradient, cosine, n_in, n_out, sense)
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


def intersect_conic(
    position: np.ndarray, direction: np.ndarray, element: Element, sense: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Intersection of rays with a conic of revolution, crossed in the direction of travel.

    Moves each ray to its point of closest approach to the vertex first, then takes the root with
    g . d = sense sqrt(F^2 - A G) in the form that does not cancel (Feder 1951; Goldberg 1991).

    Returns
    -------
    hit : (n, 3) mm; length : (n,) mm; cosine : (n,) |cos| of incidence; gradient : (n, 3) surface
    gradient; missed : (n,) bool
    """
    c, k = element.curvature, element.conic
    kappa = 1.0 + k
    vertex = np.array([0.0, 0.0, element.vertex_z_mm])
    local = position - vertex
    approach = -np.einsum("ij,ij->i", local, direction)
    local = local + approach[:, None] * direction
    x, y, z = local.T
    dx, dy, dz = direction.T
    f = dz - c * (x * dx + y * dy + kappa * z * dz)
    g = c * (x * x + y * y + kappa * z * z) - 2.0 * z
    a = c * (1.0 + k * dz * dz)
    discriminant = f * f - a * g
    missed = ~(discriminant >= 0.0)
    q = sense * np.sqrt(np.where(missed, 0.0, discriminant))
    far = f * q < 0.0
    numerator = np.where(far, f - q, g)
    denominator = np.where(far, a, f + q)
    null = denominator == 0.0
    missed = missed | (null & (numerator != 0.0))
    step = numerator / np.where(null, 1.0, denominator)
    local = local + step[:, None] * direction
    gradient = np.stack([-c * local[:, 0], -c * local[:, 1], 1.0 - kappa * c * local[:, 2]], axis=1)
    cosine = np.abs(q) / np.linalg.norm(gradient, axis=1)
    return local + vertex, approach + step, cosine, gradient, missed


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
        local = rays.positions_mm - np.array([0.0, 0.0, element.vertex_z_mm])
        local -= np.einsum("ij,ij->i", local, rays.directions)[:, None] * rays.directions
        scale = np.array([1.0, 1.0, 1.0 + element.conic])
        across = np.einsum("ij,ij->i", local * scale, rays.directions)
        f = rays.directions[:, 2] - element.curvature * across
        far |= rays.passed & (sense * f < 0.0)
    return far


def _refract(
    direction: np.ndarray,
    gradient: np.ndarray,
    cosine: np.ndarray,
    n_in: float,
    n_out: float,
    sense: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Snell's law in vector form; returns unit directions (n, 3) and total reflection (n,)."""
    normal_part = n_in * cosine
    radicand = normal_part**2 + (n_out**2 - n_in**2)
    reflected = ~(radicand >= 0.0)
    root = np.sqrt(np.where(reflected, 0.0, radicand))
    bend = (n_out**2 - n_in**2) / np.where(root + normal_part > 0, root + normal_part, 1.0)
    normal = sense * gradient / np.linalg.norm(gradient, axis=1, keepdims=True)
    bent = n_in * direction + bend[:, None] * normal
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
