"""Figure 2: what the lens takes out of the light."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from isetcl.eye import catalog
from isetcl.eye.people.ocular_media import OcularMedia
from isetcl.figures.pictures import blank, finish, letter, show_image
from isetcl.figures.result import FigureResult, Row, near, states
from isetcl.scene import targets

if TYPE_CHECKING:
    from isetcl.figures.quality import Quality
    from isetcl.retina.image import RetinalImage

NUMBER = 2
TITLE = "Lens transmittance"

# Lian et al. 2019 name a "20 year-old"; what ISET3d multiplies by is lensDensity.mat of ISETBio
# (Stockman & Sharpe), given here at some of its wavelengths: nm, density.
ISET3D_DENSITY = {400.0: 1.7649, 450.0: 0.2629, 500.0: 0.1537, 550.0: 0.0859, 600.0: 0.0297}
TABLE_AGE, CAPTION_AGE = 32.0, 20.0

_WHITE_PATCH = "white 9.5 (.05 D)"
_DISTANCE_M = 0.5


def draw(folder: Path, quality: Quality) -> FigureResult:
    """A colour chart without and with the lens of the paper, and the lens's transmittance."""
    scene = targets.macbeth_chart(_DISTANCE_M)
    eye = catalog.navarro(4.0, 1.0 / _DISTANCE_M)
    view = {
        "fov_deg": (32.0, 22.0),
        "resolution": quality.pick((128, 88), (480, 330)),
        "spp": quality.pick(16, 64),
    }
    lens = OcularMedia(TABLE_AGE, "cie_170")
    images = [quality.render(scene, eye, media=media, **view) for media in (None, lens)]
    rows, numbers = _rows(images)
    picture = blank(11.0, 3.5)
    left, right, curve = picture.subplots(1, 3, width_ratios=(1.0, 1.0, 0.75))
    white = float(np.percentile(images[0].illuminance_lux, 99.5))
    show_image(left, images[0], "no lens", white_point="D65", white_lux=white)
    show_image(
        right, images[1], "with the lens", white_point="D65", white_lux=white, has_y_label=False
    )
    wavelengths = np.arange(400.0, 701.0, 2.0)
    for age, style in ((TABLE_AGE, "-"), (CAPTION_AGE, "--")):
        curve.plot(
            wavelengths,
            OcularMedia(age, "cie_170").transmittance(wavelengths),
            style,
            color="#1f4e79",
            label=f"CIE 170-1, {age:g} years",
        )
    table = np.array(list(ISET3D_DENSITY.items()))
    curve.plot(table[:, 0], 10.0 ** -table[:, 1], "o", color="#c0392b", label="ISET3d's table")
    curve.set(xlabel="wavelength (nm)", ylabel="transmittance of the lens", ylim=(0, 1.05))
    curve.set_box_aspect(0.9)
    curve.grid(True, lw=0.4, alpha=0.7)
    curve.legend(loc="lower right", frameon=False, fontsize="small")
    for ax, name in zip((left, right), "AB", strict=True):
        letter(ax, name)
    return finish(folder, NUMBER, TITLE, quality, picture, rows, numbers)


def _rows(images: list[RetinalImage]) -> tuple[tuple[Row, ...], dict[str, object]]:
    wavelengths = images[0].wavelengths_nm
    totals = [image.irradiance.values.sum(axis=(1, 2), dtype=np.float64) for image in images]
    passed = totals[1] / totals[0]
    rows = [
        near(
            f"density of the lens in the image, {nm:g} nm",
            float(-np.log10(passed[np.argmin(np.abs(wavelengths - nm))])),
            density,
            0.0005,
            "ISET3d's lens density (ISETBio, lensDensity.mat)",
            digits=4,
        )
        for nm, density in ISET3D_DENSITY.items()
    ]
    young = float(-np.log10(OcularMedia(CAPTION_AGE, "cie_170").transmittance(400.0)[0]))
    rows.append(
        near(
            "density of a 20 year-old lens, 400 nm",
            young,
            ISET3D_DENSITY[400.0],
            0.0005,
            "caption of Figure 2 (20 year-old)",
            digits=4,
            known="the table behind the figure is CIE 170-1's average lens of 32 years, not of 20",
        )
    )
    neutral, yellow = (_blue_over_red(image) for image in images)
    rows.append(
        states(
            "blue over red of neutral patches, sRGB linear",
            f"{neutral:.2f} without, {yellow:.2f} with the lens",
            "neutral without, a yellow cast with the lens",
            "caption of Figure 2",
            abs(neutral - 1.0) < 0.1 and yellow < 0.9 * neutral,
        )
    )
    return tuple(rows), {
        "wavelengths_nm": wavelengths,
        "transmittance": passed,
        "blue_over_red": [neutral, yellow],
    }


def _blue_over_red(image: RetinalImage) -> float:
    """Blue over red, linear sRGB, of the neutral patches: the lowest row of the chart."""
    codes = image.to_srgb(None, "D65").astype(np.float64) / 255.0
    linear = np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)
    rows = linear.shape[0]
    strip = linear[int(0.78 * rows) : int(0.88 * rows)]
    red, _, blue = strip.reshape(-1, 3).sum(axis=0)
    return float(blue / red)
