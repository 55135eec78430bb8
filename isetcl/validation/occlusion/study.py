"""How wrong PSF methods are at a depth edge, over depths, focus, pupil, texture and wavelength.

Every cell of the grid is one pair of planes with a vertical edge, imaged by ray tracing and by
every method. Its field is as wide as the strip of half-width a |D1 - D2| asks for, so that profiles
of all cells lie on one axis: distance from the edge in half-widths, positive on the far plane.
"""

from __future__ import annotations

import itertools
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from isetcl import psf_baseline
from isetcl.errors import (
    InvalidInputError,
    check_between,
    check_choice,
    check_count,
    check_positive,
    check_type,
)
from isetcl.eye import catalog
from isetcl.eye.model import Eye
from isetcl.netcdf import save_dataset
from isetcl.spectrum import check_wavelengths
from isetcl.validation.occlusion.cells import FIGURES, REGIONS, EyeMaker, Log, Work, key
from isetcl.validation.occlusion.edge_scene import EdgeScene

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

StepCallback = Callable[[str, float], None]
Focus = float | Literal["near", "far"]

_SHOWN = ("strip_rms", "outside_rms", "away_rms", "away_rms_high", "largest")

AXES = ("near_m", "far_m", "focus", "pupil_mm", "contrast", "frequency_cpd")


