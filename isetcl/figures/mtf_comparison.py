"""Figure 3: the on-axis MTF of Navarro's eye beside Zemax, a formula and a population."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from isetcl.eye import catalog
from isetcl.eye.people.human_mtf import watson_2013_mtf
from isetcl.figures.edge_transfer import (
    BAND_CPD,
    FAR_M,
    POPULATION,
    best_distance_m,
    distance_text,
    draw_band,
    dress_mtf,
    edge_mtf,
    highest_cpd,
    mean_of_moduli,
)
from isetcl.figures.pictures import blank, finish, letter
from isetcl.figures.result import FigureResult, Row, near, states

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from isetcl.eye.model import Eye
    from isetcl.figures.quality import Quality
    from isetcl.validation.transfer.slanted_edge import SlantedEdgeMtf

NUMBER = 3
TITLE = "On-axis MTF of Navarro's eye"

PUPIL_MM = 3.0
BENDS = {
    "none": ("rays, no diffraction", "#d68910"),
    "iset3d": ("HURB as in ISET3d", "#1f4e79"),
    "airy": ("exact pattern at the stop", "#8e44ad"),
}
SHOWN_NM = (450.0, 500.0, 550.0, 600.0, 650.0)

# HURB with ISET3d's constants through an iris of 3 mm, summed over the pupil in closed form by
# another program; frequencies in cycles/degree.
HURB_SUM = {5.0: 0.809, 10.0: 0.621, 20.0: 0.367, 30.0: 0.223}

# Zemax, geometric MTF of the Navarro eye with a stop of 4 mm, object at infinity: cycles/mm.
ZEMAX_CPMM = np.array([10.0, 20.0, 30.0, 50.0, 100.0])
ZEMAX_550_NM = np.array([0.869452, 0.594879, 0.391965, 0.326540, 0.220863])
ZEMAX_PHOTOPIC = np.array([0.847766, 0.598627, 0.452803, 0.336307, 0.201237])
ZEMAX_LIGHT_NM = np.array([470.0, 510.0, 555.0, 610.0, 650.0])
ZEMAX_WEIGHTS = np.array([0.091, 0.503, 1.0, 0.503, 0.107])
_ZEMAX_STOP_MM = 4.0

_ABOVE = (
    "exact diffraction leaves the model eye better than most of the population; HURB with ISET3d's "
    "constants scatters more and brings it into the band. Why the printed Zemax curve is as low is "
    "not known: the paper gives no settings"
)


def draw(folder: Path, quality: Quality) -> FigureResult:
    """MTFs in photopic light, by wavelength, and beside Zemax's geometric ones."""
    eye = catalog.navarro(PUPIL_MM)
    distance = best_distance_m(eye)
    spp = quality.pick(64, 192)
    measured = {
        bend: edge_mtf(quality, eye, distance, bend, spp=spp, wavelengths_nm=None) for bend in BENDS
    }
    frequency = measured["iset3d"].frequency_cpd
    assert frequency is not None
    waves = eye.polychromatic_mtf(BAND_CPD, object_distance_m=distance)
    zemax = _zemax_edges(quality)
    picture = blank(14.0, 4.5)
    panels = picture.subplots(1, 3)
    _draw_photopic(panels[0], measured, waves)
    dress_mtf(panels[0], quality, f"pupil 3 mm, photopic, edge at {distance_text(distance)}")
    _draw_spectral(panels[1], measured["iset3d"])
    dress_mtf(panels[1], quality, "by wavelength, HURB as in ISET3d")
    _draw_zemax(panels[2], zemax)
    for ax, name in zip(panels, "ABC", strict=True):
        letter(ax, name)
    rows = (*_paper_rows(measured, waves), *_zemax_rows(zemax))
    numbers = {
        "object_distance_m": distance,
        "frequency_cpd": frequency,
        "photopic_mtf": {bend: found.photopic_mtf for bend, found in measured.items()},
        "standard_error": {bend: found.photopic_standard_error for bend, found in measured.items()},
        "mean_of_moduli": {bend: mean_of_moduli(found) for bend, found in measured.items()},
        "wavefront": {"frequency_cpd": BAND_CPD, "photopic_mtf": waves},
        "highest_cpd": highest_cpd(quality),
    }
    return finish(folder, NUMBER, TITLE, quality, picture, rows, numbers)


def _zemax_edges(quality: Quality) -> dict[str, SlantedEdgeMtf]:
    eye: Eye = catalog.navarro(_ZEMAX_STOP_MM)
    spp = quality.pick(64, 128)
    options = {"spp": spp, "wavelengths_nm": ZEMAX_LIGHT_NM, "bands": 5, "weights": ZEMAX_WEIGHTS}
    return {
        "550 nm": edge_mtf(quality, eye, FAR_M, "none", spp=spp, wavelengths_nm=np.array([550.0])),
        "photopic": edge_mtf(quality, eye, FAR_M, "none", **options),
    }


