"""The report of `isetcl validate --report`: what was measured here and now, as one HTML page.

Parts are independent: one that fails says so in the page, and the others are still there.
"""

from __future__ import annotations

import datetime
import hashlib
import importlib.metadata
import json
import os
import platform
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from isetcl.errors import check_choice, check_type
from isetcl.output import check_folder, write_file
from isetcl.page import Block, Listing, Picture, Table, Text, page, png_of
from isetcl.version import __version__

StepCallback = Callable[[str, float], None]

_PACKAGES = (
    *("numpy", "scipy", "xarray", "pyopencl", "pocl-binary-distribution", "trimesh"),
    *("scikit-image", "colour-science", "matplotlib", "h5netcdf"),
)
_LARGEST_AWAY = 0.01  # of an even field
_LARGEST_DIFFERENCE = 0.01
"""Largest difference of three ways to an MTF beyond four standard errors of the edge's."""

_ZEMAX_PUPIL_MM = 4.0


@dataclass(frozen=True)
class Part:
    """What one part of the report found.

    Parameters
    ----------
    blocks
        What stands in the page.
    failures
        What is not as it must be, in words.
    record
        The numbers, as plain values.
    """

    blocks: Sequence[Block]
    failures: Sequence[str] = ()
    record: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class ReportResult:
    """A report that was written.

    Parameters
    ----------
    files
        report.html and report.json.
    failures
        What failed, by part.
    is_complete
        False if Ctrl-C ended it early; it then holds the parts that were finished.
    """

    files: tuple[Path, ...]
    failures: dict[str, tuple[str, ...]]
    is_complete: bool = True


def write_validation_report(
    folder: str | Path,
    *,
    parts: Sequence[str] | None = None,
    is_draft: bool = False,
    device: str | None = None,
    command: str = "",
    on_step: StepCallback | None = None,
) -> ReportResult:
    """Measure everything and write report.html and report.json.

    Parameters
    ----------
    folder
        Where to write; made if it is not there.
    parts
        Some of `report_parts`; None is all of them.
    is_draft
        Few samples and small figures: minutes on two cores.
    device
        See `find_device`; the stability suite runs on every device without one.
    command
        How the report was asked for, to be shown.
    on_step
        Called with what is being done and the fraction done.

    Raises
    ------
    FileError
        If the folder cannot be written.
    InvalidInputError
        If a part is unknown.
    DeviceError
        If there is no device.
    KeyboardInterrupt
        If interrupted before a part was finished.
    """
    from isetcl.device.choose import find_device

    check_type("is_draft", is_draft, bool)
    names = list(_PARTS) if parts is None else list(dict.fromkeys(parts))
    for name in names:
        check_choice("part of the report", name, _PARTS)
    target = Path(folder)
    check_folder(target, "--report")
    find_device(device)
    done: dict[str, tuple[Part, float]] = {}
    is_complete = True
    for i, name in enumerate(names):
        if on_step is not None:
            on_step(_PARTS[name][0], i / len(names))
        start = time.perf_counter()
        try:
            part = _PARTS[name][1](is_draft, device)
        except KeyboardInterrupt:
            if not done:
                raise
            is_complete = False
            break
        except Exception as error:
            words = f"{type(error).__name__}: {error}"
            part = Part([Text(words), Listing(traceback.format_exc())], [words])
        done[name] = part, time.perf_counter() - start
    return _write(target, done, is_draft, command, is_complete)


def report_parts() -> dict[str, str]:
    """Names of the parts of the report, with their titles."""
    return {name: title for name, (title, _) in _PARTS.items()}


def _write(
    target: Path,
    done: dict[str, tuple[Part, float]],
    is_draft: bool,
    command: str,
    is_complete: bool,
) -> ReportResult:
    where = _where()
    failures = {name: tuple(part.failures) for name, (part, _) in done.items() if part.failures}
    record = {
        **where,
        "command": command,
        "quality": "draft" if is_draft else "default",
        "is_complete": is_complete,
        "failures": failures,
        "parts": {
            name: {"seconds": round(seconds, 2), **part.record}
            for name, (part, seconds) in done.items()
        },
    }
    text = json.dumps(record, indent=1, default=_plain)
    files = [write_file(target / "report.json", text.encode())]
    rows = [
        (
            _PARTS[name][0],
            "; ".join(part.failures) or "as it must be",
            f"{seconds:.0f}",
        )
        for name, (part, seconds) in done.items()
    ]
    summary = Table(
        ("part", "finding", "seconds"), rows, is_wordy=True, verdicts=(["as it must be"], ())
    )
    sections: list[tuple[str, Sequence[Block]]] = [("Summary", [summary])]
    sections += [(_PARTS[name][0], part.blocks) for name, (part, _) in done.items()]
    sections.append(("Versions, devices and hashes", _versions(where, command)))
    content = page(
        f"isetcl {__version__}: validation",
        f"isetcl {__version__}: what was measured",
        f"{where['date']}, {where['machine']['system']}, "
        f"{'; '.join(each['device'] for each in where['devices'])}; quality: {record['quality']}"
        f"{'.' if is_complete else '; interrupted, with the parts that were finished.'}",
        sections,
        has_contents=True,
        closing="All numbers are in report.json.",
    )
    files.append(write_file(target / "report.html", content.encode()))
    return ReportResult(tuple(files), failures, is_complete)


