"""Places on the retina that are sampled for themselves: apertures of receptors, not pixels."""

from __future__ import annotations

import functools
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_type, check_vectors
from isetcl.eye.model import Eye
from isetcl.netcdf import load_dataset, save_dataset
from isetcl.retina.grid import RetinalGrid
from isetcl.spectrum import Uneven
from isetcl.units import UM_PER_MM

if TYPE_CHECKING:
    import xarray

GAUSSIAN_REACH = 2.6
"""1/e radii at which a Gaussian aperture is cut off; so in lib/pixel.cl."""

COLUMNS = 1024
"""Places are listed in rows of so many, so that the number of a place says where its samples come
from, whatever the length of the list."""

_DIMS = {
    "irradiance": ("wavelength", "place"),
    "standard_error": ("wavelength", "place"),
    "replicates": ("replicate", "wavelength", "place"),
    "samples": ("replicate",),
    "wavelength": ("wavelength",),
    "x_deg": ("place",),
    "y_deg": ("place",),
    "radius_um": ("place",),
}
_STEP_DEG = 1e-3
_NODES = 64


class Receptors(Protocol):
    """What stands at places: each receptor by its own type and pigments."""

    @property
    def types(self) -> np.ndarray:
        """Types as numbers, (n,)."""
        ...

    def efficiencies(self, wavelengths_nm: np.ndarray, uneven_wavelengths: Uneven) -> np.ndarray:
        """Excitations a second per W m^-2 nm^-1 at each wavelength, (n, wavelengths).

        `uneven_wavelengths` as in `isetcl.spectrum.check_even_or_bins`.
        """
        ...


@dataclass(frozen=True, eq=False)
class Places:
    """Apertures on a retina.

    Parameters
    ----------
    positions_deg : (n, 2)
        Field angles of their middles, to the right and up, degrees.
    radius_um : (n,)
        Radius on the retina, um; of a Gaussian one, where it has fallen to 1/e.
    is_gaussian
        Whether the apertures are Gaussians, and not discs.
    receptors
        What stands there, if known: whose noise ``target_error="cone_noise:..."`` means.

    Raises
    ------
    InvalidInputError
        If there are none, shapes differ, a radius is not finite and > 0, or receptors are not those
        of the places.
    """

    positions_deg: np.ndarray
    radius_um: np.ndarray
    is_gaussian: bool = False
    receptors: Receptors | None = None

    def __post_init__(self) -> None:
        at = check_vectors("places: positions_deg", self.positions_deg, width=2)
        radius = np.broadcast_to(check_array("places: radius_um", self.radius_um), len(at))
        if len(at) == 0:
            raise InvalidInputError("places: positions_deg must hold at least one place, got none")
        if not (np.all(np.isfinite(at)) and np.all(np.isfinite(radius)) and np.all(radius > 0)):
            raise InvalidInputError("places: positions must be finite and radii finite and > 0")
        if self.receptors is not None and len(getattr(self.receptors, "types", ())) != len(at):
            raise InvalidInputError(
                f"places: receptors must be those of the {len(at)} places, such as "
                "ConeMosaic.places tells, got an object of type "
                f"{type(self.receptors).__name__}; leave them out"
            )
        object.__setattr__(self, "positions_deg", at)
        object.__setattr__(self, "radius_um", np.array(radius))

    def __len__(self) -> int:
        return len(self.positions_deg)

    def places(self) -> Places:
        """Itself, as `HasPlaces` asks for."""
        return self


class HasPlaces(Protocol):
    """What can be rendered at: `Places`, or a mosaic of cones."""

    def places(self) -> Places:
        """The apertures."""
        ...


