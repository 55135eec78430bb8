"""OpenCL devices: which there are, and what isetcl needs to know about them."""

from __future__ import annotations

import functools
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from isetcl.device import caches, pocl
from isetcl.device.layout import Precision
from isetcl.errors import DeviceError, check_choice

if TYPE_CHECKING:
    import pyopencl


@dataclass(eq=False)
class Device:
    """An OpenCL device with its context, its queue and the programs built for it.

    Attributes
    ----------
    raw
        The pyopencl device.
    index
        "platform:device", as `find_device` accepts it.
    target
        The processor that kernels are compiled for, where isetcl had to name one.
    transfer_s
        Time spent so far on copies to and from the memory of the device, s.
    """

    raw: pyopencl.Device
    index: str
    target: str | None
    programs: dict[str, Any] = field(default_factory=dict, repr=False)
    kernels: dict[tuple[str, str], Any] = field(default_factory=dict, repr=False)
    transfer_s: float = 0.0

    @property
    def name(self) -> str:
        """Name of the device as its driver gives it."""
        return str(self.raw.name).strip()

    @property
    def platform(self) -> str:
        """Name of the OpenCL platform."""
        return str(self.raw.platform.name).strip()

    @property
    def driver(self) -> str:
        """Version of the driver."""
        return str(self.raw.driver_version).strip()

    @property
    def is_cpu(self) -> bool:
        """Whether kernels run on the host's processor."""
        import pyopencl as cl

        return bool(self.raw.type & cl.device_type.CPU)

    @property
    def has_double(self) -> bool:
        """Whether the device computes in float64."""
        return "cl_khr_fp64" in self.raw.extensions

    @functools.cached_property
    def context(self) -> pyopencl.Context:
        """The OpenCL context of this device alone."""
        import pyopencl as cl

        return cl.Context([self.raw])

    @functools.cached_property
    def queue(self) -> pyopencl.CommandQueue:
        """The in-order queue that all work of this process goes through."""
        import pyopencl as cl

        return cl.CommandQueue(self.context)

    @functools.cached_property
    def build_options(self) -> tuple[str, ...]:
        """Compiler options: correctly rounded divisions and roots where they can be asked for."""
        import pyopencl as cl

        correctly_rounded = cl.device_fp_config.CORRECTLY_ROUNDED_DIVIDE_SQRT
        options = ["-cl-std=CL1.2"]
        if self.raw.single_fp_config & correctly_rounded:
            options.append("-cl-fp32-correctly-rounded-divide-sqrt")
        if self.is_interpreter:
            # Oclgrind lacks an instruction that the optimiser makes of reversing bits.
            options.append("-cl-opt-disable")
        return tuple(options)

    def vector_width(self, precision: Precision) -> int:
        """Lanes of a work-item: on a CPU 64 floats or 32 doubles (four 512-bit registers)."""
        if not self.is_cpu or self.is_interpreter:
            return 1
        return 64 if precision == "single" else 32

    @property
    def work_group_size(self) -> int:
        """Work-items of a work-group: never left to the driver.

        PoCL would choose up to 4096 and keep the private arrays of all of them on one stack, which
        overflows; 16 is as fast as any larger number there.
        """
        return 16 if self.is_cpu else 64

    @property
    def is_interpreter(self) -> bool:
        """Whether this is Oclgrind, which interprets kernels one work-item at a time."""
        return "oclgrind" in self.platform.lower()

    def defines(self, precision: Precision, vector_width: int | None = None) -> dict[str, int]:
        """The compile-time definitions that every kernel on this device needs."""
        width = self.vector_width(precision) if vector_width is None else vector_width
        return {
            "DOUBLE_PRECISION": int(precision == "double"),
            "WIDTH": width,
            "CPU_BUILTINS": int(self.is_cpu and not self.is_interpreter),
        }

    def check_precision(self, precision: Precision) -> None:
        """Raise DeviceError if the device lacks the precision."""
        check_choice("precision", precision, ("single", "double"))
        if precision == "double" and not self.has_double:
            raise DeviceError(
                f"device {self.name!r} has no float64 (cl_khr_fp64), asked for precision "
                "'double'; use precision='single' or another device"
            )

    def upload(self, array: np.ndarray) -> pyopencl.Buffer:
        """A copy of an array in the memory of the device, for kernels to read."""
        import pyopencl as cl

        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
        start = time.perf_counter()
        buffer = cl.Buffer(self.context, flags, hostbuf=np.ascontiguousarray(array))
        self.transfer_s += time.perf_counter() - start
        return buffer

    def download(self, array: np.ndarray, buffer: pyopencl.Buffer) -> None:
        """Fill an array from the memory of the device, after all work queued before."""
        import pyopencl as cl

        # The wait is the kernels' time, not the copy's.
        self.queue.finish()
        start = time.perf_counter()
        cl.enqueue_copy(self.queue, array, buffer)
        self.transfer_s += time.perf_counter() - start

    def allocate(self, count: int, dtype: np.dtype) -> pyopencl.Buffer:
        """Memory of the device for a number of values, without contents."""
        import pyopencl as cl

        return cl.Buffer(self.context, cl.mem_flags.READ_WRITE, count * dtype.itemsize)

    def describe(self) -> dict[str, str]:
        """Names and versions, for provenance and benchmark records."""
        return {
            "device": self.name,
            "platform": self.platform,
            "driver": self.driver,
            "opencl": str(self.raw.version).strip(),
            "target": self.target or "native",
        }


@functools.cache
def list_devices() -> tuple[Device, ...]:
    """All OpenCL devices of this machine, in the order of their platforms; may be empty."""
    caches.make_writable()
    import pyopencl as cl

    try:
        platforms = cl.get_platforms()
    except cl.LogicError:
        return ()
    found = []
    for p, platform in enumerate(platforms):
        for d, raw in enumerate(platform.get_devices()):
            target = None
            if platform.name == "Portable Computing Language":
                target = pocl.name_unknown_processor(raw.int_ptr)
            found.append(Device(raw, f"{p}:{d}", target))
    return tuple(found)
