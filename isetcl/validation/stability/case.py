"""A case of the stability suite: what must come out, how it is measured, and the verdict."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from isetcl.device.devices import Device
from isetcl.device.eye_features import EyeFeatures
from isetcl.device.layout import Precision, real_dtype
from isetcl.device.tracer import RayTracer
from isetcl.errors import check_choice, check_count
from isetcl.eye.prescription import Element
from isetcl.eye.rays import RayBundle
from isetcl.eye.sequential import Towards

VerdictName = Literal["pass", "fail", "error", "not applicable"]

UM_PER_MM = 1000.0


class NotApplicableError(Exception):
    """A case that a device or precision cannot show; the message says why."""


@dataclass(eq=False)
class Bench:
    """Where cases are measured.

    Attributes
    ----------
    device, precision
        What is under test.
    full
        Whether cases that are scaled down to save time run at their full size.
    """

    device: Device
    precision: Precision
    full: bool = False
    _tracers: dict[tuple[Any, ...], RayTracer] = field(default_factory=dict, repr=False)

    @property
    def real(self) -> np.dtype:
        """The numbers of the kernels."""
        return real_dtype(self.precision)

    @property
    def epsilon(self) -> float:
        """Spacing of numbers at 1."""
        return float(np.finfo(self.real).eps)

    def rounded(self, values: np.ndarray) -> np.ndarray:
        """Numbers as the kernels hold them."""
        return np.asarray(np.asarray(values, dtype=float).astype(self.real), dtype=float)

    def rays(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rays as the kernels hold them, so that a reference starts from the same ones."""
        return self.rounded(origins), self.rounded(directions)

    def number(self, value: float) -> float:
        """A single number as the kernels hold it."""
        return float(self.real.type(value))

    def trace(
        self,
        sequence: Sequence[Element],
        origins: np.ndarray,
        directions: np.ndarray,
        towards: Towards = "retina",
        *,
        features: EyeFeatures | None = None,
        width: int | None = None,
    ) -> RayBundle:
        """Rays through elements in travel order on the device, without the host's preparation."""
        features = EyeFeatures() if features is None else features
        key = features, width
        if key not in self._tracers:
            self._tracers[key] = RayTracer(
                self.device,
                self.precision,
                record_opl=True,
                features=features,
                vector_width=width,
            )
        tracer = self._tracers[key]
        trace = tracer.prepare(tracer.upload(origins, directions), tuple(sequence), towards)
        trace.run()
        return trace.fetch()


Measure = Callable[[Bench], "float | tuple[float, str]"]


@dataclass(frozen=True)
class Case:
    """One extreme case.

    Attributes
    ----------
    number
        1 to 60 are the cases of the table of extremes; more are scenes.
    title
        What is extreme.
    expected
        What must come out.
    unit
        Of what is measured.
    single, double
        The largest measured value that passes; None where the case says nothing.
    measure
        Returns the measured value, or it and a remark.
    """

    number: int
    title: str
    expected: str
    unit: str
    single: float | None
    double: float | None
    measure: Measure = field(repr=False)

    def __post_init__(self) -> None:
        check_count("number", self.number)

    def tolerance(self, precision: Precision) -> float | None:
        """The largest value that passes."""
        return self.single if precision == "single" else self.double

    def run(self, bench: Bench) -> Outcome:
        """The case on a device; a case that raises has failed, and says how."""
        start = time.perf_counter()
        tolerance = self.tolerance(bench.precision)
        value, note, verdict = float("nan"), "", "not applicable"
        try:
            if tolerance is None:
                raise NotApplicableError("says nothing in this precision")
            measured = self.measure(bench)
            value, note = measured if isinstance(measured, tuple) else (measured, "")
            verdict = "pass" if value <= tolerance else "fail"
        except NotApplicableError as reason:
            note = str(reason)
        except Exception as error:
            # A driver that refuses, a wrong shape: whatever happens is the case's outcome.
            verdict, note = "error", f"{type(error).__name__}: {error}"
        elapsed = time.perf_counter() - start
        return Outcome(self, bench.precision, float(value), note, verdict, elapsed)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Outcome:
    """What a case gave.

    Attributes
    ----------
    value
        What was measured, in the case's unit; NaN without a measurement.
    note
        A remark, or why there is no measurement.
    verdict
        ``"pass"``, ``"fail"``, ``"error"`` or ``"not applicable"``.
    seconds
        Time it took.
    """

    case: Case
    precision: Precision
    value: float
    note: str
    verdict: VerdictName
    seconds: float

    def __post_init__(self) -> None:
        check_choice("verdict", self.verdict, ("pass", "fail", "error", "not applicable"))

    @property
    def failed(self) -> bool:
        """Whether the suite must not pass with this outcome."""
        return self.verdict in ("fail", "error")


_CASES: dict[int, Case] = {}


def case(
    number: int,
    title: str,
    expected: str,
    unit: str,
    *,
    single: float | None,
    double: float | None,
) -> Callable[[Measure], Measure]:
    """Register a function that measures a case."""

    def register(measure: Measure) -> Measure:
        assert number not in _CASES, f"case {number} is registered twice"
        _CASES[number] = Case(number, title, expected, unit, single, double, measure)
        return measure

    return register


def registered(number: int) -> Case:
    """A case by its number."""
    return _CASES[number]


@functools.cache
def cases() -> tuple[Case, ...]:
    """All cases in the order of their numbers."""
    from isetcl.validation.stability import (  # noqa: F401
        builds,
        eyes,
        gradients,
        layouts,
        scenes,
        shapes,
        single_surfaces,
        solids,
        sums,
    )

    return tuple(_CASES[n] for n in sorted(_CASES))
