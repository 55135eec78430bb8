"""How many cones there are where: measured densities along the meridians, and the optic disc."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from isetcl.cones.retinal_scale import RetinalScale, watson_mm2_per_deg2
from isetcl.errors import InvalidInputError, check_choice

Meridian = Literal["nasal", "superior", "temporal", "inferior"]
MERIDIANS: tuple[Meridian, ...] = ("nasal", "superior", "temporal", "inferior")
"""Meridians of the retina in the order in which one meets them going round."""

DensityFunction = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Cones per mm^2 of retina at directions (x_deg, y_deg) of the visual field from the fovea."""

Table = tuple[tuple[float, ...], tuple[float, ...]]

_STEPS_MM = (0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)

# Curcio, Sloan, Kalina & Hendrickson 1990, Fig. 6, as digitised by ISETBio: mm, cones/mm^2. The
# peak is ISETBio's 250 000; the abstract has 199 000 on average and 100 000 to 324 000.
# fmt: off
_CURCIO: dict[Meridian, Table] = {
    "nasal": (
        (*_STEPS_MM, 2.0, 3.0, *range(5, 21)),
        (250000, 155042, 116017, 93940, 75256, 54833, 43731, 36867, 32547, 27378, 24750, 22971,
         20343, 12587, 8976, 7262, 6722, 6501, 6280, 6058, 5730, 5509, 5182, 5066, 4951, 4941, 4825,
         4816, 4806, 4902, 5317),
    ),
    "temporal": (
        (*_STEPS_MM, *range(2, 19)),
        (250000, 162669, 121947, 99872, 80340, 59916, 47970, 41105, 35089, 29921, 24750, 22971,
         20346, 11740, 9188, 7059, 5779, 5133, 4912, 4584, 4363, 4035, 3920, 3592, 3582, 3468, 3458,
         3342, 3227, 3429),
    ),
    "superior": (
        (*_STEPS_MM, 1.1, *range(2, 21)),
        (250000, 141316, 106468, 84379, 66552, 48767, 36933, 29358, 26038, 23571, 21104, 19486,
         18719, 16085, 10174, 7804, 5970, 5424, 4984, 4654, 4429, 4420, 4409, 4077, 4068, 3844,
         3834, 3932, 3816, 3912, 3795, 4108, 3239),
    ),
    "inferior": (
        (*_STEPS_MM, 1.1, *range(2, 21)),
        (250000, 146424, 107319, 87788, 69954, 53020, 40338, 33611, 30293, 26975, 23655, 21188,
         18719, 17265, 10389, 7696, 6292, 5532, 4985, 4653, 4537, 4420, 4195, 4078, 3961, 3952,
         3941, 3932, 3815, 3698, 3795, 4643, 3347),
    ),
}

_SONG_MM = (0.18, 0.27, 0.36, 0.45, 0.54, 0.72, 0.9, 1.08, 1.35, 1.62, 1.89, 2.16)

# Song, Chui, Zhong, Elsner & Burns 2011, Table 1, the younger eyes: mm, cones/mm^2.
_SONG: dict[Meridian, Table] = {
    "nasal": (_SONG_MM, (68200, 59700, 50000, 43700, 37800, 29100, 24200, 19100, 16800, 14500,
                         11900, 10400)),
    "temporal": (_SONG_MM, (75200, 59200, 50500, 41200, 37300, 28100, 24100, 19900, 16300, 13200,
                            11500, 9700)),
    "superior": (_SONG_MM, (63500, 52700, 42400, 34000, 29600, 22100, 18500, 15700, 13100, 11700,
                            10000, 8700)),
    "inferior": (_SONG_MM, (62800, 55300, 44600, 36300, 31400, 23900, 19400, 16600, 12800, 11500,
                            10200, 8100)),
}
# fmt: on

# Watson 2014: cones per square degree at the centre. ISETBio lets Curcio's peak fall to it linearly
# within 0.18 deg.
_WATSON_PEAK_PER_DEG2 = 14804.6
_WATSON_PEAK_DEG = 0.18

DENSITIES = ("curcio1990", "watson2014", "song2011")


