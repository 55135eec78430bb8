"""Methods of known bias, noise and time, for studies of error against run time."""

import numpy as np

from isetcl.validation import WorkMethod, work_precision
from isetcl.validation.work_precision import Clock

PIXELS = 256
# Mean exactly 1: errors relative to it are absolute.
TRUTH = 1.0 + 0.5 * np.sin(2.0 * np.pi * np.arange(PIXELS) / 64.0)
KNOBS = (16, 64, 256)


def pattern():
    """A fixed error of mean 0 and root mean square 1."""
    values = np.random.default_rng(0).standard_normal(PIXELS)
    values -= values.mean()
    return values / np.sqrt(np.mean(values**2))


class Planted:
    """A method of known bias and noise, on a clock that it moves itself.

    Every third call takes `jitter` longer, the next `2 jitter`; `scatter` is the standard deviation
    of the logarithm of its times.
    """

    def __init__(self, *, slope=-0.5, noise=0.1, bias=0.0, salt=0, jitter=0.0, scatter=0.0):
        self.slope, self.noise, self.bias, self.salt = slope, noise, bias, salt
        self.jitter, self.scatter = jitter, scatter
        self.clock = None
        self.calls = []

    def __call__(self, knob, seed):
        rng = np.random.default_rng([self.salt, seed, int(knob)])
        seconds = 1e-3 * knob * (1.0 + self.jitter * (len(self.calls) // 3 % 3))
        if self.scatter > 0:
            clock_rng = np.random.default_rng([self.salt, seed, int(knob), 1])
            seconds *= np.exp(self.scatter * clock_rng.standard_normal())
        self.clock.now += seconds
        self.calls.append((knob, seed))
        sigma = self.noise * knob**self.slope
        return TRUTH + self.bias * pattern() + sigma * rng.standard_normal(PIXELS)

    def true_rmse(self, knob):
        return np.hypot(self.bias, self.noise * knob**self.slope)


class FakeClock:
    now = 0.0

    def clock(self):
        return Clock(lambda: self.now, lambda: self.now)


def study(planted, *, reference=None, knobs=KNOBS, parts=(), **options):
    """A study of planted methods by name."""
    fake = FakeClock()
    for method in planted.values():
        method.clock = fake
    methods = [WorkMethod(name, f, knobs, "spp", parts=parts) for name, f in planted.items()]
    return work_precision(
        methods,
        reference=TRUTH if reference is None else reference,
        clock=fake.clock(),
        **{"least_s": 0.0, **options},
    )
