"""Photocurrent: what the membranes of cones pass on of their excitations, with its noise."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from isetcl.cones.excitations import Excitations
from isetcl.cones.outer_segment import STEP_S, OuterSegment
from isetcl.cones.receptors import ReceptorType
from isetcl.errors import (
    InvalidInputError,
    check_array,
    check_between,
    check_choice,
    check_count,
    check_type,
)

if TYPE_CHECKING:
    import xarray

NOISE_PA2_HZ = (0.16, 0.045)
NOISE_CORNER_HZ = (55.0, 190.0)
NOISE_POWER = (4.0, 2.5)
"""Two Lorentzians S / (1 + (f/f0)^2)^n whose sum is the noise's one-sided power, pA^2/Hz.

As ISETBio fits Angueyra & Rieke 2013."""

FOVEAL_LIMIT_DEG = 10.0
"""Eccentricity up to which cones have the constants of the fovea; ISETBio's choice."""

_STREAM = 3
_MEMORY_S = 0.1  # of the noise; its slower Lorentzian forgets in 3 ms
_HIGHEST_HZ = 1e4  # beyond it lies less than 1e-6 of the power
_MOST_FOLDS = 200
_MOST_BYTES = 2 << 30

Place = Literal["by eccentricity", "foveal", "peripheral"]


def noise_power_pa2_hz(frequency_hz: np.ndarray) -> np.ndarray:
    """One-sided power spectrum of the noise of the current, pA^2/Hz, of the shape given."""
    frequency = np.asarray(frequency_hz, dtype=np.float64)
    terms = zip(NOISE_PA2_HZ, NOISE_CORNER_HZ, NOISE_POWER, strict=True)
    return np.sum([s / (1.0 + (frequency / f0) ** 2) ** n for s, f0, n in terms], axis=0)


def photocurrent_noise(
    frames: int, receptors: int, frame_time_s: float, seed: int = 0
) -> np.ndarray:
    """Noise of the currents, (frames, receptors), pA: Gaussian, as if sampled once a frame.

    Power above half the frame rate is folded down, as in any sampled current, so that the variance
    is that of the current whatever the frames. Receptors are independent; each one's noise depends
    on the seed, its number and the count of frames only.
    """
    from scipy.fft import irfft, next_fast_len, rfftfreq

    frames = check_count("frames", frames, 1, 1 << 31)
    receptors = check_count("receptors", receptors, 1, 1 << 31)
    if 8 * frames * receptors > _MOST_BYTES:
        raise InvalidInputError(
            f"noise of {frames} frames and {receptors} cones needs "
            f"{8 * frames * receptors / 2**30:.3g} GiB, and at most 2 are made at once; take fewer"
        )
    step = check_between("frame_time_s", frame_time_s, 1e-6, 1e6, "s")
    seed = check_count("seed", seed, 0, (1 << 63) - 1)
    # A periodic series is made, and so much of it cut off that its ends forget each other.
    length = next_fast_len(frames + int(np.ceil(_MEMORY_S / step)), real=True)
    length += length % 2
    near = rfftfreq(length, step)
    count = int(min(_MOST_FOLDS, np.ceil(_HIGHEST_HZ * step) + 1))
    power = np.sum(
        [noise_power_pa2_hz(near + fold / step) for fold in range(-count, count + 1)], axis=0
    )
    # Two-sided power is half of the one-sided; each bin of the transform has it over the step.
    size = np.sqrt(0.5 * power / step * length)
    size[1:-1] *= np.sqrt(0.5)
    noise = np.empty((frames, receptors))
    for receptor in range(receptors):
        bits = np.random.Philox(key=[seed, receptor], counter=[0, 0, 0, _STREAM])
        real, imaginary = np.random.Generator(bits).standard_normal((2, len(size)))
        imaginary[[0, -1]] = 0.0
        noise[:, receptor] = irfft(size * (real + 1j * imaginary), length)[:frames]
    return noise


class Photocurrent:
    """Currents through the membranes of cones.

    Attributes
    ----------
    dataset : xarray.Dataset
        ``current`` (frame, receptor): current at the end of each frame, pA, without noise; inward,
        and so negative, from -86 in darkness towards 0 in bright light. Coordinates as in
        `Excitations`, ``time_s`` being the ends of frames. Attributes: ``seed``, ``provenance``.
    """

    def __init__(self, dataset: xarray.Dataset) -> None:
        self.dataset = dataset

    def __repr__(self) -> str:
        frames, cones = self.current.shape
        return f"<Photocurrent of {cones} cones in {frames} frames>"

    @property
    def current(self) -> xarray.DataArray:
        """Current at the end of each frame, (frame, receptor), pA, without noise."""
        return self.dataset["current"]

    @property
    def noisy(self) -> xarray.DataArray:
        """The current with noise of the seed it was made with, (frame, receptor), pA."""
        return self.instance(int(self.dataset.attrs["seed"]))

    def instance(self, seed: int) -> xarray.DataArray:
        """The current with noise of a seed, (frame, receptor), pA; see `photocurrent_noise`."""
        frames, receptors = self.current.shape
        step = float(self.dataset.attrs["frame_time_s"])
        return self.current + photocurrent_noise(frames, receptors, step, seed)

    @property
    def provenance(self) -> dict[str, Any]:
        """How the currents were made."""
        return dict(json.loads(self.dataset.attrs["provenance"]))


