"""The files of a comparison: images, maps, plots, report.html and report.json."""

from __future__ import annotations

import io
import json
import os
import platform
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from isetcl import plots
from isetcl.output import check_folder, write_file
from isetcl.page import Block, Listing, Picture, Table, Text, page, png_of
from isetcl.validation.comparison import Comparison
from isetcl.version import __version__


def write_report(
    comparison: Comparison,
    folder: Path,
    *,
    edge_angle_deg: float,
    white_point: str,
    command: str,
) -> list[Path]:
    """Write all files of a comparison; returns their paths.

    Every file is written under a temporary name and moved into place.

    Raises
    ------
    FileError
        If a file cannot be written.
    """
    check_folder(folder)
    written = []
    pictures: dict[str, bytes] = {}
    white = float(np.percentile(comparison.reference.illuminance_lux, 99.5))
    images = {"ray_tracing": comparison.reference, **comparison.images}
    for name, image in images.items():
        written.append(image.save(folder / f"{name}.nc"))
        written.append(write_file(folder / f"{name}.png", png(image.to_srgb(white, white_point))))
    figures = {"images": plots.retinal_images(comparison, white_point)}
    for name, error in comparison.errors.items():
        figures[f"difference_{name}"] = plots.difference_maps(name, error, comparison.reference)
    if comparison.errors:
        figures["profiles"] = plots.edge_profiles(comparison, edge_angle_deg)
    if comparison.trials:
        figures["error_against_time"] = plots.error_against_time(comparison.trials)
    for name, figure in figures.items():
        pictures[name] = png_of(figure)
        written.append(write_file(folder / f"{name}.png", pictures[name]))
    record = report_record(comparison, command)
    text = json.dumps(record, indent=1, allow_nan=False)
    written.append(write_file(folder / "report.json", text.encode()))
    page = _page(comparison, record, pictures)
    written.append(write_file(folder / "report.html", page.encode()))
    return written


def report_record(comparison: Comparison, command: str) -> dict[str, Any]:
    """Everything in numbers: trials, errors by region and wavelength, provenance."""
    return {
        "isetcl": __version__,
        "command": command,
        "machine": {
            "python": sys.version.split()[0],
            "system": platform.platform(),
            "processors": os.cpu_count(),
        },
        "is_complete": comparison.is_complete,
        "build_s": comparison.build_s,
        "total_s": comparison.total_s,
        "focus_vergence_dpt": comparison.focus_vergence_dpt,
        "trials": [asdict(trial) for trial in comparison.trials],
        "errors": {
            name: {
                "photopic": {region: asdict(value) for region, value in error.photopic.items()},
                "spectral": {
                    region: [asdict(value) for value in values]
                    for region, values in error.spectral.items()
                },
            }
            for name, error in comparison.errors.items()
        },
        "verdicts": comparison.verdicts,
        "wavelengths_nm": comparison.reference.wavelengths_nm.tolist(),
        "plan": comparison.plan_text.splitlines(),
        "reference": comparison.reference.provenance,
        "methods": {name: image.provenance for name, image in comparison.images.items()},
    }


def table_rows(comparison: Comparison) -> list[tuple[str, str, str, str, str, str]]:
    """The trials as text: method, samples, seconds, error overall, in the strip, outside it."""
    rows = []
    for trial in comparison.trials:
        rows.append(
            (
                plots.method_label(trial.method),
                "" if trial.spp is None else str(trial.spp),
                f"{trial.seconds:.2f}",
                f"{100 * trial.error:.2f}",
                f"{100 * trial.error_strip:.2f}",
                f"{100 * trial.error_outside:.2f}",
            )
        )
    return rows


TABLE_HEAD = (
    "method",
    "samples",
    "seconds",
    "error (%)",
    "in the strip (%)",
    "outside (%)",
)


def png(pixels: np.ndarray) -> bytes:
    """An image of bytes, (rows, columns, 3), as a PNG file."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, format="PNG")
    return buffer.getvalue()


_OUTSIDE = (
    "Away from depth edges the methods differ from ray tracing because one PSF, that of the "
    "middle of the image, serves the whole of it, while the eye's own PSF changes over the field "
    "(coma, and colours that part)."
)
_PROFILES = (
    "Illuminance, and irradiance at three wavelengths, along a line across the depth edge. Shaded: "
    "within a |D1 - D2| of it."
)


def _page(comparison: Comparison, record: dict[str, Any], pictures: dict[str, bytes]) -> str:
    """The self-contained HTML report."""
    return page(
        f"isetcl: {record['reference']['scene']}",
        "One retinal image, ray-traced and by PSF convolution",
        _lead(record),
        _sections(comparison, record, pictures),
        closing=f"isetcl {__version__}; all numbers are in report.json.",
    )


def _lead(record: dict[str, Any]) -> str:
    """What was rendered, in a line."""
    reference = record["reference"]
    eye, grid = reference["eye"], reference["grid"]
    focus = record["focus_vergence_dpt"]
    focused = "" if focus is None else f", focused at {focus:.3g} dpt (550 nm)"
    return (
        f"{reference['scene']}; {eye['name']} eye{focused}, "
        f"stop {eye['stop']['diameter_mm']:.3g} mm "
        f"(entrance pupil {reference['entrance_pupil_diameter_mm']:.3g} mm); "
        f"{grid['resolution'][0]} x {grid['resolution'][1]} pixels over "
        f"{grid['fov_deg'][0]:g} x {grid['fov_deg'][1]:g} deg; "
        f"{len(record['wavelengths_nm'])} wavelengths; {reference['device']}."
    )


def _sections(
    comparison: Comparison, record: dict[str, Any], pictures: dict[str, bytes]
) -> list[tuple[str, list[Block]]]:
    """Headings of the report and what stands under them."""
    sections: list[tuple[str, list[Block]]] = []
    if not comparison.is_complete:
        note = "Ctrl-C ended this comparison early; it shows what was finished."
        sections.append(("Interrupted", [Text(note)]))
    images = Picture(pictures["images"], "All in the same exposure.")
    sections.append(("Retinal images", [images]))
    if comparison.verdicts:
        text = "; ".join(comparison.verdicts.values())
        sections.append(("Predicted before a ray was traced", [Text(f"{text}.")]))
    if comparison.errors:
        differences: list[Block] = [
            Picture(
                pictures[f"difference_{name}"],
                f"{plots.method_label(name)}. Solid: depth edge; dotted: borders of the strip "
                "within a |D1 - D2| of it (a: radius of the entrance pupil, D: vergences).",
            )
            for name in comparison.errors
        ]
        sections += [
            ("Where the PSF methods differ from ray tracing", [*differences, Text(_OUTSIDE)]),
            ("Across the depth edge", [Picture(pictures["profiles"], _PROFILES)]),
        ]
    if comparison.trials:
        caption = (
            f"Kernels built before ({record['build_s']:.1f} s to the first image). The reference "
            f"has {record['reference']['samples_per_pixel']} samples, another seed."
        )
        errors: list[Block] = [
            Picture(pictures["error_against_time"], caption),
            Table(TABLE_HEAD, table_rows(comparison)),
            Text("Errors are photopic, root mean square, in % of the mean illuminance."),
        ]
        sections.append(("Error against run time", errors))
    sections += [
        ("What was compiled, and why", [Listing(comparison.plan_text)]),
        ("How to repeat it", [Listing(record["command"])]),
    ]
    return sections
