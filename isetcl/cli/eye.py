"""The commands `isetcl eye` and `isetcl mtf`: what an eye is, and what it does to light."""

from __future__ import annotations

import csv
import io
import json
import math
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from isetcl.cli import inputs
from isetcl.cli.interrupt import end_interrupted
from isetcl.errors import InvalidInputError, check_choice, check_count, check_positive

if TYPE_CHECKING:
    from isetcl.eye.aberrations.mtf_table import MtfTable
    from isetcl.eye.model import Eye
    from isetcl.eye.people.population import Population
    from isetcl.validation.transfer.three_mtfs import Section

_EYE_HELP = "A model eye by its name, such as navarro, or a file: .json, .zmx or .dat."
_PUPIL_HELP = "Diameter of the stop (iris), mm (default: 4, or that of the file)."
_FOCUS_HELP = "Dioptres ('2'), a distance ('0.5m') or 'relaxed'."
_DISTANCE_HELP = "Distance of the object, metres (default: that of --accommodation)."

EyeName = Annotated[str, typer.Argument(metavar="EYE", help=_EYE_HELP)]
Pupil = Annotated[float | None, typer.Option(help=_PUPIL_HELP)]
Wavelength = Annotated[float, typer.Option(help="Wavelength, nm.")]
Accommodation = Annotated[str, typer.Option(help=_FOCUS_HELP)]
Distance = Annotated[float | None, typer.Option(help=_DISTANCE_HELP)]


def eye(
    name: EyeName,
    pupil: Pupil = None,
    field: Annotated[str, typer.Option(help="Field angles, degrees, with commas.")] = "0,5,10",
    wavelength: Wavelength = 550.0,
    accommodation: Accommodation = "relaxed",
    distance: Distance = None,
    output: Annotated[
        Path, typer.Option("--output", "--out", "-o", help="Folder for the pictures.")
    ] = Path("isetcl-eye"),
    pictures: Annotated[
        bool, typer.Option("--pictures/--no-pictures", help="Draw, or only print.")
    ] = True,
) -> None:
    """Print the prescription of an eye and what it does to light, and draw all of it."""
    from rich.console import Console

    from isetcl.cli import tables
    from isetcl.eye.aberrations.summary import summarise

    fields = _numbers("--field", field, "0,5,10")
    check_positive("--wavelength", wavelength, "nm")
    model, object_distance = _model(name, pupil, accommodation, distance)
    _check_objects(model, fields, wavelength, object_distance)
    if pictures:
        _check_folder(output)
    summary = summarise(model, fields, wavelength, object_distance_m=object_distance)
    console = Console()
    for table in tables.eye_tables(model, summary):
        console.print(table)
    if pictures:
        record = {"command": _command(), **summary.as_dict(), "eye": model.describe()}
        _draw_all(model, fields, wavelength, object_distance, output)
        _write(output / "eye.json", _json(record))
        print(f"pictures and eye.json in {output}/, start with {output / 'overview.png'}")


