"""Excitations by the formulas, cone by cone in numpy, to compare those of isetcl with."""

from importlib import resources

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.special import erf

PLANCK_TIMES_C = 6.62607015e-34 * 299792458.0
# Banks, Sekuler & Anderson 1991, Fig. 1: eccentricity, deg, and outer-segment length, um.
SEGMENT_UM = PchipInterpolator(
    [0, 1.82, 4.86, 9.86, 19.78, 39.9], [47.81, 26.16, 21.2, 21.2, 21.2, 13.22]
)
DENSITIES = (0.5, 0.5, 0.4)


def expected_excitations(mosaic, image, time_s, gaze_deg=(0.0, 0.0), *, has_macular_pigment=True):
    """Mean excitations of every cone, (n,)."""
    data = image.dataset
    x, y = data["x"].values, data["y"].values
    dx, dy = (x[-1] - x[0]) / (len(x) - 1), (y[0] - y[-1]) / (len(y) - 1)
    um = [1e3 * data[name].values.astype(float) for name in ("x_mm", "y_mm")]
    found = []
    for i, (x_deg, y_deg) in enumerate(mosaic.positions_deg):
        column, row = (x_deg - x[0]) / dx + 0.5, (y[0] - y_deg) / dy + 0.5
        at = np.clip(int(row), 1, len(y) - 2), np.clip(int(column), 1, len(x) - 2)
        wide = np.hypot(*(each[at[0], at[1] + 1] - each[at[0], at[1] - 1] for each in um)) / 2
        high = np.hypot(*(each[at[0] + 1, at[1]] - each[at[0] - 1, at[1]] for each in um)) / 2
        radius = mosaic.aperture_um[i] / 2
        share = (share_of_gaussian if mosaic.aperture_shape == "gaussian" else share_of_disc)(
            (column + gaze_deg[0] / dx, row - gaze_deg[1] / dy),
            (radius / wide, radius / high),
            (len(y), len(x)),
        )
        irradiance = np.sum(share * data["irradiance"].values, axis=(1, 2))
        eccentricity = mosaic.eccentricity_deg[i]
        efficiency = efficiency_of(
            image.wavelengths_nm, int(mosaic.types[i]), eccentricity, has_macular_pigment
        )
        photons = irradiance * image.wavelengths_nm * 1e-9 / PLANCK_TIMES_C
        rate = np.pi * (1e-6 * radius) ** 2 * trapezoid(image.wavelengths_nm, photons * efficiency)
        found.append(time_s * rate)
    return np.array(found)


def trapezoid(nm, values):
    """The integral by trapezia, with the halves of the end bins that lie outside added."""
    inside = np.sum((values[1:] + values[:-1]) / 2 * np.diff(nm))
    return inside + (values[0] * (nm[1] - nm[0]) + values[-1] * (nm[-1] - nm[-2])) / 2


def efficiency_of(nm, kind, eccentricity_deg, has_macular_pigment=True):
    """Excitations per photon: two thirds of what the outer segment absorbs of what reaches it."""
    with resources.files("isetcl.data").joinpath("cie_170_cones.csv").open() as lines:
        table = np.loadtxt(lines, delimiter=",", comments="#")
    absorbance = 10.0 ** np.interp(nm, table[:, 0], table[:, 1 + kind])
    length = SEGMENT_UM(min(eccentricity_deg, 39.9)) / 47.81
    efficiency = 2 / 3 * (1 - 10.0 ** (-DENSITIES[kind] * length * absorbance))
    if has_macular_pigment:
        unit = np.interp(nm, table[:, 0], table[:, 5]) / table[:, 5].max()
        efficiency *= 10.0 ** (-0.35 * unit * 3.6028 / (eccentricity_deg**2 + 3.6028))
    return efficiency


def share_of_disc(middle, half, shape):
    """Share of each pixel in an ellipse's area: chords at angles t, x = -cos t.

    Between the angles at which a chord meets a column or a row the areas are analytic in t, and
    Gauss's rule is exact to rounding.
    """
    columns, rows = (
        np.clip((np.arange(n + 1) - at) / r, -1.0, 1.0)
        for n, at, r in zip(shape[::-1], middle, half, strict=True)
    )
    crossings = np.arcsin(np.abs(rows))
    edges = np.unique([0.0, np.pi, *np.arccos(-columns), *crossings, *(np.pi - crossings)])
    node, weight = np.polynomial.legendre.leggauss(24)
    t = (edges[1:, None] + edges[:-1, None] + np.diff(edges)[:, None] * node).ravel() / 2
    dt = (np.diff(edges)[:, None] * weight).ravel() / 2
    column = np.clip(np.floor(middle[0] - half[0] * np.cos(t)).astype(int), 0, shape[1] - 1)
    width, chord = dt * half[0] * np.sin(t), half[1] * np.sin(t)
    share = np.zeros(shape)
    for row in range(shape[0]):
        top, bottom = np.maximum(middle[1] - chord, row), np.minimum(middle[1] + chord, row + 1)
        area = np.maximum(bottom - top, 0.0) * width
        share[row] = np.bincount(column, area, minlength=shape[1])
    return share / share.sum()


def share_of_gaussian(middle, radius, shape):
    """Share of each pixel in a Gaussian of 1/e radii, cut off at 2.6 of them."""
    columns, rows = (
        np.diff(erf(np.clip((np.arange(n + 1) - at) / r, -2.6, 2.6)))
        for n, at, r in zip(shape[::-1], middle, radius, strict=True)
    )
    share = rows[:, None] * columns
    return share / share.sum()
