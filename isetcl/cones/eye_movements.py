"""Fixational eye movements: drift and microsaccades of an eye that tries to hold still.

Drift follows Mergenthaler & Engbert 2007, Phys Rev Lett 98:138104: along each axis, in steps of
1 ms, a noisy control signal w with delayed negative feedback drives the position x,

    w(t + 1) = (1 - gamma) w(t) - lambda tanh(epsilon w(t - tau)) + xi
    x(t + 1) = x(t) + w(t + 1) + eta

with Gaussian noise xi, eta and x in units of half a minute of arc.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Literal

import numpy as np

from isetcl.cones.microsaccades import MICROSACCADES, MicrosaccadeModel, Microsaccades
from isetcl.errors import (
    InvalidInputError,
    check_array,
    check_between,
    check_choice,
    check_count,
    check_finite,
    check_positive,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STEP_S = 1e-3
"""Time step of the models, s."""

_ARCMIN_PER_UNIT = 0.5
_WARM_UP_STEPS = 2000
_VELOCITY_ORDER = 3
_TRIALS_AT_ONCE = 256
_MOST_BYTES = 2 << 30
_SHORTEST_S, _LONGEST_S = 1e-6, 1e6
# Word of the counter that keeps these streams apart from those of other noise of the same seed.
_DRIFT_STREAM = 1


@dataclass(frozen=True)
class DriftModel:
    """Numbers of the drift; the defaults are those of Mergenthaler & Engbert 2007.

    Parameters
    ----------
    gamma
        Share of the control signal that is lost in a step.
    control_noise, position_noise
        Standard deviations of xi and eta, half minutes of arc.
    gain, steepness
        lambda and epsilon of the feedback.
    delay_x_s, delay_y_s
        Delays tau of the feedback, s.
    """

    gamma: float = 0.25
    control_noise: float = 0.075
    position_noise: float = 0.35
    gain: float = 0.15
    steepness: float = 1.1
    delay_x_s: float = 0.070
    delay_y_s: float = 0.040

    def __post_init__(self) -> None:
        for each in fields(self):
            value = check_finite(f"drift: {each.name}", getattr(self, each.name))
            if value < 0:
                raise InvalidInputError(f"drift: {each.name} must be >= 0, got {value:g}")
        if self.gamma > 1:
            raise InvalidInputError(f"drift: gamma must be <= 1, got {self.gamma:g}")

    @property
    def delay_steps(self) -> tuple[int, int]:
        """Delays along x and y in steps of 1 ms."""
        return round(self.delay_x_s / STEP_S), round(self.delay_y_s / STEP_S)


@dataclass(frozen=True, eq=False)
class EyeMovements:
    """Paths of the gaze during fixation.

    Attributes
    ----------
    time_s : ndarray
        Time of each frame, (frames,), s; evenly spaced from 0.
    gaze_deg : ndarray
        Where the fovea looks, (trials, frames, 2): to the right and up, degrees.
    is_microsaccade : ndarray
        Whether a microsaccade is under way in a frame, (trials, frames).
    """

    time_s: np.ndarray
    gaze_deg: np.ndarray
    is_microsaccade: np.ndarray

    def __post_init__(self) -> None:
        time, gaze = check_array("time_s", self.time_s), check_array("gaze_deg", self.gaze_deg)
        flags = check_array("is_microsaccade", self.is_microsaccade) != 0
        shape = (*flags.shape, 2)
        if flags.ndim != 2 or gaze.shape != shape or time.shape != shape[1:2] or 0 in shape:
            raise InvalidInputError(
                "eye movements need time_s (frames,), gaze_deg (trials, frames, 2) and "
                f"is_microsaccade (trials, frames), got shapes {time.shape}, {gaze.shape} and "
                f"{flags.shape}"
            )
        if not (np.all(np.isfinite(gaze)) and np.all(np.isfinite(time))):
            raise InvalidInputError("times and gazes must be finite")
        for name, array in (("time_s", time), ("gaze_deg", gaze), ("is_microsaccade", flags)):
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.gaze_deg)

    def __repr__(self) -> str:
        trials, frames = self.is_microsaccade.shape
        return f"<EyeMovements of {trials} trials, {frames} frames to {self.time_s[-1]:g} s>"

    def path(self, trial: int = 0) -> np.ndarray:
        """The gaze of one trial, (frames, 2), degrees: `gaze_deg` of `ConeMosaic.excitations`."""
        return np.asarray(self.gaze_deg[check_count("trial", trial, 0, len(self) - 1)])

    @property
    def frame_time_s(self) -> float:
        """Time from frame to frame, s."""
        if len(self.time_s) < 2:
            raise InvalidInputError("a path of one frame has no time from frame to frame")
        return float(self.time_s[1] - self.time_s[0])

    def velocity_deg_s(self, window_s: float = 0.041) -> np.ndarray:
        """Velocity, (trials, frames, 2), deg/s: Savitzky-Golay of order 3 over a window.

        41 ms is the window of Cherici et al. 2012, J Vis 12(6):31.

        Raises
        ------
        InvalidInputError
            If the window holds fewer than 5 frames, or the path fewer than the window.
        """
        from scipy.signal import savgol_filter

        check_between("window_s", window_s, 0.0, _LONGEST_S, "s")
        count = round(window_s / self.frame_time_s)
        count += 1 - count % 2
        if not _VELOCITY_ORDER + 2 <= count <= len(self.time_s):
            raise InvalidInputError(
                f"a window of {window_s:g} s must hold 5 frames or more and no more than the path, "
                f"got {count} of {len(self.time_s)} frames; make frames shorter or the path longer"
            )
        return np.asarray(
            savgol_filter(
                self.gaze_deg, count, _VELOCITY_ORDER, deriv=1, delta=self.frame_time_s, axis=1
            )
        )

    def displacement_arcmin(self, lag_s: float) -> np.ndarray:
        """Root mean square displacement along x and y after a time, (2,), minutes of arc.

        Over all trials and all pairs of frames so far apart.

        Raises
        ------
        InvalidInputError
            If no two frames lie so far apart.
        """
        lag = round(check_between("lag_s", lag_s, 0.0, _LONGEST_S, "s") / self.frame_time_s)
        if not 1 <= lag < len(self.time_s):
            raise InvalidInputError(
                f"lag_s must be one frame or more and shorter than the path of "
                f"{self.time_s[-1]:g} s, got {lag_s:g} s"
            )
        moved = 60.0 * (self.gaze_deg[:, lag:] - self.gaze_deg[:, :-lag])
        return np.asarray(np.sqrt(np.mean(np.square(moved), axis=(0, 1))))

    def diffusion_arcmin2_s(self, lag_s: float) -> float:
        """Diffusion constant after a time: mean squared displacement over 4 t, arcmin^2/s."""
        return float(np.sum(np.square(self.displacement_arcmin(lag_s))) / (4.0 * lag_s))

    def plot(self, ax: Axes | None = None, trials: int = 1) -> Axes:
        """Draw the first paths, microsaccades in thick lines; returns the axes."""
        import matplotlib.pyplot as plt

        count = check_count("trials", trials, 1, len(self))
        if ax is not None and not hasattr(ax, "plot"):
            raise InvalidInputError(f"ax must be matplotlib axes, got {type(ax).__name__}")
        axes = plt.subplots(layout="constrained")[1] if ax is None else ax
        for trial in range(count):
            x, y = 60.0 * self.gaze_deg[trial].T
            (line,) = axes.plot(x, y, lw=0.8, color=f"C{trial % 10}")
            jump = self.is_microsaccade[trial]
            if np.any(jump):
                moving = jump | np.roll(jump, 1)
                moving[0] = jump[0]
                thick = [np.where(moving, each, np.nan) for each in (x, y)]
                axes.plot(*thick, lw=2.2, color=line.get_color())
            axes.plot(x[:1], y[:1], "o", ms=4, color=line.get_color())
        axes.set_aspect("equal")
        axes.set_xlabel("gaze, x (arcmin)")
        axes.set_ylabel("gaze, y (arcmin)")
        return axes


def eye_movements(
    duration_s: float,
    frame_time_s: float = 0.005,
    *,
    trials: int = 1,
    microsaccades: MicrosaccadeModel | Microsaccades = "none",
    drift: DriftModel | None = None,
    centre: Literal["start", "mean"] = "start",
    seed: int = 0,
) -> EyeMovements:
    """Paths of an eye that fixates.

    The models run in steps of 1 ms; their first two seconds are left out. Random numbers come from
    a counter-based generator (Philox; Salmon et al. 2011) and depend on the seed, the trial and the
    time only: trial 7 is the same among 10 as among 1000, and a longer path begins as a shorter
    one.

    Parameters
    ----------
    duration_s
        Length of the path, s.
    frame_time_s
        Time from frame to frame, s; between the steps positions are interpolated.
    trials
        Number of paths.
    microsaccades
        ``"none"``; ``"statistics"``: towards the middle the likelier the farther away, else
        anywhere near; ``"fixation map"``: to where the gaze has not been lately; or `Microsaccades`
        with other numbers.
    drift
        Numbers of the drift; None are those of the paper.
    centre
        What lies at (0, 0): each path's ``"start"`` or its ``"mean"``.
    seed
        Paths of different seeds are independent.

    Raises
    ------
    InvalidInputError
        If an argument is out of range, or the paths need more than 2 GB.
    """
    duration = check_positive("duration_s", duration_s, "s")
    check_between("duration_s", duration, 0.0, _LONGEST_S, "s")
    frame_s = check_positive("frame_time_s", frame_time_s, "s")
    check_between("frame_time_s", frame_s, _SHORTEST_S, _LONGEST_S, "s")
    count = check_count("trials", trials, 1, 1 << 31)
    seed = check_count("seed", seed, 0, (1 << 63) - 1)
    check_choice("centre", centre, ("start", "mean"))
    if not isinstance(microsaccades, Microsaccades):
        check_choice("microsaccades", microsaccades, MICROSACCADES)
        microsaccades = Microsaccades(microsaccades)
    model = DriftModel() if drift is None else drift
    if not isinstance(model, DriftModel):
        raise InvalidInputError(f"drift must be a DriftModel, got {type(model).__name__}")
    frames = max(1, round(duration / frame_s))
    steps = int(np.ceil(frames * frame_s / STEP_S - 1e-6)) + 1
    _check_size(count, frames, steps)
    time = frame_s * np.arange(frames)
    gaze = np.empty((count, frames, 2))
    flags = np.empty((count, frames), dtype=bool)
    for first in range(0, count, _TRIALS_AT_ONCE):
        part = slice(first, min(first + _TRIALS_AT_ONCE, count))
        path, jumping = _paths(model, microsaccades, range(count)[part], steps, seed)
        gaze[part], flags[part] = _frames(path, jumping, time, frame_s)
    if centre == "mean":
        gaze -= gaze.mean(axis=1, keepdims=True)
    return EyeMovements(time, gaze, flags)


def _check_size(trials: int, frames: int, steps: int) -> None:
    # A batch has four random numbers, two increments and two positions at each step.
    batch = 64 * min(trials, _TRIALS_AT_ONCE) * (steps + _WARM_UP_STEPS)
    size = 17 * trials * frames + batch
    if size > _MOST_BYTES:
        raise InvalidInputError(
            f"{trials} paths of {frames} frames need {size / 2**30:.3g} GiB, and at most 2 are "
            "made at once; ask for fewer trials, a shorter time or longer frames"
        )


def _paths(
    model: DriftModel, microsaccades: Microsaccades, trials: range, steps: int, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Positions, (steps, trials, 2), arcmin, and whether a microsaccade is under way."""
    increments = _drift(model, trials, steps, seed)
    if microsaccades.model == "none":
        path = np.cumsum(increments, axis=0)
        jumping = np.zeros(path.shape[:2], dtype=bool)
    else:
        path, jumping = microsaccades.add(increments, trials, seed)
    return path - path[0], jumping


