"""When a render is done: after a number of samples, a time, or at an error."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator

from isetcl.errors import InvalidInputError, check_count, check_positive
from isetcl.render import schedule
from isetcl.render.film import Film
from isetcl.retina.cone_noise import ConeNoise

DEFAULT_SPP = 256
MAX_SPP = 1 << 22
_FINE_ERROR = 1e-3


def error_of_samples(spp: int) -> float:
    """The relative error that so many samples a pixel leave, roughly.

    64 leave about 3 % on a checkerboard with edges; the error falls as N^-0.6.
    """
    return 0.03 * (64.0 / spp) ** 0.6


class Goal:
    """When a render is done: after a number of samples, a time, or at an error."""

    def __init__(
        self,
        spp: int | None,
        time_budget_s: float | None,
        target_error: float | str | ConeNoise | None,
        start: float,
    ) -> None:
        if spp is not None and (time_budget_s is not None or target_error is not None):
            raise InvalidInputError(
                "give spp, or time_budget_s and target_error, not both: "
                f"got spp={spp}, time_budget_s={time_budget_s}, target_error={target_error}"
            )
        if spp is None and time_budget_s is None and target_error is None:
            spp = DEFAULT_SPP
        self._spp = None if spp is None else check_count("spp", spp, 2, MAX_SPP)
        self._deadline = math.inf
        if time_budget_s is not None:
            self._deadline = start + check_positive("time_budget_s", time_budget_s, "s")
        self._target = 0.0
        self.cone_noise: ConeNoise | None = None
        if isinstance(target_error, str):
            target_error = ConeNoise.parse(target_error)
        if isinstance(target_error, ConeNoise):
            self.cone_noise, self._target = target_error, target_error.ratio
        elif target_error is not None:
            self._target = check_positive("target_error", target_error)

    def expected_error(self) -> float:
        """The relative error to expect, for decisions that trade it against speed."""
        if self.cone_noise is not None:
            # How bright the image will be, and with it what the ratio means, is not known yet.
            return _FINE_ERROR
        if self._target > 0:
            return self._target
        return error_of_samples(self._spp) if self._spp else _FINE_ERROR

    def work(self, film: Film) -> Iterator[float]:
        """Add replicates until the goal is met; yields the fraction done."""
        if self._spp is None:
            yield from self._pilot(film)
            return
        sizes = schedule.split(self._spp)
        if sizes[0] >= schedule.LONG_REPLICATE_SPP:
            # So that an early Ctrl-C finds an image with an error.
            for _ in range(schedule.PILOT_REPLICATES):
                for _part in film.add_replicate(schedule.MIN_REPLICATE_SPP):
                    yield 0.0
            film.restart()
        done = 0
        for size in sizes:
            for part in film.add_replicate(size):
                yield (done + part * size) / self._spp
            done += size

    def _pilot(self, film: Film) -> Iterator[float]:
        """A first estimate of the error, then as much more as it shows to be needed."""
        size = schedule.MIN_REPLICATE_SPP
        if self._deadline < math.inf:
            remaining = self._deadline - time.perf_counter()
            affordable = remaining / max(film.seconds_per_sample(), 1e-9)
            size = max(1, min(size, int(affordable / (schedule.PILOT_REPLICATES + 0.5))))
        for i in range(schedule.PILOT_REPLICATES):
            for part in film.add_replicate(size):
                yield 0.05 * (i + part) / schedule.PILOT_REPLICATES
        if not self._is_met(film):
            yield from self._continue(film, size)

    def _continue(self, film: Film, size: int) -> Iterator[float]:
        """Go on after the pilot, with longer replicates if many samples are needed."""
        pilot_error = film.error()
        per_sample = film.seconds_per_sample()
        needed = float(MAX_SPP)
        if film.is_dark:
            needed = float(schedule.DARK_SPP)
        elif self._target > 0:
            needed = schedule.samples_for_error(film.samples, pilot_error, self._target)
        affordable = (self._deadline - time.perf_counter()) / per_sample
        needed = min(needed, film.samples + affordable)
        replicates = schedule.replicates_for(film.pixels)
        longer = min(
            schedule.replicate_size_for(needed, replicates), MAX_SPP // schedule.MAX_REPLICATES
        )
        is_affordable = schedule.PILOT_REPLICATES * longer <= affordable
        if longer > size * schedule.PILOT_REPLICATES and is_affordable:
            # Equal replicates make the standard error exact; the pilot is a small part of the work.
            film.restart()
            size = longer
        while not self._is_done(film, size * film.seconds_per_sample()):
            before = film.samples
            for part in film.add_replicate(size):
                if film.replicates >= schedule.PILOT_REPLICATES and self._is_late():
                    # Tiles differ in what they have now; each knows its own error.
                    return
                yield min(0.99, (before + part * size) / max(needed, 1.0))

    def _is_done(self, film: Film, replicate_s: float) -> bool:
        if film.samples >= MAX_SPP:
            return True
        if film.replicates < schedule.PILOT_REPLICATES:
            return False
        if time.perf_counter() + replicate_s > self._deadline:
            return True
        return self._is_met(film)

    def _is_late(self) -> bool:
        return time.perf_counter() > self._deadline

    def _is_met(self, film: Film) -> bool:
        """Whether the error is small enough, and known well enough to say so."""
        if film.is_dark:
            return self._target > 0 and film.samples >= schedule.DARK_SPP
        enough = film.replicates >= schedule.replicates_for(film.pixels)
        return enough and film.error() <= self._target
