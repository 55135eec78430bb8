"""The PSFs an image needs: over wavelengths, depths and field positions, each made once.

Between depths, and between field positions, PSFs may be interpolated linearly, sample by sample.
The error of that is half the L1 distance of the interpolated and the true kernel, measured
half-way: it is the share of light that lands elsewhere, and no image value changes by more than
that times the range of radiance.
"""

from __future__ import annotations

import dataclasses
import itertools
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_between,
    check_choice,
    check_count,
    check_pair,
    check_positive,
    check_type,
)
from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye
from isetcl.psf_baseline.psf import Psf
from isetcl.psf_baseline.psf_cache import PsfCache, default_cache, key_of
from isetcl.psf_baseline.psfs import PsfKind, psf_kind

MAX_PATCHES = 64

Field = tuple[float, float]


@dataclass
class PsfBank:
    """PSFs of one eye and kind on one grid, made when asked for and kept.

    Attributes
    ----------
    eye
        The eye.
    kind
        Kind of PSF, a name or a `PsfKind`; or a `Psf` of the user's, which then serves all.
    pitch_deg
        Width of a sample, degrees.
    reach_deg
        How far kernels may reach that would go on without end, degrees.
    cache
        True: the user's cache on disk, unless the environment switches it off; False or None: no
        cache on disk; or a `PsfCache`.
    """

    eye: Eye
    kind: str | PsfKind | Psf
    pitch_deg: float
    reach_deg: float = 2.0
    cache: PsfCache | bool | None = True
    made: int = field(default=0, init=False)
    loaded: int = field(default=0, init=False)
    made_s: float = field(default=0.0, init=False)
    depth_error: float = field(default=0.0, init=False)
    field_error: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        check_type("eye", self.eye, Eye)
        self.pitch_deg = check_positive("pitch_deg", self.pitch_deg, "deg")
        if isinstance(self.kind, Psf):
            self._fixed: Psf | None = _of_pitch(self.kind, self.pitch_deg)
            self._kind: PsfKind | None = None
        else:
            self._fixed, self._kind = None, psf_kind(self.kind)
        if self.cache is True:
            self.cache = default_cache()
        elif self.cache is False:
            self.cache = None
        elif self.cache is not None:
            check_type("cache", self.cache, PsfCache)
        self._psfs: dict[tuple[float, float, Field], Psf] = {}
        self._eye_values: dict[str, Any] | None = None

    def psf(self, wavelength_nm: float, vergence_dpt: float, field_deg: Field = (0.0, 0.0)) -> Psf:
        """The PSF of a wavelength in nm, a vergence in 1/m and a field position in degrees.

        What its kind does not know makes no difference: the same object is returned. In an eye that
        is a figure of revolution mirrored positions have mirrored PSFs, of which one is made.
        """
        kind = self._kind
        if kind is None:
            assert self._fixed is not None
            return self._fixed
        wavelength = float(wavelength_nm) if kind.knows_wavelength else REFERENCE_WAVELENGTH_NM
        vergence = float(vergence_dpt) if kind.knows_depth else 0.0
        at = check_pair("field_deg", field_deg, "deg") if kind.knows_field else (0.0, 0.0)
        place = (wavelength, vergence, at)
        if place not in self._psfs:
            first = _first_octant(at) if self.eye.is_rotational else at
            if first != at:
                psf = self.psf(wavelength, vergence, first)
                self._psfs[place] = dataclasses.replace(psf, kernel=_mirrored(psf.kernel, at))
            else:
                self._psfs[place] = self._get(kind, *place)
        return self._psfs[place]

    def over_depth(
        self,
        wavelength_nm: float,
        vergences_dpt: Sequence[float],
        field_deg: Field = (0.0, 0.0),
        *,
        bound: float = 0.0,
    ) -> list[Psf]:
        """PSFs at vergences, made at as few of them as keep the error of the others in a bound.

        An interval of vergences is halved, at one of those asked for, until what is interpolated
        there differs from what is made by at most half the bound, since the error in between may
        be larger than there. Errors are remembered as `depth_error`. With a bound of 0 all are
        made.
        """
        bound = check_between("bound", bound, 0.0, 1.0)
        verges = sorted(set(map(float, vergences_dpt)))
        known = {v: self.psf(wavelength_nm, v, field_deg) for v in (verges[0], verges[-1])}
        if bound == 0.0:
            known = {v: self.psf(wavelength_nm, v, field_deg) for v in verges}
        pending = [(0, len(verges) - 1)] if bound > 0.0 else []
        while pending:
            low, high = pending.pop()
            if high - low < 2:
                continue
            middle = (low + high) // 2
            v = verges[middle]
            known[v] = self.psf(wavelength_nm, v, field_deg)
            between = _between(
                known[verges[low]], known[verges[high]], v, verges[low], verges[high]
            )
            error = kernel_distance(between, known[v])
            if error > bound / 2.0:
                pending += [(low, middle), (middle, high)]
            else:
                self.depth_error = max(self.depth_error, error)
                for one, other in ((low, middle), (middle, high)):
                    self._fill(known, verges, one, other)
        return [known[float(v)] for v in vergences_dpt]

    def patches_needed(
        self,
        wavelength_nm: float,
        vergences_dpt: Sequence[float],
        middle_deg: Field,
        fov_deg: Field,
        bound: float = 0.01,
    ) -> int:
        """Nodes across a field at which interpolation between them errs by the bound.

        The error of interpolation falls with the square of the distance. It is measured over the
        whole field, and where one patch does not do, again at the number that follows.
        """
        check_between("bound", bound, 1e-4, 1.0)
        if self._kind is None or not self._kind.knows_field:
            return 1
        count = 1
        while True:
            error = self._field_error(wavelength_nm, vergences_dpt, middle_deg, fov_deg, count)
            if error <= bound or count >= MAX_PATCHES:
                self.field_error = error
                return count
            wanted = int(np.ceil(max(count - 1, 1) * np.sqrt(error / bound))) + 1
            count = min(max(count + 1, wanted), MAX_PATCHES)

    def describe(self) -> dict[str, Any]:
        """What was made, with the errors of interpolation, as plain values."""
        named = {"kind": "user"} if self._kind is None else self._kind.describe()
        return {
            **named,
            "reach_deg": self.reach_deg,
            "count": max(1, len(self._psfs)),
            "made": self.made,
            "from_cache": self.loaded,
            "made_s": self.made_s,
            "depth_error": self.depth_error,
            "field_error": self.field_error,
            "energy_outside": max((p.energy_outside for p in self._all()), default=0.0),
        }

    def _all(self) -> list[Psf]:
        return list(self._psfs.values()) if self._fixed is None else [self._fixed]

    def _get(self, kind: PsfKind, wavelength_nm: float, vergence_dpt: float, at: Field) -> Psf:
        """From disk, or made and put there."""
        key = ""
        if isinstance(self.cache, PsfCache):
            if self._eye_values is None:
                self._eye_values = self.eye.describe()
            key = key_of(
                {
                    "eye": self._eye_values,
                    "kind": kind.describe(),
                    "grid": [self.pitch_deg, self.reach_deg],
                    "at": [wavelength_nm, vergence_dpt, *at],
                }
            )
            found = self.cache.load(key)
            if found is not None:
                self.loaded += 1
                return found
        start = time.perf_counter()
        psf = kind(
            self.eye, wavelength_nm, vergence_dpt, self.pitch_deg, at, reach_deg=self.reach_deg
        )
        self.made += 1
        self.made_s += time.perf_counter() - start
        if isinstance(self.cache, PsfCache):
            self.cache.store(key, psf)
        return psf

    def _fill(self, known: dict[float, Psf], verges: list[float], low: int, high: int) -> None:
        """Interpolate the vergences between two that are known."""
        a, b = verges[low], verges[high]
        for v in verges[low + 1 : high]:
            known[v] = _between(known[a], known[b], v, a, b)

    def _field_error(
        self,
        wavelength_nm: float,
        vergences_dpt: Sequence[float],
        middle_deg: Field,
        fov_deg: Field,
        count: int,
    ) -> float:
        """Largest error of PSFs blended between patches, half-way, along both diagonals.

        With one patch, of its PSF at the corners.
        """
        ends = (min(vergences_dpt), max(vergences_dpt))
        worst = 0.0
        for v, sense in itertools.product(dict.fromkeys(ends), (1.0, -1.0)):
            places = np.linspace(-0.5, 0.5, max(2, count))

            def at(t: float, s: float, v: float = v) -> Psf:
                x, y = middle_deg[0] + t * fov_deg[0], middle_deg[1] + s * fov_deg[1]
                return self.psf(wavelength_nm, v, (x, y))

            if count == 1:
                middle = self.psf(wavelength_nm, v, middle_deg)
                for t in places:
                    worst = max(worst, kernel_distance(middle, at(t, sense * t)))
                continue
            for a, b in {(places[0], places[1]), (places[-2], places[-1])}:
                m = (a + b) / 2.0
                corners = [at(t, sense * s) for t in (a, b) for s in (a, b)]
                worst = max(worst, kernel_distance(mixed(corners, [0.25] * 4), at(m, sense * m)))
        return worst


