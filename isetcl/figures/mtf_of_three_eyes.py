"""Figure 5: on-axis MTFs of three model eyes with the band of a population."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from isetcl.eye import catalog
from isetcl.figures.edge_transfer import (
    BAND_CPD,
    POPULATION,
    best_distance_m,
    draw_band,
    dress_mtf,
    edge_mtf,
    share_within_band,
)
from isetcl.figures.pictures import blank, finish, letter
from isetcl.figures.result import FigureResult, Row, states

if TYPE_CHECKING:
    from isetcl.eye.model import Eye
    from isetcl.figures.quality import Quality
    from isetcl.validation.transfer.slanted_edge import SlantedEdgeMtf

NUMBER = 5
TITLE = "On-axis MTF of three schematic eyes"

PUPILS_MM = (3.0, 4.0)
EDGE_M = 50.0
"""Distance of the edge in ISET3d's runs, for relaxed eyes."""

_EYES: dict[str, tuple[Callable[[float], Eye], str]] = {
    "Arizona": (catalog.arizona, "#2e8b57"),
    "Navarro": (catalog.navarro, "#1f4e79"),
    "Le Grand": (catalog.legrand, "#c0392b"),
}


def draw(folder: Path, quality: Quality) -> FigureResult:
    """MTFs at pupils of 3 and 4 mm, relaxed and at best focus, with the paper's diffraction."""
    picture = blank(10.5, 4.4)
    panels = picture.subplots(1, 2, sharey=True)
    shares: dict[tuple[str, float, str], float] = {}
    lowest: dict[tuple[str, float], float] = {}
    numbers: dict[str, object] = {}
    for ax, pupil, name in zip(panels, PUPILS_MM, "AB", strict=True):
        draw_band(ax, pupil)
        for eye_name, (build, colour) in _EYES.items():
            eye = build(pupil)
            for distance, style in ((EDGE_M, "-"), (best_distance_m(eye), ":")):
                measured = edge_mtf(quality, eye, distance, "iset3d")
                assert measured.frequency_cpd is not None
                is_relaxed = distance == EDGE_M
                focus = f"edge at {EDGE_M:g} m" if is_relaxed else "best focus"
                ax.plot(
                    measured.frequency_cpd,
                    measured.photopic_mtf,
                    style,
                    color=colour,
                    label=eye_name if is_relaxed else None,
                )
                shares[eye_name, pupil, focus] = share_within_band(measured, pupil)
                if is_relaxed:
                    lowest[eye_name, pupil] = float(measured.at([BAND_CPD[0]])[0])
                numbers[f"{eye_name}, {pupil:g} mm, {focus}"] = _record(measured, distance)
        ax.plot([], [], ":", color="0.4", label="each at its best focus")
        dress_mtf(ax, quality, f"pupil {pupil:g} mm, photopic")
        letter(ax, name)
    panels[1].set_ylabel("")
    return finish(folder, NUMBER, TITLE, quality, picture, _rows(shares, lowest), numbers)


def _record(measured: SlantedEdgeMtf, distance_m: float) -> dict[str, object]:
    return {
        "object_distance_m": distance_m,
        "frequency_cpd": measured.frequency_cpd,
        "photopic_mtf": measured.photopic_mtf,
        "standard_error": measured.photopic_standard_error,
    }


def _rows(
    shares: dict[tuple[str, float, str], float], lowest: dict[tuple[str, float], float]
) -> tuple[Row, ...]:
    rows = []
    for name in ("Arizona", "Navarro"):
        found = [shares[name, pupil, f"edge at {EDGE_M:g} m"] for pupil in PUPILS_MM]
        evidence = ", ".join(
            f"{100 * share:.0f} % at {pupil:g} mm"
            for share, pupil in zip(found, PUPILS_MM, strict=True)
        )
        rows.append(
            states(
                f"{name} eye within the band, share of frequencies",
                evidence,
                "mostly within the range",
                "caption of Figure 5",
                min(found) > 0.5,
            )
        )
    floors = {pupil: float(POPULATION[pupil][0][0]) for pupil in PUPILS_MM}
    found = [lowest["Le Grand", pupil] for pupil in PUPILS_MM]
    rows.append(
        states(
            "Le Grand eye at 5 cycles/degree, and the band's lower end",
            ", ".join(
                f"{value:.2f} ({floors[pupil]:.2f}) at {pupil:g} mm"
                for value, pupil in zip(found, PUPILS_MM, strict=True)
            ),
            "outside the range",
            "caption of Figure 5",
            all(value < floors[pupil] for value, pupil in zip(found, PUPILS_MM, strict=True)),
        )
    )
    return tuple(rows)
