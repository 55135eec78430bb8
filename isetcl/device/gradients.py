"""Gradients as the kernels read them: their numbers, and how many steps they need."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable

import numpy as np

from isetcl.device.layout import Precision
from isetcl.eye.gradient import Gradient, PolynomialGradient, ShellGradient
from isetcl.eye.gradient_path import PlacedGradient, chord_rays, gauss_tableau, propagate
from isetcl.eye.prescription import Element
from isetcl.eye.surface import form_sag

WANTED_MM = {"single": 5e-6, "double": 1e-9}
"""Error on the retina that steps may cause, mm: below what rounding does in single precision."""

MOST_STEPS = 64
_STEPS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, MOST_STEPS)
_LEVER_MM = 13.0  # from the lens to the retina, over the index there
MOST_ROUNDS = 6
_SHORT_MM = {"single": 0.04, "double": 2e-3}  # the last step: its error is its cube / 1000


@functools.lru_cache(maxsize=1024)
def kernel_steps(placed: PlacedGradient, precision: Precision) -> int:
    """Steps from surface to surface with which the kernels' method is as right as is wanted.

    Found by trying them on rays over three quarters of the lens, in float64.
    """
    start = chord_rays(placed)
    exact = propagate(placed.profile, *start, placed.steps)
    for steps in _STEPS:
        error = method_error_mm(placed.profile, start, exact[:2], steps, precision)
        if error <= WANTED_MM[precision]:
            return steps
    return MOST_STEPS


def method_error_mm(
    profile: Gradient,
    start: tuple[np.ndarray, np.ndarray, np.ndarray],
    exact: tuple[np.ndarray, ...],
    steps: int,
    precision: Precision,
) -> float:
    """Largest error on the retina of rays (points, T, span) after `steps` of the kernels' steps."""
    points, rays, span = start
    for _ in range(steps):
        points, rays = kernel_step(profile, points, rays, span / steps, precision)
    error = np.abs(points - exact[0]) + _LEVER_MM * np.abs(rays - exact[1])
    return float(np.max(np.linalg.norm(error, axis=1)))


def kernel_step(
    profile: Gradient, points: np.ndarray, rays: np.ndarray, h: np.ndarray, precision: Precision
) -> tuple[np.ndarray, np.ndarray]:
    """One step of the kernels' method (lib/steps.cl) in numpy; h in mm, (n,)."""
    step = _nystroem_step if precision == "single" else _gauss_step
    return step(lambda at: profile.squared_and_half_gradient(*at.T)[1], points, rays, h[:, None])