def _first_octant(at: Field) -> Field:
    """The position with 0 <= y <= x that mirrors put on this one, to 1e-9 deg."""
    x, y = sorted((round(abs(v), 9) for v in at), reverse=True)
    return x, y


def _mirrored(kernel: np.ndarray, at: Field) -> np.ndarray:
    """The kernel of a position in the first octant, for one that mirrors put it on."""
    x, y = at
    if abs(y) > abs(x):
        # Row 0 is up: x and y change places about the other diagonal.
        kernel = kernel[::-1, ::-1].T
    kernel = kernel[:, ::-1] if x < 0 else kernel
    return kernel[::-1] if y < 0 else kernel


def _of_pitch(psf: Psf, pitch_deg: float) -> Psf:
    if abs(psf.pitch_deg / pitch_deg - 1.0) > 1e-6:
        raise InvalidInputError(
            f"psf: its samples must be as wide as those of the view, {pitch_deg:.8g} deg (a pixel "
            f"over oversampling), got {psf.pitch_deg:.8g} deg"
        )
    return psf


def mixed(psfs: Sequence[Psf], weights: Sequence[float]) -> Psf:
    """The weighted mean of PSFs of one pitch; the weights sum to 1."""
    half = max(p.radius for p in psfs)
    kernel = sum(w * _grown(p.kernel, half) for p, w in zip(psfs, weights, strict=True))
    outside = sum(w * p.energy_outside for p, w in zip(psfs, weights, strict=True))
    return Psf(np.asarray(kernel), psfs[0].pitch_deg, float(outside))


def kernel_distance(one: Psf, other: Psf) -> float:
    """Half the L1 distance of two kernels of one pitch, 0 to 1."""
    half = max(one.radius, other.radius)
    return float(np.abs(_grown(one.kernel, half) - _grown(other.kernel, half)).sum()) / 2.0


def check_field(value: str | int) -> str | int:
    """The argument `field`: "centre", "patches", or a number of patches across."""
    if isinstance(value, str):
        return check_choice("field", value, ("centre", "patches"))
    return check_count("field", value, 1, MAX_PATCHES)


def _between(low: Psf, high: Psf, v: float, a: float, b: float) -> Psf:
    t = (v - a) / (b - a)
    return mixed([low, high], [1.0 - t, t])


def _grown(kernel: np.ndarray, half: int) -> np.ndarray:
    pad = half - kernel.shape[0] // 2
    return np.pad(kernel, pad) if pad else kernel
