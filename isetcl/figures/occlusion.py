"""Figure 12: what adding blurred planes gets wrong beside a depth edge."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from isetcl.eye import catalog
from isetcl.figures.pictures import DEGREES, blank, finish, letter, show_image
from isetcl.figures.result import FigureResult, Row, between, near, states
from isetcl.scene import targets
from isetcl.units import ARCMIN_PER_DEG

if TYPE_CHECKING:
    from isetcl.eye.model import Eye
    from isetcl.figures.quality import Quality
    from isetcl.retina.image import RetinalImage
    from isetcl.validation.occlusion.error import OcclusionError

NUMBER = 12
TITLE = "Retinal images near an occluding boundary"

NEAR_M, FAR_M = 0.5, 2.0
_PUPIL_MM = 4.0
_FOV_DEG = 2.0
_EDGE_ANGLE_DEG = 45.0
_REACH_ARCMIN = 30.0
_FALLEN = 0.05  # of the largest difference: where the strip is said to end


def draw(folder: Path, quality: Quality) -> FigureResult:
    """The sum of blurred planes, the ray-traced image, and their difference."""
    from isetcl import psf_baseline
    from isetcl.validation.occlusion.error import occlusion_error

    scene = targets.two_planes(NEAR_M, FAR_M, edge_angle_deg=_EDGE_ANGLE_DEG)
    eye = catalog.navarro(_PUPIL_MM, 1.0 / NEAR_M)
    view: dict[str, Any] = {"fov_deg": _FOV_DEG, "resolution": quality.pick(96, 320)}
    traced = quality.render(scene, eye, spp=quality.pick(64, 256), **view)
    summed = psf_baseline.render(scene, eye, method="layered_sum", **view)
    error = occlusion_error(summed, traced)
    absolute = np.abs(error.difference.values).sum(axis=0)
    distance, profile = _profile(error, traced)
    picture = blank(12.5, 3.7)
    panels = picture.subplots(1, 4, width_ratios=(1, 1, 1.14, 0.95))
    white = float(np.percentile(traced.illuminance_lux, 99.5))
    show_image(panels[0], summed, "blurred planes, summed", white_lux=white)
    show_image(panels[1], traced, "ray tracing", white_lux=white, has_y_label=False)
    level = traced.irradiance.values.sum(axis=0).mean()
    drawn = panels[2].imshow(
        100.0 * absolute / level, cmap="magma", vmin=0.0, extent=traced.extent_deg
    )
    panels[2].set(xlabel=DEGREES)
    panels[2].tick_params(labelleft=False)
    panels[2].set_title("|A - B|, all wavelengths", fontsize="medium")
    picture.colorbar(drawn, ax=panels[2], label="% of the mean", shrink=0.7)
    strip = strip_half_width_arcmin(eye.entrance_pupil().diameter_mm)
    _draw_profile(panels[3], distance, 100.0 * profile, strip)
    for ax, name in zip(panels[:3], "ABC", strict=True):
        letter(ax, name)
    rows, numbers = _rows(error, distance, profile, eye)
    return finish(folder, NUMBER, TITLE, quality, picture, rows, numbers)


def strip_half_width_arcmin(entrance_pupil_mm: float) -> float:
    """Half the width of the strip in which points are partly hidden: a |D1 - D2|, arcmin."""
    slope = entrance_pupil_mm * 1e-3 / 2.0 * (1.0 / NEAR_M - 1.0 / FAR_M)
    return math.degrees(slope) * ARCMIN_PER_DEG


def _profile(error: OcclusionError, traced: RetinalImage) -> tuple[np.ndarray, np.ndarray]:
    """Root mean square of the photopic difference over lines along the edge, its noise subtracted.

    Against the distance from the edge in arcmin, far side positive; relative to the mean.
    """
    lux, deviation = traced.brightness()
    values = error.photopic_difference.values**2 - deviation.astype(np.float64) ** 2
    x, y = traced.dataset["x"].values, traced.dataset["y"].values
    turn = math.radians(_EDGE_ANGLE_DEG)
    across = ARCMIN_PER_DEG * (math.cos(turn) * x[None, :] + math.sin(turn) * y[:, None])
    step = ARCMIN_PER_DEG * float(abs(x[1] - x[0]))
    cells = np.rint(across / step).astype(int)
    reach = int(_REACH_ARCMIN / step)
    places = np.arange(-reach, reach + 1)
    means = np.array([values[cells == place].mean() for place in places])
    return places * step, np.sqrt(np.maximum(means, 0.0)) / float(lux.mean())


def _draw_profile(
    ax: object, distance: np.ndarray, profile_percent: np.ndarray, strip: float
) -> None:
    from matplotlib.axes import Axes

    assert isinstance(ax, Axes)
    ax.axvspan(-strip, strip, color="0.88", lw=0)
    ax.plot(distance, profile_percent, color="#1f4e79")
    ax.set(xlabel="distance from the edge (arcmin)", ylabel="RMS, % of the mean", ylim=(0, None))
    ax.set_title("photopic, along the edge", fontsize="medium")
    ax.text(0.03, 0.96, "near plane", transform=ax.transAxes, va="top", fontsize="small")
    ax.text(0.97, 0.96, "far plane", transform=ax.transAxes, va="top", ha="right", fontsize="small")
    ax.grid(True, lw=0.4, alpha=0.7)


def _spot_radius_arcmin(eye: Eye, wavelength_nm: float) -> float:
    """How far the far plane's light is spread over the near one where it is not hidden."""
    rays = eye.spot(0.0, wavelength_nm, object_distance_m=FAR_M)
    return float(np.hypot(rays.x_arcmin, rays.y_arcmin).max())