def _plain(value: Any) -> Any:
    return np.asarray(value).tolist()


def _where() -> dict[str, Any]:
    """Versions, machine, devices and hashes of what ran."""
    from isetcl.device.devices import list_devices

    versions = {}
    for name in _PACKAGES:
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            versions[name] = "absent"
    return {
        "isetcl": __version__,
        "date": datetime.datetime.now(tz=datetime.timezone.utc).isoformat(timespec="seconds"),
        "machine": {
            "python": sys.version.split()[0],
            "system": platform.platform(),
            "processors": os.cpu_count(),
        },
        "packages": versions,
        "devices": [each.describe() for each in list_devices()],
        "sha256": {
            "package": _hash_of((".py", ".cl", ".csv")),
            "kernels": _hash_of((".cl",)),
        },
    }


def _hash_of(suffixes: tuple[str, ...]) -> str:
    """SHA-256 over the names and contents of the package's files, in the order of their names."""
    total = hashlib.sha256()
    package = Path(__file__).parent
    for path in sorted(p for p in package.rglob("*") if p.suffix in suffixes):
        total.update(path.relative_to(package).as_posix().encode() + b"\0" + path.read_bytes())
    return total.hexdigest()


def _versions(where: dict[str, Any], command: str) -> list[Block]:
    rows = [("Python", where["machine"]["python"]), *where["packages"].items()]
    devices = [(d["platform"], d["device"], d["driver"]) for d in where["devices"]]
    blocks: list[Block] = [
        Table(("package", "version"), rows, is_wordy=True),
        Table(("platform", "device", "driver"), devices, is_wordy=True),
        Table(("SHA-256 of", "value"), list(where["sha256"].items()), is_wordy=True),
    ]
    return [*blocks, Listing(command)] if command else blocks


def _stability(is_draft: bool, device: str | None) -> Part:
    """The extreme cases on every device."""
    from isetcl.validation.stability import run
    from isetcl.validation.stability.suite import number

    reports = run(device)
    blocks: list[Block] = []
    failures = []
    for report in reports:
        rows = [
            (
                str(o.case.number),
                o.case.title,
                o.case.expected,
                "float32" if o.precision == "single" else "float64",
                "" if o.verdict == "not applicable" else f"{number(o.value)} {o.case.unit}",
                number(o.case.tolerance(o.precision)),
                o.verdict,
            )
            for o in report.outcomes
        ]
        name = f"{report.device['platform']}: {report.device['device']}"
        head = ("case", "input", "expected", "precision", "measured", "allowed", "verdict")
        bad = sorted({o.verdict for o in report.failures})
        blocks.append(Table(head, rows, name, is_wordy=True, verdicts=(["pass"], bad)))
        failures += [f"case {o.case.number} in {o.precision} on {name}" for o in report.failures]
    return Part(blocks, failures, {"reports": [report.record() for report in reports]})


def _transfer(is_draft: bool, device: str | None) -> Part:
    """Three ways to the MTF of Navarro's eye."""
    import matplotlib.pyplot as plt

    from isetcl.eye import catalog
    from isetcl.validation import three_mtfs

    figure, axes = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
    rows, failures, record = [], [], {}
    for ax, pupil in zip(axes, (3.0, _ZEMAX_PUPIL_MM), strict=True):
        found = three_mtfs(
            catalog.navarro(pupil_diameter_mm=pupil), spp=64 if is_draft else 256, device=device
        )
        found.plot(ax)
        ax.set_title(f"Navarro, stop {pupil:g} mm, {found.light}")
        noise = float(np.max(found.slanted_edge_error))
        record[f"{pupil:g} mm"] = found.differences() | {"standard_error": noise}
        for pair, value in found.differences().items():
            rows.append((f"{pupil:g} mm", pair, f"{value:.4f}", f"{noise:.4f}"))
            if value > _LARGEST_DIFFERENCE + 4.0 * noise:
                failures.append(f"{pair} differ by {value:.3f} at {pupil:g} mm")
    head = ("stop", "ways", "largest difference", "standard error of the edge's")
    words = "Geometric, at 550 nm: from the slanted edge of a rendered image, from the rays of a "
    picture = Picture(png_of(figure), words + "point, and from the normals of the wavefront.")
    return Part([picture, Table(head, rows)], failures, {"differences": record})


