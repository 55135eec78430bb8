"""Tables of an eye for the terminal, as Rich draws them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from isetcl.eye.pictures.picture_parts import field_name
from isetcl.eye.waves.zernike import osa_nm

if TYPE_CHECKING:
    from rich.table import Table

    from isetcl.eye.aberrations.mtf_table import MtfTable
    from isetcl.eye.aberrations.summary import EyeSummary, FieldSummary
    from isetcl.eye.model import Eye
    from isetcl.eye.retina import Retina
    from isetcl.eye.surface import Surface

NOTHING = "–"


def eye_tables(eye: Eye, summary: EyeSummary) -> Iterator[Table]:
    """The prescription, the numbers of the whole eye, those of field angles, Zernike terms."""
    yield _prescription(eye, summary)
    yield _whole_eye(summary)
    yield _fields(summary)
    if any(field.zernike is not None for field in summary.fields):
        yield _zernikes(summary)


def mtf(found: MtfTable) -> Table:
    """Modulation transfer by frequency."""
    title = f"MTF at {field_name(found.field_deg)}, frequencies in cycles/degree"
    table = _table(title, "light, model")
    for frequency in found.frequency_cpd:
        table.add_column(f"{frequency:g}", justify="right")
    for light, model, section, values in found.curves():
        cells = [NOTHING] * len(found.frequency_cpd)
        if values is not None:
            cells = [f"{value:.3f}" for value in values]
        table.add_row(found.label(light, model, section), *cells)
    return table


def _table(title: str, first: str | None = None) -> Table:
    from rich.table import Table

    table = Table(title=title, title_justify="left", title_style="bold")
    if first is not None:
        table.add_column(first, no_wrap=True)
    return table


def _prescription(eye: Eye, summary: EyeSummary) -> Table:
    title = f"{eye.name}: prescription in mm, indices at {summary.wavelength_nm:g} nm"
    table = _table(title, "surface")
    for head in ("z", "radius", "conic", "semi-\ndiameter", "index\nafter"):
        table.add_column(head, justify="right")
    table.add_column("medium\nafter")
    index = eye.indices(summary.wavelength_nm)
    rows = [
        (
            surface.name,
            f"{surface.vertex_z_mm:.4g}",
            _radius(surface.radius_mm),
            f"{surface.conic:.4g}",
            f"{surface.semi_diameter_mm:.4g}",
            f"{index[i + 1]:.5f}",
            surface.medium_after.name,
            _form(surface),
        )
        for i, surface in enumerate(eye.surfaces)
    ]
    stop, retina = eye.stop, eye.retina
    hole = f"{stop.radius_mm:.4g}"
    form = "" if stop.is_rotational else "ellipse" if stop.aspect != 1.0 else "shifted"
    place = f"{stop.z_mm:.4g}"
    rows.insert(eye.stop_index, ("stop", place, NOTHING, NOTHING, hole, "", "", form))
    place, radius = f"{retina.vertex_z_mm:.4g}", _radius(retina.radius_mm)
    rows.append(("retina", place, radius, f"{retina.conic:.4g}", "", "", "", _form(retina)))
    has_forms = any(row[-1] for row in rows)
    if has_forms:
        table.add_column("form")
    for row in rows:
        table.add_row(*(row if has_forms else row[:-1]))
    return table


def _form(surface: Surface | Retina) -> str:
    """What a surface is besides a centred conic."""
    words = [] if surface.shape is None else [type(surface.shape).__name__]
    if surface.placement is not None:
        words.append("placed" if surface.placement.is_centred else "tilted or shifted")
    return ", ".join(words)


def _whole_eye(summary: EyeSummary) -> Table:
    table = _table(f"{summary.name} at {summary.wavelength_nm:g} nm", "quantity")
    table.add_column("value", justify="right")
    table.add_column("unit")
    c, before, behind = summary.cardinal, summary.entrance_pupil, summary.exit_pupil
    span = f"{summary.lca_range_nm[0]:g} to {summary.lca_range_nm[1]:g} nm"
    rows: tuple[tuple[str, float | None, str], ...] = (
        ("power", c.power_dpt, "dpt"),
        ("focal length, front and back", c.focal_length_front_mm, "mm"),
        ("", c.focal_length_back_mm, "mm"),
        ("focal points F, F'", c.focal_point_front_mm, "mm"),
        ("", c.focal_point_back_mm, "mm"),
        ("principal points H, H'", c.principal_point_front_mm, "mm"),
        ("", c.principal_point_back_mm, "mm"),
        ("nodal points N, N'", c.nodal_point_front_mm, "mm"),
        ("", c.nodal_point_back_mm, "mm"),
        ("entrance pupil, place", before.z_mm, "mm"),
        ("entrance pupil, diameter", before.diameter_mm, "mm"),
        ("exit pupil, place", behind.z_mm, "mm"),
        ("exit pupil, diameter", behind.diameter_mm, "mm"),
        ("axial length", summary.axial_length_mm, "mm"),
        ("in focus: paraxial", summary.focus_paraxial_dpt, "dpt"),
        ("in focus: smallest spot", summary.focus_rms_dpt, "dpt"),
        (f"LCA, {span}", summary.lca_dpt, "dpt"),
        ("largest field angle", summary.max_field_deg, "deg"),
    )
    for name, value, unit in rows:
        table.add_row(name, _number(value, 5), unit)
    return table


def _fields(summary: EyeSummary) -> Table:
    away = summary.object_distance_m
    where = "at infinity" if math.isinf(away) else f"{away:g} m away"
    table = _table(f"image of an object {where}, {summary.wavelength_nm:g} nm", "quantity")
    rows = (
        ("spot radius, RMS (arcmin)", lambda f: f.spot_rms_arcmin),
        ("wavefront error, RMS (µm)", lambda f: f.rms_um),
        ("Strehl ratio", lambda f: f.strehl),
        ("refraction, M (dpt)", lambda f: _part(f, "m_dpt")),
        ("refraction, J0 (dpt)", lambda f: _part(f, "j0_dpt")),
        ("refraction, J45 (dpt)", lambda f: _part(f, "j45_dpt")),
        ("tangential focus (dpt)", lambda f: f.tangential_dpt),
        ("sagittal focus (dpt)", lambda f: f.sagittal_dpt),
    )
    for field in summary.fields:
        table.add_column(field_name(field.field_deg), justify="right")
    for name, value in rows:
        table.add_row(name, *(_number(value(field)) for field in summary.fields))
    return table


def _part(field: FieldSummary, name: str) -> float | None:
    return None if field.refraction is None else float(getattr(field.refraction, name))


def _zernikes(summary: EyeSummary) -> Table:
    from isetcl.eye.pictures.wave_pictures import TERM_NAMES

    fits = [field.zernike for field in summary.fields]
    radius = next(fit.radius_mm for fit in fits if fit is not None)
    table = _table(f"Zernike terms (OSA/ANSI), µm, radius about {radius:.3g} mm", "term")
    for field in summary.fields:
        table.add_column(field_name(field.field_deg), justify="right")
    terms = max(len(fit.coefficients_um) for fit in fits if fit is not None)
    for n, m in map(osa_nm, range(3, terms)):
        cells = [NOTHING if fit is None else _signed(fit.coefficient_um(n, m)) for fit in fits]
        if set(cells) <= {"0", NOTHING}:
            continue
        table.add_row(f"Z({n}, {m}) {TERM_NAMES.get((n, m), '')}".rstrip(), *cells)
    return table


def _signed(value: float) -> str:
    return "0" if abs(value) < 5e-5 else f"{value:+.4f}"


def _radius(value: float) -> str:
    return "plane" if math.isinf(value) else f"{value:.5g}"


def _number(value: float | None, digits: int = 3) -> str:
    if value is None:
        return NOTHING
    # Rounding errors of what is 0 by symmetry are no news.
    return f"{0.0 if abs(value) < 1e-9 else value:.{digits}g}"
