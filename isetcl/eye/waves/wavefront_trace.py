"""Wavefronts from traced rays: the pupil of one object point, sampled on the reference sphere."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from isetcl.errors import InvalidInputError, check_choice, check_count
from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye
from isetcl.eye.object_point import ObjectPoint, PupilRays
from isetcl.eye.smooth_map import SmoothMap
from isetcl.eye.visual_angle import retinal_scale
from isetcl.eye.waves.wavefront import Reference, Wavefront, without_plane
from isetcl.units import UM_PER_MM

MIN_SAMPLES = 16
MAX_SAMPLES = 1024

_RINGS = 16
_SPOKES = 40
_RIM = 1.03  # the outermost rays traced, in stop radii, so that samples on the rim have neighbours
_DEGREE = 12
_CORRECTIONS = 4
_AUTO_SAMPLES = (64, 512)


def wavefront(
    eye: Eye,
    field_deg: tuple[float, float] | float = (0.0, 0.0),
    wavelength_nm: float = REFERENCE_WAVELENGTH_NM,
    *,
    object_distance_m: float = math.inf,
    samples: int | None = None,
    reference: Reference = "chief",
    stiles_crawford: float | None = None,
    scale_wavelength_nm: float | None = None,
) -> Wavefront:
    """The wavefront of an object point; see `Eye.wavefront`."""
    if samples is not None:
        samples = check_count("samples", samples, MIN_SAMPLES, MAX_SAMPLES)
    check_choice("reference of the wavefront", reference, ("chief", "best_focus"))
    source = ObjectPoint(eye, field_deg, wavelength_nm, object_distance_m)
    scale_map = source.map
    if scale_wavelength_nm is not None:
        scale_map = eye.field_map(scale_wavelength_nm)
    pupil = _Pupil(source, retinal_scale(eye.retina, scale_map, source.field_deg))
    if reference == "best_focus":
        pupil.move_to_best_focus()
    vergence = 0.0 if math.isinf(object_distance_m) else 1.0 / object_distance_m
    result = pupil.sampled(samples or _AUTO_SAMPLES[0], vergence)
    if samples is None and result.samples_needed() > result.samples:
        result = pupil.sampled(min(result.samples_needed(), _AUTO_SAMPLES[1]), vergence)
    return result if stiles_crawford is None else result.with_stiles_crawford(stiles_crawford)


class _Pupil:
    """The rays of one object point, fitted by smooth maps, with the reference sphere."""

    def __init__(self, source: ObjectPoint, mm_per_deg: np.ndarray) -> None:
        self.source = source
        self.mm_per_deg = mm_per_deg
        self.chief = source.chief()
        self.centre = self.chief.point_mm[0]
        self.radius = sphere_radius_mm(source, self.centre)
        self._fill()

    def _fill(self) -> None:
        """Trace rays over the stop, and fit entrance and stop coordinates as functions of q."""
        stop = self.source.eye.stop
        ring = np.sqrt((np.arange(_RINGS) + 0.5) / (_RINGS - 0.5)) * _RIM
        turn = 2.0 * np.pi * (np.arange(_SPOKES) + 0.5 * (np.arange(_RINGS) % 2)[:, None]) / _SPOKES
        disc = ring[:, None, None] * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        rim = np.stack([np.cos(turn[0]), np.sin(turn[0])], axis=-1)
        nodes = stop.rim_mm(np.concatenate([np.zeros((1, 2)), disc.reshape(-1, 2), rim]))
        points, found = self.source.aim(nodes)
        rays = self.source.trace(points)
        usable = found & rays.passed
        lost = float(np.mean(~usable[1 : 1 + _RINGS * _SPOKES]))
        if lost > 0.75:
            raise InvalidInputError(
                f"eye {self.source.eye.name!r}: {100 * lost:.0f} % of the stop is vignetted from "
                f"field {self.source.field_deg} deg; use a smaller field angle, a smaller stop or "
                "larger semi-diameters"
            )
        self.rays = _select(rays, usable)
        self.disc = stop.disc_of(nodes[usable])

    def opd_and_q(self, rays: PupilRays) -> tuple[np.ndarray, np.ndarray]:
        """W in um (n,) and pupil coordinates q in cycles/degree (n, 2) of rays."""
        chief_opd, _ = self._to_sphere(self.chief)
        path, direction = self._to_sphere(rays)
        return (chief_opd - path) * UM_PER_MM, self._frequency(direction)

    def _frequency(self, direction: np.ndarray) -> np.ndarray:
        wavelength_mm = self.source.wavelength_nm * 1e-6
        return np.asarray(direction @ self.mm_per_deg.T * (self.source.index_after / wavelength_mm))

    def _to_sphere(self, rays: PupilRays) -> tuple[np.ndarray, np.ndarray]:
        """See `path_to_sphere`."""
        return path_to_sphere(rays, self.centre, self.radius, self.source.index_after)

    def move_to_best_focus(self) -> None:
        """Move the centre of the sphere along the chief ray to where the RMS of W is least."""
        from scipy.optimize import minimize_scalar

        start, radius = self.centre, self.radius
        direction = self.chief.direction[0]
        inside = np.linalg.norm(self.disc, axis=1) <= 1.0
        flux = np.full(np.count_nonzero(inside), 1.0 / np.count_nonzero(inside))

        def variance(shift: float) -> float:
            self.centre, self.radius = start + shift * direction, radius + shift
            values, q = self.opd_and_q(self.rays)
            left = without_plane(values[inside], q[inside, 0], q[inside, 1], flux)
            return float(np.sum(flux * left**2))

        shift = float(minimize_scalar(variance, bracket=(-0.1, 0.1), tol=1e-10).x)
        self.centre, self.radius = start + shift * direction, radius + shift

    def sampled(self, samples: int, vergence_dpt: float) -> Wavefront:
        """The wavefront on a grid in q."""
        _, q = self.opd_and_q(self.rays)
        both = np.concatenate([self.rays.entrance_mm, self.disc], axis=1)
        fitted = SmoothMap(q, both, _DEGREE)
        middle, half = _box(q, np.linalg.norm(self.disc, axis=1) <= 1 + 1e-9)
        step = 2.0 * half / samples
        axis = (np.arange(samples) - (samples - 1) / 2.0) * step
        flat = (middle + np.stack(np.meshgrid(axis, -axis), axis=-1)).reshape(-1, 2)
        # Cells whose middle lies a little outside may still reach into the pupil.
        stop = fitted(flat)[:, 2:]
        near = np.flatnonzero(np.linalg.norm(stop, axis=1) < 1.0 + 1.5 * step / half)
        stop_slopes = fitted.gradient(flat[near])[:, 2:]
        cover, inwards = _coverage(stop[near], stop_slopes, step)
        lit = cover > 0
        places, cover = flat[near[lit]] + inwards[lit], cover[lit]
        rays, slopes = self._rays_at(places, fitted)
        kept = rays.passed
        area = np.abs(np.linalg.det(slopes)) * step**2 * cover
        spread = 1.0 + self.source.per_mm**2 * np.sum(rays.entrance_mm**2, axis=1)
        flux = area * spread**-1.5
        total = float(np.sum(flux[kept]))

        def scattered(values: np.ndarray, outside: float) -> np.ndarray:
            full = np.full((len(flat), *values.shape[1:]), outside)
            full[near[lit][kept]] = values[kept]
            return full.reshape(samples, samples, *values.shape[1:])

        edge = np.abs(np.linalg.norm(self.disc, axis=1) - 1.0) < 1e-9
        start = self.chief.entrance_mm[0]
        rim = np.linalg.norm(self.rays.entrance_mm[edge] - start, axis=1)
        return Wavefront(
            opd_um=scattered(self.opd_and_q(rays)[0], np.nan),
            amplitude=scattered(np.sqrt(flux * cover / total), 0.0),
            flux=scattered(flux / total, 0.0),
            x_cpd=middle[0] + axis,
            y_cpd=middle[1] - axis,
            entrance_mm=scattered(rays.entrance_mm - start, np.nan),
            area_mm2=scattered(area, 0.0),
            entrance_radius_mm=float(np.max(rim)),
            wavelength_nm=self.source.wavelength_nm,
            field_deg=self.source.field_deg,
            vergence_dpt=vergence_dpt,
            centre_mm=self.centre,
            radius_mm=self.radius,
            mm_per_deg=self.mm_per_deg,
            vitreous_index=self.source.index_after,
            vignetted=max(0.0, float(1.0 - total / np.sum(flux))),
        )

    def _rays_at(self, q: np.ndarray, fitted: SmoothMap) -> tuple[PupilRays, np.ndarray]:
        """Rays at pupil coordinates q (n, 2), and the derivatives of the entrance pupil by q.

        The smooth map's rays, corrected by its derivatives until they are right.
        """
        entrance = fitted(q)[:, :2]
        slopes = fitted.gradient(q)[:, :2]
        size = float(np.max(np.ptp(q, axis=0)))
        for _ in range(_CORRECTIONS):
            rays = self.source.trace(entrance)
            miss = np.where(rays.passed[:, None], q - self.opd_and_q(rays)[1], 0.0)
            if np.max(np.abs(miss)) < 1e-9 * size:
                break
            entrance = entrance + np.einsum("nij,nj->ni", slopes, miss)
        return rays, slopes


def sphere_radius_mm(source: ObjectPoint, centre_mm: np.ndarray) -> float:
    """Radius of the reference sphere about a point: its distance to the exit pupil's middle, mm."""
    pupil = source.eye.exit_pupil(source.wavelength_nm)
    middle = np.array(source.eye.stop.decentre_mm) * pupil.magnification
    return float(np.linalg.norm(centre_mm - np.array([*middle, pupil.z_mm])))


