"""Personal eyes: parameters of a model eye adjusted to measured wavefronts.

Nonlinear least squares on the float64 tracer: the model's Zernike coefficients, weighted by the
noise, against the measured ones. Uncertainties come from the derivatives at the solution: the
covariance is sigma^2 (J^T J)^-1, with sigma the stated noise of a coefficient, or the
root-mean-square residual per degree of freedom where none is stated.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_between,
    check_count,
    check_positive,
    check_type,
)
from isetcl.eye.fitting.measurement import ZernikeMeasurement, measure
from isetcl.eye.fitting.parameters import get_parameter, with_parameters
from isetcl.eye.model import Eye

# Of the unit of a parameter: the cube root of the rounding error of coefficients, 1e-11 um.
_STEP = 1e-4
_UNITS = (("curvature", 0.01), ("_mm", 0.1), ("conic", 0.3), ("_deg", 1.0))
_NO_INFLUENCE_UM = 1e-5  # change of all coefficients by one unit of a parameter
_DEPENDENT = 1e-6
_IMPOSSIBLE = 1e3  # residual of an eye that cannot be, over that of the start
_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class EyeFit:
    """An eye fitted to measurements.

    Attributes
    ----------
    eye
        The eye.
    names
        Names of the adjusted parameters.
    start, values : ndarray, (parameters,)
        Before and after.
    covariance : ndarray, (parameters, parameters)
        Covariance of the values.
    residuals_um : tuple of ndarray, (terms,)
        For each measurement, model less measured coefficients in OSA order, um; those that did not
        count (piston, tilt) are 0.
    noise_um
        Standard deviation of a coefficient: as stated, or from the residuals.
    noise_is_stated
        Which of the two.
    degrees_of_freedom
        Coefficients less parameters.
    evaluations
        Eyes traced.
    is_converged
        False where the evaluations ran out.
    """

    eye: Eye
    names: tuple[str, ...]
    start: np.ndarray
    values: np.ndarray
    covariance: np.ndarray
    residuals_um: tuple[np.ndarray, ...]
    noise_um: float
    noise_is_stated: bool
    degrees_of_freedom: int
    evaluations: int
    is_converged: bool

    @property
    def standard_errors(self) -> np.ndarray:
        """Standard error of every value, (parameters,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def rms_um(self) -> float:
        """Root mean square of the residuals that counted, um."""
        count = self.degrees_of_freedom + len(self.names)
        return float(np.sqrt(sum(np.sum(r**2) for r in self.residuals_um) / count))

    def intervals(self, level: float = 0.95) -> np.ndarray:
        """Confidence intervals, (parameters, 2): normal for stated noise, else Student's t."""
        from scipy import stats

        check_between("level", level, 0.0, 1.0)
        tail = (1.0 + level) / 2.0
        if self.noise_is_stated:
            quantile = float(stats.norm.ppf(tail))
        else:
            quantile = float(stats.t.ppf(tail, self.degrees_of_freedom))
        reach = quantile * self.standard_errors
        return np.stack([self.values - reach, self.values + reach], axis=1)

    def summary(self) -> str:
        """The parameters as a table: name, start, value, standard error."""
        width = max(len(name) for name in self.names)
        rows = zip(self.names, self.start, self.values, self.standard_errors, strict=True)
        lines = [f"{n:<{width}}  {a:>12.6g}  {v:>12.6g} +- {e:.2g}" for n, a, v, e in rows]
        lines.append(f"residual {self.rms_um:.3g} um rms, {self.degrees_of_freedom} degrees")
        return "\n".join(lines)


def fit(
    measured: Sequence[ZernikeMeasurement] | ZernikeMeasurement,
    start: Eye,
    free: Sequence[str],
    *,
    noise_um: float | None = None,
    lowest_order: int = 2,
    max_evaluations: int = 100,
) -> EyeFit:
    """The eye whose wavefronts are nearest to measured ones.

    Parameters
    ----------
    measured
        Wavefronts at one or more field positions; each brings its own pupil radius, wavelength,
        radial order and object distance.
    start
        The eye to begin with.
    free
        Names of the parameters to adjust, such as ``"cornea front.curvature"``,
        ``"lens back.conic"``, ``"retina.vertex_z_mm"`` or ``"stop.z_mm"``;
        `parameters.parameter_names` lists them. A surface that touches the plane of the
        stop takes the stop along.
    noise_um
        Standard deviation of a measured coefficient, um; None estimates it from the residuals.
    lowest_order
        Radial orders below it do not count: 2 leaves out piston and tilt, which depend on how the
        instrument was aimed.
    max_evaluations
        Steps of the search at most.

    Raises
    ------
    InvalidInputError
        If a parameter is unknown, has no influence on the measured coefficients or cannot be told
        apart from others, there are fewer coefficients than parameters, or the start cannot be
        measured.
    """
    from scipy.optimize import least_squares

    problem = _Problem(_listed(measured), start, _checked_names(start, free), lowest_order)
    if noise_um is not None:
        check_positive("noise_um", noise_um, "um")
    steps = check_count("max_evaluations", max_evaluations)
    zero = np.zeros(len(problem.names))
    first = problem.residuals(zero)
    _check_influence(problem.names, problem.jacobian(zero))
    problem.impossible = np.full(len(first), _IMPOSSIBLE * max(float(np.abs(first).max()), 1.0))
    found = least_squares(
        problem.residuals,
        zero,
        jac=problem.jacobian,
        method="trf",
        x_scale="jac",
        ftol=_TOLERANCE,
        xtol=_TOLERANCE,
        gtol=_TOLERANCE,
        max_nfev=steps,
    )
    if not found.success:
        warnings.warn(
            f"the fit did not converge in {steps} steps; raise max_evaluations or start nearer",
            stacklevel=2,
        )
    _check_influence(problem.names, found.jac)
    return problem.result(found.x, found.jac, noise_um, bool(found.success))


class _Problem:
    """Residuals and derivatives in parameters counted in units from the start."""

    def __init__(
        self,
        measured: tuple[ZernikeMeasurement, ...],
        start: Eye,
        names: tuple[str, ...],
        lowest_order: int,
    ) -> None:
        self.measured, self.eye, self.names = measured, start, names
        self.skipped = check_count("lowest_order", lowest_order, 0) * (lowest_order + 1) // 2
        self.origin = np.array([get_parameter(start, name) for name in names])
        self.units = np.array([_unit(n, v) for n, v in zip(names, self.origin, strict=True)])
        self.impossible: np.ndarray | None = None
        self.evaluations = 0
        count = sum(max(0, len(m.zernike.coefficients_um) - self.skipped) for m in measured)
        if count < len(names):
            raise InvalidInputError(
                f"{count} coefficients of order {lowest_order} and more cannot determine "
                f"{len(names)} parameters; measure more field positions or free fewer parameters"
            )

    def values(self, x: np.ndarray) -> np.ndarray:
        return np.asarray(self.origin + self.units * x)

    def eye_at(self, x: np.ndarray) -> Eye:
        values = self.values(x)
        return with_parameters(
            self.eye, {n: float(v) for n, v in zip(self.names, values, strict=True)}
        )

    def by_measurement(self, x: np.ndarray) -> list[np.ndarray]:
        """Model less measured coefficients, um; 0 for those that do not count."""
        self.evaluations += 1
        eye = self.eye_at(x)
        left = []
        for item in self.measured:
            zernike = item.zernike
            found = measure(
                eye,
                item.field_deg,
                radius_mm=zernike.radius_mm,
                order=zernike.order,
                wavelength_nm=zernike.wavelength_nm,
                object_distance_m=item.object_distance_m,
            )
            difference = found.zernike.coefficients_um - zernike.coefficients_um
            difference[: self.skipped] = 0.0
            left.append(difference)
        return left

    def residuals(self, x: np.ndarray) -> np.ndarray:
        """All residuals that count, um; large ones where there is no such eye."""
        try:
            return np.concatenate([r[self.skipped :] for r in self.by_measurement(x)])
        except InvalidInputError:
            if self.impossible is None:
                raise
            return self.impossible

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Derivatives by differences, um per unit, (residuals, parameters).

        Central ones, but where there is no eye on one side.
        """
        columns = []
        for step in _STEP * np.eye(len(x)):
            found = [(t, self.residuals(x + t * step)) for t in (-1.0, 1.0)]
            there = [(t, r) for t, r in found if r is not self.impossible]
            if len(there) < 2:
                there.append((0.0, self.residuals(x)))
            (t0, r0), (t1, r1) = there[:2]
            columns.append((r1 - r0) / ((t1 - t0) * _STEP))
        return np.stack(columns, axis=1)

    def result(
        self, x: np.ndarray, slopes: np.ndarray, noise_um: float | None, converged: bool
    ) -> EyeFit:
        left = self.by_measurement(x)
        squares = float(sum(np.sum(r**2) for r in left))
        freedom = slopes.shape[0] - slopes.shape[1]
        noise = noise_um
        if noise is None:
            noise = float(np.sqrt(squares / freedom)) if freedom else float("nan")
        inverse = np.linalg.inv(slopes.T @ slopes) * np.outer(self.units, self.units)
        return EyeFit(
            eye=self.eye_at(x),
            names=self.names,
            start=self.origin,
            values=self.values(x),
            covariance=noise**2 * inverse,
            residuals_um=tuple(left),
            noise_um=noise,
            noise_is_stated=noise_um is not None,
            degrees_of_freedom=freedom,
            evaluations=self.evaluations,
            is_converged=converged,
        )


def _listed(
    measured: Sequence[ZernikeMeasurement] | ZernikeMeasurement,
) -> tuple[ZernikeMeasurement, ...]:
    items = (measured,) if isinstance(measured, ZernikeMeasurement) else measured
    check_type("measured", items, (tuple, list), "pass a list of ZernikeMeasurement")
    if not items:
        raise InvalidInputError("measured must hold at least one ZernikeMeasurement, got none")
    for i, item in enumerate(items):
        check_type(f"measured[{i}]", item, ZernikeMeasurement)
    return tuple(items)


def _checked_names(start: Eye, free: Sequence[str]) -> tuple[str, ...]:
    check_type("start", start, Eye)
    check_type("free", free, (tuple, list), "pass a list of names of parameters")
    names = tuple(free)
    if not names:
        raise InvalidInputError("free must name at least one parameter, got none")
    for name in names:
        check_type("free: a name", name, str)
        get_parameter(start, name)
    if len(set(names)) != len(names):
        raise InvalidInputError(f"free must name every parameter once, got {list(names)}")
    return names


def _unit(name: str, value: float) -> float:
    """A change of a parameter that matters."""
    field = name.rsplit(".", 1)[-1].split("[")[0]
    for ending, unit in _UNITS:
        if field.startswith(ending) or field.endswith(ending):
            return unit
    return 0.01 * max(abs(value), 0.1)


def _check_influence(names: tuple[str, ...], slopes: np.ndarray) -> None:
    """Refuse parameters that the coefficients do not depend on, or not one by one."""
    sizes = np.linalg.norm(slopes, axis=0)
    idle = [n for n, size in zip(names, sizes, strict=True) if size < _NO_INFLUENCE_UM]
    if idle:
        raise InvalidInputError(
            f"free parameter {', '.join(map(repr, idle))} must change a measured coefficient, but "
            "has no influence on any; leave it out, or measure at other field positions"
        )
    _, strengths, directions = np.linalg.svd(slopes / sizes, full_matrices=False)
    if strengths[-1] < _DEPENDENT:
        mixed = [n for n, part in zip(names, directions[-1], strict=True) if abs(part) > 0.1]
        raise InvalidInputError(
            f"free parameters {', '.join(map(repr, mixed))} change the measured coefficients in "
            "the same way and cannot be told apart; leave one out, or measure at other field "
            "positions"
        )
