"""When a render ends: budgets of time on machines and scenes whose pace changes."""

import dataclasses
import time

import numpy as np
import pytest

import isetcl as ic
from isetcl.render.film import Film
from isetcl.render.goal import Goal


class Clock:
    """A clock that only work moves on."""

    def __init__(self, monkeypatch):
        self.now = 0.0
        monkeypatch.setattr(time, "perf_counter", lambda: self.now)


class TimedFilm:
    """A film that takes `factor` times as long as it was thought to when it was timed."""

    pixels, is_dark = 10_000, False

    def __init__(self, clock, factor, thought_s=1e-3):
        self.clock, self.factor, self.thought_s = clock, factor, thought_s
        self.sizes = []

    replicates = property(lambda self: len(self.sizes))
    samples = property(lambda self: sum(self.sizes))

    def error(self):
        return 1.0

    def restart(self):
        self.sizes = []

    def seconds_per_sample(self):
        return self.thought_s

    def add_replicate(self, samples):
        for part in range(1, 11):
            self.clock.now += self.thought_s * self.factor * samples / 10
            if part == 10:
                self.sizes.append(samples)
            yield part / 10


@pytest.mark.parametrize(("factor", "end_s"), [(1.0, 10.0), (3.0, 10.2), (8.0, 20.6)])
def test_a_time_budget_is_kept_on_a_machine_that_slows_down(monkeypatch, factor, end_s):
    """A replicate is given up at the deadline, unless there would be no error without it."""
    clock = Clock(monkeypatch)
    film = TimedFilm(clock, factor)
    for _ in Goal(None, 10.0, None, 0.0).work(film):
        pass
    assert clock.now <= end_s
    assert film.replicates >= 2
    if factor == 1.0:
        assert clock.now > 8.5


def test_a_budget_for_a_few_samples_is_used_up(monkeypatch):
    """Where a sample of the whole image takes long, the pilot is short and is continued."""
    clock = Clock(monkeypatch)
    film = TimedFilm(clock, 0.2, thought_s=0.1)
    for _ in Goal(None, 1.5, None, 0.0).work(film):
        pass
    # 15 samples seemed affordable: two replicates of 6; more followed while there was time.
    assert set(film.sizes) == {6}
    assert 1.5 - 6 * 0.1 <= clock.now <= 1.5


def test_the_pace_is_that_of_the_whole_image(monkeypatch):
    """The middle of a scene may hold far more than its corner."""
    clock = Clock(monkeypatch)
    prepared = ic.plan(ic.scenes.two_planes(), ic.eyes.navarro(), resolution=(96, 64), bands=1)
    prepared = dataclasses.replace(prepared, tile=(32, 32))

    class Pipeline:
        def sample(self, tile, samples, stream):
            list(self.parts(tile, samples, stream))

        def parts(self, tile, samples, stream):
            clock.now += samples * (0.5 if tile.x == 32 else 0.001)
            yield np.ones((1, tile.rows, tile.columns)), samples

    film = Film(prepared, Pipeline(), 0)
    per_sample = 4 * 0.001 + 2 * 0.5
    assert film.seconds_per_sample() == pytest.approx(per_sample, rel=0.7)
    for _ in film.add_replicate(16):
        clock.now += 100.0  # What others do between the parts is none of its time.
    assert film.seconds_per_sample() == pytest.approx(per_sample)
