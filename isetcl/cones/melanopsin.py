"""What the ganglion cells that see light by themselves get of an image on the retina."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from isetcl.cones.observer import Observer
from isetcl.errors import InvalidInputError, check_type
from isetcl.retina.image import RetinalImage
from isetcl.spectrum import Uneven, bin_widths, check_even_or_bins

if TYPE_CHECKING:
    import xarray


def melanopic_irradiance(
    image: RetinalImage,
    observer: Observer | None = None,
    *,
    uneven_wavelengths: Uneven = "refuse",
) -> xarray.DataArray:
    """Irradiance weighted by melanopsin's own sensitivity in energy, peak 1, W m^-2, (y, x).

    It is that of light on the retina, which has come through the media that the image was put
    through (`RetinalImage.through`). The melanopic irradiance of CIE S 026:2018 is that of light at
    the cornea; weight its spectrum by `Observer.melanopic_sensitivity` for it.

    There is no mosaic of these cells: no published map of their density is at hand. A human retina
    has 4000 to 8000 of them (Liao et al. 2016, Nasir-Ahmad et al. 2017). `uneven_wavelengths` as in
    `isetcl.cones.excitations`.

    Raises
    ------
    InvalidInputError
        If the image has one wavelength only, wavelengths out of 300 to 800 nm, or unequal steps.
    """
    check_type("image", image, RetinalImage)
    who = Observer() if observer is None else observer
    check_type("observer", who, Observer)
    grid = check_even_or_bins("the image", image.wavelengths_nm, uneven_wavelengths)
    if len(grid) == 1:
        raise InvalidInputError(
            "melanopic irradiance needs at least two wavelengths, got one; render more wavelengths"
        )
    nodes = np.arange(300.0, 801.0)
    most = float((who.melanopsin_absorptance(nodes) * nodes).max())
    weights = who.melanopsin_absorptance(grid) * grid / most * bin_widths(grid)
    found = np.tensordot(weights, image.irradiance.values.astype(np.float64), axes=1)
    result = image.irradiance.isel(wavelength=0, drop=True).copy(data=found)
    result.attrs = {"units": "W m^-2", "long_name": "melanopic irradiance on the retina"}
    return result.rename("melanopic_irradiance")
