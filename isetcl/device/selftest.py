"""The start-up self-test: a device computes known answers before it is trusted.

Macros and device queries promise less, or other things, than devices do. What counts is measured:
fused multiply-add, square root, division, the cancellation-free difference of products, and 64
reference rays through the Navarro eye against the float64 tracer of the host. Results are kept on
disk, by device, driver and kernel source, so that a device is examined once.
"""

from __future__ import annotations

import json
import logging
import os
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from isetcl.device import program
from isetcl.device.devices import Device
from isetcl.device.elements import declarations
from isetcl.device.layout import Precision, real_dtype
from isetcl.device.tracer import RayTracer
from isetcl.errors import DeviceError
from isetcl.eye import sequential
from isetcl.eye.models.navarro import NavarroModel
from isetcl.eye.models.parts import PupilSpec
from isetcl.eye.prescription import elements

log = logging.getLogger(__name__)

_TOLERANCE_ULP = {"multiply-add": 0.51, "square root": 3.0, "division": 2.5}
_TOLERANCE_MM: dict[Precision, float] = {"single": 1e-5, "double": 1e-11}
_TIMED_RAYS = (1 << 12, 1 << 15, 1 << 18, 1 << 20)
_SLOW_S = 0.1


@dataclass(frozen=True)
class SelfTest:
    """What a device showed in the self-test at one precision.

    Attributes
    ----------
    failures
        What went wrong, empty if the device can be trusted.
    ray_error_mm
        Largest error of the reference rays on the retina.
    rays_per_s
        Collimated rays through the Navarro eye per second, rays and results on the device.
    """

    precision: Precision
    failures: tuple[str, ...]
    ray_error_mm: float
    rays_per_s: float

    @property
    def passed(self) -> bool:
        """Whether the device can be trusted."""
        return not self.failures


def examine(device: Device, precision: Precision = "single") -> SelfTest:
    """The self-test of a device, from the record on disk if it has been examined before."""
    key = _record_key(device, precision)
    records = _load_records()
    if key in records:
        record = records[key]
        return SelfTest(
            precision, tuple(record["failures"]), record["ray_error_mm"], record["rays_per_s"]
        )
    result = run(device, precision)
    _save_record(key, result)
    return result


def run(device: Device, precision: Precision) -> SelfTest:
    """The self-test of a device, run now."""
    try:
        failures = check_arithmetic(device, precision)
        error = reference_ray_error_mm(device, precision)
        if not error <= _TOLERANCE_MM[precision]:
            failures.append(
                f"reference rays are wrong by {error:.3g} mm, "
                f"allowed are {_TOLERANCE_MM[precision]:g} mm"
            )
        speed = measure_rays_per_s(device, precision)
    except DeviceError as refusal:
        return SelfTest(precision, (str(refusal),), float("inf"), 0.0)
    return SelfTest(precision, tuple(failures), error, speed)


def require(device: Device) -> None:
    """Raise DeviceError, with the reason, if a device fails its self-test in single precision."""
    result = examine(device)
    if not result.passed:
        raise DeviceError(
            f"device {device.index} {device.name!r} ({device.platform}, driver {device.driver}) "
            f"failed the self-test and is not used: {'; '.join(result.failures)}; choose another "
            "with ISETCL_DEVICE or update its driver"
        )


def fastest(devices: Sequence[Device]) -> Device:
    """The device that passes and traces most rays per second.

    Raises
    ------
    DeviceError
        If none passes.
    """
    results = [(examine(device), device) for device in devices]
    passed = [(result.rays_per_s, device) for result, device in results if result.passed]
    if not passed:
        require(devices[0])
    return max(passed, key=lambda pair: pair[0])[1]


