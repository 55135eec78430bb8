"""Figure 11: what the cones of the fovea catch of a light-dark edge."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from isetcl.eye import catalog
from isetcl.eye.people.ocular_media import OcularMedia
from isetcl.figures.edge_spread import edge_spread_arcmin
from isetcl.figures.edge_transfer import best_distance_m
from isetcl.figures.pictures import blank, finish, letter
from isetcl.figures.result import FigureResult, Row, near, states
from isetcl.scene import targets
from isetcl.units import ARCMIN_PER_DEG

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from isetcl.cones.excitations import Excitations
    from isetcl.cones.mosaic import ConeMosaic
    from isetcl.figures.quality import Quality
    from isetcl.retina.image import RetinalImage

NUMBER = 11
TITLE = "Cone excitations of an edge at the fovea"

MOSAIC_DEG = 0.71
MEAN_LUX = 5.0
INTEGRATION_S, DARK_RATE_HZ = 0.005, 250.0
"""Of ISET3d's script for the figure; the paper names the last two."""

_PUPIL_MM = 3.0
_FOV_DEG = 0.9
_LINE_DEG = 0.02  # half the height of the line whose cones are shown in C
_PATCH_DEG = 0.36
_RIM_DEG = 0.3
_PER_UM2_LUX_S = {"L": 2076.3, "M": 1494.6}
"""Excitations of foveal cones per um^2 of aperture, lux and second, in equal-energy light behind
the lens of 32 years: integrals of the tables of CIE 170-1 and Stockman & Sharpe 2000, 1 nm."""
_COLOURS = {"L": "#d1495b", "M": "#3c9d5d", "S": "#3056c9"}
_LINES = {450.0: "#3f51b5", 550.0: "#2e8b57", 650.0: "#c0392b"}
_SECTION = "Results, Cone mosaic excitations"


def draw(folder: Path, quality: Quality) -> FigureResult:
    """The irradiance, the mosaic, the excitations along a line and over a patch."""
    from isetcl.cones.excitations import excitations
    from isetcl.cones.generate import mosaic

    image = edge_image(quality)
    cones = mosaic(MOSAIC_DEG, seed=quality.seed, device=quality.device)
    caught = excitations(
        cones,
        image,
        INTEGRATION_S,
        dark_rate_hz=DARK_RATE_HZ,
        seed=quality.seed,
        device=quality.device,
    )
    counts = caught.counts.values[0].astype(np.float64)
    distance = ARCMIN_PER_DEG * image.dataset["x"].values
    profiles = {
        nm: image.irradiance.sel(wavelength=nm).values.mean(axis=0, dtype=np.float64)
        for nm in _LINES
    }
    spreads = {nm: edge_spread_arcmin(distance, p / p.max()) for nm, p in profiles.items()}
    picture = blank(10.5, 8.8)
    panels = picture.subplots(2, 2)
    _draw_profiles(panels[0, 0], distance, profiles)
    _draw_mosaic(panels[0, 1], cones)
    _draw_line(panels[1, 0], cones, counts)
    _draw_patch(panels[1, 1], cones, counts)
    for ax, name in zip(panels.ravel(), "ABCD", strict=True):
        letter(ax, name)
    means = _bright_means(cones, caught)
    numbers = {
        "cones": cones.counts,
        "spread_arcmin": {f"{nm:g} nm": spread for nm, spread in spreads.items()},
        "mean_excitations_on_the_bright_side": means,
    }
    rows = _rows(cones, caught, counts, spreads, means) + _sensitivities(cones, image, quality)
    return finish(folder, NUMBER, TITLE, quality, picture, rows, numbers)


def edge_image(quality: Quality) -> RetinalImage:
    """The edge on the retina, behind the lens of the paper's table, scaled to its mean level."""
    eye = catalog.navarro(_PUPIL_MM)
    image = quality.render(
        targets.slanted_edge(best_distance_m(eye), 0.0),
        eye,
        fov_deg=_FOV_DEG,
        resolution=quality.pick(180, 240),
        spp=quality.pick(8, 128),
        media=OcularMedia(32.0, "cie_170"),
        diffraction="iset3d",
    )
    return image.scale_to_mean_illuminance(MEAN_LUX)


