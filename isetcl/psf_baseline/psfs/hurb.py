"""PSFs of rays that are bent at the stop by Heisenberg's uncertainty (`isetcl.Hurb`)."""

from __future__ import annotations

import math

import numpy as np

from isetcl.errors import InvalidInputError, check_choice
from isetcl.eye import paraxial
from isetcl.eye.bending.ray_bending import Hurb, to_disc
from isetcl.eye.model import Eye
from isetcl.eye.prescription import Element, ElementKind, elements
from isetcl.eye.sequential import trace_elements
from isetcl.psf_baseline.psf import Psf, launch, seen_from
from isetcl.psf_baseline.psfs.cells import checked_half, cropped, psf_of

_RAYS = 1 << 13
_BENDS = 128
_LARGEST_PUPIL = 1.3
_SMALL_BEND = 1e-4
_GOLDEN_TURN = math.pi * (3.0 - math.sqrt(5.0))


def hurb_psf(
    eye: Eye,
    wavelength_nm: float,
    vergence_dpt: float,
    pitch_deg: float,
    field_deg: tuple[float, float] = (0.0, 0.0),
    *,
    reach_deg: float = 2.0,
    model: str = "hurb",
) -> Psf:
    """The PSF of an eye's own rays, each spread by the Gaussian bends of `Hurb` at the stop.

    Every ray stands for 128 bends of equal share. Where a bent ray lands is linear in the bend.

    Parameters
    ----------
    model
        ``"hurb"`` or ``"iset3d"``, as the argument `diffraction` of `isetcl.render`.
    """
    check_choice("model of psf 'hurb'", model, ("hurb", "iset3d"))
    hurb = Hurb.iset3d() if model == "iset3d" else Hurb()
    places, steps, disc, flux, index = _rays(eye, wavelength_nm, vergence_dpt, field_deg)
    bend = np.arange(_BENDS)
    turn = _GOLDEN_TURN * (bend + _BENDS * np.arange(len(places))[:, None])
    beyond = np.broadcast_to((bend + 0.5) / _BENDS, turn.shape)
    tau = hurb.tau(
        np.repeat(disc, _BENDS, axis=0),
        beyond.ravel(),
        np.stack([np.cos(turn), np.sin(turn)], axis=-1).reshape(-1, 2),
    )
    change = hurb.scale_mm(wavelength_nm, index) * (tau @ to_disc(eye.stop))
    moved = np.einsum("rbi,rij->rbj", change.reshape(-1, _BENDS, 2), steps)
    landed = (places[:, None] + moved).reshape(-1, 2) / pitch_deg
    is_round = field_deg == (0.0, 0.0) and eye.is_rotational
    kernel = _deposited(landed, np.repeat(flux / _BENDS, _BENDS), reach_deg / pitch_deg, is_round)
    return psf_of(cropped(kernel, reach_deg / pitch_deg), pitch_deg)


def _rays(
    eye: Eye, wavelength_nm: float, vergence_dpt: float, field_deg: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
    """Where rays land from the chief ray (n, 2), degrees, and what a bend changes that (n, 2, 2).

    Also their points in the unit disc of the stop (n, 2), their flux (n,) and the index there.
    """
    sequence = elements(eye, wavelength_nm)
    at = next(i for i, e in enumerate(sequence) if e.kind is ElementKind.STOP)
    i = np.arange(_RAYS)
    radius = _LARGEST_PUPIL * paraxial.entrance_pupil(eye, wavelength_nm).radius_mm
    r, turn = radius * np.sqrt((i + 0.5) / _RAYS), i * _GOLDEN_TURN
    points = np.stack([r * np.cos(turn), r * np.sin(turn)], axis=1)
    middle = eye.field_map(wavelength_nm).entrance_mm(*np.array(field_deg))
    origins, directions = launch(points, vergence_dpt, middle, field_deg)
    rays = trace_elements(sequence[: at + 1], origins, directions, "retina")
    index = sequence[at].n_before
    kept = rays.passed
    disc = eye.stop.disc_of(rays.positions_mm[:, :2])[kept]
    start, heading = rays.positions_mm[kept], index * rays.directions[kept]
    flux = directions[kept, 2] ** 3
    seen, passed = [], np.ones(len(start), dtype=bool)
    for change in ((0.0, 0.0), (_SMALL_BEND, 0.0), (0.0, _SMALL_BEND)):
        field, arrived = _landing(eye, wavelength_nm, sequence[at + 1 :], start, heading, change)
        seen.append(field)
        passed &= arrived
    if not flux[passed].sum() > 0:
        raise InvalidInputError(
            f"no ray of an object at {vergence_dpt:g} dpt passes eye {eye.name!r}; "
            "move the object or the field position"
        )
    steps = np.stack([seen[1] - seen[0], seen[2] - seen[0]], axis=1) / _SMALL_BEND
    flux = flux[passed] / flux[passed].sum()
    return (seen[0] - np.array(field_deg))[passed], steps[passed], disc[passed], flux, index


def _landing(
    eye: Eye,
    wavelength_nm: float,
    behind: tuple[Element, ...],
    start: np.ndarray,
    heading: np.ndarray,
    change: tuple[float, float],
) -> tuple[np.ndarray, np.ndarray]:
    """Field angles where rays from the stop land whose directions T are changed, and which do."""
    across = heading[:, :2] + np.array(change)
    squared = np.sum(heading**2, axis=1) - np.sum(across**2, axis=1)
    bent = np.concatenate([across, np.sqrt(squared)[:, None]], axis=1)
    rays = trace_elements(behind, start, bent, "retina")
    return seen_from(eye, wavelength_nm, rays), rays.passed


def _deposited(landed: np.ndarray, flux: np.ndarray, reach: float, is_round: bool) -> np.ndarray:
    """A kernel from points (n, 2) in samples, each counted in its square; what is farther is lost.

    For round patterns the mean over the eight symmetries of the square.
    """
    largest = float(np.abs(landed).max())
    half = checked_half(min(reach, largest + 1.0))
    size = 2 * half + 1
    with np.errstate(invalid="ignore"):
        column = np.rint(landed[:, 0]) + half
        row = half - np.rint(landed[:, 1])
        inside = (column >= 0) & (column < size) & (row >= 0) & (row < size)
    place = row[inside].astype(int) * size + column[inside].astype(int)
    counts = np.bincount(place, flux[inside], minlength=size * size)
    kernel = np.asarray(counts, dtype=np.float64).reshape(size, size)
    if is_round:
        kernel = (kernel + kernel[::-1]) / 2.0
        kernel = (kernel + kernel[:, ::-1]) / 2.0
        kernel = (kernel + kernel.T) / 2.0
    return kernel
