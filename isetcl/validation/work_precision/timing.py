"""Run times in the steady state, one method after the other, and whether they can be believed."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from isetcl.errors import InvalidInputError, IsetclError

if TYPE_CHECKING:
    from isetcl.validation.work_precision.result import WorkPrecision

LARGEST_SPREAD = 0.2
LEAST_S = 0.2
_MOST_CALLS = 10_000

ClockName = Literal["wall", "cpu"]
CLOCKS: tuple[ClockName, ...] = ("wall", "cpu")


class NoisyTimingError(IsetclError, RuntimeError):
    """Times differ too much from run to run to be reported; `result` has all but the times."""

    def __init__(self, message: str, result: WorkPrecision) -> None:
        super().__init__(message)
        self.result = result


@dataclass(frozen=True)
class Clock:
    """Where times come from: functions that return seconds.

    Attributes
    ----------
    wall
        Time that passes.
    cpu
        Processor time of all threads of this process.
    """

    wall: Callable[[], float] = time.perf_counter
    cpu: Callable[[], float] = time.process_time


@dataclass
class Times:
    """Seconds a call of one method at one knob.

    Attributes
    ----------
    first_s
        Of the very first call, kernels and tables built in it.
    wall_s, cpu_s
        Of each measurement after it.
    transfer_s
        Part of each call spent on copies to and from the device, as the image tells.
    """

    first_s: float = 0.0
    wall_s: list[float] = field(default_factory=list)
    cpu_s: list[float] = field(default_factory=list)
    transfer_s: list[float] = field(default_factory=list)

    def of(self, clock: ClockName) -> list[float]:
        """The measurements of one clock."""
        return self.wall_s if clock == "wall" else self.cpu_s

    def median_s(self, clock: ClockName) -> float:
        """Median over the measurements."""
        return statistics.median(self.of(clock))

    def spread(self, clock: ClockName) -> float:
        """(median - least) / least."""
        least = min(self.of(clock))
        return (self.median_s(clock) - least) / least


def timed(
    call: Callable[[], object], what: str, clock: Clock, least_s: float
) -> tuple[object, float, float]:
    """The first result of a call, and its wall and processor time, s, over `least_s` of calls.

    Raises
    ------
    InvalidInputError
        If the call takes no time.
    """
    wall, cpu = clock.wall(), clock.cpu()
    result = call()
    calls, elapsed = 1, clock.wall() - wall
    if elapsed > 0:
        while elapsed < least_s and calls < _MOST_CALLS:
            call()
            calls += 1
            elapsed = clock.wall() - wall
    used = clock.cpu() - cpu
    if not elapsed > 0 or used < 0:
        raise InvalidInputError(
            f"the run time of {what} must be > 0 s, got {elapsed:g} s; the function does nothing, "
            "or the clock does not run"
        )
    return result, elapsed / calls, used / calls


def check_quiet(spreads: dict[str, float]) -> str | None:
    """What to say of times that differ too much; None if there are none such."""
    noisy = {name: s for name, s in spreads.items() if s > LARGEST_SPREAD}
    if not noisy:
        return None
    worst = sorted(noisy, key=noisy.__getitem__, reverse=True)[:3]
    listed = ", ".join(f"{name} by {100 * noisy[name]:.0f} %" for name in worst)
    return (
        f"the machine was too noisy: medians may lie {100 * LARGEST_SPREAD:.0f} % above the least "
        f"time, but {len(noisy)} of {len(spreads)} lie farther ({listed})"
    )