def mtf(
    name: Annotated[str | None, typer.Argument(metavar="EYE", help=_EYE_HELP)] = None,
    eye_name: Annotated[str | None, typer.Option("--eye", help="The same as EYE.")] = None,
    pupil: Pupil = None,
    field: Annotated[float, typer.Option(help="Field angle, degrees.")] = 0.0,
    wavelength: Wavelength = 550.0,
    accommodation: Accommodation = "relaxed",
    distance: Distance = None,
    frequency: Annotated[
        str, typer.Option(help="Frequencies, cycles/degree, with commas.")
    ] = "5,10,20,30,60",
    step: Annotated[
        float, typer.Option(help="Step of the wavelengths of photopic light, nm.")
    ] = 10.0,
    output: Annotated[
        Path | None,
        typer.Option("--output", "--out", "-o", help="Folder for mtf.csv, mtf.json and mtf.png."),
    ] = None,
    plot: Annotated[
        bool,
        typer.Option(
            "--plot",
            help="Measure a slanted edge in a rendered image too, and draw it in three_mtfs.png "
            "beside rays, wavefront, diffraction limit and people's eyes.",
        ),
    ] = False,
    population: Annotated[
        Path | None,
        typer.Option(help="Zernike statistics of people for --plot: .npz, .mat or .csv."),
    ] = None,
    section: Annotated[
        str | None,
        typer.Option(
            help="What --plot draws off the axis: sagittal (across stripes along the field; the "
            "default) or tangential."
        ),
    ] = None,
    spp: Annotated[int, typer.Option(help="Samples a pixel and band of that image.")] = 256,
) -> None:
    """Print the MTF of an eye: one wavelength and photopic light, with and without diffraction."""
    from rich.console import Console

    from isetcl.cli import tables
    from isetcl.eye.aberrations.mtf_table import mtf_table

    frequencies = _numbers("--frequency", frequency, "5,10,20,30,60")
    if min(frequencies) < 0:
        raise InvalidInputError(f"--frequency must be >= 0 cycles/degree, got {frequency!r}")
    check_positive("--wavelength", wavelength, "nm")
    check_positive("--step", step, "nm")
    check_count("--spp", spp, 2)
    model, object_distance = _model(_only(name, eye_name), pupil, accommodation, distance)
    _check_objects(model, [field], wavelength, object_distance)
    people = _people(plot, population)
    drawn = _section(plot, section)
    folder = Path("isetcl-mtf") if plot and output is None else output
    if folder is not None:
        _check_folder(folder)
    options: dict[str, Any] = {"step_nm": step, "object_distance_m": object_distance}
    wanted = np.union1d(frequencies, np.linspace(0.0, max(60.0, *frequencies), 61))
    try:
        found = mtf_table(model, wanted, field, wavelength, **options)
    except KeyboardInterrupt:
        end_interrupted(" before there was an MTF")
    for column, reason in found.refused.items():
        inputs.note(f"no {column}: {reason}")
    Console().print(tables.mtf(found.at(frequencies)))
    if folder is not None:
        _write_mtf(found, frequencies, model, folder, options)
        print(f"mtf.csv, mtf.json, mtf.png in {folder}/")
    if plot and folder is not None:
        from isetcl.cli import mtf_drawing

        view = (field, object_distance, max(60.0, *frequencies), step, spp)
        try:
            picture, rows, summary = mtf_drawing.three_ways(model, view, people, drawn)
        except KeyboardInterrupt:
            end_interrupted(" before the edge was measured")
        _save(picture, folder / "three_mtfs.png", 110)
        _write(folder / "three_mtfs.csv", rows.encode())
        print(f"{summary}\nthree_mtfs.csv, three_mtfs.png in {folder}/")


def _model(
    name: str, pupil: float | None, accommodation: str, distance: float | None
) -> tuple[Eye, float]:
    """The eye of a name or a file, accommodated, and the distance of its object in metres."""
    from isetcl.eye import catalog
    from isetcl.eye.files.load import load_eye

    focus = inputs.vergence(accommodation)
    if focus == "centre":
        raise InvalidInputError(
            "--accommodation must be dioptres (2), a distance (0.5m) or 'relaxed', got 'centre'"
        )
    wanted = None if isinstance(focus, str) else focus
    path = Path(name)
    if path.suffix.lower() in catalog.FILE_SUFFIXES:
        model = load_eye(path, pupil_diameter_mm=pupil)
        if wanted is not None:
            model = model.focus_at(1.0 / wanted if wanted else math.inf)
    else:
        model = catalog.by_name(name, 4.0 if pupil is None else pupil, wanted)
    if distance is not None:
        away = math.inf if math.isinf(distance) else check_positive("--distance", distance, "m")
        return model, away
    return model, 1.0 / wanted if wanted is not None and wanted > 0 else math.inf


def _only(name: str | None, other: str | None) -> str:
    """The eye that was named, in one of two ways."""
    if (name is None) == (other is None):
        raise InvalidInputError(
            "name one eye, as EYE or with --eye, such as isetcl mtf navarro, got "
            + ("none" if name is None else f"{name!r} and {other!r}")
        )
    return str(name if other is None else other)