def path_to_sphere(
    rays: PupilRays, centre_mm: np.ndarray, radius_mm: float, index: float
) -> tuple[np.ndarray, np.ndarray]:
    """Optical path to a reference sphere, mm, and unit directions from there to its centre.

    The ray is followed back from the retina, in a medium of the index given.
    """
    offset = rays.point_mm - centre_mm
    along = np.sum(offset * rays.direction, axis=1)
    inside = along**2 - np.sum(offset**2, axis=1) + radius_mm**2
    back = along + np.sqrt(np.maximum(inside, 0.0))
    on_sphere = offset - back[:, None] * rays.direction
    return rays.opl_mm - index * back, -on_sphere / radius_mm


def _box(q: np.ndarray, used: np.ndarray) -> tuple[np.ndarray, float]:
    """Middle and half of the longer side of the box about samples."""
    low, high = q[used].min(axis=0), q[used].max(axis=0)
    return (low + high) / 2.0, float(np.max(high - low) / 2.0)


def _coverage(stop: np.ndarray, slopes: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Part of every cell that lies inside the stop (n,), and the way to where it is sampled (n, 2).

    `stop` in stop radii, `slopes` its derivatives by q. The rim is straight in a cell to second
    order. Cells on the rim are sampled half way from their middle to the middle of their lit part:
    with the lit parts as weights this cancels, on average over where the rim cuts cells, the
    h^2 / 24 error of the midpoint rule, which full way would turn round.
    """
    rho = np.linalg.norm(stop, axis=1)
    unit = stop / np.maximum(rho, 1e-12)[:, None]
    gradient = np.einsum("ni,nij->nj", unit, slopes)
    steepness = np.abs(gradient) * step
    cover = _cut_square(1.0 - rho, np.max(steepness, axis=1), np.min(steepness, axis=1))
    outwards = gradient / np.maximum(np.linalg.norm(gradient, axis=1), 1e-300)[:, None]
    # The middle of the lit part of a strip along the rim is (1 - cover) / 2 away.
    return cover, -outwards * ((1.0 - cover) * step / 4.0)[:, None]


def _cut_square(distance: np.ndarray, across: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Part of a unit square in which distance + across s + along t > 0, |s|, |t| <= 1/2.

    The exact area cut off by a straight line; `across` >= `along` >= 0.
    """
    across = np.maximum(across, 1e-12)
    # Integrate clip(1/2 + (distance + along t) / across, 0, 1) over t: trapezium by its corners.
    low, high = distance - along / 2.0, distance + along / 2.0
    width = np.maximum(along, 1e-9 * across)

    def integral(u: np.ndarray) -> np.ndarray:
        """Antiderivative of clip(1/2 + u / across, 0, 1)."""
        inside = np.clip(u, -across / 2.0, across / 2.0)
        return np.asarray(
            (inside + across / 2.0) ** 2 / (2.0 * across) + np.maximum(u - across / 2.0, 0.0)
        )

    return np.clip((integral(high) - integral(low)) / np.maximum(width, high - low), 0.0, 1.0)


def _select(rays: PupilRays, used: np.ndarray) -> PupilRays:
    return PupilRays(*(getattr(rays, field.name)[used] for field in dataclasses.fields(PupilRays)))