def _drift(model: DriftModel, trials: range, steps: int, seed: int) -> np.ndarray:
    """Drift in each step, (steps, trials, 2), arcmin, after the warm-up."""
    total = steps + _WARM_UP_STEPS
    noise = np.empty((total, len(trials), 2, 2))
    for i, trial in enumerate(trials):
        bits = np.random.Philox(key=[seed, trial], counter=[0, 0, 0, _DRIFT_STREAM])
        noise[:, i] = np.random.Generator(bits).standard_normal((total, 2, 2))
    noise[:, :, 0] *= model.control_noise
    noise[:, :, 1] *= model.position_noise
    longest = max(model.delay_steps)
    # Rows before the first step: the control signal has been zero.
    control = np.zeros((longest + 1 + total, len(trials), 2))
    for t in range(total):
        now = longest + t
        delayed = np.stack(
            [control[now - lag, :, axis] for axis, lag in enumerate(model.delay_steps)], axis=1
        )
        feedback = model.gain * np.tanh(model.steepness * delayed)
        control[now + 1] = (1.0 - model.gamma) * control[now] - feedback + noise[t, :, 0]
    moves = control[longest + 1 :] + noise[:, :, 1]
    return np.asarray(_ARCMIN_PER_UNIT * moves[_WARM_UP_STEPS:])


def _frames(
    path: np.ndarray, jumping: np.ndarray, time_s: np.ndarray, frame_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """Gaze at the frames, (trials, frames, 2), degrees, and flags, (trials, frames)."""
    at = time_s / STEP_S
    before = np.minimum(np.floor(at + 1e-9).astype(int), len(path) - 2)
    share = (at - before)[:, None, None]
    gaze = (1.0 - share) * path[before] + share * path[before + 1]
    # Microsaccades are rare events that a frame must not step over: any step in it counts.
    counted = np.concatenate([np.zeros((1, jumping.shape[1])), np.cumsum(jumping, axis=0)])
    after = np.maximum(np.ceil((time_s + frame_s) / STEP_S - 1e-9).astype(int), before + 1)
    flags = counted[np.minimum(after, len(path))] > counted[before]
    return np.moveaxis(gaze, 0, 1) / 60.0, flags.T
