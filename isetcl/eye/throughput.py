"""How much irradiance an eye makes of a uniform radiance."""

from __future__ import annotations

import dataclasses
import functools
import math

import numpy as np

from isetcl.eye.exit_pupil import StopOutline
from isetcl.eye.exit_pupil_plane import PlaneOutline
from isetcl.eye.field import FieldMap
from isetcl.eye.field_plane import FieldPlane
from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye
from isetcl.eye.prescription import ElementKind, elements
from isetcl.eye.retina_form import retinal_normal
from isetcl.eye.sequential import trace_elements


@functools.lru_cache(maxsize=1024)
def axial_irradiance_per_radiance(eye: Eye, wavelength_nm: float) -> float:
    """Irradiance at the retinal vertex per unit uniform radiance in front of the eye, sr.

    In an eye that is no figure of revolution, at the point that sees along the axis at 550 nm.
    Otherwise
    pi (n'/n)^2 sin^2(theta'), with theta' the angle in the vitreous of the real ray from the
    retinal vertex to the edge of the stop (Born & Wolf, 4.8; n'/n is conservation of basic
    radiance).
    """
    if not eye.is_rotational:
        grid_map = eye.field_map(REFERENCE_WAVELENGTH_NM)
        assert isinstance(grid_map, FieldPlane)
        return float(
            plane_irradiance_per_radiance(eye, wavelength_nm, grid_map, np.zeros((1, 2)))[0]
        )
    index = eye.indices(wavelength_nm)
    sine = _marginal_sine(eye, wavelength_nm)
    return math.pi * (float(index[-1]) / float(index[0])) ** 2 * sine**2


def irradiance_per_radiance(
    eye: Eye, wavelength_nm: float, grid_map: FieldMap, field_deg: np.ndarray
) -> np.ndarray:
    """Irradiance per unit uniform radiance at the retinal points of field angles, sr.

    The integral of (n'/n)^2 cos(retina) cos(pupil) / d^2 over the part of the exit pupil that each
    point sees, in polar coordinates about its chief ray: Gauss in radius, even in angle.

    Parameters
    ----------
    grid_map
        The chief-ray map that labels retinal points with field angles.
    field_deg
        Field angles, degrees, (n,).
    """
    field = np.atleast_1d(np.asarray(field_deg, dtype=np.float64))
    outline = StopOutline(eye, wavelength_nm, grid_map)
    edge = outline.edge(field, _AZIMUTHS)
    if not outline.is_complete:
        # Points that see the whole stop keep the exact outline.
        edge = np.concatenate(
            [StopOutline(eye, wavelength_nm, grid_map).edge(f, _AZIMUTHS) for f in field[:, None]]
        )
    start = grid_map.retinal_point_mm(np.zeros_like(field), field)
    return _over_outlines(eye, wavelength_nm, start, edge, outline.z_mm)


def plane_irradiance_per_radiance(
    eye: Eye, wavelength_nm: float, grid_map: FieldPlane, field_deg: np.ndarray
) -> np.ndarray:
    """`irradiance_per_radiance` in an eye of any form, at field angles (n, 2) in degrees; (n,)."""
    outline = PlaneOutline(eye, wavelength_nm, grid_map)
    edge = outline.edge(field_deg, _AZIMUTHS)
    if not outline.is_complete:
        edge = np.concatenate(
            [
                PlaneOutline(eye, wavelength_nm, grid_map).edge(one[None], _AZIMUTHS)
                for one in field_deg
            ]
        )
    start = grid_map.retinal_point_mm(*field_deg.T)
    return _over_outlines(eye, wavelength_nm, start, edge, outline.z_mm)


def _over_outlines(
    eye: Eye, wavelength_nm: float, start: np.ndarray, edge: np.ndarray, z_mm: float
) -> np.ndarray:
    """The integral over outlines (n, azimuths, 2) in the plane z, from retinal points (n, 3)."""
    nodes, weights = np.polynomial.legendre.leggauss(_RADII)
    radius, weights = (nodes + 1.0) / 2.0, weights / 2.0
    middle = edge.mean(axis=1, keepdims=True)
    spoke = edge - middle
    points = middle[:, None] + radius[:, None, None] * spoke[:, None]
    target = np.concatenate([points, np.full((*points.shape[:-1], 1), z_mm)], axis=-1)
    ray = target - start[:, None, None, :]
    distance2 = np.sum(ray * ray, axis=-1)
    normal = retinal_normal(eye.retina, start)[:, None, None, :]
    cosines = np.abs(np.sum(ray * normal, axis=-1)) * np.abs(ray[..., 2]) / distance2
    # Area element: t dt times the area swept by the spoke per angle.
    following, previous = np.roll(spoke, -1, axis=1), np.roll(spoke, 1, axis=1)
    rate = (following - previous) / 2.0
    swept = np.abs(spoke[..., 0] * rate[..., 1] - spoke[..., 1] * rate[..., 0])
    element = (weights * radius)[:, None] * swept[:, None, :]
    index = eye.indices(wavelength_nm)
    ratio2 = (float(index[-1]) / float(index[0])) ** 2
    # Central differences see a smooth outline shortened by sin(h) / h.
    step = 2.0 * np.pi / _AZIMUTHS
    values = np.sum(element * cosines / distance2, axis=(1, 2)) * step / np.sin(step)
    return np.asarray(ratio2 * values)


_AZIMUTHS = 48
_RADII = 8


def _marginal_sine(eye: Eye, wavelength_nm: float) -> float:
    """Sine of the angle at the retinal vertex of the ray that meets the edge of the stop."""
    from scipy.optimize import newton

    sequence = [
        e for e in reversed(elements(eye, wavelength_nm)) if e.kind is not ElementKind.RETINA
    ]
    rear = len(eye.surfaces) - eye.stop_index
    plane = dataclasses.replace(sequence[rear], kind=ElementKind.REFRACT, semi_diameter_mm=math.inf)
    path = (*sequence[:rear], plane)
    start = np.array([[0.0, 0.0, eye.retina.vertex_z_mm]])
    radius = eye.stop.radius_mm

    def excess(sine: float) -> float:
        direction = np.array([[0.0, sine, -math.sqrt(1.0 - sine * sine)]])
        return float(trace_elements(path, start, direction, "scene").positions_mm[0, 1]) - radius

    pupil = eye.exit_pupil(wavelength_nm)
    guess = math.sin(math.atan2(pupil.radius_mm, eye.retina.vertex_z_mm - pupil.z_mm))
    # The factor keeps the two starting points apart where the first is the root.
    second = guess * (1.0 - 0.5 * excess(guess) / radius) * (1.0 + 1e-9)
    return float(newton(excess, guess, x1=second, tol=1e-14))
