"""The field a mosaic covers: its border and margin, the density over it, how much it holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from isetcl.cones.density import ConeDensity, DensityFunction, in_optic_disc
from isetcl.cones.disorder import Disorder, least_distance_mm, measured_disorder
from isetcl.cones.lattice import Sector, parted, relaxed, rings, spacing_of
from isetcl.cones.mosaic import Side, check_fov
from isetcl.cones.retinal_scale import RetinalScale
from isetcl.cones.rod_density import RodDensity, check_known, wanted_rods
from isetcl.device.lattice import LatticeKernels
from isetcl.errors import InvalidInputError, check_choice, check_pair
from isetcl.eye.model import Eye
from isetcl.memory import check_memory

_MARGIN = 8.0  # spacings around the field; the outer half does not move
_BYTES_PER_CONE = 900.0
_BYTES_OF_A_START = 100.0
_GRID = 65


@dataclass(frozen=True)
class MosaicEstimate:
    """What a mosaic will be before it is made.

    Attributes
    ----------
    n_cones
        Cones expected in the field, the optic disc not left out.
    n_rods
        Rods expected in it.
    memory_bytes
        Memory its making takes at most.
    """

    n_cones: int
    n_rods: int
    memory_bytes: float


@dataclass(frozen=True, eq=False)
class Field:
    """A rectangle of the visual field with the density over it."""

    width_deg: float
    height_deg: float
    centre_deg: tuple[float, float]
    eye: Side
    density: ConeDensity
    scale: RetinalScale
    margin_deg: float

    @classmethod
    def of(
        cls,
        fov_deg: float | Sequence[float],
        centre_deg: Sequence[float],
        eye: Side,
        density: str | DensityFunction,
        scale: str | float | Eye,
    ) -> Field:
        """The field of a mosaic, checked; see `isetcl.cones.generate.mosaic`."""
        width, height = check_fov(fov_deg)
        centre = check_pair("centre_deg", centre_deg, "deg")
        check_choice("eye", eye, ("right", "left"))
        chart = RetinalScale.of(scale)
        cones = ConeDensity.of(density, eye, chart)
        field = cls(width, height, centre, eye, cones, chart, 0.0)
        corners = field.grid_deg()
        ecc = np.hypot(corners[:, 0], corners[:, 1])
        chart.check("the mosaic", float(ecc.max()))
        spacing = cones.spacing_mm(chart.to_mm(corners))
        per_deg = float(chart.arc_mm(ecc.max()[None])[0] / ecc.max())
        margin = _MARGIN * float(spacing.max()) / per_deg
        return cls(width, height, centre, eye, cones, chart, margin)

    def grid_deg(self, margin_deg: float = 0.0) -> np.ndarray:
        """Directions on a grid that covers the field to its borders, (n, 2)."""
        x, y = (
            c + (0.5 * side + margin_deg) * np.linspace(-1.0, 1.0, _GRID)
            for c, side in zip(self.centre_deg, (self.width_deg, self.height_deg), strict=True)
        )
        return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)

    def holds(self, deg: np.ndarray, margin_deg: float = 0.0) -> np.ndarray:
        """Whether directions (n, 2) lie in the field, widened by a margin."""
        half = 0.5 * np.array([self.width_deg, self.height_deg]) + margin_deg
        return np.asarray(np.all(np.abs(deg - self.centre_deg) <= half, axis=1))

    def sector(self) -> Sector:
        """The sector about the fovea that holds the field with its margin."""
        border = self.scale.to_mm(self.grid_deg(self.margin_deg))
        return Sector.around(border, bool(self.holds(np.zeros((1, 2)), self.margin_deg)[0]))

    def check_disc(self) -> None:
        """Raise InvalidInputError if the middle of the field lies in the optic disc."""
        middle = self.scale.to_mm(np.array([self.centre_deg]))
        if in_optic_disc(middle, self.eye, self.scale)[0]:
            raise InvalidInputError(
                f"centre_deg must not lie in the optic disc, where no cones are, got "
                f"({self.centre_deg[0]:g}, {self.centre_deg[1]:g}) deg in a {self.eye} eye; move "
                "it, or pass has_optic_disc=False"
            )

    def rods(self, rods: RodDensity) -> DensityFunction | None:
        """Rods per mm^2 at directions in degrees; see `isetcl.cones.rod_density.wanted_rods`."""
        wanted = wanted_rods(rods, self.eye, self.scale)
        if wanted is not None and not callable(rods):
            check_known(float(np.hypot(*self.scale.to_mm(self.grid_deg()).T).max()))
        return wanted

    def estimate(self, rods: DensityFunction | None = None) -> MosaicEstimate:
        """Cones in the field by the trapezoidal rule, and memory for what is made around it.

        Rods, where there are any, by the same rule.
        """
        at = self.scale.to_mm
        n_cones = self._total(self.at(at(self.grid_deg())), 0.0)
        around = self._total(self.at(at(self.grid_deg(self.margin_deg))), self.margin_deg)
        n_rods, rods_around = (self._rods_in(rods, margin) for margin in (0.0, self.margin_deg))
        # The rings are made all round the fovea and cropped: places and little else.
        sector = self.sector()
        area = 0.5 * (sector.last_rad - sector.first_rad) * (sector.high_mm**2 - sector.low_mm**2)
        share = self._total(np.ones(_GRID**2), self.margin_deg) / area
        whole = (around + rods_around) / min(share, 1.0)
        memory = _BYTES_PER_CONE * (around + rods_around) + _BYTES_OF_A_START * whole + 2e8
        return MosaicEstimate(round(n_cones), round(n_rods), memory)

    def _rods_in(self, rods: DensityFunction | None, margin_deg: float) -> float:
        """Rods in the field widened by a margin, by the trapezoidal rule."""
        if rods is None:
            return 0.0
        deg = self.grid_deg(margin_deg)
        wanted = np.broadcast_to(np.asarray(rods(deg[:, 0], deg[:, 1]), float), len(deg))
        return self._total(wanted, margin_deg)

    def _total(self, per_mm2: np.ndarray, margin_deg: float) -> float:
        """The integral over the field of a density on `grid_deg`, (n,)."""
        deg = self.grid_deg(margin_deg)
        per_deg2 = per_mm2 * self.scale.mm2_per_deg2(np.hypot(deg[:, 0], deg[:, 1]))
        sides = (self.width_deg, self.height_deg)
        dx, dy = ((side + 2.0 * margin_deg) / (_GRID - 1) for side in sides)
        grid = per_deg2.reshape(_GRID, _GRID)
        return float(np.trapezoid(np.trapezoid(grid, dx=dx), dx=dy))

    def check_memory(self, rods: DensityFunction | None = None) -> None:
        """Raise OutOfMemoryError if there is less memory than the mosaic takes.

        InvalidInputError if it would be empty: cones far apart ask for a margin without end.
        """
        estimate = self.estimate(rods)
        if estimate.n_cones == 0:
            raise InvalidInputError(
                f"a field of {self.width_deg:g} x {self.height_deg:g} deg holds no cone at this "
                "density; make the field wider, or the density higher"
            )
        count = f"{estimate.n_cones:.3g} cones"
        count += f", {estimate.n_rods:.3g} rods" if rods is not None else ""
        check_memory(
            f"a mosaic of {self.width_deg:g} x {self.height_deg:g} deg ({count})",
            estimate.memory_bytes,
            lambda factor: f"a field of {factor:.2g} times its sides would fit",
        )

    def at(self, places_mm: np.ndarray) -> np.ndarray:
        """Cones per mm^2, in the margin too: beyond the data the value at their end."""
        arc = np.hypot(places_mm[:, 0], places_mm[:, 1])
        low, high = self.density.range_mm
        clipped = np.clip(arc, low, high) / np.where(arc > 0, arc, 1.0)
        if np.all(clipped[arc > 0] == 1.0):
            return self.density.per_mm2(places_mm)
        return self.density.per_mm2(places_mm * np.where(arc > 0, clipped, 1.0)[:, None])

    def lattice(self, kernels: LatticeKernels, disorder: Disorder, seed: int) -> np.ndarray:
        """Places of cones in the field and its margin, (n, 2), mm."""
        start = rings(self.density, self.sector(), seed)
        deg = self.scale.to_deg(start)
        near = self.holds(deg, self.margin_deg)
        start, deg = start[near], deg[near]
        is_fixed = ~self.holds(deg, 0.5 * self.margin_deg)
        if disorder != "measured":
            return relaxed(start, self.at, is_fixed, kernels, disorder, seed)
        spacing = self.spacing_mm(start)
        spread = measured_disorder(np.hypot(*deg.T), spacing)
        places = relaxed(start, self.at, is_fixed, kernels, spread, seed)
        return parted(places, least_distance_mm(spacing), is_fixed, kernels)

    def spacing_mm(self, places_mm: np.ndarray) -> np.ndarray:
        """Spacing of a hexagonal lattice of the density at places (n, 2), mm; in the margin too."""
        return spacing_of(self.at(places_mm))

    def describe(self) -> dict[str, Any]:
        """Plain values for provenance."""
        return {
            "fov_deg": [self.width_deg, self.height_deg],
            "centre_deg": list(self.centre_deg),
            "density": self.density.name,
            "scale": self.scale.name,
        }
