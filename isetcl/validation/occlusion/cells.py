"""One cell of an occlusion study after the other, and the file in which they are kept."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from isetcl import psf_baseline
from isetcl.errors import FileError, InvalidInputError
from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye
from isetcl.psf_baseline.on_retina import throughput
from isetcl.render.interrupt import check_complete
from isetcl.render.render import render
from isetcl.retina.grid import RetinalGrid
from isetcl.retina.image import RetinalImage
from isetcl.spectrum import Spectrum
from isetcl.units import MM_PER_M
from isetcl.validation.occlusion.edge_scene import LUMINANCE_CD_M2, EdgeScene

EyeMaker = Callable[[float, float], Eye]
REGIONS = ("strip", "outside")

_SIGMAS = 4.0
_FORMAT = 1


@dataclass(frozen=True, eq=False)
class Work:
    """What all cells have in common."""

    methods: tuple[str, ...]
    wavelengths_nm: np.ndarray
    levels: tuple[float, float]
    eye: EyeMaker
    thin_lens: bool
    columns: int
    span: float
    spp: int
    seed: int
    device: str | None
    reach_error: float
    eyes: dict[tuple[float, float], Eye] = field(default_factory=dict, repr=False)

    @property
    def offsets(self) -> np.ndarray:
        """Middles of columns, half-widths."""
        return (np.arange(self.columns) + 0.5) / self.columns * 2.0 * self.span - self.span

    @property
    def rows(self) -> int:
        """Rows of pixels."""
        return max(2, self.columns // 6 * 2)

    def settings(self) -> dict[str, Any]:
        """What a kept cell depends on besides its place in the grid."""
        return {
            "format": _FORMAT,
            "methods": list(self.methods),
            "wavelengths_nm": self.wavelengths_nm.tolist(),
            "levels": list(self.levels),
            "thin_lens": self.thin_lens,
            "columns": self.columns,
            "span": self.span,
            "reference_spp": self.spp,
            "seed": self.seed,
            "reach_error": self.reach_error,
        }

    def eye_at(self, edge: EdgeScene, focus: str | float, pupil_mm: float) -> tuple[Eye, float]:
        """The eye focused on a plane or a vergence at its pupil, and what it is focused on, m."""
        distances = {"near": edge.near_m, "far": edge.far_m}
        focus_m = distances[focus] if isinstance(focus, str) else 1.0 / focus
        # Focusing takes longer than many an image: eyes serve all cells that share them.
        if (pupil_mm, focus_m) not in self.eyes:
            # Where the entrance pupil lies changes a little with focus.
            first = self.eye(pupil_mm, 1.0 / focus_m)
            own = self.eye(pupil_mm, 1.0 / (focus_m - _pupil_depth_m(first)))
            self.eyes[pupil_mm, focus_m] = own
        return self.eyes[pupil_mm, focus_m], focus_m

    def cell(self, edge: EdgeScene, place: tuple[Any, ...]) -> dict[str, np.ndarray]:
        """Errors of all methods, each (method, wavelength) or (method, wavelength, column)."""
        pupil = float(place[3])
        eye, focus_m = self.eye_at(edge, place[2], pupil)
        scene = edge.scene(_pupil_depth_m(eye))
        half_deg = edge.half_width_arcmin(pupil) / 60.0
        where: dict[str, Any] = {
            "fov_deg": 2.0 * self.span * half_deg,
            "resolution": (self.columns, self.rows),
            "wavelengths_nm": self.wavelengths_nm,
        }
        options: dict[str, Any] = {"psf": "disc"} if self.thin_lens else {}
        grid = RetinalGrid.of(eye, where["fov_deg"], where["resolution"])
        white = _white(grid, self.wavelengths_nm)
        if self.thin_lens:
            image = edge.thin_lens_image(grid.x_deg, grid.y_deg, grid.pitch_deg[0], pupil, focus_m)
            truth = np.broadcast_to(image, (len(white), *image.shape))
            noise = np.zeros_like(truth)
        else:
            traced = render(
                scene,
                eye,
                spp=self.spp,
                seed=self.seed,
                device=self.device,
                progress=False,
                **where,
            )
            check_complete(traced)
            truth = traced.irradiance.values / white
            noise = (traced.standard_error.values / white) ** 2
        off = []
        for name in self.methods:
            made: RetinalImage = psf_baseline.render(scene, eye, method=name, **where, **options)
            off.append(made.irradiance.values / white - truth)
        return self._errors(np.array(off), noise, half_deg * 60.0)

    def _errors(
        self, off: np.ndarray, noise: np.ndarray, half_arcmin: float
    ) -> dict[str, np.ndarray]:
        """Figures of differences (method, wavelength, y, x) with the reference's variance."""
        inside = np.abs(self.offsets) <= 1.0
        found: dict[str, np.ndarray] = {}
        for name, mask in zip(REGIONS, (inside, ~inside), strict=True):
            square = (off[..., mask] ** 2 - noise[..., mask]).mean(axis=(-2, -1))
            found[f"{name}_rms"] = np.sqrt(np.maximum(square, 0.0))
            found[f"{name}_bias"] = off[..., mask].mean(axis=(-2, -1))
        found["largest"] = np.abs(off).max(axis=(-2, -1))
        profile = off.mean(axis=-2)
        square = (off**2 - noise).mean(axis=-2)
        rms = np.sqrt(np.maximum(square, 0.0))
        column_arcmin = 2.0 * self.span * half_arcmin / self.columns
        found["integral_arcmin"] = np.abs(profile).sum(axis=-1) * column_arcmin
        # Squared noise of a column: its mean is taken out, its spread is not.
        spread = np.sqrt(2.0 * (noise**2).mean(axis=-2) / self.rows)
        is_wrong = square > np.maximum(self.reach_error**2, _SIGMAS * spread)
        # Outward from the edge without a gap: fine detail in focus far away is another error.
        half = self.columns // 2
        sides = (is_wrong[..., half - 1 :: -1], is_wrong[..., half:])
        counts = [np.cumprod(side, axis=-1).sum(axis=-1) for side in sides]
        found["reach_arcmin"] = np.maximum(*counts) * column_arcmin
        return found | {"profile": profile, "profile_rms": rms}


