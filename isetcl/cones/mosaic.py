"""The mosaic of receptors: where each lies, its type, and how large it is."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from isetcl.cones.receptors import (
    APERTURE_MODELS,
    ApertureModel,
    ReceptorType,
    aperture_um,
    neighbour_spacing,
    outer_segment_um,
)
from isetcl.cones.retinal_scale import RetinalScale
from isetcl.errors import (
    InvalidInputError,
    check_array,
    check_choice,
    check_pair,
    check_positive,
    check_type,
    check_vectors,
)
from isetcl.eye.model import Eye

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from isetcl.cones.excitations import Excitations
    from isetcl.cones.quality import MosaicQuality
    from isetcl.cones.viewing import Viewing
    from isetcl.retina.image import RetinalImage
    from isetcl.retina.places import IrradianceAtPlaces, Places

Side = Literal["right", "left"]

_LENGTHS = ("spacing_um", "aperture_um", "outer_segment_um")
PER_RECEPTOR = ("positions_deg", "positions_mm", "types", *_LENGTHS, "eccentricity_deg")


@dataclass(frozen=True, eq=False)
class ConeMosaic:
    """Receptors of a patch of retina.

    Directions are those of isetcl's images: x to the right and y up in the visual field, degrees
    from the fovea, which looks along the axis of the image unless the mosaic was moved. The retina
    has them upside down and mirrored, as `RetinalImage` has in its coordinates ``x_mm``, ``y_mm``:
    the lower field (y < 0) falls on the superior retina (y_mm > 0); in a right eye the right field
    falls on the nasal retina.

    Attributes
    ----------
    positions_deg : ndarray
        Directions the receptors look in, (n, 2), degrees.
    positions_mm : ndarray
        Where they lie on the retina, (n, 2), mm from the fovea, in a flat chart polar about it.
    types : ndarray
        uint8, (n,): 0 L, 1 M, 2 S, 3 rod; see `ReceptorType`.
    spacing_um : ndarray
        Distance to the neighbours, (n,), um of retina: the median of the six nearest, smoothed.
    aperture_um : ndarray
        Diameter of the light-collecting aperture, (n,), um; of a Gaussian one, twice its
        characteristic radius sqrt(2) sigma, so that the area is that of a disc either way.
    outer_segment_um : ndarray
        Length of the outer segment, (n,), um.
    eccentricity_deg : ndarray
        Distance from the fovea, (n,), degrees of visual field.
    eye : str
        ``"right"`` or ``"left"``.
    aperture_shape : str
        ``"pillbox"`` or ``"gaussian"``.
    provenance : dict
        How it was made; plain values.
    """

    positions_deg: np.ndarray
    positions_mm: np.ndarray
    types: np.ndarray
    spacing_um: np.ndarray
    aperture_um: np.ndarray
    outer_segment_um: np.ndarray
    eccentricity_deg: np.ndarray
    eye: Side = "right"
    aperture_shape: Literal["pillbox", "gaussian"] = "pillbox"
    provenance: dict[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        check_choice("eye", self.eye, ("right", "left"))
        check_choice("aperture shape", self.aperture_shape, ("pillbox", "gaussian"))
        check_type("provenance", self.provenance, dict)
        places = check_vectors("positions_deg", self.positions_deg, width=2)
        n = len(places)
        if n == 0:
            raise InvalidInputError("a mosaic must have at least one receptor, got none")
        arrays = {
            "positions_deg": places,
            "positions_mm": check_vectors("positions_mm", self.positions_mm, width=2),
            "types": _check_types(self.types, n),
        }
        for name in (*_LENGTHS, "eccentricity_deg"):
            arrays[name] = check_array(name, getattr(self, name))
        for name, array in arrays.items():
            wanted = (n, 2) if array.ndim == 2 else (n,)
            if array.shape != wanted:
                raise InvalidInputError(f"{name} must have shape {wanted}, got {array.shape}")
            _check_values(name, array, is_positive=name in _LENGTHS)
            array = np.array(array)
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @classmethod
    def from_positions(
        cls,
        positions_deg: np.ndarray | Sequence[Sequence[float]],
        types: np.ndarray | Sequence[int],
        *,
        eye: Side = "right",
        scale: str | float | Eye = "watson2014",
        spacing_um: np.ndarray | float | None = None,
        aperture: ApertureModel = "pillbox",
        has_rod_intrusion: bool = False,
        provenance: dict[str, Any] | None = None,
    ) -> ConeMosaic:
        """A mosaic of given receptors, with sizes and lengths by their places.

        Parameters
        ----------
        positions_deg
            Directions from the fovea, (n, 2), degrees; see the class.
        types
            0 L, 1 M, 2 S, 3 rod, (n,).
        scale
            Degrees to mm of retina: ``"watson2014"``, a number of mm per degree, or an `Eye`.
        spacing_um
            Distance to the neighbours, um; None measures it, which needs two receptors.
        aperture
            ``"pillbox"`` (0.79 of the spacing), ``"chen1993"`` (0.577 of it) or ``"gaussian"``.
        has_rod_intrusion
            Whether inner segments fill less of the spacing where rods lie between them.

        Raises
        ------
        InvalidInputError
            If shapes or values do not fit.
        """
        check_choice("aperture", aperture, APERTURE_MODELS)
        places = check_vectors("positions_deg", np.asarray(positions_deg), width=2)
        _check_values("positions_deg", places)
        chart = RetinalScale.of(scale)
        eccentricity = np.hypot(places[:, 0], places[:, 1])
        chart.check("the mosaic", float(np.max(eccentricity, initial=0.0)))
        places_mm = chart.to_mm(places)
        if spacing_um is None:
            if len(places) == 1:
                raise InvalidInputError(
                    "the spacing of a single receptor cannot be measured; pass spacing_um"
                )
            spacing = 1e3 * neighbour_spacing(places_mm)
        else:
            given = check_array("spacing_um", spacing_um)
            spacing = np.full(len(places), float(given)) if given.ndim == 0 else given
        return cls(
            places,
            places_mm,
            np.asarray(types),
            spacing,
            aperture_um(spacing, eccentricity, aperture, has_rod_intrusion=has_rod_intrusion),
            outer_segment_um(eccentricity),
            eccentricity,
            eye,
            "gaussian" if aperture == "gaussian" else "pillbox",
            {"scale": chart.name, "aperture": aperture} | (provenance or {}),
        )

    def __len__(self) -> int:
        return len(self.types)

    def __repr__(self) -> str:
        counts = ", ".join(f"{v} {k}" for k, v in self.counts.items() if v)
        low, high = self.extent_deg
        return (
            f"<ConeMosaic of a {self.eye} eye, {len(self)} receptors ({counts}), x {low[0]:.3g} to "
            f"{high[0]:.3g} deg, y {low[1]:.3g} to {high[1]:.3g} deg>"
        )

    @property
    def counts(self) -> dict[str, int]:
        """How many receptors of each type there are."""
        numbers = np.bincount(self.types, minlength=len(ReceptorType))
        return {kind.name: int(numbers[kind]) for kind in ReceptorType}

    @property
    def extent_deg(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The least and the greatest (x, y) of the receptors, degrees."""
        low, high = self.positions_deg.min(axis=0), self.positions_deg.max(axis=0)
        return (float(low[0]), float(low[1])), (float(high[0]), float(high[1]))

    @property
    def aperture_deg(self) -> np.ndarray:
        """Diameters of the apertures in the visual field, (n,), degrees, along the radius."""
        arc = np.hypot(self.positions_mm[:, 0], self.positions_mm[:, 1])
        # At the fovea itself both are 0: there the scale of the receptors farther out.
        per_deg = arc.max() / max(float(self.eccentricity_deg.max()), 1e-12)
        scale = np.where(arc > 0, arc / np.maximum(self.eccentricity_deg, 1e-12), per_deg)
        return np.asarray(1e-3 * self.aperture_um / np.where(scale > 0, scale, 0.28))

    def select(self, which: np.ndarray) -> ConeMosaic:
        """The receptors named by a mask or by their numbers; their sizes stay what they are.

        Raises
        ------
        InvalidInputError
            If none is left, or it is neither a mask nor numbers of receptors.
        """
        chosen, n = np.atleast_1d(which), len(self)
        is_mask = chosen.dtype == bool and chosen.shape == (n,)
        is_list = chosen.dtype.kind in "iu" and chosen.ndim == 1
        if chosen.size and not (is_mask or (is_list and -n <= chosen.min() <= chosen.max() < n)):
            raise InvalidInputError(
                f"which must be a mask of {n} receptors or their numbers, 0 to {n - 1}, got "
                f"{chosen.dtype} of shape {chosen.shape}"
                + (f" from {chosen.min()} to {chosen.max()}" if is_list else "")
            )
        if chosen.size == 0 or (is_mask and not np.any(chosen)):
            raise InvalidInputError("no receptor is left; choose at least one")
        return dataclasses.replace(self, **{k: getattr(self, k)[chosen] for k in PER_RECEPTOR})

    def within(
        self, fov_deg: float | Sequence[float], centre_deg: Sequence[float] = (0.0, 0.0)
    ) -> ConeMosaic:
        """The receptors inside a rectangle of the visual field.

        Parameters
        ----------
        fov_deg
            Width and height, degrees; one number for a square.
        centre_deg
            Its middle, degrees.
        """
        width, height = check_fov(fov_deg)
        x, y = check_pair("centre_deg", centre_deg, "deg")
        offset = np.abs(self.positions_deg - (x, y))
        inside = (offset[:, 0] <= width / 2) & (offset[:, 1] <= height / 2)
        if not np.any(inside):
            low, high = self.extent_deg
            raise InvalidInputError(
                f"no receptor lies within {width:g} x {height:g} deg around ({x:g}, {y:g}) deg; "
                f"this mosaic spans x {low[0]:.4g} to {high[0]:.4g} and y {low[1]:.4g} to "
                f"{high[1]:.4g} deg"
            )
        return self.select(inside)

    def moved(self, by_deg: Sequence[float]) -> ConeMosaic:
        """The mosaic looking elsewhere in the image: a turned eye, or a fovea off the axis.

        Only `positions_deg` changes; places on the retina and eccentricities stay.
        """
        step = check_pair("by_deg", by_deg, "deg")
        return dataclasses.replace(self, positions_deg=self.positions_deg + np.array(step))

    def merge(self, other: ConeMosaic) -> ConeMosaic:
        """The receptors of both mosaics, first those of this one; overlaps are not looked for."""
        check_type("other", other, ConeMosaic)
        for name in ("eye", "aperture_shape"):
            if getattr(self, name) != getattr(other, name):
                raise InvalidInputError(
                    f"merged mosaics must have the same {name}, got {getattr(self, name)!r} and "
                    f"{getattr(other, name)!r}"
                )
        both: dict[str, Any] = {
            k: np.concatenate([getattr(self, k), getattr(other, k)], axis=0) for k in PER_RECEPTOR
        }
        history = {"merged": [self.provenance, other.provenance]}
        return dataclasses.replace(self, **both, provenance=history)

    def excitations(
        self,
        image: RetinalImage | IrradianceAtPlaces,
        integration_time_s: float = 0.005,
        **options: Any,
    ) -> Excitations:
        """Mean excitations of every receptor by a retinal image; see `isetcl.cones.excitations`."""
        from isetcl.cones.excitations import excitations

        return excitations(self, image, integration_time_s, **options)

    def quality(self, **options: Any) -> MosaicQuality:
        """How regular the lattice is, and how near its density to the wanted one.

        See `isetcl.cones.quality.mosaic_quality`.
        """
        from isetcl.cones.quality import mosaic_quality

        return mosaic_quality(self, **options)

    def places(self, viewing: Viewing | None = None) -> Places:
        """The apertures, for `isetcl.render`'s ``at``.

        `viewing` tells whose excitations ``target_error="cone_noise:..."`` means; None is the
        standard observer with macular pigment, as in `excitations`.
        """
        from isetcl.cones.at_places import ReceptorsAtPlaces
        from isetcl.cones.viewing import Viewing
        from isetcl.retina.places import Places

        return Places(
            self.positions_deg,
            0.5 * self.aperture_um,
            self.aperture_shape == "gaussian",
            ReceptorsAtPlaces(self, Viewing() if viewing is None else viewing),
        )

    def plot(self, ax: Axes | None = None, **options: Any) -> Axes:
        """Draw the apertures, coloured by type; see `isetcl.cones.pictures.plot_mosaic`."""
        from isetcl.cones.pictures import plot_mosaic

        return plot_mosaic(self, ax, **options)

    def save(self, path: str | Path) -> Path:
        """Write the mosaic as NetCDF-4, with its provenance; returns the path."""
        from isetcl.cones.files import save_mosaic

        return save_mosaic(self, path)

    @classmethod
    def load(cls, path: str | Path) -> ConeMosaic:
        """Read a mosaic that `save` wrote."""
        from isetcl.cones.files import load_mosaic

        return load_mosaic(path)

    def to_isetbio(self, path: str | Path, *, image: RetinalImage | None = None) -> Path:
        """Write the cones as a file that ISETBio's cMosaic imports; returns the path.

        See `isetcl.cones.isetbio.to_isetbio`.
        """
        from isetcl.cones.isetbio import to_isetbio

        return to_isetbio(self, path, image=image)

    def arrays(self) -> dict[str, np.ndarray]:
        """The arrays by name, one row a receptor."""
        return {name: getattr(self, name) for name in PER_RECEPTOR}

    def describe(self) -> str:
        """The provenance as JSON."""
        return json.dumps(self.provenance, default=float)