@dataclass(frozen=True, eq=False)
class ConeDensity:
    """Density of cones over the retina of one eye.

    Parameters
    ----------
    name
        What it is, for provenance.
    scale
        Degrees to mm.
    range_mm
        Least and largest distance from the fovea that it is known for.
    at
        Cones per mm^2 of retina at places (n, 2) of the retina's chart, mm.
    """

    name: str
    scale: RetinalScale
    range_mm: tuple[float, float]
    at: Callable[[np.ndarray], np.ndarray]

    @classmethod
    def of(cls, density: str | DensityFunction, eye: str, scale: RetinalScale) -> ConeDensity:
        """A density by name, or a user's function of the direction in degrees.

        ``"curcio1990"`` and ``"song2011"`` hold per mm^2 of retina, whatever the scale;
        ``"watson2014"`` holds per square degree: Curcio's values by Watson's eqs A5 and A7, with
        his peak.
        """
        if callable(density):
            return cls._of_function(density, scale)
        name = check_choice("density", density, DENSITIES)
        tables = _SONG if name == "song2011" else _CURCIO
        low = max(mm[0] for mm, _ in tables.values())
        high = min(mm[-1] for mm, _ in tables.values())
        if name == "watson2014":
            watson = RetinalScale.of("watson2014")
            high_deg = min(float(watson.eccentricity_deg(np.array(high))), scale.limit_deg)
            limits = (low, float(scale.arc_mm(np.array(high_deg))))
            return cls(name, scale, limits, lambda mm: _watson_per_mm2(mm, eye, scale, watson))
        return cls(name, scale, (low, high), lambda mm: by_meridians(tables, mm, eye))

    @classmethod
    def _of_function(cls, function: DensityFunction, scale: RetinalScale) -> ConeDensity:
        def per_mm2(places_mm: np.ndarray) -> np.ndarray:
            deg = scale.to_deg(places_mm)
            values = np.asarray(function(deg[:, 0], deg[:, 1]), dtype=np.float64)
            return np.array(np.broadcast_to(values, deg.shape[:1]))

        limit = float(scale.arc_mm(np.array(scale.limit_deg)))
        name = getattr(function, "__name__", type(function).__name__)
        return cls(f"function {name}", scale, (0.0, limit), per_mm2)

    def per_mm2(self, places_mm: np.ndarray) -> np.ndarray:
        """Cones per mm^2 at places (n, 2), mm from the fovea.

        Raises
        ------
        InvalidInputError
            Where the density is not finite or not positive, or not known.
        """
        arc = np.hypot(places_mm[:, 0], places_mm[:, 1])
        self.check_range(float(arc.min()), float(arc.max()))
        try:
            values = self.at(places_mm)
        except (TypeError, ValueError, ArithmeticError) as error:
            raise InvalidInputError(
                "density must be a function of arrays (x_deg, y_deg) that returns cones per mm^2 "
                f"for each; {self.name} fails: {error}"
            ) from error
        bad = ~(np.isfinite(values) & (values > 0))
        if np.any(bad):
            first = int(np.argmax(bad))
            x, y = self.scale.to_deg(places_mm[first])
            raise InvalidInputError(
                f"density must be finite and > 0 cones/mm^2 all over the field, got "
                f"{values[first]:g} at ({x:.4g}, {y:.4g}) deg from {self.name}; make it positive "
                "there or fov_deg smaller"
            )
        return values

    def check_range(self, low_mm: float, high_mm: float) -> None:
        """Raise InvalidInputError unless the density is known between two distances, mm."""
        least, most = self.range_mm
        if high_mm > most * (1 + 1e-9) or low_mm < least * (1 - 1e-9):
            deg = self.scale.eccentricity_deg(np.array([least, most, low_mm, high_mm]))
            raise InvalidInputError(
                f"density {self.name!r} is known from {deg[0]:.3g} to {deg[1]:.3g} deg from the "
                f"fovea ({least:g} to {most:.4g} mm), asked for from {deg[2]:.3g} to "
                f"{deg[3]:.3g} deg; choose another fov_deg, centre_deg or density"
            )

    def spacing_mm(self, places_mm: np.ndarray) -> np.ndarray:
        """Spacing of a hexagonal lattice of this density, sqrt(2 / (sqrt(3) D)). Watson's A4."""
        return np.asarray(np.sqrt(2.0 / (math.sqrt(3.0) * self.per_mm2(places_mm))))