def _gauss_step(
    force: Callable[[np.ndarray], np.ndarray], points: np.ndarray, rays: np.ndarray, h: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Three stages begun on a parabola, one sweep: order 6."""
    c, b, a = gauss_tableau(3)
    early = force(points + h / 6.0 * rays)
    f = [force(points + ci * h * rays + (ci * h) ** 2 / 2.0 * early) for ci in c]
    aa = a @ a
    f = [
        force(points + ci * h * rays + h * h * np.tensordot(row, f, axes=1))
        for ci, row in zip(c, aa, strict=True)
    ]
    return (
        points + h * rays + h * h * np.tensordot(b * (1.0 - c), f, axes=1),
        rays + h * np.tensordot(b, f, axes=1),
    )


def _nystroem_step(
    force: Callable[[np.ndarray], np.ndarray], points: np.ndarray, rays: np.ndarray, h: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Four stages, explicit: order 5."""
    f1 = force(points)
    f2 = force(points + h / 5.0 * rays + h * h / 50.0 * f1)
    f3 = force(points + 2.0 * h / 3.0 * rays + h * h / 27.0 * (7.0 * f2 - f1))
    f4 = force(points + h * rays + h * h / 70.0 * (21.0 * f1 - 4.0 * f2 + 18.0 * f3))
    return (
        points + h * rays + h * h / 336.0 * (14.0 * f1 + 100.0 * f2 + 54.0 * f3),
        rays + h / 336.0 * (14.0 * f1 + 125.0 * f2 + 162.0 * f3 + 35.0 * f4),
    )


@functools.lru_cache(maxsize=1024)
def landing_rounds(placed: PlacedGradient, precision: Precision) -> int:
    """How often the rest of the way to a surface is integrated before the last, short step.

    The straight way is some percent too long or too short; every round squares what is left.
    Found as the step count is, on the planes at the ends of the rays.
    """
    points, rays, span = chord_rays(placed)
    end = np.array([chord[2] for chord in placed.chords[:-1] for _ in range(3)])
    for rounds in range(MOST_ROUNDS):
        points, rays, _ = propagate(placed.profile, points, rays, span, placed.steps)
        span = (end - points[:, 2]) / rays[:, 2]
        if np.max(np.abs(span)) <= _SHORT_MM[precision]:
            return rounds
    return MOST_ROUNDS


def is_smooth(element: Element, precision: Precision) -> bool:
    """Whether the index is so nearly the same on both sides of a surface that nothing bends there.

    So at the equator of a lens of two gradients, whose published numbers do not quite meet. A jump
    dn turns a ray by dn tan(i) / n; rays meet an equator at less than 45 deg.
    """
    before, after = element.gradient_before, element.gradient_after
    if before is None or after is None or not math.isfinite(element.semi_diameter_mm):
        return False
    r, turn = np.meshgrid(np.linspace(0.0, element.semi_diameter_mm, 9), np.arange(8.0))
    x, y = r * np.cos(turn), r * np.sin(turn)
    sag = form_sag(element.curvature, element.conic, element.shape, x, y)
    points = np.stack([x, y, sag], axis=-1).reshape(-1, 3)
    points, _ = element.leave(points, points)
    jump = float(np.max(np.abs(after.index_at(points) - before.index_at(points))))
    return jump * _LEVER_MM <= WANTED_MM[precision]


def landing_steps(steps: int) -> int:
    """Steps of such a round, where a way took `steps`."""
    return 1 + steps // 8


def profile_numbers(placed: PlacedGradient, element: Element, most_degree: int) -> np.ndarray:
    """A profile in the layout of lib/gradient.cl, as seen from an element's vertex.

    A profile that lies along the axis of the eye is shifted along it; any other brings its frame.
    """
    profile = placed.profile
    offset = placed.origin_mm - np.array([0.0, 0.0, element.vertex_z_mm])
    rotation = np.eye(3)
    if placed.is_centred:
        profile, offset = shifted(profile, -float(offset[2])), np.zeros(3)
    else:
        rotation = placed.rotation.T
    is_shells = isinstance(profile, ShellGradient)
    frame = np.concatenate([offset, rotation.ravel(), [float(is_shells)]])
    if isinstance(profile, ShellGradient):
        numbers = np.array(
            [
                profile.n_core,
                profile.n_core - profile.n_edge,
                profile.centre_z_mm,
                profile.semi_z_mm**-2,
                profile.semi_r_mm**-2,
                profile.power - 1.0,
            ]
        )
    else:
        numbers = np.zeros((most_degree + 1, most_degree // 2 + 1))
        given = np.array(profile.coefficients)[: most_degree + 1, : most_degree // 2 + 1]
        numbers[: given.shape[0], : given.shape[1]] = given
    return np.concatenate([frame, numbers.ravel()])


def shifted(profile: Gradient, by_mm: float) -> Gradient:
    """The same profile with z measured from `by_mm` farther back."""
    if isinstance(profile, ShellGradient):
        return ShellGradient(
            profile.n_core,
            profile.n_edge,
            profile.centre_z_mm - by_mm,
            profile.semi_z_mm,
            profile.semi_r_mm,
            profile.power,
        )
    rows = np.array(profile.coefficients)
    moved = np.zeros_like(rows)
    for i, row in enumerate(rows):
        for k in range(i + 1):
            moved[k] += math.comb(i, k) * by_mm ** (i - k) * row
    return PolynomialGradient(tuple(map(tuple, moved.tolist())))
