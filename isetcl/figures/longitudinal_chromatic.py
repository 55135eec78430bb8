"""Figure 9: colour fringes at an edge, by accommodation."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from isetcl.eye import catalog
from isetcl.figures.edge_spread import edge_spread_arcmin
from isetcl.figures.pictures import blank, finish, letter, show_image
from isetcl.figures.result import FigureResult, Row, between, states
from isetcl.scene import targets
from isetcl.scene.mesh import Mesh
from isetcl.scene.targets.letters import FIGURE_9_DISTANCES_M
from isetcl.units import ARCMIN_PER_DEG

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from isetcl.figures.quality import Quality
    from isetcl.retina.image import RetinalImage
    from isetcl.scene.model import Scene

NUMBER = 9
TITLE = "Longitudinal chromatic aberration"

ACCOMMODATIONS_DPT = (0.6, 1.2, 1.8)
"""Of the letters C, B and A; the edge is one of B, at 1.2 dpt."""
SHOWN_NM = (450.0, 550.0, 650.0)
MIDDLE_ARCMIN, SHORT_ARCMIN = (5.0, 20.0), (10.0, 40.0)

_PUPIL_MM = 4.0
_CROP_DEG = (1.1, 0.55)
_CROP_UP_DEG = 0.45  # before the black check of the wall
_DARK_BEFORE, _BRIGHT_ARCMIN = -20.0, (14.0, 24.0)  # the stem of B ends at about 40 arcmin
_SECTION = "Results, Longitudinal Chromatic Aberration"
_COLOURS = {450.0: "#3f51b5", 550.0: "#2e8b57", 650.0: "#c0392b"}


def draw(folder: Path, quality: Quality) -> FigureResult:
    """The scene, an edge of B, and its profiles by wavelength, for three accommodations."""
    scene = targets.letters_at_depth()
    centre = left_edge_of_b_deg(scene)
    picture = blank(11.5, 7.6)
    panels = picture.subplots(3, 3, width_ratios=(1.15, 1.0, 1.1))
    spreads: dict[float, dict[float, float]] = {}
    fringes: dict[float, float] = {}
    numbers: dict[str, Any] = {}
    for row, focus in zip(panels, ACCOMMODATIONS_DPT, strict=True):
        eye = catalog.navarro(_PUPIL_MM, focus)
        whole = quality.render(
            scene,
            eye,
            fov_deg=(14.0, 8.0),
            resolution=quality.pick((84, 48), (280, 160)),
            spp=quality.pick(16, 64),
        )
        crop = quality.render(
            scene,
            eye,
            fov_deg=_CROP_DEG,
            resolution=quality.pick((48, 24), (128, 64)),
            centre_deg=(centre, _CROP_UP_DEG),
            spp=quality.pick(32, 128),
        )
        show_image(row[0], whole, f"accommodated to {focus:g} dpt")
        _show_crop(row[1], crop, centre)
        distance, profiles = _profiles(crop, centre)
        spreads[focus] = {nm: edge_spread_arcmin(distance, p) for nm, p in profiles.items()}
        fringes[focus] = _red_outside(distance, profiles)
        _draw_profiles(row[2], distance, profiles)
        numbers[f"{focus:g} dpt"] = {
            "distance_arcmin": distance,
            "profiles": {f"{nm:g} nm": p for nm, p in profiles.items()},
            "spread_arcmin": {f"{nm:g} nm": s for nm, s in spreads[focus].items()},
        }
    for ax in panels[:2].ravel():
        ax.set_xlabel("")
    panels[0, 1].set_title("left edge of B (1.2 dpt)", fontsize="medium")
    panels[0, 2].legend(frameon=False, fontsize="small", loc="lower right")
    for ax, name in zip(panels[0], "ABC", strict=True):
        letter(ax, name)
    return finish(folder, NUMBER, TITLE, quality, picture, _rows(spreads, fringes), numbers)


def left_edge_of_b_deg(scene: Scene) -> float:
    """Field angle of the left edge of the letter B, seen from the entrance pupil, degrees."""
    shape = next(item.shape for item in scene.objects if item.name == "B")
    assert isinstance(shape, Mesh)
    front = shape.vertices_m[np.argmin(shape.vertices_m[:, 0])]
    pupil = catalog.navarro(_PUPIL_MM).entrance_pupil().z_mm * 1e-3
    return math.degrees(math.atan2(float(front[0]), FIGURE_9_DISTANCES_M[1] + pupil))


def _show_crop(ax: Axes, crop: RetinalImage, centre_deg: float) -> None:
    left, right, low, high = (ARCMIN_PER_DEG * value for value in crop.extent_deg)
    middle = ARCMIN_PER_DEG * centre_deg
    ax.imshow(
        crop.to_srgb(None, "E"),
        extent=(left - middle, right - middle, low, high),
        interpolation="nearest",
    )
    ax.set(xlabel="distance from the edge (arcmin)", ylabel="visual angle (arcmin)")


def _profiles(crop: RetinalImage, centre_deg: float) -> tuple[np.ndarray, dict[float, np.ndarray]]:
    """Irradiance across the edge, mean of all rows, from 0 (outside) to 1 (on the letter)."""
    distance = ARCMIN_PER_DEG * (crop.dataset["x"].values - centre_deg)
    is_bright = (distance > _BRIGHT_ARCMIN[0]) & (distance < _BRIGHT_ARCMIN[1])
    profiles = {}
    for nm in SHOWN_NM:
        mean = crop.irradiance.sel(wavelength=nm).values.mean(axis=0, dtype=np.float64)
        dark, bright = mean[distance < _DARK_BEFORE].mean(), mean[is_bright].mean()
        profiles[nm] = (mean - dark) / (bright - dark)
    return distance, profiles


def _red_outside(distance: np.ndarray, profiles: dict[float, np.ndarray]) -> float:
    """Long less short wavelengths on the dark side of the edge, arcmin of full light."""
    outside = (distance < 0.0) & (distance > -20.0)
    step = float(distance[1] - distance[0])
    return float(np.sum((profiles[650.0] - profiles[450.0])[outside]) * step)


def _draw_profiles(ax: Axes, distance: np.ndarray, profiles: dict[float, np.ndarray]) -> None:
    for nm, profile in profiles.items():
        ax.plot(distance, profile, color=_COLOURS[nm], label=f"{nm:g} nm")
    ax.set(xlim=(-33.0, 33.0), ylim=(-0.05, 1.08), ylabel="relative irradiance")
    ax.set_xlabel("distance from the edge (arcmin)")
    ax.grid(True, lw=0.4, alpha=0.7)


def _rows(spreads: dict[float, dict[float, float]], fringes: dict[float, float]) -> tuple[Row, ...]:
    far, focus, near_ = ACCOMMODATIONS_DPT
    rows = []
    for dioptres, found in spreads.items():
        for nm, limits in ((550.0, MIDDLE_ARCMIN), (450.0, SHORT_ARCMIN)):
            known = ""
            if (dioptres, nm) in ((far, 450.0), (focus, 550.0)):
                known = (
                    f"{nm:g} nm is nearly in focus there; the paper's range is that of its plots, "
                    "whose wavelengths and measure of spread are not stated"
                )
            rows.append(
                between(
                    f"spread at {nm:g} nm, accommodated to {dioptres:g} dpt",
                    found[nm],
                    *limits,
                    _SECTION,
                    unit="arcmin",
                    known=known,
                )
            )
    rows += [
        states(
            "long less short wavelengths outside the edge, focus farther",
            f"{fringes[far]:+.2f} arcmin",
            "fringe red (outside) and cyan",
            _SECTION,
            fringes[far] > 0.0,
        ),
        states(
            "long less short wavelengths outside the edge, focus nearer",
            f"{fringes[near_]:+.2f} arcmin",
            "fringe blue (outside) and orange",
            _SECTION,
            fringes[near_] < 0.0,
        ),
        states(
            "spread in the focal plane, 450, 550 and 650 nm",
            ", ".join(f"{spreads[focus][nm]:.1f}" for nm in SHOWN_NM) + " arcmin",
            "large for short wavelengths, moderate for long ones",
            _SECTION,
            spreads[focus][450.0] > 1.5 * spreads[focus][650.0],
        ),
    ]
    return tuple(rows)
