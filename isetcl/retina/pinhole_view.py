"""A sharp view of a scene from the middle of the entrance pupil: radiance and depth, by layers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from isetcl.errors import InvalidInputError, check_type
from isetcl.netcdf import load_dataset, save_dataset

if TYPE_CHECKING:
    import xarray


class PinholeView:
    """Radiance along the chief ray of every pixel, and what the rays meet on their way.

    Layer 0 is what is seen; layer k is what would be seen if the k nearest surfaces along each ray
    were taken away. A layer is as wide as the image; where nothing is left it shows the background
    and its `object` is -1.

    Attributes
    ----------
    dataset
        Variables ``radiance`` and ``standard_error`` (layer, wavelength, y, x), W m^-2 sr^-1 nm^-1;
        ``distance_m`` (layer, y, x) along the ray, infinite where there is nothing;
        ``vergence_dpt`` (layer, y, x), 1/m along the axis from the cornea; ``object`` and
        ``material`` (layer, y, x), numbers of the scene's objects and of their materials, -1 for
        none; ``position_m`` and ``normal`` (layer, axis, y, x), world frame;
        ``albedo`` (layer, wavelength, y, x). Coordinates as those of a `RetinalImage`.
        Attribute ``object_names``.
    """

    def __init__(self, dataset: xarray.Dataset) -> None:
        import xarray

        check_type("dataset", dataset, xarray.Dataset)
        for name in ("radiance", "vergence_dpt", "object"):
            if name not in dataset:
                raise InvalidInputError(f"a pinhole view needs a variable {name!r}; it has none")
        self.dataset = dataset

    @property
    def radiance(self) -> xarray.DataArray:
        """Spectral radiance, W m^-2 sr^-1 nm^-1, (layer, wavelength, y, x)."""
        return self.dataset["radiance"]

    @property
    def vergence_dpt(self) -> xarray.DataArray:
        """Vergence of the surfaces, 1/m, (layer, y, x); 0 where there is nothing."""
        return self.dataset["vergence_dpt"]

    @property
    def layers(self) -> int:
        """Number of layers."""
        return int(self.dataset.sizes["layer"])

    @property
    def object_names(self) -> tuple[str, ...]:
        """Names of the scene's objects, by their number."""
        return tuple(np.atleast_1d(self.dataset.attrs["object_names"]).tolist())

    def save(self, path: str | Path) -> Path:
        """Write the view as NetCDF (HDF5).

        Raises
        ------
        FileError
            If it cannot be written.
        """
        return save_dataset(self.dataset, path)

    @classmethod
    def load(cls, path: str | Path) -> PinholeView:
        """Read a view that `save` wrote.

        Raises
        ------
        FileError
            If the file does not exist or is no view.
        """
        return load_dataset(path, "pinhole view", cls)