def _draw_profiles(ax: Axes, distance: np.ndarray, profiles: dict[float, np.ndarray]) -> None:
    for nm, profile in profiles.items():
        ax.plot(distance, profile / profile.max(), color=_LINES[nm], label=f"{nm:g} nm")
    ax.set(xlabel="distance from the edge (arcmin)", ylabel="relative irradiance")
    ax.set_title("irradiance of the edge", fontsize="medium")
    ax.grid(True, lw=0.4, alpha=0.7)
    ax.legend(frameon=False, fontsize="small")


def _draw_mosaic(ax: Axes, cones: ConeMosaic) -> None:
    cones.plot(ax, legend=False)
    dots = [
        ax.plot([], [], "o", ms=4, color=colour, label=kind)[0] for kind, colour in _COLOURS.items()
    ]
    ax.set(xlabel="visual angle (deg)", ylabel="visual angle (deg)")
    ax.set_title(f"{len(cones)} cones", fontsize="medium")
    ax.legend(handles=dots, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)


def _draw_line(ax: Axes, cones: ConeMosaic, counts: np.ndarray) -> None:
    x, y = cones.positions_deg.T
    near_line = np.abs(y) < _LINE_DEG
    for number, (kind, colour) in enumerate(_COLOURS.items()):
        own = near_line & (cones.types == number)
        ax.plot(ARCMIN_PER_DEG * x[own], counts[own], "o", ms=3, color=colour, label=kind)
    ax.axhline(DARK_RATE_HZ * INTEGRATION_S, color="0.4", lw=0.8, ls="--", label="dark")
    ax.set(xlabel="distance from the edge (arcmin)", ylabel="excitations in 5 ms", ylim=(0, None))
    ax.set_title(f"within {ARCMIN_PER_DEG * _LINE_DEG:g} arcmin of a line", fontsize="medium")
    ax.grid(True, lw=0.4, alpha=0.7)
    ax.legend(frameon=False, fontsize="small")


def _draw_patch(ax: Axes, cones: ConeMosaic, counts: np.ndarray) -> None:
    """Excitations of the cones of a patch beside the edge, each a disc of its aperture."""
    from matplotlib.collections import EllipseCollection

    x, y = cones.positions_deg.T
    half = _PATCH_DEG / 2.0
    inside = (np.abs(x) < half + 0.02) & (np.abs(y) < half + 0.02)
    mm_per_deg = float(np.ptp(cones.positions_mm[:, 0]) / np.ptp(x))
    diameter = cones.aperture_um[inside] * 1e-3 / mm_per_deg * ARCMIN_PER_DEG
    discs = EllipseCollection(
        diameter,
        diameter,
        np.zeros(len(diameter)),
        units="xy",
        offsets=ARCMIN_PER_DEG * cones.positions_deg[inside],
        offset_transform=ax.transData,
        array=counts[inside],
        cmap="gray",
        lw=0,
    )
    discs.set_clim(0.0, float(np.percentile(counts[inside], 99.5)))
    ax.add_collection(discs)
    ax.set_facecolor("#2b2f3a")
    edge = ARCMIN_PER_DEG * half
    ax.set(xlim=(-edge, edge), ylim=(-edge, edge), aspect="equal")
    ax.set(xlabel="visual angle (arcmin)", ylabel="visual angle (arcmin)")
    ax.set_title("excitations in 5 ms", fontsize="medium")
    ax.figure.colorbar(discs, ax=ax, shrink=0.85)