def _people(plot: bool, file: Path | None) -> Population | None:
    """The statistics of a file; read before any work."""
    from isetcl.eye.people.population import load_population

    if file is not None and not plot:
        raise InvalidInputError("--population is drawn by --plot only; add --plot")
    return None if file is None else load_population(file)


def _section(plot: bool, section: str | None) -> Section:
    """The section to draw."""
    if section is None:
        return "sagittal"
    if not plot:
        raise InvalidInputError("--section is drawn by --plot only; add --plot")
    wanted = check_choice("--section", section, ("sagittal", "tangential"))
    return "tangential" if wanted == "tangential" else "sagittal"


def _numbers(option: str, text: str, example: str) -> tuple[float, ...]:
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if not values or not all(map(math.isfinite, values)):
        raise InvalidInputError(
            f"{option} must be numbers with commas, such as {example}, got {text!r}"
        )
    return values


def _check_objects(
    model: Eye, fields: Sequence[float], wavelength: float, object_distance: float
) -> None:
    """Refuse field angles from which no chief ray enters, and objects inside the eye."""
    from isetcl.eye.object_point import ObjectPoint

    for field in fields:
        ObjectPoint(model, field, wavelength, object_distance).chief()


def _draw_all(
    model: Eye, fields: tuple[float, ...], wavelength: float, distance: float, folder: Path
) -> None:
    """Every picture, and all on one page."""
    from matplotlib.figure import Figure

    from isetcl.eye.pictures.overview import PAGE_IN, Overview

    overview = Overview(model, fields, wavelength, distance)
    for picture in overview.names():
        figure = Figure(figsize=overview.size_in(picture), layout="constrained")
        refused = overview.draw_or_say(picture, figure)
        if refused is not None:
            inputs.note(f"not drawn: {refused}")
        _save(figure, folder / f"{picture}.png", 120)
    page = Figure(figsize=PAGE_IN, layout="constrained")
    overview.page(page)
    _save(page, folder / "overview.png", 100)


def _write_mtf(
    dense: MtfTable,
    frequencies: tuple[float, ...],
    model: Eye,
    folder: Path,
    options: dict[str, Any],
) -> None:
    """The table as CSV and JSON, and curves through more frequencies."""
    from matplotlib.figure import Figure

    from isetcl.eye.pictures import curve_pictures

    found = dense.at(frequencies)
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(["frequency_cpd", *found.columns])
    for i, value in enumerate(found.frequency_cpd):
        writer.writerow([value, *(column[i] for column in found.columns.values())])
    _write(folder / "mtf.csv", text.getvalue().encode())
    distance = options["object_distance_m"]
    record = {
        "command": _command(),
        "field_deg": found.field_deg,
        "wavelength_nm": found.wavelength_nm,
        "object_distance_m": None if math.isinf(distance) else distance,
        "step_nm": options["step_nm"],
        "frequency_cpd": found.frequency_cpd.tolist(),
        "mtf": {name: column.tolist() for name, column in found.columns.items()},
        "refused": found.refused,
        "eye": model.describe(),
    }
    _write(folder / "mtf.json", _json(record))
    figure = Figure(figsize=(8.0, 5.4), layout="constrained")
    axes = curve_pictures.draw_mtf_table(dense, figure.subplots())
    title = f"{model.name}, {model.stop.diameter_mm:g} mm stop, {axes.get_title()}"
    axes.set_title(title, fontsize="medium")
    _save(figure, folder / "mtf.png", 100)


def _save(figure: Any, path: Path, dpi: int) -> None:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi)
    _write(path, buffer.getvalue())


def _write(path: Path, data: bytes) -> None:
    from isetcl.output import write_file

    write_file(path, data)


def _check_folder(folder: Path) -> None:
    from isetcl.output import check_folder

    check_folder(folder)


def _json(record: dict[str, Any]) -> bytes:
    """Text of a record; arrays become lists."""
    return json.dumps(record, indent=1, default=lambda value: value.tolist()).encode()


def _command() -> str:
    return shlex.join(["isetcl", *sys.argv[1:]])
