"""The outer segment of a cone: from excitations a second to the current through its membrane.

The biophysical model of Rieke and colleagues (Angueyra & Rieke 2013, Nat Neurosci 16:1692), which
ISETBio has as ``osBioPhys``. With excitations R*(t) a second,

    r' = gain R* - sigma r                          activity of the pigment
    p' = r + eta - phi p                            activity of the phosphodiesterase
    g' = s - p g,  s = s_max / (1 + (c / K)^n)      cyclic GMP, and its cyclase
    c' = q I - beta c                               calcium
    d' = beta_slow (c - d)                          calcium, slow
    I  = k g^h / (1 + d / c_dark)                   current

where s_max and q follow from what g and c are in darkness.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_positive

STEP_S = 1e-4
"""Default time step, s; ISETBio's."""

_HALVINGS = 64
_MOST_STEPS = 1e8
_CONES_AT_ONCE = 2048


@dataclass(frozen=True)
class OuterSegment:
    """Constants of the cascade; the defaults are ISETBio's for the fovea.

    Parameters
    ----------
    sigma_hz, phi_hz
        Decay rates of the pigment's and the phosphodiesterase's activity.
    eta_hz2
        Activation of the phosphodiesterase in darkness, 1/s^2.
    dark_gmp, dark_calcium
        Concentrations in darkness, uM.
    current_factor, channel_power
        k, pA/uM^h, and h.
    beta_hz, slow_hz
        Rates of calcium's removal and of its slow share.
    cyclase_power, cyclase_calcium
        n, and K, uM.
    gain_hz
        Pigment activity that an excitation adds.
    """

    sigma_hz: float = 10.0
    phi_hz: float = 22.0
    eta_hz2: float = 700.0
    dark_gmp: float = 20.5
    current_factor: float = 0.02
    channel_power: float = 3.0
    dark_calcium: float = 1.0
    beta_hz: float = 5.0
    slow_hz: float = 0.4
    cyclase_power: float = 4.0
    cyclase_calcium: float = 0.5
    gain_hz: float = 12.0

    def __post_init__(self) -> None:
        for each in fields(self):
            check_positive(f"outer segment: {each.name}", getattr(self, each.name))

    @classmethod
    def foveal(cls) -> OuterSegment:
        """A cone within 10 degrees of the fovea."""
        return cls()

    @classmethod
    def peripheral(cls) -> OuterSegment:
        """A cone farther out: faster, and less sensitive."""
        return cls(sigma_hz=22.0, eta_hz2=2000.0, beta_hz=9.0, gain_hz=10.0)

    @property
    def calcium_share(self) -> float:
        """q, uM/(pA s): calcium is at rest in darkness, where the current is k g^h / 2."""
        current = 0.5 * self.current_factor * self.dark_gmp**self.channel_power
        return self.beta_hz * self.dark_calcium / current

    @property
    def most_cyclase(self) -> float:
        """s_max, uM/s: cyclic GMP is at rest in darkness."""
        held = 1.0 + (self.dark_calcium / self.cyclase_calcium) ** self.cyclase_power
        return self.eta_hz2 / self.phi_hz * self.dark_gmp * held

    @property
    def dark_current_pa(self) -> float:
        """Current in darkness, pA; inward, and so negative."""
        return -0.5 * self.current_factor * self.dark_gmp**self.channel_power

    def steady_current_pa(self, rate_hz: np.ndarray | float) -> np.ndarray:
        """Current under steady light of so many excitations a second, pA, of the shape given."""
        return np.asarray(-self._current(*self.steady_state(rate_hz)[2::2]))

    def steady_state(self, rate_hz: np.ndarray | float) -> tuple[np.ndarray, ...]:
        """r, p, g, c and d under steady light of so many excitations a second.

        The light fixes r and p; calcium then lies where its inflow, which falls as it rises,
        equals its removal: one root, found by halving. The gain of the pigment counts here as it
        does in time, so that a response to steady light is flat.

        Raises
        ------
        InvalidInputError
            If a rate is negative or not finite.
        """
        rate = _check_rates("rate_hz", rate_hz)
        pigment = self.gain_hz * rate / self.sigma_hz
        diesterase = (pigment + self.eta_hz2) / self.phi_hz
        low = np.zeros_like(diesterase)
        high = self._inflow(low, diesterase) / self.beta_hz
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            is_low = self._inflow(middle, diesterase) > self.beta_hz * middle
            low, high = np.where(is_low, middle, low), np.where(is_low, high, middle)
        calcium = 0.5 * (low + high)
        return pigment, diesterase, self._cyclase(calcium) / diesterase, calcium, calcium

    def _cyclase(self, calcium: np.ndarray) -> np.ndarray:
        held = _power(calcium / self.cyclase_calcium, self.cyclase_power)
        return np.asarray(self.most_cyclase / (1.0 + held))

    def _current(self, gmp: np.ndarray, slow: np.ndarray) -> np.ndarray:
        open_share = _power(gmp, self.channel_power)
        return np.asarray(self.current_factor * open_share / (1.0 + slow / self.dark_calcium))

    def _inflow(self, calcium: np.ndarray, diesterase: np.ndarray) -> np.ndarray:
        """Calcium that comes in a second where calcium is at rest, uM/s."""
        gmp = self._cyclase(calcium) / diesterase
        return self.calcium_share * self._current(gmp, calcium)

    def respond(
        self,
        rates_hz: np.ndarray,
        frame_time_s: float = STEP_S,
        background_hz: np.ndarray | float | None = None,
        *,
        step_s: float = STEP_S,
    ) -> np.ndarray:
        """Current at the end of each frame, pA, of the shape of the rates.

        Second order in the step, and stable however bright the light: pigment and phosphodiesterase
        are solved exactly for light constant within a frame; cyclic GMP, in which its equation is
        linear, by the trapezium rule; calcium likewise, half a step apart.

        Parameters
        ----------
        rates_hz
            Excitations a second in each frame, (frames, cones) or (frames,).
        frame_time_s
            Length of a frame, s.
        background_hz
            Steady light before, a number or (cones,); None is that of the first frame.
        step_s
            Longest time step, s.

        Raises
        ------
        InvalidInputError
            If a rate is negative or not finite, or shapes do not fit.
        """
        rates = _check_rates("rates_hz", rates_hz)
        if rates.ndim not in (1, 2) or 0 in rates.shape:
            raise InvalidInputError(
                f"rates_hz must have shape (frames, cones) or (frames,), got {rates.shape}"
            )
        columns = rates.reshape(len(rates), -1)
        background = _check_rates(
            "background_hz", columns[0] if background_hz is None else background_hz
        )
        if background.shape not in ((), columns.shape[1:]):
            raise InvalidInputError(
                f"background_hz must be a number or one for each of {columns.shape[1]} cones, got "
                f"shape {background.shape}"
            )
        background = np.broadcast_to(background, columns.shape[1:])
        frame_s = check_positive("frame_time_s", frame_time_s, "s")
        count = frame_s / check_positive("step_s", step_s, "s")
        if count * len(rates) > _MOST_STEPS:
            raise InvalidInputError(
                f"{len(rates)} frames of {frame_s:g} s need {count * len(rates):.3g} steps of "
                f"{step_s:g} s, and at most {_MOST_STEPS:.0e} are made; take a longer step_s or "
                "shorter frames"
            )
        steps = max(1, int(np.ceil(count - 1e-9)))
        current = np.empty_like(columns)
        for first in range(0, columns.shape[1], _CONES_AT_ONCE):
            part = slice(first, first + _CONES_AT_ONCE)
            self._march(
                columns[:, part], background[part], frame_s / steps, steps, current[:, part]
            )
        return current.reshape(rates.shape)

    def _march(
        self, rates: np.ndarray, background: np.ndarray, step: float, steps: int, out: np.ndarray
    ) -> None:
        """Write the current at the end of each frame of so many steps into `out`."""
        pigment, diesterase, gmp, calcium, slow = self.steady_state(background)
        # Calcium lives at half steps; at rest it does not move within the first one.
        decay = np.exp(-np.array([self.sigma_hz, self.phi_hz]) * step)
        half_beta, half_slow = 0.5 * step * self.beta_hz, 0.5 * step * self.slow_hz
        keep_calcium, gain_calcium = (
            (1.0 - half_beta) / (1.0 + half_beta),
            step * self.calcium_share / (1.0 + half_beta),
        )
        keep_slow, gain_slow = (
            (1.0 - half_slow) / (1.0 + half_slow),
            2.0 * half_slow / (1.0 + half_slow),
        )
        mixed = self._mixing(step)
        for frame, rate in enumerate(rates):
            goal = self.gain_hz * rate / self.sigma_hz
            goal_diesterase = (goal + self.eta_hz2) / self.phi_hz
            for _ in range(steps):
                half = 0.25 * step * diesterase
                excess = pigment - goal
                diesterase = (
                    goal_diesterase + (diesterase - goal_diesterase) * decay[1] + mixed * excess
                )
                pigment = goal + excess * decay[0]
                half += 0.25 * step * diesterase
                gmp = (gmp * (1.0 - half) + step * self._cyclase(calcium)) / (1.0 + half)
                slow = keep_slow * slow + gain_slow * calcium
                current = self._current(gmp, slow)
                calcium = keep_calcium * calcium + gain_calcium * current
            out[frame] = -current

    def _mixing(self, step: float) -> float:
        """What an excess of pigment activity adds to phosphodiesterase within a step, s."""
        sigma, phi = self.sigma_hz, self.phi_hz
        if abs(phi - sigma) * step < 1e-6:
            return float(step * np.exp(-0.5 * (sigma + phi) * step))
        return float((np.exp(-sigma * step) - np.exp(-phi * step)) / (phi - sigma))


def _power(base: np.ndarray, exponent: float) -> np.ndarray:
    """A power; small whole ones by multiplication, which is many times faster."""
    if exponent == 3.0:
        return base * base * base
    if exponent == 4.0:
        squared = base * base
        return squared * squared
    return np.asarray(base**exponent)


def _check_rates(name: str, rates: np.ndarray | float) -> np.ndarray:
    array = check_array(name, rates)
    bad = ~(np.isfinite(array) & (array >= 0))
    if np.any(bad):
        raise InvalidInputError(
            f"{name} must be finite and >= 0 excitations/s, got {array[bad].ravel()[0]:g}"
        )
    return array