def _bright_means(cones: ConeMosaic, caught: Excitations) -> dict[str, float]:
    """Mean excitations by type where the edge's blur does not reach, on the bright side."""
    bright = cones.positions_deg[:, 0] < -0.15
    mean = caught.mean.values[0]
    return {
        kind: float(mean[bright & (cones.types == number)].mean())
        for number, kind in enumerate(_COLOURS)
    }


def _sensitivities(cones: ConeMosaic, image: RetinalImage, quality: Quality) -> tuple[Row, ...]:
    """Excitations by light near the middle, outer segments all foveal, against the integrals."""
    from isetcl.cones.excitations import excitations

    x = cones.positions_deg[:, 0]
    bright = (x < -0.1) & (cones.eccentricity_deg < 0.2)
    lit = (image.dataset["x"].values < -0.1) & (image.dataset["x"].values > -0.2)
    lux = float(image.illuminance_lux.values[:, lit].mean())
    caught = excitations(cones, image, INTEGRATION_S, segments="none", device=quality.device)
    light = caught.mean.values[0]
    per_um2 = light / (np.pi * (0.5 * cones.aperture_um) ** 2 * lux * INTEGRATION_S)
    return tuple(
        near(
            f"excitations of {kind} cones per um^2, lux and s, within 0.2 deg",
            float(per_um2[bright & (cones.types == number)].mean()),
            _PER_UM2_LUX_S[kind],
            0.02 * _PER_UM2_LUX_S[kind],
            "integrals of CIE 170-1 and Stockman & Sharpe 2000, foveal",
            digits=4,
        )
        for number, kind in enumerate(_PER_UM2_LUX_S)
    )


def variance_over_mean(counts: np.ndarray, mean: np.ndarray) -> tuple[float, float]:
    """Mean square of the deviations over the mean, and its standard error for Poisson variables.

    The variance of (count - m)^2 is m + 2 m^2 of a Poisson variable of mean m; bright cones make
    nearly all of it.
    """
    ratio = np.mean((counts - mean) ** 2) / np.mean(mean)
    error = np.sqrt(np.sum(mean + 2.0 * mean**2)) / np.sum(mean)
    return float(ratio), float(error)


def _rows(
    cones: ConeMosaic,
    caught: Excitations,
    counts: np.ndarray,
    spreads: dict[float, float],
    means: dict[str, float],
) -> tuple[Row, ...]:
    away = cones.eccentricity_deg
    nearest = float(away[cones.types == 2].min())
    inner = float(cones.aperture_um[away < 0.1].mean())
    outer = float(cones.aperture_um[away > _RIM_DEG].mean())
    expected = caught.mean.values[0].astype(np.float64)
    fano, error = variance_over_mean(counts, expected)
    middle = 0.5 * (means["L"] + means["M"])
    return (
        states(
            "spread of the edge, 450 and 550 nm",
            f"{spreads[450.0]:.1f} and {spreads[550.0]:.1f} arcmin",
            "short wavelengths are spread substantially",
            "caption of Figure 11",
            spreads[450.0] > 2.0 * spreads[550.0],
        ),
        states(
            "S cone nearest to the middle of the fovea",
            f"{nearest:.2f} deg",
            "no S cones in the central fovea",
            _SECTION,
            nearest > 0.1,
        ),
        states(
            f"cone apertures within 0.1 deg, and beyond {_RIM_DEG:g} deg",
            f"{inner:.2f} and {outer:.2f} um",
            "they change within tenths of a degree",
            _SECTION,
            outer > 1.1 * inner,
        ),
        states(
            "mean excitations of L, M and S cones in 5 ms, bright side",
            ", ".join(f"{mean:.1f}" for mean in means.values()),
            "very low absorption rates by the S cones",
            _SECTION,
            means["S"] < 0.5 * middle,
        ),
        states(
            "variance over mean of the noise",
            f"{fano:.3f} ± {error:.3f}",
            "variation by Poisson noise and dark noise (1.25 in 5 ms)",
            "caption of Figure 11",
            abs(fano - 1.0) < 4.0 * error,
        ),
    )
