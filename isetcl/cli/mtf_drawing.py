"""What `isetcl mtf --plot` draws: the transfer of an eye by three ways, beside that of people."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING

import numpy as np

from isetcl.cli import inputs

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from isetcl.eye.model import Eye
    from isetcl.eye.people.population import Population
    from isetcl.validation.transfer.population_band import PopulationBand
    from isetcl.validation.transfer.three_mtfs import Section, ThreeMtfs

_LEAST_STEP_NM = 20.0


def three_ways(
    eye: Eye,
    view: tuple[float, float, float, float, int],
    people: Population | None,
    section: Section = "sagittal",
) -> tuple[Figure, str, str]:
    """The picture, its numbers as CSV, and a line that says how well the ways agree.

    Parameters
    ----------
    view
        Field angle (degrees), object distance (m), highest frequency (cycles/degree), step of the
        wavelengths (nm), samples a pixel.
    people
        Statistics for the band; None takes published percentiles, where there are any.
    section
        Which blur off the axis.
    """
    from matplotlib.figure import Figure

    from isetcl.eye.aberrations.mtf_table import PHOTOPIC_RANGE_NM
    from isetcl.validation.transfer.pictures import draw_with_people
    from isetcl.validation.transfer.three_mtfs import three_mtfs

    field, distance, highest, step, spp = view
    low, high = eye.wavelength_range_nm()
    ends = max(PHOTOPIC_RANGE_NM[0], low), min(PHOTOPIC_RANGE_NM[1], high)
    grid = np.arange(ends[0], ends[1] + 1e-6, max(step, _LEAST_STEP_NM))
    found = three_mtfs(
        eye,
        wavelengths_nm=grid,
        model="diffraction",
        largest_cpd=highest,
        field_deg=field,
        section=section,
        object_distance_m=distance,
        spp=spp,
    )
    pupil = eye.entrance_pupil().diameter_mm
    band = _band(found, pupil, people) if field == 0.0 else None
    figure = Figure(figsize=(8.5, 5.8), layout="constrained")
    axes = draw_with_people(found, pupil, band, figure.subplots())
    axes.set_title(
        f"{eye.name}, {eye.stop.diameter_mm:g} mm stop ({pupil:.3g} mm entrance pupil), "
        f"{field:g}°{f' {section}' if field else ''}, photopic light",
        fontsize="medium",
    )
    return figure, _rows(found, band), _summary(found)


def _band(found: ThreeMtfs, pupil_mm: float, people: Population | None) -> PopulationBand | None:
    from isetcl.validation.transfer.population_band import population_band, published_band

    if people is None:
        band = published_band(pupil_mm)
        if band is None:
            inputs.note("percentiles of people are known for 3 and 4 mm; use --population FILE")
        return band
    frequency = np.linspace(0.0, found.frequency_cpd[-1], 13)
    return population_band(people, frequency, pupil_mm)


def _rows(found: ThreeMtfs, band: PopulationBand | None) -> str:
    columns = {
        "frequency_cpd": found.frequency_cpd,
        "slanted_edge": found.slanted_edge,
        "slanted_edge_standard_error": found.slanted_edge_error,
        "line_spread": found.line_spread,
        "wavefront": found.wavefront,
    }
    if band is not None:
        names = ("population_low", "population_mean", "population_high")
        columns |= dict(zip(names, band.at(found.frequency_cpd), strict=True))
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    return text.getvalue()


def _summary(found: ThreeMtfs) -> str:
    pairs = ", ".join(f"{pair} {value:.3f}" for pair, value in found.differences().items())
    error = float(np.max(found.slanted_edge_error))
    beyond = 100.0 * found.measured.beyond
    return (
        f"largest differences: {pairs}; standard error of the edge up to {error:.3f}, with "
        f"{beyond:.2f} % of its light found beyond the image and put back\n"
        "(rays, in the edge and the line spread, do not interfere; the wavefront does)"
    )