def check_arithmetic(device: Device, precision: Precision) -> list[str]:
    """Failures of the basic operations on a device, empty if there are none."""
    import pyopencl as cl

    real = real_dtype(precision)
    a, b, c = _operands(real)
    n = len(a)
    source = program.assemble("selftest.cl", device.defines(precision))
    kernel = program.kernel(device, source, "arithmetic")
    flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
    inputs = [cl.Buffer(device.context, flags, hostbuf=x) for x in (a, b, c)]
    output = np.empty((4, n), dtype=real)
    results = cl.Buffer(device.context, cl.mem_flags.WRITE_ONLY, output.nbytes)
    kernel.set_args(*inputs, np.int32(n), results)
    width = device.defines(precision)["WIDTH"]
    cl.enqueue_nd_range_kernel(device.queue, kernel, (n // width,), (1,))
    cl.enqueue_copy(device.queue, output, results)
    return _judge(real, a, b, c, output)


def _operands(real: np.dtype) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """256 triples; the first is one whose product-sum survives only a fused multiply-add."""
    rng = np.random.default_rng(20261122)
    a, b, c = (rng.uniform(0.5, 2.0, 256).astype(real) for _ in range(3))
    half = 0.5 ** (12 if real == np.float32 else 27)
    a[0] = b[0] = 1.0 + half
    c[0] = -(1.0 + 2.0 * half)
    return a, b, c


def _judge(
    real: np.dtype, a: np.ndarray, b: np.ndarray, c: np.ndarray, output: np.ndarray
) -> list[str]:
    """Failures among the results of the kernel `arithmetic`."""
    failures = []
    half = 0.5 ** (12 if real == np.float32 else 27)
    if output[0, 0] != half * half:
        failures.append(
            f"multiply-add is not fused: (1+h)^2 - (1+2h) gave {output[0, 0]:g}, not h^2"
        )
    wide = [x.astype(np.longdouble) for x in (a, b, c)]
    expected = {
        "multiply-add": wide[0] * wide[1] + wide[2],
        "square root": np.sqrt(wide[0]),
        "division": wide[0] / wide[1],
    }
    for row, (name, exact) in enumerate(expected.items()):
        scale = np.spacing(np.abs(exact).astype(real))
        ulp = np.max(np.abs(output[row].astype(np.longdouble) - exact) / scale)
        # numpy's longdouble has 64 bits: enough for float, short of the last bit for double.
        if not ulp <= _TOLERANCE_ULP[name] + (0.5 if real == np.float64 else 0.0):
            failures.append(f"{name} is wrong by {float(ulp):.3g} ulp")
    exact_difference = wide[0] * wide[1] - wide[2] * wide[2]
    scale = np.finfo(real).eps * np.abs(exact_difference) + np.finfo(real).eps ** 2
    error = np.max(np.abs(output[3].astype(np.longdouble) - exact_difference) / scale)
    if not error <= 4.0:
        failures.append(f"a difference of products is wrong by {float(error):.3g} ulp")
    return failures


def reference_ray_error_mm(device: Device, precision: Precision) -> float:
    """Largest distance on the retina between 64 rays on a device and on the host, mm."""
    eye = NavarroModel(PupilSpec(6.0)).eye(0.0)
    sequence = elements(eye, 550.0)
    origins, directions = reference_rays()
    tracer = RayTracer(device, precision)
    trace = tracer.prepare(tracer.upload(origins, directions), sequence, "retina")
    trace.run()
    got = trace.fetch()
    real = real_dtype(precision)
    expected = sequential.trace_elements(
        sequence,
        origins.astype(real).astype(float),
        directions.astype(real).astype(float),
        "retina",
    )
    if not np.array_equal(got.status, expected.status) or not expected.passed.all():
        return float("inf")
    return float(np.max(np.linalg.norm(got.positions_mm - expected.positions_mm, axis=1)))


def reference_rays() -> tuple[np.ndarray, np.ndarray]:
    """64 rays towards the pupil from field angles of 0 to 60 degrees, (64, 3) mm and (64, 3)."""
    i = np.arange(64)
    radius = 2.0 * np.sqrt((i + 0.5) / 64.0)
    turn = i * np.pi * (3.0 - np.sqrt(5.0))
    field = np.radians(60.0 * (i % 8) / 7.0)
    pupil = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.full(64, 3.04)], axis=1)
    directions = np.stack([np.zeros(64), np.sin(field), np.cos(field)], axis=1)
    # Start 8 mm in front of the pupil along each ray: outside the cornea at every angle.
    return pupil - 8.0 * directions, directions


def measure_rays_per_s(device: Device, precision: Precision) -> float:
    """Collimated rays through the Navarro eye per second; best of five short runs.

    Bundles grow until one takes 5 ms, so that slow devices are not kept busy.
    """
    for count in _TIMED_RAYS:
        seconds = _seconds_for_rays(device, precision, count)
        if seconds > 5e-3:
            break
    return count / seconds


def _seconds_for_rays(device: Device, precision: Precision, count: int) -> float:
    eye = NavarroModel(PupilSpec(4.0)).eye(0.0)
    i = np.arange(count)
    radius = 2.2 * np.sqrt((i + 0.5) / count)
    turn = i * np.pi * (3.0 - np.sqrt(5.0))
    origins = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.full(count, -1.0)], axis=1)
    tracer = RayTracer(device, precision)
    rays = tracer.upload(origins, np.broadcast_to([0.0, 0.0, 1.0], origins.shape))
    trace = tracer.prepare(rays, elements(eye, 550.0), "retina")
    trace.run().wait()
    best = float("inf")
    for _ in range(5):
        start = time.perf_counter()
        trace.run().wait()
        best = min(best, time.perf_counter() - start)
        if best > _SLOW_S:
            break
    return best


def _record_key(device: Device, precision: Precision) -> str:
    sources = declarations() + "".join(
        program.assemble(name, device.defines(precision))
        for name in ("selftest.cl", "trace_rays.cl")
    )
    parts = [*device.describe().values(), precision, program.digest(sources)]
    return " | ".join(parts)


def records_path() -> Path:
    """Where the results of self-tests are kept."""
    import platformdirs

    return Path(platformdirs.user_cache_dir("isetcl")) / "selftest.json"


def _load_records() -> dict[str, dict[str, Any]]:
    try:
        return dict(json.loads(records_path().read_text(encoding="utf-8")))
    except (OSError, ValueError):
        return {}


def _save_record(key: str, result: SelfTest) -> None:
    """Keep a result; a cache that cannot be written is no reason to stop."""
    path = records_path()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        records = _load_records() | {key: asdict(result)}
        temporary = path.with_suffix(f".{os.getpid()}")
        temporary.write_text(json.dumps(records, indent=1), encoding="utf-8")
        temporary.replace(path)
    except OSError as error:
        log.info("self-test result not kept: %s", error)
