"""The pixels of a retinal image: equal steps of visual angle, each a small patch of retina.

The grid is laid out in polar field angles at a reference wavelength (see isetcl/eye/field.py).
Row 0 is the top of the visual field and column 0 its left, so an image of the grid is upright
although the retina's is inverted. A pixel stands for the patch of retina whose chief rays come
from its directions; its value is the mean irradiance over the patch.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Literal

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_choice,
    check_count,
    check_pair,
    check_positive,
    check_type,
)
from isetcl.eye.field import FieldMap, direction_from_field
from isetcl.eye.field_plane import FieldPlane
from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye
from isetcl.eye.plane_polynomial import PlanePolynomial, Rectangle
from isetcl.eye.plane_polynomial import fit as plane_fit
from isetcl.eye.polynomial import fit, unit_nodes
from isetcl.eye.retina_form import retinal_normal, without_relief

MAX_PIXELS_PER_SIDE = 32768

Centre = tuple[float, float] | Literal["fovea"]
"""The middle of an image: field angles (x, y) in degrees, or where the fovea of the eye looks."""

_FIT_TOLERANCE_MM = 1e-9
_FIT_NODES = 24
_PLANE_TOLERANCE_MM = 1e-7  # a tenth of a nanometre; every further degree costs time


@dataclass(frozen=True)
class RetinalGrid:
    """A rectangular grid of retinal pixels.

    Parameters
    ----------
    eye
        The eye whose retina it is.
    fov_deg
        Width and height in degrees of field angle.
    resolution
        Columns and rows.
    centre_deg
        Field angles (x, y) of the middle.
    wavelength_nm
        Reference wavelength of the chief rays that label the pixels.
    """

    eye: Eye
    fov_deg: tuple[float, float]
    resolution: tuple[int, int]
    centre_deg: tuple[float, float] = (0.0, 0.0)
    wavelength_nm: float = REFERENCE_WAVELENGTH_NM

    def __post_init__(self) -> None:
        check_type("eye", self.eye, Eye)
        width, height = check_pair("fov_deg", self.fov_deg, "deg")
        check_positive("fov_deg (width)", width, "deg")
        check_positive("fov_deg (height)", height, "deg")
        columns, rows = check_pair("resolution", self.resolution)
        check_count("resolution (columns)", columns, 1, MAX_PIXELS_PER_SIDE)  # type: ignore[arg-type]
        check_count("resolution (rows)", rows, 1, MAX_PIXELS_PER_SIDE)  # type: ignore[arg-type]
        check_pair("centre_deg", self.centre_deg, "deg")
        limit = self.field_map.max_field_deg
        if self.limit_deg > limit:
            raise InvalidInputError(
                f"the corners of the image lie {self.limit_deg:.3g} deg from the optical axis, but "
                f"chief rays enter eye {self.eye.name!r} only out to {limit:.4g} deg; "
                "reduce fov_deg or centre_deg"
            )

    @classmethod
    def of(
        cls,
        eye: Eye,
        fov_deg: float | tuple[float, float],
        resolution: int | tuple[int, int],
        centre_deg: Centre = (0.0, 0.0),
    ) -> RetinalGrid:
        """A grid from the arguments of `render`: numbers mean squares, "fovea" the eye's fovea.

        Raises
        ------
        InvalidInputError
            If a size is not positive, or the corners lie outside the eye's field.
        """
        columns, rows = (
            check_pair("resolution", resolution) if np.ndim(resolution) else (resolution,) * 2  # type: ignore[arg-type]
        )
        columns = check_count("resolution (columns)", columns, 1, MAX_PIXELS_PER_SIDE)  # type: ignore[arg-type]
        rows = check_count("resolution (rows)", rows, 1, MAX_PIXELS_PER_SIDE)  # type: ignore[arg-type]
        if np.ndim(fov_deg):
            size = check_pair("fov_deg", fov_deg, "deg")  # type: ignore[arg-type]
        else:
            width = check_positive("fov_deg", fov_deg, "deg")  # type: ignore[arg-type]
            size = (width, width * rows / columns)
        if isinstance(centre_deg, str):
            check_choice("centre_deg", centre_deg, ("fovea",))
            centre_deg = eye.fovea_deg
        return cls(eye, size, (columns, rows), check_pair("centre_deg", centre_deg, "deg"))

    @property
    def field_map(self) -> FieldMap | FieldPlane:
        """The chief-ray map that labels the pixels."""
        return self.eye.field_map(self.wavelength_nm)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.resolution[1], self.resolution[0]

    @property
    def pitch_deg(self) -> tuple[float, float]:
        """Width and height of a pixel, degrees."""
        return self.fov_deg[0] / self.resolution[0], self.fov_deg[1] / self.resolution[1]

    @property
    def left_deg(self) -> float:
        """Field angle x of the left border."""
        return self.centre_deg[0] - self.fov_deg[0] / 2.0

    @property
    def top_deg(self) -> float:
        """Field angle y of the upper border."""
        return self.centre_deg[1] + self.fov_deg[1] / 2.0

    @property
    def x_deg(self) -> np.ndarray:
        """Field angles x of the pixel centres, ascending, shape (columns,)."""
        return self.left_deg + (np.arange(self.resolution[0]) + 0.5) * self.pitch_deg[0]

    @property
    def y_deg(self) -> np.ndarray:
        """Field angles y of the pixel centres, descending, shape (rows,)."""
        return self.top_deg - (np.arange(self.resolution[1]) + 0.5) * self.pitch_deg[1]

    @functools.cached_property
    def limit_deg(self) -> float:
        """Largest field angle on the grid, at a corner."""
        x = np.array([self.left_deg, self.left_deg + self.fov_deg[0]])
        y = np.array([self.top_deg, self.top_deg - self.fov_deg[1]])
        return float(np.max(np.hypot(x[:, None], y[None, :])))

    @property
    def rectangle(self) -> Rectangle:
        """The field angles of the image."""
        return Rectangle(self.centre_deg, (self.fov_deg[0] / 2.0, self.fov_deg[1] / 2.0))

    def eccentricity_deg(self) -> np.ndarray:
        """Angles of the pixel centres from the direction that the fovea sees, (rows, columns)."""
        fovea = direction_from_field(*(np.array(angle) for angle in self.eye.fovea_deg))
        seen = self.directions()
        across = np.linalg.norm(np.cross(seen, fovea), axis=-1)
        return np.degrees(np.arctan2(across, seen @ fovea))

    def directions(self) -> np.ndarray:
        """Unit vectors towards the scene of the pixel centres, shape (rows, columns, 3)."""
        return direction_from_field(self.x_deg[None, :], self.y_deg[:, None])

    def positions_mm(self) -> tuple[np.ndarray, np.ndarray]:
        """Retinal arc-length coordinates (x, y) of the pixel centres, mm, each (rows, columns).

        Polar about the retinal vertex, in the eye frame: the point that sees up lies at y < 0.
        """
        at = self.field_map.coordinates_mm(*np.meshgrid(self.x_deg, self.y_deg))
        return at[..., 0], at[..., 1]

    def plane_polynomial(self) -> PlanePolynomial:
        """The retina of an eye that is no figure of revolution, as the kernels see it.

        Six polynomials of the field angles: the point (x, y, z), mm, of the retina without relief,
        and its unit normal, away from the lens.
        """
        labels = self.field_map
        assert isinstance(labels, FieldPlane)
        retina = without_relief(self.eye.retina)
        at = self.rectangle.nodes()
        point = labels.base_point_mm(at)
        values = np.concatenate([point, retinal_normal(retina, point)], axis=1)
        return plane_fit(self.rectangle, at, values, _PLANE_TOLERANCE_MM)

    def polynomials(self) -> tuple[np.ndarray, np.ndarray]:
        """The retina as the kernels see it, in g = field vector / `limit_deg` and s = g . g.

        Of an eye that is a figure of revolution.

        Returns
        -------
        chord : coefficients in s of height / |g|, mm
        depth : coefficients in s of z - (z of the retinal vertex), mm
        """
        s = unit_nodes(_FIT_NODES)
        field = self.limit_deg * np.sqrt(s)
        point = self.field_map.retinal_point_mm(np.zeros_like(field), field)
        chord = -point[:, 1] / np.sqrt(s)
        depth = point[:, 2] - self.eye.retina.vertex_z_mm
        return fit(s, chord, _FIT_TOLERANCE_MM), fit(s, depth, _FIT_TOLERANCE_MM)
