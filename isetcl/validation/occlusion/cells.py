"""One cell of an occlusion study after the other, and the file in which they are kept."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from dataclasses import field as made
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
from isetcl.units import ARCMIN_PER_DEG, MM_PER_M
from isetcl.validation.occlusion.edge_scene import LUMINANCE_CD_M2, EdgeScene
from isetcl.validation.occlusion.error import noise_freedom, region_error

EyeMaker = Callable[[float, float], Eye]
REGIONS = ("strip", "outside", "away")
FIGURES = ("rms", "rms_low", "rms_high", "bias")

_SIGMAS = 4.0
_BEYOND = 1.05  # of the largest spot of the axis, for those of the borders
_FORMAT = 2


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
    psf: str
    field: int
    oversampling: int
    eyes: dict[tuple[float, float], Eye] = made(default_factory=dict, repr=False)

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
            "psf": self.psf,
            "field": self.field,
            "oversampling": self.oversampling,
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
        options: dict[str, Any] = {
            "psf": "disc" if self.thin_lens else self.psf,
            "field": "centre" if self.thin_lens else self.field,
            "oversampling": self.oversampling,
            "psf_cache": False,
        }
        grid = RetinalGrid.of(eye, where["fov_deg"], where["resolution"])
        white = _white(grid, self.wavelengths_nm)
        if self.thin_lens:
            image = edge.thin_lens_image(grid.x_deg, grid.y_deg, grid.pitch_deg[0], pupil, focus_m)
            truth = np.broadcast_to(image, (len(white), *image.shape))
            noise, freedom = np.zeros_like(truth), 1
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
            freedom = noise_freedom(traced)
        off = []
        for name in self.methods:
            made: RetinalImage = psf_baseline.render(scene, eye, method=name, **where, **options)
            off.append(made.irradiance.values / white - truth)
        blurred = self._blurred_arcmin(eye, edge, pupil, focus_m)
        found = self._errors(np.array(off), noise, half_deg * 60.0, blurred, freedom)
        return found | {"blur_reach_arcmin": np.tile(blurred, (len(off), 1))}

    def _blurred_arcmin(
        self, eye: Eye, edge: EdgeScene, pupil_mm: float, focus_m: float
    ) -> np.ndarray:
        """How far from the edge light of the planes is blurred, by wavelength, arcmin."""
        planes = (edge.near_m, edge.far_m)
        if self.thin_lens:
            defocus = max(abs(1.0 / distance - 1.0 / focus_m) for distance in planes)
            reach = np.degrees(pupil_mm / 2.0 / MM_PER_M * defocus) * ARCMIN_PER_DEG
            return np.full(len(self.wavelengths_nm), reach)
        depth_m = _pupil_depth_m(eye)
        spots = [
            [eye.spot(0.0, float(w), object_distance_m=d - depth_m) for d in planes]
            for w in self.wavelengths_nm
        ]
        return _BEYOND * np.array(
            [max(float(np.hypot(s.x_arcmin, s.y_arcmin).max()) for s in pair) for pair in spots]
        )

    def _errors(
        self,
        off: np.ndarray,
        noise: np.ndarray,
        half_arcmin: float,
        blurred_arcmin: np.ndarray,
        freedom: int,
    ) -> dict[str, np.ndarray]:
        """Figures of differences (method, wavelength, y, x) with the reference's variance."""
        found: dict[str, np.ndarray] = {
            f"{region}_{figure}": np.full(off.shape[:2], np.nan)
            for region in REGIONS
            for figure in FIGURES
        }
        distance = np.abs(self.offsets)
        pixel = self.offsets[1] - self.offsets[0]
        for i, blurred in enumerate(blurred_arcmin):
            inside = distance <= 1.0
            away = distance > max(1.0, blurred / half_arcmin) + pixel
            for region, columns in zip(REGIONS, (inside, ~inside, away), strict=True):
                mask = np.broadcast_to(columns, off.shape[-2:])
                if not columns.any():
                    continue
                for k in range(len(off)):
                    own = region_error(off[k, i], noise[i], 1.0, mask, freedom)
                    figures = (own.rms, *own.rms_interval, own.bias)
                    for figure, value in zip(FIGURES, figures, strict=True):
                        found[f"{region}_{figure}"][k, i] = value
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
