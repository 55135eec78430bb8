"""Figure 6: the MTF of Navarro's eye by pupil size."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from isetcl.eye import catalog
from isetcl.figures.edge_transfer import best_distance_m, dress_mtf, edge_mtf
from isetcl.figures.pictures import blank, finish
from isetcl.figures.result import FigureResult, Row, near, states

if TYPE_CHECKING:
    from isetcl.figures.quality import Quality

NUMBER = 6
TITLE = "MTF by pupil size"

PUPILS_MM = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
_COMPARED_CPD = (10.0, 20.0, 30.0)


def draw(folder: Path, quality: Quality) -> FigureResult:
    """MTFs of six pupils, each at its best focus, with the paper's diffraction."""
    from matplotlib import colormaps

    picture = blank(6.4, 4.6)
    ax = picture.subplots()
    compared: dict[float, np.ndarray] = {}
    numbers: dict[str, object] = {}
    for i, pupil in enumerate(PUPILS_MM):
        eye = catalog.navarro(pupil)
        distance = best_distance_m(eye)
        measured = edge_mtf(quality, eye, distance, "iset3d")
        assert measured.frequency_cpd is not None
        ax.plot(
            measured.frequency_cpd,
            measured.photopic_mtf,
            color=colormaps["viridis"](i / len(PUPILS_MM)),
            label=f"{pupil:g} mm",
        )
        compared[pupil] = measured.at(list(_COMPARED_CPD))
        numbers[f"{pupil:g} mm"] = {
            "object_distance_m": distance,
            "frequency_cpd": measured.frequency_cpd,
            "photopic_mtf": measured.photopic_mtf,
            "standard_error": measured.photopic_standard_error,
        }
    dress_mtf(ax, quality, "Navarro eye, photopic, best focus, HURB as in ISET3d")
    ax.legend(title="pupil (stop)", frameon=False)
    return finish(folder, NUMBER, TITLE, quality, picture, _rows(compared), numbers)


def _rows(compared: dict[float, np.ndarray]) -> tuple[Row, ...]:
    means = {pupil: float(np.mean(values)) for pupil, values in compared.items()}
    text = ", ".join(f"{pupil:g} mm {mean:.3f}" for pupil, mean in means.items())
    best = max(means, key=lambda pupil: means[pupil])
    return (
        near("pupil with the best MTF", best, 3.0, 0.0, "caption of Figure 6", unit="mm"),
        states(
            "mean MTF at 10, 20 and 30 cycles/degree",
            text,
            "quality rises from 6 mm down to about 2.5 mm",
            "Results, Pupil Size: MTF",
            means[6.0] < means[5.0] < means[4.0] < means[3.0],
        ),
        states(
            "below 2 mm",
            f"1 mm {means[1.0]:.3f}, 2 mm {means[2.0]:.3f}",
            "diffraction (HURB) lowers it",
            "Results, Pupil Size: MTF",
            means[1.0] < means[2.0],
        ),
    )