def _occlusion(is_draft: bool, device: str | None) -> Part:
    """Errors of PSF methods at depth edges."""
    from isetcl.validation import occlusion_study

    study = occlusion_study(
        columns=30 if is_draft else 60, reference_spp=256 if is_draft else 1024, device=device
    )
    if not study.is_complete:
        raise KeyboardInterrupt
    data = study.dataset
    caption = (
        "Errors in the strip of half-width a |D1 - D2| beside a depth edge, and away from it, "
        "farther than any light is blurred, with bounds of 95 %; profiles across the edge; and "
        "errors by setting. Away from the edge what is left is the samples of the methods' views."
    )
    rows = study.rows()
    blocks: list[Block] = [Picture(png_of(study.plot()), caption), Table(rows[0], rows[1:])]
    # The sum of layers adds hidden light within the strip, and nothing beyond it.
    summed = data.sel(kind="layered_sum")
    ratio = float((summed["strip_rms"] / summed["outside_rms"]).min())
    failures = [] if ratio > 3.0 else [f"errors in the strip are only {ratio:.2g} times the others"]
    away = float(summed["away_rms_low"].max())
    if away > _LARGEST_AWAY:
        failures.append(f"away from depth edges the sum of layers is wrong by {100 * away:.2g} %")
    shown = ("strip_rms", "outside_rms", "away_rms", "away_rms_low", "away_rms_high")
    record = {name: data[name].values for name in (*shown, "reach_arcmin")}
    return Part(blocks, failures, record | {"kinds": data["kind"].values})


def _work_precision(is_draft: bool, device: str | None) -> Part:
    """Error against run time of ray tracing and of two PSF methods."""
    import matplotlib.pyplot as plt

    from isetcl.eye import catalog
    from isetcl.scene import targets
    from isetcl.validation import SceneMethod, work_precision

    spp = (4, 16) if is_draft else (4, 16, 64, 256)
    found = work_precision(
        [SceneMethod("ray_tracing", "spp", spp), "layered_sum", "layered_over"],
        scene=targets.two_planes(near_m=0.5, far_m=2.0),
        eye=catalog.navarro(pupil_diameter_mm=4.0, accommodation_dpt=2.0),
        fov_deg=2.0,
        resolution=32 if is_draft else 128,
        replicates=8 if is_draft else 16,
        least_s=0.05 if is_draft else 0.2,
        parts=not is_draft,
        allow_noise=True,
        device=device,
    )
    caption = "Relative root-mean-square error against time; bars are intervals of 95 %."
    figure, ax = plt.subplots(figsize=(8.0, 5.0), layout="constrained")
    found.plot(ax)
    other, ax = plt.subplots(figsize=(8.0, 5.0), layout="constrained")
    found.plot(ax, error="cone_noise")
    pictures: list[Block] = [
        Picture(png_of(figure), caption),
        Picture(png_of(other), "The same in units of the Poisson noise of a cone."),
    ]
    rows = found.rows()
    words: list[Block] = [Text(line) for line in (*found.summary(), *found.notes)]
    return Part([*pictures, Table(rows[0], rows[1:]), *words], (), found.record())


def _figures(is_draft: bool, device: str | None) -> Part:
    """The paper's figures."""
    import tempfile

    from isetcl.figures import FIGURES, Quality

    blocks: list[Block] = []
    failures: list[str] = []
    record: dict[str, Any] = {}
    head = ("quantity", "isetcl", "paper", "source", "verdict", "reason")
    verdicts = (["agrees"], ["differs"])
    with tempfile.TemporaryDirectory() as folder:
        for number, figure in FIGURES.items():
            found = figure.draw(Path(folder), Quality(is_draft, device))
            rows = [
                (r.quantity, r.isetcl, r.paper, r.source, r.verdict, r.reason) for r in found.rows
            ]
            title = f"Figure {number}: {found.title}"
            blocks.append(Picture(found.files[0].read_bytes(), title))
            blocks.append(Table(head, rows, is_wordy=True, verdicts=verdicts))
            failures += [f"Figure {number}: {row.quantity}" for row in found.unexplained]
            record[str(number)] = [dict(zip(head, row, strict=True)) for row in rows]
    return Part(blocks, failures, {"figures": record})


_PARTS: dict[str, tuple[str, Callable[[bool, str | None], Part]]] = {
    "stability": ("Extreme cases", _stability),
    "mtf": ("Three ways to an MTF", _transfer),
    "occlusion": ("PSF methods at depth edges", _occlusion),
    "work-precision": ("Error against run time", _work_precision),
    "figures": ("The figures of Lian et al. 2019", _figures),
}