def photocurrent(
    excitations: Excitations,
    *,
    background_hz: np.ndarray | float | None = None,
    segment: Place | OuterSegment = "by eccentricity",
    is_noisy_light: bool = False,
    step_s: float = STEP_S,
    seed: int = 0,
) -> Photocurrent:
    """Currents of the cones of a mosaic in the course of their excitations.

    Between the frames' starts the excitation rate is constant. Before the first frame the cones
    have been in steady light; then they adapt, each by itself.

    Parameters
    ----------
    excitations
        Frames evenly spaced in time; see `eye_movements` and `ConeMosaic.excitations`.
    background_hz
        Excitations a second before, a number or (receptors,); None is the mean over the frames of
        each receptor.
    segment
        ``"by eccentricity"``: constants of the fovea up to 10 degrees, of the periphery beyond;
        ``"foveal"`` or ``"peripheral"``: the same for all; or an `OuterSegment`.
    is_noisy_light
        Whether `Excitations.counts` are the input and not the means.
    step_s
        Longest time step, s.
    seed
        Seed of `Photocurrent.noisy`.

    Raises
    ------
    InvalidInputError
        If there are rods, frames are uneven, or rates negative.
    """
    check_type("excitations", excitations, Excitations)
    check_type("is_noisy_light", is_noisy_light, bool)
    seed = check_count("seed", seed, 0, (1 << 63) - 1)
    if np.any(excitations.types == ReceptorType.ROD):
        raise InvalidInputError(
            "the photocurrent model is one of cones, and the mosaic has rods; leave them out with "
            "mosaic.select(mosaic.types < 3)"
        )
    source = excitations.counts if is_noisy_light else excitations.mean
    size = 24 * source.size
    if size > _MOST_BYTES:
        raise InvalidInputError(
            f"currents of {source.shape[0]} frames and {source.shape[1]} cones need "
            f"{size / 2**30:.3g} GiB, and at most 2 are made at once; take fewer cones or frames"
        )
    frame_s = _frame_time(excitations)
    rates = source.values.astype(np.float64) / excitations.integration_time_s
    if background_hz is None:
        background = excitations.mean.values.mean(axis=0, dtype=np.float64)
        background = background / excitations.integration_time_s
    else:
        given = check_array("background_hz", background_hz)
        if given.shape not in ((), rates.shape[1:]):
            raise InvalidInputError(
                f"background_hz must be a number or one for each of {rates.shape[1]} cones, got "
                f"shape {given.shape}"
            )
        background = np.broadcast_to(given, rates.shape[1:])
    current = np.empty_like(rates)
    groups = _segments(excitations, segment)
    for own, which in groups:
        current[:, which] = own.respond(rates[:, which], frame_s, background[which], step_s=step_s)
    details = {
        "segments": [asdict(own) for own, _ in groups],
        "is_noisy_light": is_noisy_light,
        "step_s": step_s,
        "excitations": excitations.provenance,
    }
    dataset = excitations.dataset.drop_vars("mean").assign_attrs(
        seed=seed, frame_time_s=frame_s, provenance=json.dumps(details)
    )
    dataset["current"] = (
        ("frame", "receptor"),
        current,
        {"units": "pA", "long_name": "current through the outer segment's membrane"},
    )
    ends = dataset["time_s"].values + frame_s
    return Photocurrent(dataset.assign_coords(time_s=("frame", ends, {"units": "s"})))


def _frame_time(excitations: Excitations) -> float:
    times = excitations.dataset["time_s"].values
    if len(times) == 1:
        return excitations.integration_time_s
    steps = np.diff(times)
    if not steps[0] > 0 or np.max(np.abs(steps - steps[0])) > 1e-6 * steps[0]:
        raise InvalidInputError(
            f"frames must be evenly spaced in time, got steps of {steps.min():g} to "
            f"{steps.max():g} s"
        )
    return float(steps[0])


def _segments(
    excitations: Excitations, segment: Place | OuterSegment
) -> list[tuple[OuterSegment, np.ndarray]]:
    """Outer segments, and which receptors have them."""
    everywhere = np.arange(len(excitations.types))
    if isinstance(segment, OuterSegment):
        return [(segment, everywhere)]
    check_choice("segment", segment, ("by eccentricity", "foveal", "peripheral"))
    foveal, peripheral = OuterSegment.foveal(), OuterSegment.peripheral()
    if segment != "by eccentricity":
        return [(foveal if segment == "foveal" else peripheral, everywhere)]
    if "eccentricity_deg" not in excitations.dataset.coords:
        raise InvalidInputError(
            "these excitations do not tell the eccentricity of their receptors; pass "
            "segment='foveal' or 'peripheral'"
        )
    near = excitations.dataset["eccentricity_deg"].values <= FOVEAL_LIMIT_DEG
    groups = [(foveal, np.flatnonzero(near)), (peripheral, np.flatnonzero(~near))]
    return [(own, which) for own, which in groups if len(which)]
