"""Figure 12: what adding blurred planes gets wrong beside a depth edge."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from isetcl.eye import catalog
from isetcl.figures.pictures import DEGREES, blank, finish, letter, show_image
from isetcl.figures.result import FigureResult, Row, near, states
from isetcl.scene import targets
from isetcl.units import ARCMIN_PER_DEG

if TYPE_CHECKING:
    from isetcl.eye.model import Eye
    from isetcl.figures.quality import Quality
    from isetcl.retina.image import RetinalImage
    from isetcl.validation.occlusion.error import OcclusionError, RegionError

NUMBER = 12
TITLE = "Retinal images near an occluding boundary"

NEAR_M, FAR_M = 0.5, 2.0
_PUPIL_MM = 4.0
_FOV_DEG = 2.0
_EDGE_ANGLE_DEG = 45.0
_REACH_ARCMIN = 30.0
_FALLEN = 0.05  # of the largest difference: where the strip is said to end
_NONE = 0.003  # of the mean: what counts as no difference
_PATCHES = 3  # field positions across, whose PSFs are blended
_BEYOND = 1.05  # of the largest spot of the axis: those of the borders are a little larger


def draw(folder: Path, quality: Quality) -> FigureResult:
    """The sum of blurred planes, the ray-traced image, and their difference."""
    from isetcl import psf_baseline
    from isetcl.validation.occlusion.error import occlusion_error

    scene = targets.two_planes(NEAR_M, FAR_M, edge_angle_deg=_EDGE_ANGLE_DEG)
    eye = catalog.navarro(_PUPIL_MM, 1.0 / NEAR_M, pupil_plane="entrance")
    wavelengths = np.arange(400.0, 701.0, quality.pick(20.0, 10.0))
    view: dict[str, Any] = {
        "fov_deg": _FOV_DEG,
        "resolution": quality.pick(96, 320),
        "wavelengths_nm": wavelengths,
    }
    # Every wavelength is traced by itself, as the PSFs have it; bands would leave 0.1 %.
    traced = quality.render(scene, eye, spp=256, bands=len(wavelengths), **view)
    # Samples of 0.1 arcmin, and PSFs of each field position: without, edges away from the occluding
    # one are blurred wrongly, by as much as a method may be without being wrong about occlusion.
    fine: dict[str, Any] = {"oversampling": quality.pick(8, 4), "psf_cache": False}
    summed = psf_baseline.render(scene, eye, method="layered_sum", field=_PATCHES, **fine, **view)
    error = occlusion_error(summed, traced)
    one_psf = occlusion_error(
        psf_baseline.render(scene, eye, method="layered_sum", **fine, **view), traced
    )
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
    blurred = blur_reach_arcmin(eye, wavelengths)
    _draw_profile(panels[3], distance, 100.0 * profile, strip, blurred)
    for ax, name in zip(panels[:3], "ABC", strict=True):
        letter(ax, name)
    rows, numbers = _rows(error, one_psf, traced, distance, profile, eye)
    return finish(folder, NUMBER, TITLE, quality, picture, rows, numbers)


def strip_half_width_arcmin(entrance_pupil_mm: float) -> float:
    """Half the width of the strip in which points are partly hidden: a |D1 - D2|, arcmin."""
    slope = entrance_pupil_mm * 1e-3 / 2.0 * (1.0 / NEAR_M - 1.0 / FAR_M)
    return math.degrees(slope) * ARCMIN_PER_DEG


def _across_arcmin(image: RetinalImage) -> np.ndarray:
    """Distance of every pixel from the edge, (rows, columns), arcmin, far side positive."""
    x, y = image.dataset["x"].values, image.dataset["y"].values
    turn = math.radians(_EDGE_ANGLE_DEG)
    return np.asarray(ARCMIN_PER_DEG * (math.cos(turn) * x[None, :] + math.sin(turn) * y[:, None]))


def _profile(error: OcclusionError, traced: RetinalImage) -> tuple[np.ndarray, np.ndarray]:
    """Root mean square of the photopic difference over lines along the edge, its noise subtracted.

    Against the distance from the edge in arcmin, far side positive; relative to the mean.
    """
    noise = error.photopic_noise.values.astype(np.float64)
    values = error.photopic_difference.values**2 - noise**2
    x = traced.dataset["x"].values
    step = ARCMIN_PER_DEG * float(abs(x[1] - x[0]))
    cells = np.rint(_across_arcmin(traced) / step).astype(int)
    reach = int(_REACH_ARCMIN / step)
    places = np.arange(-reach, reach + 1)
    means = np.array([values[cells == place].mean() for place in places])
    return places * step, np.sqrt(np.maximum(means, 0.0)) / error.photopic["all"].level


def _draw_profile(
    ax: object, distance: np.ndarray, profile_percent: np.ndarray, strip: float, blurred: float
) -> None:
    from matplotlib.axes import Axes

    assert isinstance(ax, Axes)
    ax.axvspan(-strip, strip, color="0.88", lw=0)
    for end in (-blurred, blurred):
        ax.axvline(end, color="0.6", lw=0.8, ls=":")
    ax.plot(distance, profile_percent, color="#1f4e79")
    ax.set(xlabel="distance from the edge (arcmin)", ylabel="RMS, % of the mean", ylim=(0, None))
    ax.set_title("photopic; dotted: end of all blur", fontsize="medium")
    ax.text(0.03, 0.96, "near plane", transform=ax.transAxes, va="top", fontsize="small")
    ax.text(0.97, 0.96, "far plane", transform=ax.transAxes, va="top", ha="right", fontsize="small")
    ax.grid(True, lw=0.4, alpha=0.7)


def _spot_radius_arcmin(eye: Eye, wavelength_nm: float, distance_m: float) -> float:
    """How far a plane's light is spread."""
    rays = eye.spot(0.0, wavelength_nm, object_distance_m=distance_m)
    return float(np.hypot(rays.x_arcmin, rays.y_arcmin).max())


