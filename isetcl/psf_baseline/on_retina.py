"""From a blurred view to the retina: lateral colour, and irradiance per radiance."""

from __future__ import annotations

import math

import numpy as np

from isetcl.eye.field import FieldMap
from isetcl.eye.field_plane import FieldPlane
from isetcl.eye.throughput import irradiance_per_radiance
from isetcl.psf_baseline.plane import fields_seen_deg, plane_throughput
from isetcl.psf_baseline.view import ViewGrid
from isetcl.retina.grid import RetinalGrid

_SHIFT_TOLERANCE = 0.05


def onto_retina(
    radiance: np.ndarray, view: ViewGrid, wavelength_nm: float, whole: RetinalGrid
) -> np.ndarray:
    """Blurred radiance at the retinal pixels: moved by lateral colour, averaged over samples.

    A retinal point receives another direction at each wavelength. The blurred view is looked up
    there, linearly between samples, and averaged over the samples of a pixel. Nothing is moved
    where all of the image that the view is part of, of the pixels `whole`, moves by next to
    nothing.
    """
    from scipy.ndimage import map_coordinates

    grid, n = view.grid, view.oversampling
    rows, columns = grid.shape
    inner = slice(view.margin, -view.margin) if view.margin else slice(None)
    x, y = view.x_deg()[inner], view.y_deg()[inner]
    if shift_deg(whole, wavelength_nm) > _SHIFT_TOLERANCE * view.pitch_deg[0]:
        seen_x, seen_y = _seen(grid, wavelength_nm, x, y)
        column = (seen_x - view.x_deg()[0]) / view.pitch_deg[0]
        row = (view.y_deg()[0] - seen_y) / view.pitch_deg[1]
        samples = map_coordinates(radiance, [row, column], order=1, mode="nearest")
    else:
        samples = radiance[inner, inner]
    return samples.reshape(rows, n, columns, n).mean(axis=(1, 3))


def _seen(
    grid: RetinalGrid, wavelength_nm: float, x_deg: np.ndarray, y_deg: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Directions (x, y) that retinal points see at a wavelength, degrees.

    The points have the labels of a grid of columns `x_deg` and rows `y_deg`.
    """
    labels, own = grid.field_map, grid.eye.field_map(wavelength_nm)
    if isinstance(labels, FieldPlane) and isinstance(own, FieldPlane):
        x, y = np.meshgrid(x_deg, y_deg)
        at = np.stack([x.ravel(), y.ravel()], axis=1)
        both = fields_seen_deg(labels, own, at)
        return both[:, 0].reshape(x.shape), both[:, 1].reshape(x.shape)
    assert isinstance(labels, FieldMap)
    assert isinstance(own, FieldMap)
    field = np.linspace(0.0, grid.limit_deg, 65)
    seen = own.field_deg(_within(labels.arc_mm(field), own))
    ratio = np.ones_like(field)
    ratio[1:] = seen[1:] / field[1:]
    ratio[0] = ratio[1]
    scale = np.interp(np.hypot(x_deg[None, :], y_deg[:, None]), field, ratio)
    return x_deg[None, :] * scale, y_deg[:, None] * scale


def throughput(grid: RetinalGrid, wavelength_nm: float) -> np.ndarray:
    """Irradiance per unit radiance at every pixel, sr, (rows, columns)."""
    from scipy.interpolate import CubicSpline

    labels = grid.field_map
    if isinstance(labels, FieldPlane):
        return plane_throughput(grid, wavelength_nm)
    # A node every two degrees: far out the pupil closes quickly.
    nodes = np.linspace(0.0, grid.limit_deg, max(9, math.ceil(grid.limit_deg / 2.0) + 1))
    values = irradiance_per_radiance(grid.eye, wavelength_nm, labels, nodes)
    even = CubicSpline(
        np.concatenate([-nodes[:0:-1], nodes]), np.concatenate([values[:0:-1], values])
    )
    x, y = np.meshgrid(grid.x_deg, grid.y_deg)
    return np.asarray(even(np.hypot(x, y)))


def shift_deg(grid: RetinalGrid, wavelength_nm: float) -> float:
    """How far from its label a retinal point of the image looks at a wavelength, at the worst."""
    labels, own = grid.field_map, grid.eye.field_map(wavelength_nm)
    if isinstance(labels, FieldPlane) and isinstance(own, FieldPlane):
        at = grid.rectangle.lattice(5)
        return float(np.max(np.linalg.norm(fields_seen_deg(labels, own, at) - at, axis=1)))
    assert isinstance(labels, FieldMap)
    assert isinstance(own, FieldMap)
    arc = float(labels.arc_mm(grid.limit_deg))
    return abs(float(own.field_deg(_within(arc, own))) - grid.limit_deg)


def _within(arc_mm: np.ndarray | float, field_map: FieldMap) -> np.ndarray:
    return np.minimum(arc_mm, float(field_map.arc_mm(field_map.max_field_deg)))
