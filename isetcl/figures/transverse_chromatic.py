"""Figure 10: transverse chromatic aberration at two depths of the anterior chamber."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from isetcl.eye import catalog
from isetcl.figures.pictures import blank, finish, letter, show_image
from isetcl.figures.result import FigureResult, Row, near, states
from isetcl.scene import targets
from isetcl.units import ARCMIN_PER_DEG

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from isetcl.eye.model import Eye
    from isetcl.figures.quality import Quality
    from isetcl.retina.image import RetinalImage
    from isetcl.scene.model import Scene

NUMBER = 10
TITLE = "Transverse chromatic aberration"

GRID_M = 1.0
CHAMBERS_MM = (3.29, 2.57)
FIELDS_DEG = (0.0, 8.0, 15.0)
MEASURED_NM = (400.0, 430.0, 700.0, 770.0)
"""Ends of the range that ISET3d renders, and of that of the measurements."""

_PUPIL_MM = 4.0
_NARROW_MM = 0.5  # the centroid of a line is then that of chief rays
_GRID_DEG = 60.0
_LINES = 16
_CROP_DEG = 1.5
_CHIEF = "chief rays, traced on the host"
_SECTION = "Results, Transverse Chromatic Aberration"

# Lian et al. 2019 print two numbers; those of chief rays to the grid are of another program.
_PAPER_ARCMIN, _HUMAN_ARCMIN = 10.0, 6.0


def eyes() -> dict[str, Eye]:
    """Navarro's eye as it is, and with its lens and iris moved: both accommodated to the grid.

    The depths are those of the aqueous; the retina moves with the lens.
    """
    eye = catalog.navarro(_PUPIL_MM, 1.0 / GRID_M)
    moved = {
        f"{depth:g} mm": eye.with_anterior_chamber_depth(
            depth, measured_from="endothelium", hold="vitreous_depth"
        )
        for depth in CHAMBERS_MM
    }
    return {"unchanged": eye, **moved}


def draw(folder: Path, quality: Quality) -> FigureResult:
    """The grid, and where its lines lie in light of the ends of the spectrum."""
    variants = eyes()
    chief = {name: _chief_arcmin(eye) for name, eye in variants.items()}
    picture = blank(12.0, 5.6)
    parts: Any = picture.subfigures(1, 2, width_ratios=(0.85, 1.0))
    whole, crops = parts
    image = quality.render(
        targets.tca_grid(GRID_M, _GRID_DEG, lines=_LINES),
        variants["unchanged"],
        fov_deg=56.0,
        resolution=quality.pick(192, 640),
        spp=quality.pick(16, 48),
    )
    ax = whole.subplots()
    show_image(ax, image, "grid at 1 m, Navarro eye, 4 mm")
    letter(ax, "A")
    panels = crops.subplots(2, 3, sharex=False, sharey=True)
    names = list(variants)[1:]
    crops.supxlabel("distance from the line (arcmin)", fontsize="medium")
    for i, name in enumerate(names):
        panels[i, 0].set_ylabel(f"chamber {name}\n(arcmin)")
        letter(panels[i, 0], "BC"[i])
        for j, field in enumerate(FIELDS_DEG):
            _draw_crop(panels[i, j], variants[name], quality, field)
            panels[0, j].set_title(f"{field:g}°", fontsize="medium")
    found = {name: _rendered(eye.with_pupil(_NARROW_MM), quality) for name, eye in variants.items()}
    wide = _rendered(variants["unchanged"], quality)
    rows = (*_rows(chief, found), _wide_row(variants["unchanged"], wide), *_paper_rows(chief))
    numbers = {
        "wavelengths_nm": MEASURED_NM,
        "fields_deg": FIELDS_DEG,
        "chief_ray_arcmin": chief,
        "rendered_arcmin": found,
        "rendered_4_mm_arcmin": wide,
    }
    return finish(folder, NUMBER, TITLE, quality, picture, rows, numbers)


def _chief_arcmin(eye: Eye) -> np.ndarray:
    """Displacement outwards of the wavelengths' chief rays from that of 550 nm, (fields, 4)."""
    return np.array(
        [eye.tca_arcmin((field, 0.0), MEASURED_NM, 550.0, GRID_M)[:, 0] for field in FIELDS_DEG]
    )


def _grid_through(eye: Eye, field_deg: float) -> Scene:
    """The grid with about its lines' spacing, one of which runs through a field angle."""
    spacing = 2.0 * GRID_M * math.tan(math.radians(_GRID_DEG / 2.0)) / _LINES
    # Field angles are those at the entrance pupil, behind the cornea.
    away = GRID_M + eye.entrance_pupil().z_mm * 1e-3
    height = away * math.tan(math.radians(field_deg))
    if field_deg > 0.0:
        spacing = height / round(height / spacing)
    width_deg = 2.0 * math.degrees(math.atan(spacing * _LINES / 2.0 / GRID_M))
    return targets.tca_grid(GRID_M, width_deg, lines=_LINES)


def _crop(quality: Quality, field_deg: float) -> dict[str, Any]:
    return {
        "fov_deg": _CROP_DEG,
        "resolution": quality.pick(48, 120),
        "centre_deg": (field_deg, 0.0),
        "spp": quality.pick(32, 128),
    }