@dataclass(frozen=True)
class PlaceGrid(RetinalGrid):
    """A list of places in the form of a grid, row by row: a pixel is a place.

    Its field is the rectangle that holds all places. The last row may repeat the last place.
    """

    listed: Places = field(kw_only=True)

    @classmethod
    def around(cls, eye: Eye, places: Places) -> PlaceGrid:
        """The grid of a list of places.

        Raises
        ------
        InvalidInputError
            If a place lies outside the eye's field.
        """
        check_type("eye", eye, Eye)
        check_type("places", places, Places)
        chart = eye.field_map()
        low, high = places.positions_deg.min(axis=0), places.positions_deg.max(axis=0)
        per_deg = chart.axial_scale_mm_per_deg()
        reach = GAUSSIAN_REACH if places.is_gaussian else 1.0
        # Off the axis a degree may be shorter; what lies beyond the rectangle is only less exact.
        margin = 2.0 * reach * float(places.radius_um.max()) / UM_PER_MM / per_deg
        corner = np.maximum(np.abs(low), np.abs(high)) + margin
        if np.hypot(*corner) > chart.max_field_deg:
            raise InvalidInputError(
                f"places lie up to {np.hypot(*corner):.4g} deg from the optical axis, but chief "
                f"rays enter eye {eye.name!r} only out to {chart.max_field_deg:.4g} deg; leave the "
                "outer ones out"
            )
        size = high - low + 2.0 * margin
        middle = 0.5 * (low + high)
        columns = min(len(places), COLUMNS)
        return cls(
            eye,
            (float(size[0]), float(size[1])),
            (columns, -(-len(places) // columns)),
            (float(middle[0]), float(middle[1])),
            listed=places,
        )

    @property
    def pitch_deg(self) -> tuple[float, float]:
        """Diameter of the smallest aperture, degrees: what must not be blurred."""
        size = 2.0 * float(np.sqrt(np.min(np.abs(np.linalg.det(self.shapes_deg)))))
        return size, size

    @property
    def x_deg(self) -> np.ndarray:
        """Field angles x across the field, ascending; no columns of it."""
        count = max(_NODES, self.resolution[0])
        return self.left_deg + self.fov_deg[0] * (np.arange(count) + 0.5) / count

    @property
    def y_deg(self) -> np.ndarray:
        """Field angles y across the field, descending; no rows of it."""
        count = max(_NODES, self.resolution[1])
        return self.top_deg - self.fov_deg[1] * (np.arange(count) + 0.5) / count

    @functools.cached_property
    def shapes_deg(self) -> np.ndarray:
        """Matrices that make the apertures, in field angles, of the unit disc, (n, 2, 2), degrees.

        The ellipse that is a disc on the retina: r (J^T J)^(-1/2), J the derivative of the retinal
        point by the field angles. To first order in its size samples are uniform in area.
        """
        x, y = self.listed.positions_deg.T
        at = self.field_map.retinal_point_mm
        across = (at(x + _STEP_DEG, y) - at(x - _STEP_DEG, y)) / (2.0 * _STEP_DEG)
        along = (at(x, y + _STEP_DEG) - at(x, y - _STEP_DEG)) / (2.0 * _STEP_DEG)
        metric = np.empty((len(x), 2, 2))
        metric[:, 0, 0] = np.sum(across * across, axis=-1)
        metric[:, 1, 1] = np.sum(along * along, axis=-1)
        metric[:, 0, 1] = metric[:, 1, 0] = np.sum(across * along, axis=-1)
        # The square root of a symmetric 2 x 2 matrix G: (G + s) / t, s^2 = det G, t^2 = tr G + 2 s.
        s = np.sqrt(np.linalg.det(metric))
        t = np.sqrt(np.trace(metric, axis1=1, axis2=2) + 2.0 * s)
        root = (metric + s[:, None, None] * np.eye(2)) / t[:, None, None]
        radius_mm = self.listed.radius_um / UM_PER_MM
        return np.asarray(radius_mm[:, None, None] * np.linalg.inv(root))

    def table(self, scale_deg: Sequence[float], middle_deg: Sequence[float]) -> np.ndarray:
        """Middle and shape of every place for the kernels, (rows * columns, 6).

        Parameters
        ----------
        scale_deg, middle_deg
            Degrees that the kernels' field angles count in and from, (x, y).
        """
        scale = np.asarray(scale_deg)
        numbers = np.empty((self.resolution[0] * self.resolution[1], 6))
        n = len(self.listed)
        numbers[:n, :2] = (self.listed.positions_deg - np.asarray(middle_deg)) / scale
        numbers[:n, 2:] = (self.shapes_deg / scale[:, None]).reshape(n, 4)
        numbers[n:] = numbers[n - 1]
        return numbers


class IrradianceAtPlaces:
    """Spectral irradiance averaged over each of a list of apertures.

    Attributes
    ----------
    dataset : xarray.Dataset
        ``irradiance`` and ``standard_error`` (wavelength, place), W m^-2 nm^-1; ``replicates``
        (replicate, wavelength, place): independent estimates, of ``samples`` (replicate,) samples,
        whose mean weighted so is the irradiance. Coordinates ``wavelength`` (nm), ``x_deg``,
        ``y_deg``, ``radius_um`` (place). Attributes ``aperture_shape``, ``"pillbox"`` or
        ``"gaussian"``, and ``provenance``: JSON.
    """

    def __init__(self, dataset: xarray.Dataset) -> None:
        import xarray

        check_type("dataset", dataset, xarray.Dataset)
        for name, dims in _DIMS.items():
            if name not in dataset or dataset[name].dims != dims:
                raise InvalidInputError(
                    f"irradiance at places needs a variable {name!r} with dimensions "
                    f"({', '.join(dims)}); this dataset has none"
                )
        self.dataset = dataset

    def __repr__(self) -> str:
        wavelengths, places = self.dataset["irradiance"].shape
        return f"<IrradianceAtPlaces: {places} places, {wavelengths} wavelengths>"

    @classmethod
    def from_replicates(
        cls,
        places: Places,
        wavelengths_nm: np.ndarray,
        replicates: np.ndarray,
        samples: np.ndarray,
        provenance: dict[str, Any],
    ) -> IrradianceAtPlaces:
        """The mean of independent estimates (replicate, wavelength, place), and their spread."""
        import xarray

        mean, error = mean_and_error(replicates, samples)
        dims, units = ("wavelength", "place"), {"units": "W m-2 nm-1"}
        dtype = replicates.dtype
        dataset = xarray.Dataset(
            {
                "irradiance": (dims, mean.astype(dtype), units),
                "standard_error": (dims, error.astype(dtype), units),
                "replicates": (("replicate", *dims), replicates, units),
            },
            coords={
                "wavelength": ("wavelength", wavelengths_nm, {"units": "nm"}),
                "x_deg": ("place", places.positions_deg[:, 0], {"units": "deg"}),
                "y_deg": ("place", places.positions_deg[:, 1], {"units": "deg"}),
                "radius_um": ("place", places.radius_um, {"units": "um"}),
                "samples": ("replicate", samples),
            },
            attrs={
                "aperture_shape": "gaussian" if places.is_gaussian else "pillbox",
                "provenance": json.dumps(provenance),
            },
        )
        return cls(dataset)

    def save(self, path: str | Path) -> Path:
        """Write all of it as NetCDF-4; returns the path. A crash leaves no half-written file.

        Raises
        ------
        FileError
            If the file cannot be written.
        """
        return save_dataset(self.dataset, path)

    @classmethod
    def load(cls, path: str | Path) -> IrradianceAtPlaces:
        """Read what `save` wrote.

        Raises
        ------
        FileError
            If the file does not exist or holds something else.
        """
        return load_dataset(path, "irradiance at places", cls)

    @property
    def irradiance(self) -> xarray.DataArray:
        """Spectral irradiance, W m^-2 nm^-1, (wavelength, place)."""
        return self.dataset["irradiance"]

    @property
    def standard_error(self) -> xarray.DataArray:
        """Standard error of the irradiance, W m^-2 nm^-1, (wavelength, place)."""
        return self.dataset["standard_error"]

    @property
    def wavelengths_nm(self) -> np.ndarray:
        """Wavelengths, nm, (wavelengths,)."""
        return np.asarray(self.dataset["wavelength"].values)

    @property
    def provenance(self) -> dict[str, Any]:
        """How it was made."""
        return dict(json.loads(self.dataset.attrs.get("provenance", "{}")))

    def weighted(self, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Sums over wavelengths with weights (place, wavelength), and their standard errors.

        The error is that of the sums of the replicates, so that errors that wavelengths share are
        counted once.
        """
        values = self.dataset["replicates"].values
        sums = np.stack([np.einsum("pw,wp->p", weights, each) for each in values])
        return mean_and_error(sums, self.dataset["samples"].values)


def mean_and_error(values: np.ndarray, samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weighted mean over the first axis and its standard error, as `TileAccumulator` has it."""
    share = np.asarray(samples, dtype=np.float64) / np.sum(samples)
    mean = np.tensordot(share, values, axes=1)
    count = len(values)
    if count < 2:
        return mean, np.full_like(mean, np.nan)
    squares = np.zeros_like(mean)
    for weight, each in zip(share, values, strict=True):
        squares += weight * np.square(each - mean)
    return mean, np.sqrt(squares / (count - 1))