def _draw_photopic(ax: Axes, measured: dict[str, SlantedEdgeMtf], waves: np.ndarray) -> None:
    draw_band(ax, PUPIL_MM)
    for bend, (label, colour) in BENDS.items():
        found = measured[bend]
        assert found.frequency_cpd is not None
        ax.plot(found.frequency_cpd, found.photopic_mtf, color=colour, label=f"edge, {label}")
    ax.plot(BAND_CPD, waves, "o", color="#8e44ad", mfc="white", label="wavefront, exact")
    assert measured["none"].frequency_cpd is not None
    nodes = measured["none"].frequency_cpd
    ax.plot(nodes, watson_2013_mtf(nodes, PUPIL_MM), "k--", label="Watson 2013")


def _draw_spectral(ax: Axes, found: SlantedEdgeMtf) -> None:
    from isetcl.eye.pictures.picture_parts import wavelength_colour

    assert found.wavelengths_nm is not None
    assert found.frequency_cpd is not None
    for nm in SHOWN_NM:
        values = found.mtf[int(np.argmin(np.abs(found.wavelengths_nm - nm)))]
        ax.plot(found.frequency_cpd, values, color=wavelength_colour(nm), label=f"{nm:g} nm")


def _draw_zemax(ax: Axes, zemax: dict[str, SlantedEdgeMtf]) -> None:
    colours = {"550 nm": "#2e8b57", "photopic": "#1f4e79"}
    truths = {"550 nm": ZEMAX_550_NM, "photopic": ZEMAX_PHOTOPIC}
    for name, found in zemax.items():
        assert found.frequency_cpmm is not None
        ax.plot(
            found.frequency_cpmm, found.photopic_mtf, color=colours[name], label=f"edge, {name}"
        )
        ax.plot(ZEMAX_CPMM, truths[name], "o", color=colours[name], label=f"Zemax, {name}")
    ax.set(xlabel="frequency (cycles/mm)", ylabel="modulation transfer", xlim=(0, 110))
    ax.set_ylim(0.0, 1.02)
    ax.set_title("stop 4 mm, no diffraction, object at infinity", fontsize="medium")
    ax.grid(True, lw=0.4, alpha=0.7)
    ax.legend(frameon=False, fontsize="small")


def _paper_rows(measured: dict[str, SlantedEdgeMtf], waves: np.ndarray) -> list[Row]:
    rows = [
        near(
            f"MTF at {cpd:g} c/deg, HURB as in ISET3d",
            float(measured["iset3d"].at([cpd])[0]),
            expected,
            0.02,
            "HURB summed over the pupil (the paper prints no number)",
        )
        for cpd, expected in HURB_SUM.items()
    ]
    low, high = (edge[:3] for edge in POPULATION[PUPIL_MM])
    compared = BAND_CPD[:3]
    hurb, watson = measured["iset3d"].at(compared), watson_2013_mtf(compared, PUPIL_MM)
    rows.append(
        states(
            "HURB less Watson 2013 at 5, 10, 20 c/deg, and the band's height",
            ", ".join(
                f"{a - b:+.2f} ({c:.2f})" for a, b, c in zip(hurb, watson, high - low, strict=True)
            ),
            "differences smaller than the measured variation",
            "caption of Figure 3",
            bool(np.all(np.abs(hurb - watson) < high - low)),
        )
    )
    for label, values, known in (
        ("HURB as in ISET3d", hurb, ""),
        ("exact, from the wavefront (as Zemax can)", waves[:3], _ABOVE),
    ):
        rows.append(
            states(
                f"MTF at 5, 10, 20 c/deg, {label}",
                ", ".join(f"{value:.2f}" for value in values),
                "within the population: "
                + ", ".join(f"{a:.2f}-{b:.2f}" for a, b in zip(low, high, strict=True)),
                "Results, Validation",
                bool(np.all((values >= low) & (values <= high))),
                known=known,
            )
        )
    return rows


def _zemax_rows(zemax: dict[str, SlantedEdgeMtf]) -> list[Row]:
    rows = []
    for name, truth in (("550 nm", ZEMAX_550_NM), ("photopic", ZEMAX_PHOTOPIC)):
        found = zemax[name]
        assert found.frequency_cpmm is not None
        values = np.interp(ZEMAX_CPMM, found.frequency_cpmm, found.photopic_mtf)
        rows += [
            near(
                f"MTF at {f:g} cycles/mm, 4 mm, no diffraction, {name}",
                float(value),
                float(expected),
                0.01,
                "Zemax, geometric",
            )
            for f, value, expected in zip(ZEMAX_CPMM, values, truth, strict=True)
        ]
    return rows