@dataclass(frozen=True, eq=False)
class OcclusionStudy:
    """Errors of PSF methods over a grid of scenes and eyes.

    Attributes
    ----------
    dataset : xarray.Dataset
        Dimensions ``kind`` (the PSF method), ``near_m``, ``far_m``, ``focus``, ``pupil_mm``,
        ``contrast``, ``frequency_cpd``, ``wavelength`` (nm) and ``offset`` (distance from the edge
        in half-widths of the strip, > 0 on the far plane). In three regions, the ``strip``, all
        ``outside`` it, and ``away``: beyond `blur_reach_arcmin`, where no light that passed the
        edge is blurred to, NaN where the field is narrower: ``strip_rms``, less the noise of the
        reference, from ``strip_rms_low`` to ``strip_rms_high`` with 95 %, and ``strip_bias``, and
        so on for the others. ``largest``;
        ``integral_arcmin`` (of the absolute mean profile); ``reach_arcmin`` (how far from the edge,
        without a gap, columns are wrong by more than `reach_error` and four standard errors);
        ``profile`` and ``profile_rms``; all relative to an even field of level 1.
        ``half_width_arcmin``: a |D1 - D2|.
    provenance : dict
        Settings, cells and time.
    is_complete
        False if it was interrupted; cells that are missing are NaN.
    """

    dataset: xarray.Dataset
    provenance: dict[str, Any]
    is_complete: bool = True

    def table(self, wavelength_nm: float | None = None) -> str:
        """Root-mean-square error in the strip and outside it, a line for each cell and method.

        Parameters
        ----------
        wavelength_nm
            The nearest is shown; None is the middle one.
        """
        rows = self.rows(wavelength_nm)
        widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
        lines = ("  ".join(c.ljust(w) for c, w in zip(r, widths, strict=True)) for r in rows)
        return "\n".join(line.rstrip() for line in lines)

    def rows(self, wavelength_nm: float | None = None) -> list[list[str]]:
        """The table's cells, the names of the columns first; see `table`."""
        known = self.dataset["wavelength"].values
        wanted = known[len(known) // 2] if wavelength_nm is None else wavelength_nm
        data = self.dataset.sel(wavelength=wanted, method="nearest")
        head = [
            *AXES,
            "method",
            "half-width arcmin",
            "reach arcmin",
            "strip %",
            "outside %",
            "away %",
            "away, at most %",
            "largest %",
        ]
        rows = [head]
        places = [range(data.sizes[axis]) for axis in AXES]
        for place in itertools.product(*places):
            cell = data.isel(dict(zip(AXES, place, strict=True)))
            if not np.isfinite(cell["half_width_arcmin"].item()):
                continue  # the near plane is not nearer
            names = [_word(cell[axis].item()) for axis in AXES]
            for kind in data["kind"].values:
                own = cell.sel(kind=kind)
                numbers = [
                    cell["half_width_arcmin"].item(),
                    own["reach_arcmin"].item(),
                    *(100.0 * own[n].item() for n in _SHOWN),
                ]
                rows.append([*names, str(kind), *(_number(n) for n in numbers)])
        return rows

    def plot(self, wavelength_nm: float | None = None) -> Figure:
        """Errors in and outside the strip by method, and profiles across the edge."""
        from isetcl.validation.occlusion.picture import draw

        return draw(self, wavelength_nm)

    def save(self, path: str | Path) -> Path:
        """Write the dataset as NetCDF; returns the path.

        Raises
        ------
        FileError
            If it cannot be written.
        """
        data = self.dataset.assign_attrs(provenance=json.dumps(self.provenance))
        return save_dataset(data, path)


def occlusion_study(
    methods: Sequence[str] | Literal["all"] = "all",
    *,
    near_m: Sequence[float] = (0.5,),
    far_m: Sequence[float] = (2.0,),
    focus: Sequence[Focus] = ("near", "far"),
    pupil_mm: Sequence[float] = (2.0, 4.0),
    contrast: Sequence[float] = (0.9,),
    frequency_cpd: Sequence[float] = (3.0,),
    wavelengths_nm: Sequence[float] = (550.0,),
    levels: tuple[float, float] = (1.0, 1.0),
    eye: EyeMaker | None = None,
    thin_lens: bool = False,
    psf: str = "geometric",
    field: int = 3,
    oversampling: int = 8,
    columns: int = 60,
    span: float = 2.5,
    reach_error: float = 0.05,
    reference_spp: int = 1024,
    seed: int = 0,
    device: str | None = None,
    path: str | Path | None = None,
    on_step: StepCallback | None = None,
) -> OcclusionStudy:
    """Errors of PSF methods against ray tracing at a vertical depth edge, over a grid.

    The default, 4 cells of one wavelength by all methods, takes a minute. Away from the edge
    methods differ from ray tracing by what the samples of their views blur, and by the field
    positions their PSFs are not made for: 0.2 % with the default, a percent or two with one PSF
    and two samples a pixel.

    Parameters
    ----------
    methods
        Names of `isetcl.psf_baseline.methods()`, or ``"all"``.
    near_m, far_m
        Distances of the planes from the middle of the entrance pupil; pairs whose near plane is
        not nearer are left out (NaN).
    focus
        What the eye is focused on: ``"near"``, ``"far"``, or vergences at the entrance pupil, 1/m.
    pupil_mm
        Diameters of the entrance pupil.
    contrast, frequency_cpd
        Of the checks on both planes, see `EdgeScene`.
    wavelengths_nm
        Where errors are found.
    levels
        Mean radiance of the near and the far plane.
    eye
        A function of the pupil's diameter (mm) and of the vergence in focus, counted from the
        cornea (1/m); None is Navarro's eye.
    thin_lens
        Compare with a thin lens without colour or aberrations, whose images are known in closed
        form, instead of ray tracing; the methods then take its blur discs.
    psf
        Kind of PSFs of the methods; thin lenses have blur discs.
    field, oversampling
        Positions across the field whose PSFs the methods blend, and samples across a pixel of
        their views; see `isetcl.psf_baseline.render`. Thin lenses have one PSF.
    columns
        Pixels across the field; a third as many down.
    span
        Half of the field, in half-widths of the strip.
    reach_error
        Error of a column, of an even field, that counts for ``reach_arcmin``.
    reference_spp
        Samples a pixel of the ray-traced references.
    seed
        Of the references.
    path
        A file that finished cells are kept in, a line each; a study that finds it goes on where
        it was stopped.
    on_step
        Called with what is being done and the fraction done.

    Returns
    -------
    OcclusionStudy
        After Ctrl-C with the cells that were finished.

    Raises
    ------
    InvalidInputError
        If an argument breaks its rule, no pair of planes is left, or `path` holds another study.
    FileError
        If `path` cannot be read or written.
    """
    start = time.perf_counter()
    names = _names(methods)
    grid = _grid(near_m, far_m, focus, pupil_mm, contrast, frequency_cpd)
    waves = check_wavelengths(np.atleast_1d(np.asarray(wavelengths_nm, dtype=np.float64)))
    check_type("thin_lens", thin_lens, bool)
    if eye is not None and not callable(eye):
        raise InvalidInputError(f"eye must be a function of pupil and focus, got {eye!r}")
    if on_step is not None and not callable(on_step):
        raise InvalidInputError(f"on_step must be a function or None, got {on_step!r}")
    work = Work(
        tuple(names),
        waves,
        (float(levels[0]), float(levels[1])),
        _navarro if eye is None else eye,
        thin_lens,
        check_count("columns", columns, 6, 4096) // 2 * 2,
        check_between("span", span, 1.1, 20.0),
        check_count("reference_spp", reference_spp, 2),
        check_count("seed", seed, 0, 1 << 62),
        device,
        check_between("reach_error", reach_error, 1e-4, 1.0),
        check_choice("psf", psf, psf_baseline.psf_kinds()),
        check_count("field", field, 1, psf_baseline.bank.MAX_PATCHES),
        check_count("oversampling", oversampling, 1, 8),
    )
    cells = [c for c in itertools.product(*grid.values()) if c[0] < c[1]]
    if not cells:
        raise InvalidInputError("no near plane is nearer than a far one; swap near_m and far_m")
    # Everything that can be wrong with a cell is, before the first is worked on.
    scenes = {c: EdgeScene(c[0], c[1], c[4], c[5], *work.levels) for c in cells}
    for place in {c[:4]: c for c in cells}.values():
        work.eye_at(scenes[place], place[2], place[3])
    settings = work.settings() | {"eye": "Navarro" if eye is None else getattr(eye, "__name__", "")}
    log = Log(path, settings)
    found: dict[tuple[Any, ...], dict[str, np.ndarray]] = {}
    is_complete = True
    try:
        for i, cell in enumerate(cells):
            if on_step is not None:
                on_step(_words(cell), i / len(cells))
            known = log.known.get(key(cell))
            found[cell] = work.cell(scenes[cell], cell) if known is None else known
            if known is None:
                log.add(cell, found[cell])
    except KeyboardInterrupt:
        is_complete = False
    details = settings | {"elapsed_s": time.perf_counter() - start, "cells": len(cells)}
    return OcclusionStudy(_dataset(work, grid, found), details, is_complete)


def _names(methods: Sequence[str] | Literal["all"]) -> list[str]:
    known = psf_baseline.methods()
    if isinstance(methods, str) and methods == "all":
        return list(known)
    check_type("methods", methods, (list, tuple))
    names = [check_choice("method", name, known) for name in methods]
    if not names:
        raise InvalidInputError("methods must name one or more, got none")
    return list(dict.fromkeys(names))


def _grid(*axes: Sequence[Any]) -> dict[str, list[Any]]:
    """Values along each axis, checked, each once."""
    grid: dict[str, list[Any]] = {}
    for name, values in zip(AXES, axes, strict=True):
        own: list[Any] = []
        check_type(name, values, (list, tuple, np.ndarray))
        for value in values:
            if name == "focus" and isinstance(value, str):
                own.append(check_choice("focus", value, ("near", "far")))
            elif name == "contrast":
                own.append(check_between(name, value, 0.0, 1.0))
            else:
                own.append(check_positive(name, value))
        if not own or len(set(own)) < len(own):
            raise InvalidInputError(
                f"{name} must hold one value or more, each once, got {values!r}"
            )
        grid[name] = own
    return grid


def _navarro(pupil_mm: float, focus_dpt: float) -> Eye:
    return catalog.navarro(pupil_mm, focus_dpt, pupil_plane="entrance")


def _number(value: float) -> str:
    return f"{value:.3g}" if np.isfinite(value) else "-"


def _word(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def _words(cell: tuple[Any, ...]) -> str:
    return ", ".join(f"{name} {_word(value)}" for name, value in zip(AXES, cell, strict=True))


def _dataset(
    work: Work,
    grid: Mapping[str, list[Any]],
    found: Mapping[tuple[Any, ...], Mapping[str, np.ndarray]],
) -> xarray.Dataset:
    import xarray

    shape = tuple(len(values) for values in grid.values())
    kinds, waves = len(work.methods), len(work.wavelengths_nm)
    arrays: dict[str, np.ndarray] = {}
    half = np.full(shape, np.nan)
    for place in itertools.product(*(range(n) for n in shape)):
        cell = tuple(values[i] for values, i in zip(grid.values(), place, strict=True))
        if cell[0] < cell[1]:
            half[place] = EdgeScene(cell[0], cell[1]).half_width_arcmin(cell[3])
        for name, value in found.get(cell, {}).items():
            empty = np.full((kinds, *shape, *value.shape[1:]), np.nan)
            kept = arrays.setdefault(name, empty)
            for own, one in zip(kept, value, strict=True):
                own[place] = one
    names = (
        *(f"{r}_{q}" for r in REGIONS for q in FIGURES),
        *("largest", "integral_arcmin", "reach_arcmin", "blur_reach_arcmin"),
    )
    for name in names:
        arrays.setdefault(name, np.full((kinds, *shape, waves), np.nan))
    for name in ("profile", "profile_rms"):
        arrays.setdefault(name, np.full((kinds, *shape, waves, work.columns), np.nan))
    dims = ("kind", *AXES, "wavelength")
    variables: dict[str, Any] = {
        name: (dims if a.ndim == len(dims) else (*dims, "offset"), a) for name, a in arrays.items()
    }
    # The same for all methods.
    variables["blur_reach_arcmin"] = (
        (*AXES, "wavelength"),
        arrays["blur_reach_arcmin"][0],
        {"units": "arcmin", "long_name": "how far light is blurred"},
    )
    variables["half_width_arcmin"] = (AXES, half, {"units": "arcmin", "long_name": "a |D1 - D2|"})
    coordinates: dict[str, Any] = {
        name: [_word(v) for v in values] if name == "focus" else values
        for name, values in grid.items()
    }
    coordinates |= {
        "kind": list(work.methods),
        "wavelength": ("wavelength", work.wavelengths_nm, {"units": "nm"}),
        "offset": ("offset", work.offsets, {"long_name": "distance from the edge, half-widths"}),
    }
    return xarray.Dataset(variables, coords=coordinates)