def check_fov(fov_deg: float | Sequence[float]) -> tuple[float, float]:
    """Width and height of a field, degrees; raise InvalidInputError unless both are > 0."""
    if np.ndim(fov_deg) == 0:
        side = check_positive("fov_deg", fov_deg, "deg")  # type: ignore[arg-type]
        return side, side
    width, height = check_pair("fov_deg", fov_deg, "deg")  # type: ignore[arg-type]
    check_positive("fov_deg (width)", width, "deg")
    check_positive("fov_deg (height)", height, "deg")
    return width, height


def _check_types(types: np.ndarray, n: int) -> np.ndarray:
    array = np.asarray(types)
    if array.shape != (n,) or array.dtype.kind not in "iu":
        raise InvalidInputError(
            f"types must be {n} whole numbers (0 L, 1 M, 2 S, 3 rod), got shape {array.shape} of "
            f"{array.dtype}"
        )
    if array.min() < 0 or array.max() > max(ReceptorType):
        raise InvalidInputError(
            "types must be 0 (L), 1 (M), 2 (S) or 3 (rod), got "
            f"{array.min() if array.min() < 0 else array.max()}"
        )
    return array.astype(np.uint8)


def _check_values(name: str, array: np.ndarray, *, is_positive: bool = False) -> None:
    bad = ~np.isfinite(array) if not is_positive else ~(np.isfinite(array) & (array > 0))
    if np.any(bad):
        where = np.argwhere(bad)[0]
        rule = "finite and > 0" if is_positive else "finite"
        raise InvalidInputError(
            f"{name} must be {rule}, got {array[tuple(where)]:g} for receptor {where[0]}"
        )
