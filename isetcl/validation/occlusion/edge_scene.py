"""Two textured planes with a vertical edge, as a scene and as a formula of angles."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError, check_between, check_finite, check_positive
from isetcl.scene.material import Emission
from isetcl.scene.model import Scene, SceneObject
from isetcl.scene.targets.planes import facing_quad, half_plane, near_and_far
from isetcl.scene.texture import Checkerboard
from isetcl.spectrum import Spectrum
from isetcl.units import MM_PER_M

LUMINANCE_CD_M2 = 100.0
"""Of a plane of level 1, equal-energy light."""

WIDE_DEG = 70.0
_PUPIL_SAMPLES_LOG2 = 12
_ROWS_AT_ONCE = 4


@dataclass(frozen=True)
class EdgeScene:
    """A near plane at the left, a far one behind it and at the right, both facing the eye.

    Attributes
    ----------
    near_m, far_m
        Distances from the middle of the entrance pupil, m.
    contrast
        Michelson contrast of the checks on both planes; 0 is uniform.
    frequency_cpd
        Pairs of checks a degree, on both planes alike. The edge is the edge of a check.
    near_level, far_level
        Mean radiance of the planes; 1 is 100 cd/m^2.
    """

    near_m: float
    far_m: float
    contrast: float = 0.0
    frequency_cpd: float = 1.0
    near_level: float = 1.0
    far_level: float = 1.0

    def __post_init__(self) -> None:
        near_and_far(self.near_m, self.far_m)
        check_between("contrast", self.contrast, 0.0, 1.0)
        check_positive("frequency_cpd", self.frequency_cpd, "cycles/degree")
        for name in ("near_level", "far_level"):
            if check_finite(name, getattr(self, name)) < 0:
                raise InvalidInputError(f"{name} must be >= 0, got {getattr(self, name):g}")

    @property
    def step_dpt(self) -> float:
        """Difference of the planes' vergences, 1/m."""
        return 1.0 / self.near_m - 1.0 / self.far_m

    def half_width_arcmin(self, pupil_mm: float) -> float:
        """Half-width a |D1 - D2| of the strip in which light is hidden or revealed, arcmin.

        Points behind the edge are seen through part of the pupil only, whatever the eye is focused
        on. Small angles; a is the radius of the entrance pupil.
        """
        return math.degrees(pupil_mm / 2.0 / MM_PER_M * self.step_dpt) * 60.0

    def scene(self, pupil_depth_m: float) -> Scene:
        """The scene for an eye whose entrance pupil lies so far behind its cornea."""
        objects = []
        for name, distance, level in (
            ("near plane", self.near_m, self.near_level),
            ("far plane", self.far_m, self.far_level),
        ):
            check_m = distance * math.radians(0.5 / self.frequency_cpd)
            pairs = math.ceil(distance * math.tan(math.radians(WIDE_DEG)) / check_m)
            size = 2.0 * check_m * pairs
            depth = distance - pupil_depth_m
            quad = (
                half_plane(depth, 0.0, size)
                if name == "near plane"
                else facing_quad(depth, size, size)
            )
            objects.append(SceneObject(name, quad, self._material(level, pairs)))
        return Scene(tuple(objects), None, f"edge at {self.near_m:g} and {self.far_m:g} m")

    def _material(self, level: float, pairs: int) -> Emission:
        white = Spectrum.equal_energy(LUMINANCE_CD_M2)
        if self.contrast == 0:
            return Emission(white.scaled(level))
        bright, dark = level * (1.0 + self.contrast), level * (1.0 - self.contrast)
        return Emission(white, Checkerboard(float(pairs), float(pairs), bright, dark))

    def radiance(self, level: float, x_deg: np.ndarray, y_deg: np.ndarray) -> np.ndarray:
        """Radiance of a plane of a mean level at angles seen from the middle of the pupil."""
        if self.contrast == 0:
            return np.full(np.broadcast(x_deg, y_deg).shape, level)
        checks = 2.0 * self.frequency_cpd
        odd = (np.floor(x_deg * checks) + np.floor(y_deg * checks)) % 2.0
        return np.asarray(level * (1.0 + self.contrast * (1.0 - 2.0 * odd)))

    def thin_lens_image(
        self,
        x_deg: np.ndarray,
        y_deg: np.ndarray,
        pitch_deg: float,
        pupil_mm: float,
        focus_m: float,
    ) -> np.ndarray:
        """What a thin lens without colour or aberrations makes of the planes, (rows, columns).

        L(u) = int A(p) sum_k m_k f_k(u + p dD_k) prod_{j nearer} [1 - m_j(u + p dD_j)] dp over the
        pupil, by 4096 Sobol' points of pupil and pixel; exact for small angles.

        Parameters
        ----------
        x_deg, y_deg
            Middles of columns and rows.
        pitch_deg
            Width of a pixel.
        pupil_mm
            Diameter of the pupil.
        focus_m
            Distance the lens is focused on.
        """
        from scipy.stats import qmc

        points = qmc.Sobol(4, rng=np.random.default_rng(12_345)).random_base2(_PUPIL_SAMPLES_LOG2)
        radius, turn = np.sqrt(points[:, 0]), 2.0 * np.pi * points[:, 1]
        p = radius * np.stack([np.cos(turn), np.sin(turn)]) * pupil_mm / 2.0 / MM_PER_M
        jitter = (points[:, 2:].T - 0.5) * pitch_deg
        shifts = [
            np.degrees(p * (1.0 / distance - 1.0 / focus_m)) + jitter
            for distance in (self.near_m, self.far_m)
        ]
        image = np.empty((len(y_deg), len(x_deg)))
        # Rows of uniform planes are alike.
        count = len(y_deg) if self.contrast > 0 else 1
        for top in range(0, count, _ROWS_AT_ONCE):
            rows = slice(top, min(top + _ROWS_AT_ONCE, count))
            x, y = x_deg[None, :, None], y_deg[rows, None, None]
            near_x, near_y = x + shifts[0][0], y + shifts[0][1]
            seen = np.where(
                near_x < 0.0,
                self.radiance(self.near_level, near_x, near_y),
                self.radiance(self.far_level, x + shifts[1][0], y + shifts[1][1]),
            )
            image[rows] = seen.mean(axis=-1)
        image[count:] = image[0]
        return image