def _rendered(eye: Eye, quality: Quality) -> np.ndarray:
    """The same from images of the grid, as centroids of a line, (fields, 4)."""
    wavelengths = np.sort([*MEASURED_NM, 550.0])
    found = [np.zeros(len(MEASURED_NM))]
    for field in FIELDS_DEG[1:]:
        scene = _grid_through(eye, field)
        # Every wavelength takes its own path: shared ones would be moved together.
        image = quality.render(
            scene,
            eye,
            wavelengths_nm=wavelengths,
            bands=len(wavelengths),
            **_crop(quality, field),
        )
        found.append(_line_places(image))
    return np.array(found)


def _line_places(image: RetinalImage) -> np.ndarray:
    """Centroids across the vertical line, arcmin from that at the longest wavelength.

    In the upper third of the image, free of the horizontal line and its blur; without that of the
    reference wavelength.
    """
    from isetcl.validation.transfer.measured_tca import measured_tca

    rows, columns = image.irradiance.shape[1:]
    found = measured_tca(image, region=(0, rows // 3, 0, columns))
    return found.shift_arcmin[np.isin(found.wavelengths_nm, MEASURED_NM)]


def _draw_crop(ax: Axes, eye: Eye, quality: Quality, field_deg: float) -> None:
    """Draw the crossing at a field angle, in arcmin from it."""
    image = quality.render(_grid_through(eye, field_deg), eye, **_crop(quality, field_deg))
    left, right, low, high = (ARCMIN_PER_DEG * value for value in image.extent_deg)
    middle = ARCMIN_PER_DEG * field_deg
    ax.imshow(
        image.to_srgb(None, "E"),
        extent=(left - middle, right - middle, low, high),
        interpolation="nearest",
    )


def _between(displacements: np.ndarray, low_nm: float, high_nm: float, field_deg: float) -> float:
    """Arcmin between two wavelengths at a field angle."""
    row = displacements[FIELDS_DEG.index(field_deg)]
    return abs(float(row[MEASURED_NM.index(high_nm)] - row[MEASURED_NM.index(low_nm)]))


def _rows(chief: dict[str, np.ndarray], found: dict[str, np.ndarray]) -> tuple[Row, ...]:
    rows = []
    for ends in ((430.0, 770.0), (400.0, 700.0)):
        for name in ("unchanged", *(f"{depth:g} mm" for depth in CHAMBERS_MM)):
            for field in FIELDS_DEG[1:]:
                expected = _between(chief[name], *ends, field)
                rows.append(
                    near(
                        f"TCA {ends[0]:g} to {ends[1]:g} nm at {field:g}°, chamber {name}",
                        _between(found[name], *ends, field),
                        expected,
                        0.02 * expected,
                        _CHIEF,
                        unit="arcmin",
                    )
                )
    return tuple(rows)


def _wide_row(eye: Eye, found: np.ndarray) -> Row:
    """Centroids through the wide pupil beside those of spots: coma moves them from chief rays."""
    ends = [430.0, 550.0, 770.0]
    spots = eye.spots((15.0, 0.0), ends, reference_nm=550.0, object_distance_m=GRID_M)
    expected = abs(spots[2].centroid_arcmin[0] - spots[0].centroid_arcmin[0])
    return near(
        f"centroids 430 to 770 nm at 15°, {_PUPIL_MM:g} mm pupil",
        _between(found, 430.0, 770.0, 15.0),
        expected,
        0.05 * expected,
        "spots, traced on the host",
        unit="arcmin",
    )


def _paper_rows(chief: dict[str, np.ndarray]) -> list[Row]:
    """What the paper says of the unchanged eye at 15 degrees, of measurements, and of depths."""
    wide = _between(chief["unchanged"], 430.0, 770.0, 15.0)
    rendered = _between(chief["unchanged"], 400.0, 700.0, 15.0)
    smaller, larger = (
        _between(chief[f"{depth:g} mm"], 400.0, 700.0, 15.0) for depth in CHAMBERS_MM
    )
    return [
        near(
            "TCA at 15°, 430 to 770 nm",
            wide,
            _PAPER_ARCMIN,
            1.0,
            _SECTION,
            unit="arcmin",
            known="the paper's software renders 400 to 700 nm only; over that range the same eye "
            f"has {rendered:.1f} arcmin ({smaller:.1f} and {larger:.1f} at the two depths)",
        ),
        near(
            "TCA at 15°, 400 to 700 nm",
            rendered,
            _PAPER_ARCMIN,
            1.5,
            f"{_SECTION} (its wavelengths are not stated)",
            unit="arcmin",
        ),
        near(
            "TCA at 15°, 430 to 770 nm, beside measured eyes",
            wide,
            _HUMAN_ARCMIN,
            1.5,
            "Winter et al. 2016, in the paper",
            unit="arcmin",
        ),
        states(
            "TCA at 15°, 400 to 700 nm, by depth of the chamber",
            f"{smaller:.2f} at 3.29 mm, {larger:.2f} arcmin at 2.57 mm",
            "larger where the chamber is shallower",
            "caption of Figure 10",
            larger > smaller,
        ),
    ]