def _pupil_depth_m(eye: Eye) -> float:
    return eye.entrance_pupil(REFERENCE_WAVELENGTH_NM).z_mm / MM_PER_M


def _white(grid: RetinalGrid, wavelengths_nm: np.ndarray) -> np.ndarray:
    """Irradiance of an even field of level 1, (wavelength, y, x)."""
    radiance = Spectrum.equal_energy(LUMINANCE_CD_M2).at(wavelengths_nm)
    return np.array(
        [throughput(grid, float(w)) * r for w, r in zip(wavelengths_nm, radiance, strict=True)]
    )


class Log:
    """Cells that were finished, one JSON line each after a line of settings."""

    def __init__(self, path: str | Path | None, settings: Mapping[str, Any]) -> None:
        self._path = None if path is None else Path(path)
        self.known: dict[str, dict[str, np.ndarray]] = {}
        if self._path is None:
            return
        try:
            text = self._path.read_text(encoding="utf-8") if self._path.exists() else ""
            if not text:
                self._path.write_text(json.dumps(dict(settings)) + "\n", encoding="utf-8")
                return
        except (OSError, UnicodeDecodeError) as error:
            raise FileError(f"cannot use {self._path}: {error}") from error
        first, *lines = text.split("\n")
        if _parsed(first) != json.loads(json.dumps(dict(settings))):
            raise InvalidInputError(
                f"{self._path} holds another study than this one; delete it, or give another path"
            )
        for line in lines:
            # The last line may have been cut off.
            record = _parsed(line)
            if isinstance(record, dict):
                values = {name: np.array(v) for name, v in record["values"].items()}
                self.known[record["cell"]] = values
        if not text.endswith("\n"):
            self._append("\n")

    def add(self, cell: tuple[Any, ...], values: Mapping[str, np.ndarray]) -> None:
        """Keep a finished cell."""
        if self._path is not None:
            plain = {name: v.tolist() for name, v in values.items()}
            self._append(json.dumps({"cell": key(cell), "values": plain}) + "\n")

    def _append(self, text: str) -> None:
        assert self._path is not None
        try:
            with self._path.open("a", encoding="utf-8") as file:
                file.write(text)
        except OSError as error:
            raise FileError(f"cannot write {self._path}: {error.strerror}") from error


def _parsed(line: str) -> Any:
    try:
        return json.loads(line)
    except json.JSONDecodeError:
        return None


def key(cell: tuple[Any, ...]) -> str:
    """A cell of the grid as text."""
    return json.dumps(cell)
