"""How regular a mosaic is, and how near its density to the wanted one."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from isetcl.cones.density import ConeDensity, DensityFunction, Meridian, on_meridian
from isetcl.cones.disorder import (
    LEAST_DISTANCE_FROM_DEG,
    LEAST_DISTANCE_PERCENTILE,
    LEAST_DISTANCE_UM,
    measured_six_sided,
)
from isetcl.cones.mosaic import ConeMosaic
from isetcl.cones.receptors import ReceptorType
from isetcl.cones.retinal_scale import RetinalScale
from isetcl.errors import InvalidInputError, check_array, check_count
from isetcl.eye.model import Eye

_CONES_OF_A_BAND, _MOST_BANDS = 200, 10
_FARTHEST_CORNER = 1.3  # spacings: a hexagon's corners are at 0.58, those at a border far away


@dataclass(frozen=True, eq=False)
class MosaicQuality:
    """Statistics of a mosaic's cones whose Voronoi cells touch no border.

    Attributes
    ----------
    n_cones : int
        Cones counted.
    neighbours : ndarray
        Share of cones with 0, 1, 2, ... Voronoi neighbours.
    spacing_cv : float
        Standard deviation over mean of the distances between Voronoi neighbours, each in units of
        the local spacing.
    nearest_neighbour_regularity : float
        Mean over standard deviation of the distances to the nearest neighbour, in the same units.
    area_cv : float
        Standard deviation over mean of the Voronoi cells' areas times the wanted density; times the
        density that the spacing stands for where none is wanted.
    eccentricity_deg : ndarray
        Borders of bands of eccentricity, (bands + 1,), degrees.
    density_error : ndarray
        Density over the wanted one in each band, less 1, (bands,); NaN in a band without cones or
        without a wanted density.
    six_sided, measured_six_sided : ndarray
        Share of cones with six neighbours in each band, and the share that was measured in human
        retinas (Pum, Ahnelt & Grasl 1990; Li & Roorda 2007; Legras, Gaudric & Woog 2018), NaN
        beyond 6 degrees, (bands,).
    least_distance_um : ndarray
        Distance to the nearest neighbour that 1 % of the cones of each band fall short of, um,
        (bands,). From 10 degrees on 6 to 8 um were measured as the least (Curcio & Sloan 1992).
    """

    n_cones: int
    neighbours: np.ndarray
    spacing_cv: float
    nearest_neighbour_regularity: float
    area_cv: float
    eccentricity_deg: np.ndarray
    density_error: np.ndarray
    six_sided: np.ndarray
    measured_six_sided: np.ndarray
    least_distance_um: np.ndarray

    @property
    def six_neighbour_fraction(self) -> float:
        """Share of cones with six neighbours."""
        return float(self.neighbours[6])

    def __str__(self) -> str:
        errors = ", ".join(
            f"{low:.3g}-{high:.3g} deg {100 * e:+.2f} %"
            for low, high, e in zip(
                self.eccentricity_deg, self.eccentricity_deg[1:], self.density_error, strict=False
            )
            if np.isfinite(e)
        )
        return (
            f"{self.n_cones} cones, {100 * self.six_neighbour_fraction:.1f} % with six neighbours, "
            f"spacing CV {100 * self.spacing_cv:.1f} %, nearest-neighbour regularity "
            f"{self.nearest_neighbour_regularity:.1f}, density error {errors or 'not asked for'}; "
            f"measured in human retinas: {self._beside_the_measured()}"
        )

    def _beside_the_measured(self) -> str:
        """Every band's regularity with what was measured there, or that nothing was."""
        parts = []
        low, high = LEAST_DISTANCE_UM
        for i, (inner, outer) in enumerate(itertools.pairwise(self.eccentricity_deg)):
            if np.isfinite(self.measured_six_sided[i]):
                found, wanted = 100 * self.six_sided[i], 100 * self.measured_six_sided[i]
                parts.append(
                    f"{inner:.3g}-{outer:.3g} deg {wanted:.0f} % six-sided, here {found:.0f} %"
                )
            elif inner >= LEAST_DISTANCE_FROM_DEG:
                found = self.least_distance_um[i]
                parts.append(
                    f"{inner:.3g}-{outer:.3g} deg {low:g} to {high:g} um apart at least, here "
                    f"{found:.1f} um"
                )
        return ", ".join(parts) or "nothing at these eccentricities"


