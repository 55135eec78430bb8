"""Making a mosaic: from a field and a density to cones with types and sizes."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from isetcl.cones.cone_types import SFraction, assign_types, check_ratios
from isetcl.cones.density import DensityFunction, in_optic_disc
from isetcl.cones.disorder import Disorder, check_disorder
from isetcl.cones.field import Field, MosaicEstimate
from isetcl.cones.mosaic import ConeMosaic, Side
from isetcl.cones.receptors import (
    APERTURE_MODELS,
    ApertureModel,
    ReceptorType,
    aperture_um,
    neighbour_spacing,
    outer_segment_um,
)
from isetcl.cones.rod_density import RodDensity
from isetcl.cones.rods import ROD_DISORDER, ROD_OUTER_SEGMENT_UM, check_rods, rods_between
from isetcl.device.choose import find_device
from isetcl.device.lattice import LatticeKernels
from isetcl.device.layout import Precision
from isetcl.errors import InvalidInputError, check_between, check_choice, check_count
from isetcl.eye.model import Eye
from isetcl.version import __version__


def mosaic(
    fov_deg: float | Sequence[float],
    centre_deg: Sequence[float] = (0.0, 0.0),
    *,
    eye: Side = "right",
    density: str | DensityFunction = "curcio1990",
    ratios: Sequence[float] = (0.6, 0.3, 0.1),
    s_free_radius_deg: float = 0.15,
    s_fraction: SFraction | None = None,
    disorder: Disorder = "measured",
    scale: str | float | Eye = "watson2014",
    aperture: ApertureModel = "pillbox",
    has_rod_intrusion: bool | None = None,
    has_optic_disc: bool = True,
    rods: RodDensity = None,
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
        ``"measured"``: as irregular as lattices were found to be, by eccentricity; see
        `isetcl.cones.disorder.measured_disorder`. Or the relative spread of the cones' sizes, 0 to
        0.4, the same everywhere: 0 is as regular as the density allows (from 88 % six-sided in the
        fovea to 99 % outside).
    scale
        Degrees to mm of retina: ``"watson2014"``, a number of mm per degree, or an `Eye`, whose
        chief rays are used.
    aperture, has_rod_intrusion
        See `isetcl.cones.receptors.aperture_um`. None narrows the cones' apertures where the mosaic
        has rods, which then take no light twice.
    has_optic_disc
        Whether cones are left out in the optic disc.
    rods
        Rods in the room that the cones' inner segments leave: True or ``"curcio1990"`` for the
        average eye (see `isetcl.cones.rod_density.wanted_rods` for how well it is known), rods per
        mm^2 of retina as a function of directions ``(x_deg, y_deg)``, 0 where there are none, or
        None for no rods.
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
    check_disorder(disorder)
    check_choice("aperture", aperture, APERTURE_MODELS)
    seed = check_count("seed", seed, 0)
    field = Field.of(fov_deg, centre_deg, eye, density, scale)
    if has_optic_disc:
        field.check_disc()
    wanted = field.rods(rods)
    if wanted is not None:
        check_rods(wanted, field.grid_deg(field.margin_deg))
    field.check_memory(wanted)
    is_narrowed = wanted is not None if has_rod_intrusion is None else bool(has_rod_intrusion)
    kernels = LatticeKernels(find_device(device), precision)
    details = field.describe() | {
        "ratios": list(shares),
        "s_free_radius_deg": float(s_free_radius_deg),
        "s_fraction": None if s_fraction is None else "function",
        "disorder": disorder if isinstance(disorder, str) else float(disorder),
        "aperture": aperture,
        "has_rod_intrusion": is_narrowed,
        "has_optic_disc": bool(has_optic_disc),
        "rods": None if wanted is None else _name_of(rods),
        "seed": int(seed),
        "device": find_device(device).describe(),
        "precision": precision,
        "isetcl": __version__,
    }
    lattice = field.lattice(kernels, disorder, seed)
    spacing_mm = neighbour_spacing(lattice)
    inside = _inside(field, lattice, has_optic_disc)
    cones = _receptors(field, lattice[inside], spacing_mm[inside], aperture, is_narrowed)
    types = assign_types(
        cones.positions_mm,
        cones.eccentricity_deg,
        field.density.spacing_mm(cones.positions_mm),
        kernels,
        ratios=shares,
        s_fraction=s_fraction,
        s_free_radius_deg=s_free_radius_deg,
        seed=seed,
    )
    made = dataclasses.replace(cones, types=types, provenance=details)
    if wanted is None:
        return made
    places, apart = rods_between(
        field,
        lattice,
        wanted,
        kernels,
        disorder=ROD_DISORDER if isinstance(disorder, str) else disorder,
        seed=seed,
    )
    inside = _inside(field, places, has_optic_disc, may_be_empty=True)
    return _with_rods(made, field, places[inside], apart[inside], aperture)


def estimate_mosaic(
    fov_deg: float | Sequence[float],
    centre_deg: Sequence[float] = (0.0, 0.0),
    *,
    eye: Side = "right",
    density: str | DensityFunction = "curcio1990",
    scale: str | float | Eye = "watson2014",
    rods: RodDensity = None,
) -> MosaicEstimate:
    """How many receptors a mosaic would have and how much memory it would take; see `mosaic`."""
    field = Field.of(fov_deg, centre_deg, eye, density, scale)
    return field.estimate(field.rods(rods))


def _name_of(rods: RodDensity) -> str:
    """What rods are called in provenance."""
    return "function" if callable(rods) else "curcio1990"


def _inside(
    field: Field, places_mm: np.ndarray, has_optic_disc: bool, *, may_be_empty: bool = False
) -> np.ndarray:
    """Which receptors lie in the field and not in the optic disc."""
    inside = field.holds(field.scale.to_deg(places_mm))
    if has_optic_disc:
        inside &= ~in_optic_disc(places_mm, field.eye, field.scale)
    if not np.any(inside) and not may_be_empty:
        raise InvalidInputError(
            f"a field of {field.width_deg:g} x {field.height_deg:g} deg holds no cone; make "
            "fov_deg larger"
        )
    return inside


def _with_rods(
    cones: ConeMosaic,
    field: Field,
    places_mm: np.ndarray,
    apart_mm: np.ndarray,
    aperture: ApertureModel,
) -> ConeMosaic:
    """The mosaic with rods at places, if any, after its cones."""
    if len(places_mm) == 0:
        return cones
    between = _receptors(field, places_mm, apart_mm, aperture, False)
    between = dataclasses.replace(
        between,
        types=np.full(len(between), ReceptorType.ROD),
        outer_segment_um=np.full(len(between), ROD_OUTER_SEGMENT_UM),
    )
    return dataclasses.replace(cones.merge(between), provenance=cones.provenance)


def _receptors(
    field: Field,
    places_mm: np.ndarray,
    spacing_mm: np.ndarray,
    aperture: ApertureModel,
    has_rod_intrusion: bool,
) -> ConeMosaic:
    """Receptors with sizes by their places and the type L."""
    deg = field.scale.to_deg(places_mm)
    eccentricity = np.hypot(deg[:, 0], deg[:, 1])
    spacing_um = 1e3 * spacing_mm
    return ConeMosaic(
        deg,
        places_mm,
        np.zeros(len(deg), dtype=np.uint8),
        spacing_um,
        aperture_um(spacing_um, eccentricity, aperture, has_rod_intrusion=has_rod_intrusion),
        outer_segment_um(eccentricity),
        eccentricity,
        field.eye,
        "gaussian" if aperture == "gaussian" else "pillbox",
    )
