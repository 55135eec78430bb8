"""The files of a comparison: images, maps, plots, report.html and report.json."""

from __future__ import annotations

import base64
import html
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
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=120, bbox_inches="tight")
        pictures[name] = buffer.getvalue()
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


_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 1180px; margin: 2em auto;
  padding: 0 1em; }
h1 { font-size: 1.6em; margin-bottom: 0.2em; } h2 { font-size: 1.2em; margin-top: 2em; }
img { max-width: 100%; height: auto; } figure { margin: 1em 0; }
figcaption { color: #555; font-size: 0.92em; }
table { border-collapse: collapse; } th, td { padding: 0.3em 0.9em; text-align: right;
  border-bottom: 1px solid #ddd; } th:first-child, td:first-child { text-align: left; }
th { font-weight: 600; } pre { background: #f6f6f6; padding: 0.8em; overflow-x: auto;
  font-size: 0.82em; } .lead { color: #444; }
.wide { overflow-x: auto; }
"""


_OUTSIDE = (
    "<p>Away from depth edges the methods differ from ray tracing because one PSF, that of the "
    "middle of the image, serves the whole of it, while the eye's own PSF changes over the field "
    "(coma, and colours that part).</p>"
)
_PROFILES = (
    "Illuminance, and irradiance at three wavelengths, along a line across the depth edge. Shaded: "
    "within a |D1 - D2| of it."
)


def _page(comparison: Comparison, record: dict[str, Any], pictures: dict[str, bytes]) -> str:
    """The self-contained HTML report."""
    content = "".join(
        f"<h2>{html.escape(title)}</h2>{part}"
        for title, part in _sections(comparison, record, pictures)
    )
    scene = html.escape(record["reference"]["scene"])
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>isetcl: {scene}</title><style>{_STYLE}</style></head>"
        f"<body><h1>One retinal image, ray-traced and by PSF convolution</h1>"
        f'<p class="lead">{html.escape(_lead(record))}</p>{content}'
        f'<p class="lead">isetcl {__version__}; all numbers are in report.json.</p></body></html>'
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
) -> list[tuple[str, str]]:
    """Headings of the report and what stands under them."""

    def figure(name: str, caption: str) -> str:
        data = base64.b64encode(pictures[name]).decode()
        return (
            f'<figure><img alt="{html.escape(caption)}" src="data:image/png;base64,{data}">'
            f"<figcaption>{html.escape(caption)}</figcaption></figure>"
        )

    sections = []
    if not comparison.is_complete:
        note = "<p>Ctrl-C ended this comparison early; it shows what was finished.</p>"
        sections.append(("Interrupted", note))
    sections.append(("Retinal images", figure("images", "All in the same exposure.")))
    if comparison.verdicts:
        text = "; ".join(html.escape(text) for text in comparison.verdicts.values())
        sections.append(("Predicted before a ray was traced", f"<p>{text}.</p>"))
    if comparison.errors:
        differences = "".join(
            figure(
                f"difference_{name}",
                f"{plots.method_label(name)}. Solid: depth edge; dotted: borders of the strip "
                "within a |D1 - D2| of it (a: radius of the entrance pupil, D: vergences).",
            )
            for name in comparison.errors
        )
        sections += [
            ("Where the PSF methods differ from ray tracing", differences + _OUTSIDE),
            ("Across the depth edge", figure("profiles", _PROFILES)),
        ]
    if comparison.trials:
        caption = (
            f"Kernels built before ({record['build_s']:.1f} s to the first image). The reference "
            f"has {record['reference']['samples_per_pixel']} samples, another seed."
        )
        plot = figure("error_against_time", caption)
        sections.append(("Error against run time", plot + _table(comparison)))
    sections += [
        ("What was compiled, and why", f"<pre>{html.escape(comparison.plan_text)}</pre>"),
        ("How to repeat it", f"<pre>{html.escape(record['command'])}</pre>"),
    ]
    return sections


def _table(comparison: Comparison) -> str:
    """The trials as an HTML table."""
    head = "".join(f"<th>{html.escape(name)}</th>" for name in TABLE_HEAD)
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>"
        for row in table_rows(comparison)
    )
    return (
        f'<div class="wide"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
        "<p>Errors are photopic, root mean square, in % of the mean illuminance.</p>"
    )
