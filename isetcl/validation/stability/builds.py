"""Cases 59 and 60: options of the compiler, and wavelengths that are not known."""

from __future__ import annotations

import math

import numpy as np

from isetcl.device import selftest
from isetcl.device.devices import Device
from isetcl.errors import InvalidInputError
from isetcl.eye import catalog
from isetcl.eye.rays import RayBundle
from isetcl.render.plan import plan
from isetcl.render.trace import trace_rays
from isetcl.scene.model import Scene
from isetcl.spectrum import Spectrum
from isetcl.validation.stability.case import Bench, NotApplicableError, case, registered

FAST_MATH = "-cl-fast-relaxed-math"
_SENSITIVE = (8, 10, 11, 15)
"""Cases in which rays are lost: without NaN there is no telling."""


def with_option(device: Device, option: str) -> Device:
    """The same device, whose programs are built with one more option."""
    other = Device(device.raw, device.index, device.target)
    # Shadows the property that is computed once.
    other.__dict__["build_options"] = (*device.build_options, option)
    return other


@case(59, "the shipped build, and one with fast relaxed math", "right, and found out",
      "verdicts wrong", single=0, double=0)  # fmt: skip
def _fast_math(bench: Bench) -> tuple[int, str]:
    shipped = selftest.check_arithmetic(bench.device, bench.precision)
    if shipped:
        return 1, "; ".join(shipped)
    if bench.device.is_interpreter:
        raise NotApplicableError("an interpreter has no fast math")
    fast = Bench(with_option(bench.device, FAST_MATH), bench.precision)
    found = [f"arithmetic: {f}" for f in selftest.check_arithmetic(fast.device, fast.precision)]
    found += [f"case {n}" for n in _SENSITIVE if registered(n).run(fast).failed]
    note = f"with fast math fail {'; '.join(found)}" if found else "fast math was not noticed"
    return int(not found), note


@case(60, "wavelengths at the ends and beyond", "380 and 780 nm pass; what is not known is refused",
      "answers wrong", single=0, double=0)  # fmt: skip
def _wavelengths(bench: Bench) -> int:
    eye = catalog.navarro(4.0)

    def traced(wavelength: float) -> RayBundle:
        return trace_rays(
            eye,
            np.array([0.0, 0.5, -1.0]),
            np.array([0.0, 0.0, 1.0]),
            wavelength,
            precision=bench.precision,
            record_hits=False,
            device=bench.device.index,
        )

    def planned(wavelength: float) -> None:
        light = Spectrum(np.array([400.0, 700.0]), np.array([1.0, 1.0]))
        plan(
            Scene((), light),
            eye,
            resolution=4,
            wavelengths_nm=np.array([wavelength]),
            precision=bench.precision,
            device=bench.device.index,
        )

    wrong = 0
    for wavelength in (380.0, 780.0):
        rays = traced(wavelength)
        wrong += int(not rays.passed.all()) + int(not np.isfinite(rays.positions_mm).all())
    attempts = (
        (traced, 300.0),
        (traced, 1100.0),
        (traced, math.nan),
        (planned, 390.0),
        (planned, 701.0),
    )
    for attempt, wavelength in attempts:
        try:
            attempt(wavelength)
        except InvalidInputError:
            continue
        wrong += 1
    return wrong
