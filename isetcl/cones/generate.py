"""Making a mosaic: from a field and a density to cones with types and sizes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from isetcl.cones.cone_types import SFraction, assign_types, check_ratios
from isetcl.cones.density import ConeDensity, DensityFunction, in_optic_disc
from isetcl.cones.lattice import Sector, relaxed, rings
from isetcl.cones.mosaic import ConeMosaic, Side, check_fov
from isetcl.cones.receptors import (
    APERTURE_MODELS,
    ApertureModel,
    aperture_um,
    neighbour_spacing,
    outer_segment_um,
)
from isetcl.cones.retinal_scale import RetinalScale
from isetcl.device.choose import find_device
from isetcl.device.lattice import LatticeKernels
from isetcl.device.layout import Precision
from isetcl.errors import (
    InvalidInputError,
    check_between,
    check_choice,
    check_count,
    check_pair,
)
from isetcl.eye.model import Eye
from isetcl.memory import check_memory
from isetcl.version import __version__

DISORDER = 0.16
"""Relative spread of the cones' sizes that makes 55 % of them six-sided, inside the fovea's rim.

Measured at 0.2 to 1.05 mm: 40 to 50 % (Lombardo, Serrao, Ducoli & Lombardo 2013), which cones
missed in the images lower.
"""

_MARGIN = 8.0  # spacings around the field; the outer half does not move
_BYTES_PER_CONE = 900.0
_GRID = 65


def mosaic(
    fov_deg: float | Sequence[float],
    centre_deg: Sequence[float] = (0.0, 0.0),
    *,
    eye: Side = "right",
    density: str | DensityFunction = "curcio1990",
    ratios: Sequence[float] = (0.6, 0.3, 0.1),
    s_free_radius_deg: float = 0.15,
    s_fraction: SFraction | None = None,
    disorder: float = DISORDER,
    scale: str | float | Eye = "watson2014",
    aperture: ApertureModel = "pillbox",
    has_rod_intrusion: bool = False,
    has_optic_disc: bool = True,
    seed: int = 0,
    device: str | None = None,
    precision: Precision = "single",
) -> ConeMosaic:
    """A mosaic of cones over a rectangle of the visual field.

    Parameters
    ----------
    fov_deg
        Width and height, degrees; one number for a square.
    centre_deg
        Its middle, degrees right and up from the fovea.
    eye
        ``"right"`` or ``"left"``: which side is nasal.
    density
        ``"curcio1990"``, ``"watson2014"``, ``"song2011"``, or a function of directions
        ``(x_deg, y_deg)`` that returns cones per mm^2 of retina. It is asked a few cones beyond the
        field, too.
    ratios
        Shares of L, M and S cones; 0 for a type that is missing.
    s_free_radius_deg
        Radius of the centre without S cones, degrees.
    s_fraction
        Share of S cones as a function of eccentricity in degrees, instead of that of `ratios`.
    disorder
        Relative spread of the cones' sizes, 0 to 0.4: 0 is as regular as the density allows (93 %
        six-sided), the default about as regular as measured.
    scale
        Degrees to mm of retina: ``"watson2014"``, a number of mm per degree, or an `Eye`, whose
        chief rays are used.
    aperture, has_rod_intrusion
        See `isetcl.cones.receptors.aperture_um`.
    has_optic_disc
        Whether cones are left out in the optic disc.
    seed
        Seed of positions and types: the same on one device, bit for bit.
    device, precision
        Where and how to compute.

    Raises
    ------
    InvalidInputError
        If the field is empty, reaches beyond the density's data, or has its centre in the optic
        disc; if the density is not finite and positive; if the ratios do not sum to 1.
    OutOfMemoryError
        If the mosaic does not fit into memory; its size is said.
    """
    shares = check_ratios(ratios)
    check_between("s_free_radius_deg", s_free_radius_deg, 0.0, 180.0, "deg")
    check_between("disorder", disorder, 0.0, 0.4)
    check_choice("aperture", aperture, APERTURE_MODELS)
    check_count("seed", seed, 0)
    field = _Field.of(fov_deg, centre_deg, eye, density, scale)
    if has_optic_disc:
        field.check_disc()
    field.check_memory()
    kernels = LatticeKernels(find_device(device), precision)
    places = field.lattice(kernels, disorder, seed)
    spacing_um = 1e3 * neighbour_spacing(places)
    deg = field.scale.to_deg(places)
    inside = field.holds(deg)
    if has_optic_disc:
        inside &= ~in_optic_disc(places, eye, field.scale)
    if not np.any(inside):
        raise InvalidInputError(
            f"a field of {field.width_deg:g} x {field.height_deg:g} deg holds no cone; make "
            "fov_deg larger"
        )
    places, deg, spacing_um = places[inside], deg[inside], spacing_um[inside]
    eccentricity = np.hypot(deg[:, 0], deg[:, 1])
    types = assign_types(
        places,
        eccentricity,
        field.density.spacing_mm(places),
        kernels,
        ratios=shares,
        s_fraction=s_fraction,
        s_free_radius_deg=s_free_radius_deg,
        seed=seed,
    )
    return ConeMosaic(
        deg,
        places,
        types,
        spacing_um,
        aperture_um(spacing_um, eccentricity, aperture, has_rod_intrusion=has_rod_intrusion),
        outer_segment_um(eccentricity),
        eccentricity,
        eye,
        "gaussian" if aperture == "gaussian" else "pillbox",
        field.describe()
        | {
            "ratios": list(shares),
            "s_free_radius_deg": float(s_free_radius_deg),
            "s_fraction": None if s_fraction is None else "function",
            "disorder": float(disorder),
            "aperture": aperture,
            "has_rod_intrusion": bool(has_rod_intrusion),
            "has_optic_disc": bool(has_optic_disc),
            "seed": int(seed),
            "device": find_device(device).describe(),
            "precision": precision,
            "isetcl": __version__,
        },
    )


@dataclass(frozen=True)
class MosaicEstimate:
    """What a mosaic will be before it is made.

    Attributes
    ----------
    n_cones
        Cones expected in the field, the optic disc not left out.
    memory_bytes
        Memory its making takes at most.
    """

    n_cones: int
    memory_bytes: float


def estimate_mosaic(
    fov_deg: float | Sequence[float],
    centre_deg: Sequence[float] = (0.0, 0.0),
    *,
    eye: Side = "right",
    density: str | DensityFunction = "curcio1990",
    scale: str | float | Eye = "watson2014",
) -> MosaicEstimate:
    """How many cones a mosaic would have and how much memory it would take; see `mosaic`."""
    return _Field.of(fov_deg, centre_deg, eye, density, scale).estimate()


@dataclass(frozen=True, eq=False)
class _Field:
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
    ) -> _Field:
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

    def estimate(self) -> MosaicEstimate:
        """Cones in the field by the trapezoidal rule, and memory for what is made around it."""
        counts = []
        for margin in (0.0, self.margin_deg):
            deg = self.grid_deg(margin)
            ecc = np.hypot(deg[:, 0], deg[:, 1])
            per_deg2 = self.at(self.scale.to_mm(deg)) * self.scale.mm2_per_deg2(ecc)
            grid = per_deg2.reshape(_GRID, _GRID)
            step = [(s + 2.0 * margin) / (_GRID - 1) for s in (self.width_deg, self.height_deg)]
            counts.append(float(np.trapezoid(np.trapezoid(grid, dx=step[0]), dx=step[1])))
        # The rings are made all round the fovea and cropped: places and little else.
        sector = self.sector()
        area = 0.5 * (sector.last_rad - sector.first_rad) * (sector.high_mm**2 - sector.low_mm**2)
        around = area * float(np.median(self.at(self.scale.to_mm(self.grid_deg()))))
        memory = _BYTES_PER_CONE * counts[1] + 100.0 * around + 2e8
        return MosaicEstimate(round(counts[0]), memory)

    def check_memory(self) -> None:
        """Raise OutOfMemoryError if there is less memory than the mosaic takes."""
        estimate = self.estimate()
        check_memory(
            f"a mosaic of {self.width_deg:g} x {self.height_deg:g} deg "
            f"({estimate.n_cones:.3g} cones)",
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

    def lattice(self, kernels: LatticeKernels, disorder: float, seed: int) -> np.ndarray:
        """Places of cones in the field and its margin, (n, 2), mm."""
        start = rings(self.density, self.sector(), seed)
        deg = self.scale.to_deg(start)
        near = self.holds(deg, self.margin_deg)
        is_fixed = ~self.holds(deg[near], 0.5 * self.margin_deg)
        return relaxed(start[near], self.at, is_fixed, kernels, disorder, seed)

    def describe(self) -> dict[str, Any]:
        """Plain values for provenance."""
        return {
            "fov_deg": [self.width_deg, self.height_deg],
            "centre_deg": list(self.centre_deg),
            "density": self.density.name,
            "scale": self.scale.name,
        }