def _end(distance: np.ndarray, profile: np.ndarray) -> float:
    """How far from the edge the profile first falls to a share of its peak, arcmin."""
    beyond = np.flatnonzero((distance > 0.0) & (profile < _FALLEN * profile.max()))
    return float(distance[beyond[0]]) if beyond.size else float(distance[-1])


def _rows(
    error: OcclusionError, distance: np.ndarray, profile: np.ndarray, eye: Eye
) -> tuple[tuple[Row, ...], dict[str, object]]:
    inside, outside = error.photopic["strip"].rms, error.photopic["outside"].rms
    ends = _end(-distance[::-1], profile[::-1]), _end(distance, profile)
    step = float(distance[1] - distance[0])
    strip = strip_half_width_arcmin(eye.entrance_pupil().diameter_mm)
    spots = _spot_radius_arcmin(eye, 550.0), _spot_radius_arcmin(eye, 450.0)
    rows = [
        near(
            "half-width of the strip a |D1 - D2|, entrance pupil of 4 mm",
            strip_half_width_arcmin(_PUPIL_MM),
            10.3,
            0.05,
            "geometry of the scene of Figure 12",
            unit="arcmin",
        ),
        near(
            "the difference reaches, far plane",
            ends[1],
            strip,
            0.15 * strip + step,
            f"a |D1 - D2| of a stop of {_PUPIL_MM:g} mm, whose image is larger",
            unit="arcmin",
        ),
        between(
            "the difference reaches, near plane",
            ends[0],
            spots[0] - step,
            spots[1] + step,
            "radius of spots of the far plane, 550 and 450 nm",
            unit="arcmin",
        ),
        states(
            "error of the sum, photopic, root mean square",
            f"{100 * inside:.1f} % in the strip, {100 * outside:.2f} % outside",
            "large near the occluding boundary, none away from it",
            "caption of Figure 12",
            inside > 0.02 and inside > 5.0 * outside,
        ),
    ]
    numbers = {
        "rms_strip": inside,
        "rms_outside": outside,
        "strip_half_width_arcmin": strip,
        "difference_ends_arcmin": ends,
        "distance_arcmin": distance,
        "rms_difference": profile,
    }
    return tuple(rows), numbers
