"""Microsaccades: small jumps that fixation makes between drifts.

When one comes and how fast it is follow measured statistics; where it goes follows one of two
models, of which both are ISETBio's. Positions are minutes of arc from where the path began.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Literal

import numpy as np

from isetcl.errors import check_choice, check_positive

MicrosaccadeModel = Literal["none", "statistics", "fixation map"]
MICROSACCADES: tuple[MicrosaccadeModel, ...] = ("none", "statistics", "fixation map")

_STREAM = 2
_INTERVAL_SHAPE = 5.0
_AMPLITUDE_SHAPE = 4.0
_CANDIDATES = 64
# The fixation map: its width, its nodes, how often it is updated, and its memory.
_MAP_WIDTH_ARCMIN = 40.0
_NODE_ARCMIN = 2.0
_UPDATE_STEPS = 10
_KERNEL_ARCMIN = 2.0
_KERNEL_REACH = 2.5
_MEMORY_STEPS = 500.0
_MAP_WEIGHT = 0.5


@dataclass(frozen=True)
class Microsaccades:
    """When microsaccades come, how fast and how far they go; defaults are ISETBio's.

    Parameters
    ----------
    model
        ``"none"``, ``"statistics"`` or ``"fixation map"``.
    interval_s
        Mean time from one start to the next, s; a gamma distribution of shape 5.
    amplitude_arcmin
        Mean length in ``"statistics"``, where it does not correct; gamma of shape 4.
    speed_deg_s, speed_spread_deg_s
        Mean speed and its standard deviation, deg/s (Martinez-Conde et al. 2009).
    shortest_s
        Least duration, s.
    end_spread_arcmin
        Standard deviation of the end point along each axis.
    direction_spread_deg
        Standard deviation of the direction of corrections in ``"statistics"``.
    fixation_arcmin
        Standard deviation of where the gaze wants to be.
    """

    model: MicrosaccadeModel = "statistics"
    interval_s: float = 0.45
    amplitude_arcmin: float = 8.0
    speed_deg_s: float = 39.0
    speed_spread_deg_s: float = 2.0
    shortest_s: float = 0.002
    end_spread_arcmin: float = 0.3
    direction_spread_deg: float = 15.0
    fixation_arcmin: float = 15.0

    def __post_init__(self) -> None:
        check_choice("microsaccades", self.model, MICROSACCADES)
        for each in fields(self)[1:]:
            check_positive(f"microsaccades: {each.name}", getattr(self, each.name))

    def add(self, drift: np.ndarray, trials: range, seed: int) -> tuple[np.ndarray, np.ndarray]:
        """Positions with microsaccades, and whether one is under way.

        Parameters
        ----------
        drift
            Drift in each step of 1 ms, (steps, trials, 2), arcmin.
        trials, seed
            Whose random numbers.

        Returns
        -------
        ndarray, (steps, trials, 2), arcmin; ndarray of bool, (steps, trials)
        """
        steps, count = drift.shape[:2]
        streams = [
            np.random.Generator(np.random.Philox(key=[seed, trial], counter=[0, 0, 0, _STREAM]))
            for trial in trials
        ]
        due = np.array([self._interval(stream) for stream in streams])
        step_left = np.zeros(count, dtype=int)
        stride = np.zeros((count, 2))
        position = np.zeros((count, 2))
        visits = FixationMap(count) if self.model == "fixation map" else None
        path = np.empty_like(drift)
        jumping = np.zeros((steps, count), dtype=bool)
        for t in range(steps):
            # The path begins where the first step ends, so that it is where its middle is.
            position = position + drift[t] * (t > 0)
            for i in np.flatnonzero(due == t).tolist():
                jump = self._jump(position[i], streams[i], visits, i)
                step_left[i] = self._duration(jump, streams[i])
                stride[i] = jump / step_left[i]
                due[i] = t + max(self._interval(streams[i]), step_left[i] + 1)
            moving = step_left > 0
            position[moving] += stride[moving]
            step_left[moving] -= 1
            path[t], jumping[t] = position, moving
            if visits is not None:
                visits.add(t, position)
        return path, jumping

    def _interval(self, stream: np.random.Generator) -> int:
        """Steps from one start to the next."""
        scale = 1e3 * self.interval_s / _INTERVAL_SHAPE
        return max(1, round(stream.gamma(_INTERVAL_SHAPE, scale)))

    def _duration(self, jump: np.ndarray, stream: np.random.Generator) -> int:
        """Steps that a jump takes."""
        speed = stream.normal(self.speed_deg_s, self.speed_spread_deg_s) * 60.0 / 1e3
        speed = max(speed, 0.1 * self.speed_deg_s * 60.0 / 1e3)
        return max(1, round(1e3 * self.shortest_s), round(float(np.hypot(*jump)) / speed))

    def _jump(
        self, here: np.ndarray, stream: np.random.Generator, visits: FixationMap | None, trial: int
    ) -> np.ndarray:
        """The displacement, (2,), arcmin."""
        if visits is not None:
            jump = visits.target(trial, self.fixation_arcmin) - here
        else:
            jump = self._by_statistics(here, stream)
        return np.asarray(jump + self.end_spread_arcmin * stream.standard_normal(2))

    def _by_statistics(self, here: np.ndarray, stream: np.random.Generator) -> np.ndarray:
        away = float(np.hypot(*here))
        chance = -np.expm1(-((away / (0.5 * self.fixation_arcmin)) ** 2))
        if stream.random() < chance:
            spread = np.radians(self.direction_spread_deg) * stream.standard_normal()
            angle = np.arctan2(-here[1], -here[0]) + spread
            return np.asarray(away * np.array([np.cos(angle), np.sin(angle)]))
        angle = stream.uniform(0.0, 2.0 * np.pi)
        scale = self.amplitude_arcmin / _AMPLITUDE_SHAPE
        lengths = stream.gamma(_AMPLITUDE_SHAPE, scale, _CANDIDATES)
        jumps = lengths[:, None] * np.array([np.cos(angle), np.sin(angle)])
        # The first length that ends near the middle; if none does, the one that ends nearest.
        ends = np.hypot(*(here + jumps).T)
        near = np.flatnonzero(ends < self.fixation_arcmin)
        return np.asarray(jumps[near[0] if len(near) else np.argmin(ends)])


class FixationMap:
    """Where the gaze of each trial has been lately, on a grid of 2 arcmin, and where it is to go.

    Every 10 ms what is remembered fades with a time constant of 0.5 s.
    """

    def __init__(self, trials: int) -> None:
        half = int(_MAP_WIDTH_ARCMIN / _NODE_ARCMIN / 2.0)
        self._half = half
        self._nodes = _NODE_ARCMIN * np.arange(-half, half + 1)
        side = len(self._nodes)
        self._heat = np.zeros((trials, side, side))
        self._fresh = np.zeros((trials, side, side))
        self._trials = np.arange(trials)

    def add(self, step: int, position: np.ndarray) -> None:
        """Count a step at positions (trials, 2); visits outside the grid are forgotten."""
        place = np.rint(position / _NODE_ARCMIN).astype(int) + self._half
        inside = np.all((place >= 0) & (place < len(self._nodes)), axis=1)
        column, row = place[inside].T
        self._fresh[self._trials[inside], row, column] += 1.0
        if step % _UPDATE_STEPS == _UPDATE_STEPS - 1:
            self._heat *= np.exp(-_UPDATE_STEPS / _MEMORY_STEPS)
            self._heat += self._fresh
            self._fresh[:] = 0.0

    def target(self, trial: int, fixation_arcmin: float) -> np.ndarray:
        """The best place to go: central, and not visited lately, (2,), arcmin."""
        from scipy.ndimage import gaussian_filter

        sigma = _KERNEL_ARCMIN / _NODE_ARCMIN
        heat = gaussian_filter(self._heat[trial], sigma, mode="constant", truncate=_KERNEL_REACH)
        heat /= max(heat.max(), 1e-300)
        falloff = np.exp(-0.5 * np.square(self._nodes / fixation_arcmin))
        wish = (1.0 - _MAP_WEIGHT) * np.outer(falloff, falloff) + _MAP_WEIGHT * (1.0 - heat)
        row, column = np.unravel_index(np.argmax(wish), wish.shape)
        return np.array([self._nodes[column], self._nodes[row]])
