"""The region of the exit pupil that retinal points see, in an eye that is no figure of revolution.

As in `isetcl.eye.exit_pupil`, but a point of the retina has two field angles, and what it sees of
the stop is an affine image of the unit disc: the first harmonics of the rim.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.eye.exit_pupil import MARGIN, ExitPupilBound, StopOutline, exit_pupil_bound
from isetcl.eye.field import FieldMap
from isetcl.eye.field_plane import FieldPlane
from isetcl.eye.model import Eye
from isetcl.eye.plane_polynomial import PlanePolynomial, Rectangle, fit
from isetcl.eye.retina_form import lifted, relief

_AZIMUTHS = 24
_CHECK_AZIMUTHS = 40
_NODES = (7, 11, 17)
_CHECKS = 7
_ELLIPSE_STEPS = 4
_FIT_TOLERANCE = 2e-7  # of the radius of the stop
_SCAN_NODES = 11
_SCAN_TOLERANCE = 0.01
_SCAN_MARGIN = 0.02  # outlines found by trial may have corners between the azimuths tried


@dataclass(frozen=True, eq=False)
class PlanePupilBound:
    """An ellipse in the plane `z_mm` for every field angle of a rectangle.

    Attributes
    ----------
    z_mm
        Plane of the ellipses, mm behind the corneal vertex.
    ellipse
        Six polynomials: the middle (x, y), and the matrix (xx, xy, yx, yy) that makes the unit disc
        the ellipse, mm.
    fill
        The smallest fraction of the ellipse that the true outline fills, over the field.
    clipped_elsewhere
        True if a ray inside the bound may be lost other than at the stop.
    has_far_side
        True if a ray inside the bound may cross a surface beyond its equator.
    """

    z_mm: float
    ellipse: PlanePolynomial
    fill: float
    clipped_elsewhere: bool
    has_far_side: bool

    def area_mm2(self, field_deg: np.ndarray) -> np.ndarray:
        """Area of the ellipse for field angles (n, 2) in degrees, mm^2."""
        return math.pi * np.abs(np.linalg.det(_matrix(self.ellipse(field_deg))))


@functools.lru_cache(maxsize=256)
def plane_pupil_bound(
    eye: Eye, wavelength_nm: float, grid_map: FieldPlane, rectangle: Rectangle
) -> PlanePupilBound:
    """The bound for all retinal points of a rectangle of field angles, at one wavelength.

    Parameters
    ----------
    grid_map
        The chief-ray map that labels retinal points with field angles (one wavelength for all
        bands: a retinal point does not move).

    Raises
    ------
    InvalidInputError
        If some retinal point cannot see the stop.
    """
    # Under a relief, bounds are those of the smooth retina, and hold for its highest and lowest
    # points: outlines hardly depend on them.
    heights = relief(eye.retina)
    outline = PlaneOutline(eye, wavelength_nm, grid_map, None if heights is None else 0.0)
    check = rectangle.lattice(_CHECKS)
    # Whether the whole stop can be seen decides how outlines are found, for all fields alike.
    outline.edge(rectangle.lattice(3), _AZIMUTHS)
    ellipse = _fitted_ellipse(outline, rectangle, eye.stop.radius_mm)
    _check_ellipses(eye, ellipse)
    excess, fill = outline.compare_ellipse(ellipse, check)
    if heights is not None:
        for lift in (float(heights.heights_mm.min()), float(heights.heights_mm.max())):
            other = PlaneOutline(eye, wavelength_nm, grid_map, lift)
            excess = max(excess, other.compare_ellipse(ellipse, check)[0])
    grow = max(excess, 1.0) * (1.0 + (MARGIN if outline.is_complete else _SCAN_MARGIN))
    clipped, far_side = outline.losses(check)
    grown = ellipse.coefficients * np.array([1.0, 1.0, grow, grow, grow, grow])
    return PlanePupilBound(
        outline.z_mm,
        dataclasses.replace(ellipse, coefficients=grown),
        fill=fill / grow**2,
        clipped_elsewhere=clipped,
        has_far_side=far_side,
    )


def _fitted_ellipse(
    outline: PlaneOutline, rectangle: Rectangle, radius_mm: float
) -> PlanePolynomial:
    """Polynomials through the ellipses about outlines, from as few of these as they need."""
    for count in _NODES if outline.is_complete else (_SCAN_NODES,):
        nodes = rectangle.nodes(count)
        affine = outline.affine(nodes)
        relative = _FIT_TOLERANCE if outline.is_complete else _SCAN_TOLERANCE
        found = fit(rectangle, nodes, affine, relative * radius_mm)
        residual = np.max(np.abs(found(nodes) - affine))
        if residual <= relative * radius_mm and found.degree <= count - 3:
            break
    return found


def _check_ellipses(eye: Eye, ellipse: PlanePolynomial) -> None:
    """Refuse ellipses that are none somewhere: their polynomials have failed."""
    turn = np.linalg.det(_matrix(ellipse(ellipse.rectangle.lattice(33))))
    if np.min(turn) * np.max(turn) <= 0:
        raise InvalidInputError(
            f"eye {eye.name!r}: the stop cannot be seen from the retina at every field angle of "
            "the image; reduce fov_deg or centre_deg"
        )


def _matrix(ellipse: np.ndarray) -> np.ndarray:
    return ellipse[:, 2:].reshape(-1, 2, 2)


def pupil_bounds(
    eye: Eye,
    wavelengths_nm: Sequence[float],
    grid_map: FieldMap | FieldPlane,
    rectangle: Rectangle,
    field_limit_deg: float,
) -> tuple[ExitPupilBound | PlanePupilBound, ...]:
    """The bounds of the bands of an image, as the eye needs them.

    Parameters
    ----------
    wavelengths_nm
        Wavelengths of the bands.
    rectangle, field_limit_deg
        Field angles of the image, and the largest of them.
    """
    if isinstance(grid_map, FieldPlane):
        return tuple(plane_pupil_bound(eye, w, grid_map, rectangle) for w in wavelengths_nm)
    return tuple(exit_pupil_bound(eye, w, grid_map, field_limit_deg) for w in wavelengths_nm)


class PlaneOutline(StopOutline):
    """The edge of the stop as seen from retinal points of field angles (n, 2).

    Parameters
    ----------
    lift_mm
        Height above the retina without its relief; None for the retina itself.
    """

    def __init__(
        self, eye: Eye, wavelength_nm: float, grid_map: FieldPlane, lift_mm: float | None = None
    ) -> None:
        super().__init__(eye, wavelength_nm, grid_map)
        self._lift_mm = lift_mm
        self._plane_map = grid_map
        self._stop = eye.stop

    def affine(self, field_deg: np.ndarray) -> np.ndarray:
        """Middle and matrix of the ellipse about each outline, (fields, 6), mm."""
        edge = self.edge(field_deg, _AZIMUTHS)
        turn = np.arange(_AZIMUTHS) * 2.0 * np.pi / _AZIMUTHS
        if self.is_complete:
            right = 2.0 * np.mean(edge * np.cos(turn)[:, None], axis=1)
            up = 2.0 * np.mean(edge * np.sin(turn)[:, None], axis=1)
            middle, matrix = _fitted(edge.mean(axis=1), np.stack([right, up], axis=-1), edge)
        else:
            middle, matrix = _about_polygons(edge)
        return np.concatenate([middle, matrix.reshape(-1, 4)], axis=1)

    def compare_ellipse(
        self, ellipse: PlanePolynomial, field_deg: np.ndarray
    ) -> tuple[float, float]:
        """How far the outline reaches beyond the ellipse (1 touches it); what it fills of it."""
        edge = self.edge(field_deg, _CHECK_AZIMUTHS)
        values = ellipse(field_deg)
        offset = edge - values[:, None, :2]
        disc = np.einsum("fij,faj->fai", np.linalg.inv(_matrix(values)), offset)
        u, v = disc[..., 0], disc[..., 1]
        area = np.abs(np.sum(u * np.roll(v, -1, axis=1) - v * np.roll(u, -1, axis=1), axis=1)) / 2
        polygon = np.sin(2 * np.pi / _CHECK_AZIMUTHS) / (2 * np.pi / _CHECK_AZIMUTHS)
        return float(np.max(np.hypot(u, v))), float(np.min(area) / (np.pi * polygon))

    def _rim(self, circle: np.ndarray) -> np.ndarray:
        return self._stop.rim_mm(circle)

    def _retina(self, field_deg: np.ndarray, repeats: int) -> np.ndarray:
        if self._lift_mm is None:
            point = self._plane_map.retinal_point_mm(*field_deg.T)
        else:
            point = lifted(
                self._plane_map.eye.retina, self._plane_map.base_point_mm(field_deg), self._lift_mm
            )
        return np.repeat(point, repeats, axis=0)

    def _chief(self, retina_mm: np.ndarray) -> np.ndarray:
        """Where the chief rays of retinal points cross the pupil plane.

        Those of the map's own wavelength: outlines only need a point well inside them.
        """
        point, direction = self._plane_map.arriving(self._plane_map.field_of_point_deg(retina_mm))
        along = (self.z_mm - point[:, 2]) / direction[:, 2]
        return np.asarray(point[:, :2] + along[:, None] * direction[:, :2])


def _fitted(
    middle: np.ndarray, matrix: np.ndarray, edge: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Ellipses that lie nearest to outlines (n, m, 2), by Gauss's and Newton's method.

    The first harmonics, which it starts from, miss an outline whose points are displaced along
    itself. Least squares of |w| - 1 with w = matrix^-1 (point - middle) over displacements t of the
    middle and symmetric strains of the matrix.
    """
    for _ in range(_ELLIPSE_STEPS):
        w = np.einsum("fij,faj->fai", np.linalg.inv(matrix), edge - middle[:, None])
        length = np.linalg.norm(w, axis=-1)
        x, y = w[..., 0] / length, w[..., 1] / length
        basis = np.stack([x, y, x * w[..., 0], y * w[..., 1], x * w[..., 1] + y * w[..., 0]], -1)
        gram = np.einsum("fai,faj->fij", basis, basis)
        change = np.linalg.solve(gram, np.einsum("fai,fa->fi", basis, length - 1.0)[..., None])
        tx, ty, xx, yy, xy = change[..., 0].T
        middle = middle + np.einsum("fij,fj->fi", matrix, np.stack([tx, ty], axis=-1))
        strain = np.stack([1.0 + xx, xy, xy, 1.0 + yy], axis=-1).reshape(-1, 2, 2)
        matrix = matrix @ strain
    return middle, matrix