def mosaic_quality(
    mosaic: ConeMosaic,
    *,
    density: str | DensityFunction | None = None,
    scale: str | float | Eye = "watson2014",
    bands: int | None = None,
) -> MosaicQuality:
    """How regular the cones of a mosaic lie, and how near their density is to the wanted one.

    Parameters
    ----------
    mosaic
        The mosaic; rods are left out.
    density
        The wanted density as `isetcl.cones.mosaic` takes it; None is the named one of the mosaic's
        provenance, if there is one.
    scale
        Degrees to mm, as the mosaic was made with; only functions and Watson's density use it.
    bands
        Bands of eccentricity that share the cones evenly; None takes one for every 200 cones, and
        not more than 10.

    Raises
    ------
    InvalidInputError
        If the mosaic has too few cones for any to have neighbours all round.
    """
    if bands is not None:
        check_count("bands", bands)
    cells = VoronoiCells.of(mosaic)
    wanted = _wanted(mosaic, density, scale, cells)
    inside = cells.is_inside
    both = inside[cells.pairs].all(axis=1)
    distance = cells.distance_mm[both] / cells.spacing_mm[cells.pairs[both]].mean(axis=1)
    nearest = (cells.nearest_mm / cells.spacing_mm)[inside]
    ecc, area = cells.eccentricity_deg[inside], cells.area_mm2[inside]
    if bands is None:
        bands = min(max(len(ecc) // _CONES_OF_A_BAND, 1), _MOST_BANDS)
    borders = np.quantile(ecc, np.linspace(0.0, 1.0, bands + 1))
    band = np.clip(np.searchsorted(borders, ecc, side="right") - 1, 0, bands - 1)
    if wanted is None:
        error = np.full(bands, np.nan)
        relative = area / (np.sqrt(0.75) * cells.spacing_mm[inside] ** 2)
    else:
        relative = area * wanted[inside]
        expected = np.bincount(band, weights=relative, minlength=bands)
        with np.errstate(divide="ignore", invalid="ignore"):
            error = np.bincount(band, minlength=bands) / expected - 1.0
    degree = cells.degree[inside]
    return MosaicQuality(
        len(ecc),
        np.bincount(degree, minlength=12) / len(degree),
        float(distance.std() / distance.mean()),
        float(nearest.mean() / nearest.std()) if nearest.std() > 0 else float("inf"),
        float(relative.std() / relative.mean()),
        borders,
        error,
        _by_band(degree == 6, band, bands),
        _by_band(measured_six_sided(ecc), band, bands),
        _by_band(1e3 * cells.nearest_mm[inside], band, bands, LEAST_DISTANCE_PERCENTILE),
    )


def _by_band(
    values: np.ndarray, band: np.ndarray, bands: int, percentile: float | None = None
) -> np.ndarray:
    """Mean, or a percentile, of the values in each band, (bands,); NaN where there are none."""
    found = np.full(bands, np.nan)
    for number in np.unique(band):
        own = values[band == number]
        found[number] = np.mean(own) if percentile is None else np.percentile(own, percentile)
    return found


def meridian_density(
    mosaic: ConeMosaic,
    meridian: Meridian,
    eccentricity_deg: Sequence[float] | np.ndarray,
    *,
    cones: int = 300,
) -> tuple[np.ndarray, np.ndarray]:
    """Density at places of a meridian: of the nearest cones, and where they lie.

    Cones over the area of their Voronoi cells, which is free of the noise of counting in windows.

    Parameters
    ----------
    eccentricity_deg
        Where, degrees, (n,).
    cones
        How many of the nearest cones are counted.

    Returns
    -------
    ndarray
        Cones per mm^2, (n,).
    ndarray
        Numbers of the cones counted, (n, cones); those at a border of the mosaic never are.
    """
    from scipy.spatial import cKDTree

    check_count("cones", cones)
    ecc = check_array("eccentricity_deg", eccentricity_deg)
    cells = VoronoiCells.of(mosaic)
    able = np.flatnonzero(cells.is_inside)
    if len(able) < cones:
        raise InvalidInputError(
            f"cones must be at most {len(able)}, those that touch no border, got {cones}"
        )
    places = on_meridian(meridian, ecc, mosaic.eye)
    # From the fovea, wherever a moved mosaic looks: the retina has directions upside down.
    of = cells.numbers[able]
    from_fovea = -mosaic.positions_mm[of]
    length = np.maximum(np.hypot(*from_fovea.T), 1e-12)
    deg = from_fovea * (mosaic.eccentricity_deg[of] / length)[:, None]
    _, nearest = cKDTree(deg).query(places, k=cones)
    chosen = able[nearest.reshape(len(ecc), cones)]
    density = cones / cells.area_mm2[chosen].sum(axis=1)
    return density, cells.numbers[chosen]


@dataclass(frozen=True, eq=False)
class VoronoiCells:
    """The Voronoi cells of a mosaic's cones on the retina.

    Attributes
    ----------
    numbers : ndarray
        Numbers of the cones in the mosaic; everything else is counted among these.
    pairs, distance_mm : ndarray
        Neighbours, (p, 2), and how far apart they are, mm.
    degree, nearest_mm, area_mm2 : ndarray
        Number of neighbours, distance to the nearest, area of the cell.
    is_inside : ndarray
        Cells that touch neither the border nor a hole.
    """

    numbers: np.ndarray
    pairs: np.ndarray
    distance_mm: np.ndarray
    degree: np.ndarray
    nearest_mm: np.ndarray
    area_mm2: np.ndarray
    is_inside: np.ndarray
    spacing_mm: np.ndarray
    eccentricity_deg: np.ndarray

    @classmethod
    def of(cls, mosaic: ConeMosaic) -> VoronoiCells:
        """Cells of all receptors that are no rods."""
        from scipy.spatial import QhullError, Voronoi

        numbers = np.flatnonzero(mosaic.types != ReceptorType.ROD)
        places = mosaic.positions_mm[numbers]
        spacing = 1e-3 * mosaic.spacing_um[numbers]
        try:
            diagram = Voronoi(places)
        except (QhullError, ValueError) as error:
            raise InvalidInputError(
                "the quality of a mosaic needs four cones that are not on a line, got "
                f"{len(numbers)} cones"
            ) from error
        pairs, n = diagram.ridge_points, len(numbers)
        ends = np.array(diagram.ridge_vertices)
        is_finite = np.all(ends >= 0, axis=1)
        corner = diagram.vertices[np.where(is_finite[:, None], ends, 0)]
        apart = places[pairs[:, 0]] - places[pairs[:, 1]]
        distance = np.hypot(apart[:, 0], apart[:, 1])
        ridge = np.where(is_finite, np.hypot(*(corner[:, 0] - corner[:, 1]).T), 0.0)
        # Two triangles over each ridge, half as high as the neighbours are apart.
        area = np.bincount(pairs.ravel(), weights=np.repeat(0.25 * distance * ridge, 2))
        nearest = np.full(n, np.inf)
        inside = np.ones(n, dtype=bool)
        for side in (0, 1):
            own = pairs[:, side]
            np.minimum.at(nearest, own, distance)
            reach = np.hypot(*np.moveaxis(corner - places[own][:, None], -1, 0)).max(axis=1)
            inside[own[~is_finite | (reach > _FARTHEST_CORNER * spacing[own])]] = False
        # Their neighbours miss neighbours, too.
        touches = ~inside[pairs].all(axis=1)
        inside[pairs[touches].ravel()] = False
        if not np.any(inside):
            raise InvalidInputError(
                f"none of the {n} cones has neighbours all round; make the mosaic larger"
            )
        degree = np.bincount(pairs.ravel(), minlength=n)
        ecc = mosaic.eccentricity_deg[numbers]
        return cls(numbers, pairs, distance, degree, nearest, area, inside, spacing, ecc)


def _wanted(
    mosaic: ConeMosaic,
    density: str | DensityFunction | None,
    scale: str | float | Eye,
    cells: VoronoiCells,
) -> np.ndarray | None:
    """The wanted density at every cone, cones/mm^2."""
    named = mosaic.provenance.get("density") if density is None else density
    if named is None or (isinstance(named, str) and named.startswith("function ")):
        return None
    wanted = ConeDensity.of(named, mosaic.eye, RetinalScale.of(scale))
    return wanted.per_mm2(mosaic.positions_mm[cells.numbers])
