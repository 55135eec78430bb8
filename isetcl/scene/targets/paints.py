"""Measured reflectances: the ColorChecker, and the walls of the Cornell box."""

from __future__ import annotations

import functools
from importlib import resources

import numpy as np

from isetcl.errors import check_choice
from isetcl.spectrum import Spectrum

CHART_COLUMNS, CHART_ROWS = 6, 4


@functools.cache
def chart_paints() -> dict[str, Spectrum]:
    """Reflectances of the 24 patches of the ColorChecker by name, from the top left, row by row.

    Source: ISO 17321-1:2012, 380 to 780 nm in steps of 5 nm, as tabulated by colour-science.
    """
    import colour

    return {
        name: Spectrum(
            np.asarray(data.domain), np.clip(np.asarray(data.values), 0.0, 1.0), str(name)
        )
        for name, data in colour.SDS_COLOURCHECKERS["ISO 17321-1"].items()
    }


def paint(name: str) -> Spectrum:
    """Reflectance of one patch of the ColorChecker.

    Raises
    ------
    InvalidInputError
        If there is no patch of the name.
    """
    paints = chart_paints()
    return paints[check_choice("paint", name, list(paints))]


@functools.cache
def cornell_paints() -> dict[str, Spectrum]:
    """Reflectances of the white, green and red paint of the Cornell box, 400 to 700 nm.

    Source: Cornell University Program of Computer Graphics, Cornell Box Data.
    """
    with resources.files("isetcl.data").joinpath("cornell_box.csv").open() as lines:
        table = np.loadtxt(lines, delimiter=",", comments="#")
    names = ("white", "green", "red")
    return {
        name: Spectrum(table[:, 0], table[:, k + 1], f"Cornell {name}")
        for k, name in enumerate(names)
    }