def by_meridians(tables: dict[Meridian, Table], places_mm: np.ndarray, eye: str) -> np.ndarray:
    """Densities at places (n, 2): linear along the four meridians and in the angle between them.

    As ISETBio reads Curcio's data. NaN outside the tables.
    """
    arc = np.hypot(places_mm[:, 0], places_mm[:, 1])
    # The nasal retina of a right eye has x_mm < 0, of a left one x_mm > 0.
    to_nasal = -places_mm[:, 0] if eye == "right" else places_mm[:, 0]
    turns = np.arctan2(places_mm[:, 1], to_nasal) / (math.pi / 2.0) % 4.0
    first = np.minimum(np.floor(turns).astype(np.intp), 3)
    share = turns - first
    along = np.stack([_along(tables[m], arc) for m in MERIDIANS], axis=0)
    each = np.arange(len(arc))
    before, after = along[first, each], along[(first + 1) % 4, each]
    # A place on a meridian asks nothing of the next one.
    return np.where(share == 0.0, before, before + share * (after - before))


def _along(table: Table, arc_mm: np.ndarray) -> np.ndarray:
    """Densities along a meridian; what rounding put beyond an end of the table lies at it."""
    near = np.clip(arc_mm, table[0][0], table[0][-1])
    is_known = np.abs(near - arc_mm) <= 1e-9 * table[0][-1]
    return np.where(is_known, np.interp(near, *table), np.nan)


def on_meridian(meridian: Meridian, eccentricity_deg: np.ndarray, eye: str) -> np.ndarray:
    """Directions (n, 2), degrees of visual field, that a meridian of the retina receives."""
    nasal = 1.0 if eye == "right" else -1.0
    x, y = {
        "nasal": (nasal, 0.0),
        "superior": (0.0, -1.0),
        "temporal": (-nasal, 0.0),
        "inferior": (0.0, 1.0),
    }[check_choice("meridian", meridian, MERIDIANS)]
    return np.asarray(eccentricity_deg)[:, None] * np.array([x, y])


def curcio_per_mm2(meridian: Meridian, arc_mm: np.ndarray) -> np.ndarray:
    """Curcio's cone density along a meridian, cones/mm^2, at distances from the fovea in mm."""
    check_choice("meridian", meridian, MERIDIANS)
    return np.interp(arc_mm, *_CURCIO[meridian])


def _watson_per_mm2(
    places_mm: np.ndarray, eye: str, scale: RetinalScale, watson: RetinalScale
) -> np.ndarray:
    """Watson's cones per square degree, spread over the square degrees of another scale."""
    deg = scale.to_deg(places_mm)
    ecc = np.hypot(deg[:, 0], deg[:, 1])
    peak = _CURCIO["nasal"][1][0] * float(watson_mm2_per_deg2(np.array(0.0)))
    excess = 1.0 - _WATSON_PEAK_PER_DEG2 / peak
    lowered = 1.0 - excess * np.clip(1.0 - ecc / _WATSON_PEAK_DEG, 0.0, None)
    curcio = by_meridians(_CURCIO, watson.to_mm(deg), eye)
    return curcio * watson_mm2_per_deg2(ecc) * lowered / scale.mm2_per_deg2(ecc)


# Optic nerve head: centre 15.5 deg nasal and 1.5 deg superior on the retina (Rohrschneider 2004),
# 1.77 mm wide and 1.88 mm high (Quigley 1990), turned by 6 deg; the numbers ISETBio uses. It does
# not say which way; here the upper end leans away from the fovea.
_DISC_DEG = (15.5, 1.5)
_DISC_SEMI_MM = (1.77 / 2.0, 1.88 / 2.0)
_DISC_TURN_DEG = 6.0


def in_optic_disc(places_mm: np.ndarray, eye: str, scale: RetinalScale) -> np.ndarray:
    """Whether places (n, 2) of the retina, mm, lie in the optic disc, where no cones are."""
    nasal = 1.0 if eye == "right" else -1.0
    centre = scale.to_mm(np.array([nasal * _DISC_DEG[0], -_DISC_DEG[1]]))
    offset = places_mm - centre
    out, up = -nasal * offset[:, 0], offset[:, 1]
    c, s = math.cos(math.radians(_DISC_TURN_DEG)), math.sin(math.radians(_DISC_TURN_DEG))
    across, along = c * out - s * up, s * out + c * up
    return np.asarray((across / _DISC_SEMI_MM[0]) ** 2 + (along / _DISC_SEMI_MM[1]) ** 2 < 1.0)
