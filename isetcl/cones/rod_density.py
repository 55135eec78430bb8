"""How many rods there are where, of the average human eye."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from isetcl.cones.density import MERIDIANS, Meridian, Table, by_meridians
from isetcl.cones.retinal_scale import RetinalScale
from isetcl.errors import InvalidInputError

RodDensity = bool | str | Callable[[np.ndarray, np.ndarray], np.ndarray] | None
"""True or ``"curcio1990"``, rods per mm^2 at directions (x_deg, y_deg), or False or None."""

ROD_DENSITIES = ("curcio1990",)

# No rod within 0.175 mm (Curcio, Sloan, Kalina & Hendrickson 1990, abstract: a zone 0.350 mm wide).
# From 0.695 to 4.227 mm the averages of their eyes along the meridians (their Fig. 6), 1000
# rods/mm^2, as interpolated from the authors' spreadsheet in the public repository
# dogmaticcentral/oct (MIT), data/rods_per_sq_mm.csv; its grid has points at these distances. The
# same grid of cones lies within 3 % of `curcio_per_mm2` from 2.5 mm on.
_MEASURED_MM = (0.175, 0.695, 1.554, 2.506, 2.865, 3.475, 3.743, 4.227)
_MEASURED: dict[Meridian, tuple[float, ...]] = {
    "nasal": (0.0, 51.1, 92.5, 121.8, 128.9, 129.9, 129.3, 131.9),
    "superior": (0.0, 67.6, 113.5, 145.7, 153.6, 156.3, 156.5, 153.1),
    "temporal": (0.0, 53.3, 91.8, 121.4, 129.8, 135.4, 137.0, 138.2),
    "inferior": (0.0, 55.1, 105.0, 136.7, 141.8, 144.0, 144.4, 143.5),
}

DECLINE_PER_MM = 0.038
"""Share of the density at 4.227 mm that is lost with every mm farther out, on every meridian.

Not measured: with it a retina of 11.5 mm radius that ends 20 mm from the fovea, in which Curcio's
cones add up to her 4.6 million, has her 92 million rods. She found a slow decline.
"""

RETINA_RADIUS_MM = 11.5
RETINA_ENDS_MM = 20.0


def _extended(measured: tuple[float, ...]) -> Table:
    at, values = _MEASURED_MM, 1e3 * np.array(measured)
    left = 1.0 - DECLINE_PER_MM * (RETINA_ENDS_MM - at[-1])
    return (0.0, *at, RETINA_ENDS_MM), (0.0, *values.tolist(), float(values[-1] * left))


_CURCIO = {meridian: _extended(_MEASURED[meridian]) for meridian in MERIDIANS}


def rods_per_mm2(meridian: Meridian, arc_mm: np.ndarray) -> np.ndarray:
    """Rods per mm^2 along a meridian, at distances from the fovea in mm, to 20 mm; then none."""
    return np.interp(arc_mm, *_CURCIO[meridian], right=0.0)


def check_known(arc_mm: float) -> None:
    """Raise InvalidInputError for a distance from the fovea at which there is no retina."""
    if arc_mm > RETINA_ENDS_MM * (1 + 1e-9):
        raise InvalidInputError(
            f"rods 'curcio1990' are known to {RETINA_ENDS_MM:g} mm from the fovea, and the field "
            f"reaches {arc_mm:.4g} mm; make fov_deg smaller or pass your own function"
        )


def wanted_rods(
    rods: RodDensity, eye: str, scale: RetinalScale
) -> Callable[[np.ndarray, np.ndarray], np.ndarray] | None:
    """Rods per mm^2 of retina at directions (x_deg, y_deg); None for no rods.

    The densities of ``"curcio1990"`` are measured from 0.7 to 4.2 mm of the fovea (2.6 to 15.6
    degrees), and averages of eyes that differ: they have 78 to 107 million rods. Farther out they
    are a guess that meets the total; the nasal retina, which has more rods there, is not told from
    the temporal one.

    Raises
    ------
    InvalidInputError
        If it is none of the choices.
    """
    if callable(rods):
        return rods
    is_switch = isinstance(rods, (bool, np.bool_))
    if rods is None or (is_switch and not rods):
        return None
    if not is_switch and not (isinstance(rods, str) and rods in ROD_DENSITIES):
        raise InvalidInputError(
            "rods must be True or 'curcio1990', None, or a function of arrays (x_deg, y_deg) that "
            f"returns rods per mm^2 of retina for each, got {rods!r}"
        )

    def curcio1990(x_deg: np.ndarray, y_deg: np.ndarray) -> np.ndarray:
        places = scale.to_mm(np.stack(np.broadcast_arrays(x_deg, y_deg), axis=-1))
        flat = places.reshape(-1, 2)
        arc = np.hypot(flat[:, 0], flat[:, 1])
        # Around the field rods are laid out, too; there the last density goes on.
        inside = np.minimum(1.0, RETINA_ENDS_MM / np.maximum(arc, 1e-12))
        density = by_meridians(_CURCIO, flat * inside[:, None], eye)
        return density.reshape(places.shape[:-1])

    return curcio1990