def _about_polygons(edge: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ellipses about polygons (n, m, 2): middles (n, 2) and matrices (n, 2, 2).

    Shaped like the polygons' second moments, and as large as their outermost corners need.
    """
    following = np.roll(edge, -1, axis=1)
    inner = edge.mean(axis=1, keepdims=True)
    a, b = edge - inner, following - inner
    # Triangles about an inner point: area, and the moments of their three corners.
    area = np.abs(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]) / 2.0 + 1e-30
    total = area.sum(axis=1)
    shift = np.einsum("nm,nmi->ni", area, a + b) / 3.0 / total[:, None]
    moment = np.einsum("nm,nmi,nmj->nij", area, a, a) + np.einsum("nm,nmi,nmj->nij", area, b, b)
    both = np.einsum("nm,nmi,nmj->nij", area, a + b, a + b)
    covariance = (moment + both) / 12.0 / total[:, None, None]
    covariance -= np.einsum("ni,nj->nij", shift, shift)
    values, vectors = np.linalg.eigh(covariance)
    root = 2.0 * np.sqrt(np.maximum(values, 1e-12))
    matrix = np.einsum("nij,nj,nkj->nik", vectors, root, vectors)
    middle = inner[:, 0] + shift
    disc = np.einsum("nij,nmj->nmi", np.linalg.inv(matrix), edge - middle[:, None])
    reach = np.max(np.linalg.norm(disc, axis=-1), axis=1)
    return middle, matrix * reach[:, None, None]