def blur_reach_arcmin(eye: Eye, wavelengths_nm: np.ndarray) -> float:
    """How far from the edge any light comes that passed it, or would if nothing hid it, arcmin."""
    ends = (float(wavelengths_nm[0]), 550.0, float(wavelengths_nm[-1]))
    spots = [_spot_radius_arcmin(eye, w, d) for w in ends for d in (NEAR_M, FAR_M)]
    return _BEYOND * max(spots)


def _end(distance: np.ndarray, profile: np.ndarray) -> float:
    """How far from the edge the profile first falls to a share of its peak, arcmin."""
    beyond = np.flatnonzero((distance > 0.0) & (profile < _FALLEN * profile.max()))
    return float(distance[beyond[0]]) if beyond.size else float(distance[-1])


def _rows(
    error: OcclusionError,
    one_psf: OcclusionError,
    traced: RetinalImage,
    distance: np.ndarray,
    profile: np.ndarray,
    eye: Eye,
) -> tuple[tuple[Row, ...], dict[str, object]]:
    across = np.abs(_across_arcmin(traced))
    blurred = blur_reach_arcmin(eye, traced.wavelengths_nm)
    inside, outside = error.photopic["strip"], error.photopic["outside"]
    away, away_of_one = (e.photopic_over(across > blurred) for e in (error, one_psf))
    ends = _end(-distance[::-1], profile[::-1]), _end(distance, profile)
    step = float(distance[1] - distance[0])
    strip = strip_half_width_arcmin(eye.entrance_pupil().diameter_mm)
    rows = [
        near(
            "half-width of the strip a |D1 - D2|, entrance pupil of 4 mm",
            strip,
            10.3,
            0.05,
            "geometry of the scene of Figure 12",
            unit="arcmin",
        ),
        *(
            near(
                f"the difference falls to a twentieth, {plane} plane",
                end,
                10.3,
                0.15 * strip + step,
                "a |D1 - D2|; a disc's share falls to a twentieth at 0.8 of that, with blue light "
                "farther out",
                unit="arcmin",
            )
            for plane, end in zip(("near", "far"), ends, strict=True)
        ),
        states(
            "error of the sum near the edge, photopic, root mean square",
            f"{_percent(inside)} in the strip, {_percent(outside)} outside it, to where blue light "
            "of the far plane is spread",
            "large near the occluding boundary",
            "caption of Figure 12",
            inside.rms > 0.02 and inside.rms > 5.0 * outside.rms,
        ),
        states(
            f"error farther than {blurred:.1f} arcmin from it, beyond all blur",
            f"{_percent(away)}; with one PSF for the whole field {_percent(away_of_one)}",
            f"none away from it: here, less than {100 * _NONE:g} %",
            "caption of Figure 12",
            away.rms_interval[1] < _NONE,
        ),
    ]
    numbers = {
        "rms_strip": inside.rms,
        "rms_outside": outside.rms,
        "rms_away": away.rms,
        "rms_away_interval": away.rms_interval,
        "rms_away_of_one_psf": away_of_one.rms,
        "bias_away": away.bias,
        "bias_away_standard_error": away.bias_error,
        "strip_half_width_arcmin": strip,
        "blur_reach_arcmin": blurred,
        "difference_ends_arcmin": ends,
        "distance_arcmin": distance,
        "rms_difference": profile,
    }
    return tuple(rows), numbers


def _percent(found: RegionError) -> str:
    low, high = (100.0 * end for end in found.rms_interval)
    return f"{100.0 * found.rms:.2f} % ({low:.2f} to {high:.2f})"
