"""Where an eye is focused, and how to bring it into focus.

An eye is said to be focused on the axial object whose image on the retina is best by a named
criterion. Spherical aberration makes that depend on the stop: the relaxed Navarro eye of the
paper is focused 0.07 dpt in front of infinity at 2 mm, 0.43 dpt at 4 mm (550 nm).
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np

from isetcl.errors import FocusError, check_choice, check_positive
from isetcl.eye import paraxial
from isetcl.eye.model import Eye, FocusCriterion
from isetcl.eye.prescription import Element, ElementKind, elements
from isetcl.eye.sequential import trace_elements
from isetcl.eye.spot_pupil import SpotPupil
from isetcl.units import MM_PER_M, distance_from_vergence, vergence_from_distance

CRITERIA = ("rms_spot", "paraxial")

_RADIAL_NODES = 32
_FIRST_STEP_DPT = 0.5
_DISTINCT = 1e-9  # keeps the two starting points of a secant apart where the first is the root
_TOLERANCE = 1e-7  # relative, of the vergence: the mean square is flat to 1e-14 there


def focus_vergence_dpt(
    eye: Eye, wavelength_nm: float, criterion: FocusCriterion = "rms_spot"
) -> float:
    """Vergence (1/m from the corneal vertex) of the object the eye is focused on.

    See `Eye.focus_vergence_dpt`.

    Raises
    ------
    InvalidInputError
        If the criterion is unknown.
    FocusError
        If the rays of the stop do not reach the retina.
    """
    from scipy.optimize import minimize_scalar

    check_choice("focus criterion", criterion, CRITERIA)
    start = paraxial.object_vergence_dpt(eye, wavelength_nm)
    if criterion == "paraxial":
        return start
    found = minimize_scalar(
        _spot(eye, wavelength_nm).mean_square_mm2,
        bracket=(start, start + _FIRST_STEP_DPT),
        tol=_TOLERANCE,
    )
    return float(found.x)


def rms_spot_mm(eye: Eye, vergence_dpt: float, wavelength_nm: float) -> float:
    """Root-mean-square distance from the axis of the image of an axial point, mm on the retina.

    The point lies at a vergence in 1/m from the corneal vertex and radiates uniformly into the
    stop. In an eye that is no figure of revolution the distance counts from the centroid.
    """
    return float(np.sqrt(_spot(eye, wavelength_nm).mean_square_mm2(vergence_dpt)))


def focus_at(eye: Eye, distance_m: float, wavelength_nm: float, criterion: FocusCriterion) -> Eye:
    """The eye of the same family that is focused at a distance; see `Eye.focus_at`."""
    target = vergence_from_distance(distance_m)
    wavelength = check_positive("wavelength_nm", wavelength_nm, "nm")
    check_choice("focus criterion", criterion, CRITERIA)
    return _focused(eye, target, wavelength, criterion)


@functools.lru_cache(maxsize=256)
def _focused(eye: Eye, target: float, wavelength_nm: float, criterion: FocusCriterion) -> Eye:
    """The eye of the same family that is focused at a vergence, 1/m; found once."""
    from scipy.optimize import brentq

    model = eye.accommodation_model
    if model is None:
        raise FocusError(
            f"eye {eye.name!r} cannot accommodate: it has no accommodation model; "
            f"it is focused at {_place(focus_vergence_dpt(eye, wavelength_nm, criterion))} "
            f"({wavelength_nm:g} nm, {criterion}); move its retina, or use another eye"
        )

    def excess(parameter: float) -> float:
        return focus_vergence_dpt(model.eye(parameter), wavelength_nm, criterion) - target

    low, high = model.parameter_range
    far = target + excess(low)
    high, near = _nearest_focus(excess, low, high)
    near += target
    if not far <= target <= near:
        raise FocusError(
            f"eye {eye.name!r} with a stop of {eye.stop.diameter_mm:.3g} mm is in focus between "
            f"{_place(far)} and {_place(near)} ({wavelength_nm:g} nm, {criterion}), asked for "
            f"{_place(target)}; "
            + (
                "move the object farther away"
                if target > near
                else "leave out the accommodation for the relaxed eye, use a smaller stop or the "
                "paraxial criterion"
            )
        )
    return model.eye(float(brentq(excess, low, high, xtol=1e-10)))


def _nearest_focus(
    excess: Callable[[float], float], low: float, high: float
) -> tuple[float, float]:
    """The largest parameter, to 1 %, at which the stop can be filled, and the excess there.

    Strong accommodation makes some model lenses smaller than a large stop.
    """
    reach = high - low
    while reach > 0.01 * (high - low):
        try:
            return low + reach, excess(low + reach)
        except FocusError:
            reach -= 0.01 * (high - low)
    return low, excess(low)


def _spot(eye: Eye, wavelength_nm: float) -> _SpotFan | SpotPupil:
    return (_SpotFan if eye.is_rotational else SpotPupil)(eye, wavelength_nm)


class _SpotFan:
    """The meridional rays of an axial object that fill the stop, weighted by their flux."""

    def __init__(self, eye: Eye, wavelength_nm: float) -> None:
        self._eye = eye
        self._sequence = elements(eye, wavelength_nm)
        self._pupil = paraxial.entrance_pupil(eye, wavelength_nm)
        nodes, weights = np.polynomial.legendre.leggauss(_RADIAL_NODES)
        self._relative_height = np.sqrt((nodes + 1.0) / 2.0)
        self._weights = weights / 2.0

    def mean_square_mm2(self, vergence_dpt: float) -> float:
        """Flux-weighted mean square height on the retina, mm^2."""
        per_mm = vergence_dpt / MM_PER_M
        edge = self._stop_edge_height(per_mm)
        origins, directions = self._launch(edge * self._relative_height, per_mm)
        rays = trace_elements(self._sequence, origins, directions, "retina")
        if not rays.passed.all():
            raise FocusError(
                f"eye {self._eye.name!r}: rays from an axial point at {vergence_dpt:g} dpt do not "
                f"fill the stop ({rays.summary()}); use a smaller stop"
            )
        weights = self._weights * directions[:, 2] ** 3
        return float(np.sum(weights * rays.positions_mm[:, 1] ** 2) / np.sum(weights))

    def _stop_edge_height(self, per_mm: float) -> float:
        """Height in the entrance pupil of the ray that meets the edge of the stop, mm."""
        from scipy.optimize import newton

        before = tuple(
            e for e in self._sequence[: self._eye.stop_index] if e.kind is ElementKind.REFRACT
        )
        plane = self._sequence[self._eye.stop_index]
        radius = self._eye.stop.radius_mm

        def excess(height: float) -> float:
            return self._height_at(before, plane, height, per_mm) - radius

        start = self._pupil.radius_mm
        second = start * (1.0 - excess(start) / radius) * (1.0 + _DISTINCT)
        height = newton(excess, start, x1=second, tol=1e-13)
        return float(height) * (1.0 - 1e-13)

    def _height_at(
        self, before: tuple[Element, ...], plane: Element, height: float, per_mm: float
    ) -> float:
        origins, directions = self._launch(np.array([height]), per_mm)
        rays = trace_elements(before, origins, directions, "retina")
        slope = rays.directions[0, 1] / rays.directions[0, 2]
        reached = rays.positions_mm[0, 1] + slope * (plane.vertex_z_mm - rays.positions_mm[0, 2])
        if not rays.passed.all() or not reached > 0:
            raise FocusError(
                f"eye {self._eye.name!r}: no axial ray reaches the edge of the stop "
                f"(diameter {self._eye.stop.diameter_mm:g} mm); use a smaller stop"
            )
        return float(reached)

    def _launch(self, heights_mm: np.ndarray, per_mm: float) -> tuple[np.ndarray, np.ndarray]:
        """Rays through given heights in the entrance pupil, started 1 mm in front of the cornea.

        The object's distance enters as its vergence, so that infinity is no special case.
        """
        slope = heights_mm * per_mm / (1.0 + per_mm * self._pupil.z_mm)
        zeros = np.zeros_like(heights_mm)
        origins = np.stack(
            [zeros, heights_mm - slope * (self._pupil.z_mm + 1.0), zeros - 1.0], axis=1
        )
        directions = np.stack([zeros, slope, zeros + 1.0], axis=1)
        return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def _place(vergence_dpt: float) -> str:
    if vergence_dpt <= 0:
        return f"{vergence_dpt:.3f} dpt (beyond infinity)" if vergence_dpt < 0 else "infinity"
    return f"{distance_from_vergence(vergence_dpt):.4g} m ({vergence_dpt:.3f} dpt)"
