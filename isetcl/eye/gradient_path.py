"""Rays in gradient-index media on the host: Gauss's collocation with five stages, order 10.

The ray equation in the variable t with ds = n dt is R'' = grad(n^2) / 2 and T = R' = n times the
unit direction, so that the optical path length is the integral of n^2 dt (Sharma, Kumar & Ghatak
1982, Appl Opt 21:984). The kernels use three stages and a fixed number of sweeps instead.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from isetcl.eye.gradient import Gradient
from isetcl.eye.placement import Placement

_STAGES = 5
_SWEEPS = 40
_AXIAL_STAGES = 24
_STEPS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
_WANTED_MM = 1e-13


@functools.lru_cache
def gauss_tableau(stages: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes c (s,), weights b (s,) and matrix A (s, s) of Gauss's collocation on [0, 1].

    A[i, j] is the integral of the j-th Lagrange polynomial from 0 to c[i], formed with Legendre
    polynomials (Hairer, Norsett & Wanner 1993, Solving ODEs I, II.7).
    """
    x, w = np.polynomial.legendre.leggauss(stages)
    at_nodes = np.polynomial.legendre.legvander(x, stages)
    k = np.arange(stages)
    to_series = (2.0 * k[:, None] + 1.0) / 2.0 * at_nodes[:, :stages].T * w
    integral = np.empty((stages, stages))
    integral[:, 0] = (x + 1.0) / 2.0
    for i in range(1, stages):
        integral[:, i] = (at_nodes[:, i + 1] - at_nodes[:, i - 1]) / (2.0 * (2.0 * i + 1.0))
    return (x + 1.0) / 2.0, w / 2.0, integral @ to_series


def propagate(
    gradient: Gradient, points: np.ndarray, rays: np.ndarray, span: np.ndarray, steps: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rays followed through a gradient.

    Parameters
    ----------
    points
        (n, 3), mm, frame of the gradient.
    rays
        T, (n, 3): directions of length n.
    span
        Length of t, (n,), mm; may be negative.
    steps
        Equal steps.

    Returns
    -------
    points, rays : (n, 3); optical path length : (n,), mm. Rays that leave for where the index is
    meaningless hold anything, NaN included.
    """
    c, b, a = gauss_tableau(_STAGES)
    aa = a @ a
    h = (span / steps)[:, None]
    path = np.zeros(len(points))
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(steps):
            straight = points + c[:, None, None] * (h * rays)
            at, force = straight, np.zeros_like(straight)
            last = math.inf
            for _ in range(_SWEEPS):
                squared, new = gradient.squared_and_half_gradient(*np.moveaxis(at, -1, 0))
                change = float(np.max(np.nan_to_num(np.abs(h * h * (new - force)), posinf=0.0)))
                force = new
                # Until rounding is all that changes.
                if change < 1e-16 or (change < 1e-13 and change >= 0.5 * last):
                    break
                last = change
                at = straight + h * h * np.tensordot(aa, force, axes=1)
            points = points + h * rays + h * h * np.tensordot(b * (1.0 - c), force, axes=1)
            rays = rays + h * np.tensordot(b, force, axes=1)
            path = path + h[:, 0] * (b @ squared)
    return points, rays, path


@dataclass(frozen=True)
class PlacedGradient:
    """A profile between two surfaces of an eye.

    Attributes
    ----------
    profile
        The profile, in the frame of the surface in front.
    vertex_z_mm, placement
        That frame in the eye; see `Surface`.
    chords
        (r, z in front, z behind) in that frame, mm: rays parallel to the axis from the axis to the
        rim, from which step counts are found.
    """

    profile: Gradient
    vertex_z_mm: float
    placement: Placement | None
    chords: tuple[tuple[float, float, float], ...]

    @property
    def is_centred(self) -> bool:
        """Whether its axis is that of the eye."""
        return self.placement is None or self.placement.is_centred

    @property
    def origin_mm(self) -> np.ndarray:
        """The vertex of the surface in front, eye frame, mm, (3,)."""
        x, y = (0.0, 0.0) if self.placement is None else self.placement.decentre_mm
        return np.array([x, y, self.vertex_z_mm])

    @property
    def rotation(self) -> np.ndarray:
        """The axes of the profile's frame in the eye frame, as columns, (3, 3)."""
        return np.eye(3) if self.placement is None else self.placement.rotation

    def enter(self, position: np.ndarray, vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points and vectors of the eye frame in the profile's, (n, 3)."""
        return (position - self.origin_mm) @ self.rotation, vector @ self.rotation

    def leave(self, position: np.ndarray, vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points and vectors of the profile's frame in the eye's, (n, 3)."""
        turned = self.rotation.T
        return position @ turned + self.origin_mm, vector @ turned

    def index_at(self, position: np.ndarray) -> np.ndarray:
        """Refractive index at points of the eye frame in mm, (n, 3) -> (n,)."""
        return self.profile.index(*self.enter(position, position)[0].T)

    @property
    def steps(self) -> int:
        """Steps of `propagate` from surface to surface that are right to 1e-13 mm, or 64."""
        return _steps(self)

    def ray_matrix(self, from_z_mm: float, to_z_mm: float) -> np.ndarray:
        """The matrix that takes (y, n u) from one plane to another, (2, 2); z in its own frame.

        (n0 y')' = 2 n1 y with n = n0(z) + n1(z) r^2, by collocation in one step.
        """
        c, b, a = gauss_tableau(_AXIAL_STAGES)
        h = to_z_mm - from_z_mm
        n0, n1 = self.profile.axial(from_z_mm + h * c)
        by_y, by_v = 2.0 * h * n1, h / n0
        # Stages: Y = y + A (by_v V), V = v + A (by_y Y).
        one = np.eye(len(c))
        system = np.block([[one, -a * by_v], [-a * by_y, one]])
        ones, zeros = np.ones(len(c)), np.zeros(len(c))
        start = np.stack([np.concatenate([ones, zeros]), np.concatenate([zeros, ones])], axis=1)
        stages = np.linalg.solve(system, start)
        y, v = stages[: len(c)], stages[len(c) :]
        return np.eye(2) + np.stack([(b * by_v) @ v, (b * by_y) @ y])


def chord_rays(placed: PlacedGradient) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Start points, rays T and spans of t of rays along the chords, straight and tilted 0.15 rad.

    A chord ends where the surface behind would be met by a straight ray parallel to the axis.
    """
    # Light rarely comes near the rim, where shells are steepest.
    inner = np.array(placed.chords[:-1])
    chords = np.repeat(inner, 3, axis=0)
    tilt = np.tile([-0.15, 0.0, 0.15], len(inner))
    zeros = np.zeros(len(chords))
    points = np.stack([chords[:, 0], zeros, chords[:, 1]], axis=1)
    n = placed.profile.index(*points.T)
    rays = n[:, None] * np.stack([np.sin(tilt), zeros, np.cos(tilt)], axis=1)
    return points, rays, (chords[:, 2] - chords[:, 1]) / n


@functools.lru_cache(maxsize=1024)
def _steps(placed: PlacedGradient) -> int:
    rays = chord_rays(placed)
    ends = [propagate(placed.profile, *rays, n)[0] for n in _STEPS[:2]]
    for i in range(2, len(_STEPS)):
        if float(np.max(np.abs(ends[-1] - ends[-2]))) < _WANTED_MM:
            return _STEPS[i - 2]
        ends.append(propagate(placed.profile, *rays, _STEPS[i])[0])
    return _STEPS[-1]
