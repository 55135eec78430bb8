"""Rays through an eye on an OpenCL device: packing, the kernel, unpacking."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from isetcl.device import program
from isetcl.device.devices import Device
from isetcl.device.elements import declarations, pack_eye
from isetcl.device.eye_features import EyeFeatures
from isetcl.device.layout import Precision, real_dtype
from isetcl.errors import InvalidInputError
from isetcl.eye.prescription import Element
from isetcl.eye.rays import RayBundle
from isetcl.eye.sequential import Towards

if TYPE_CHECKING:
    import pyopencl


_CONICS = EyeFeatures()


@dataclass(eq=False)
class DeviceRays:
    """Rays in the memory of a device, padded to a whole number of lanes."""

    count: int
    padded: int
    origin: pyopencl.Buffer
    direction: pyopencl.Buffer


class RayTracer:
    """The kernel `trace_rays` for one device, precision and set of outputs.

    Parameters
    ----------
    device, precision
        Where and how to compute.
    record_hits
        Also keep the hits on every element.
    record_directions
        Keep the directions at the end points.
    record_opl
        Keep the optical path lengths; double precision only.
    shared_direction
        All rays have one direction (a collimated beam).
    features
        What the surfaces need; what they do not is left out.
    vector_width
        Lanes of a work-item; None for the device's own.
    """

    def __init__(
        self,
        device: Device,
        precision: Precision,
        *,
        record_hits: bool = False,
        record_directions: bool = True,
        record_opl: bool = False,
        shared_direction: bool = False,
        features: EyeFeatures = _CONICS,
        vector_width: int | None = None,
    ) -> None:
        device.check_precision(precision)
        self._device = device
        self._precision = precision
        self._record_hits = record_hits
        self._record_directions = record_directions
        self._record_opl = record_opl and precision == "double"
        self._shared_direction = shared_direction
        self._features = features
        defines = device.defines(precision, vector_width)
        self._width = defines["WIDTH"]
        defines |= features.eye_feature_defines() | {
            "HAS_HITS": int(record_hits),
            "HAS_OPL": int(self._record_opl),
            "HAS_DIRECTIONS": int(record_directions),
            "HAS_SHARED_DIRECTION": int(shared_direction),
        }
        source = program.assemble("trace_rays.cl", defines, declarations())
        self._kernel = program.kernel(device, source, "trace_rays")

    def upload(self, origins_mm: np.ndarray, directions: np.ndarray) -> DeviceRays:
        """Copy rays to the device: origins (n, 3), mm, and unit directions (n, 3).

        With `shared_direction` the first direction serves all rays.
        """
        count = len(origins_mm)
        step = self._width * self._device.work_group_size
        padded = -(-count // step) * step
        if self._shared_direction:
            direction = self._planes(directions[:1], 1)
        else:
            direction = self._planes(directions, padded)
        return DeviceRays(count, padded, self._planes(origins_mm, padded), direction)

    def _planes(self, rows: np.ndarray, padded: int) -> pyopencl.Buffer:
        """Rows (n, 3) as three planes on the device; the last row fills the rest."""

        array = np.empty((3, padded), dtype=real_dtype(self._precision))
        array[:, : len(rows)] = rows.T
        array[:, len(rows) :] = array[:, len(rows) - 1 : len(rows)]
        return self._device.upload(array)

    def prepare(self, rays: DeviceRays, sequence: tuple[Element, ...], towards: Towards) -> Trace:
        """Allocate the results of a trace of `rays` through elements in travel order.

        Raises
        ------
        InvalidInputError
            If the elements have something that is not compiled into this tracer.
        """
        missing = self._features.missing([sequence])
        if missing:
            raise InvalidInputError(
                f"this tracer was built without {', '.join(missing)}, which its elements need; "
                "pass features=EyeFeatures.of([sequence])"
            )
        return Trace(self, rays, sequence, towards)


class Trace:
    """One prepared launch: rays, elements and result buffers on the device. Owns the results."""

    def __init__(
        self,
        tracer: RayTracer,
        rays: DeviceRays,
        sequence: tuple[Element, ...],
        towards: Towards,
    ) -> None:

        self._tracer = tracer
        self._rays = rays
        self._names = tuple(e.name for e in sequence)
        device = tracer._device
        real = real_dtype(tracer._precision)

        def results(planes: int, dtype: np.dtype = real) -> pyopencl.Buffer:
            return device.allocate(max(1, planes * rays.padded), dtype)

        degree = tracer._features.gradient_degree
        packed = pack_eye([sequence], towards, tracer._precision, gradient_degree=degree)
        self._elements = device.upload(packed.elements)
        self._table = device.upload(packed.table)
        self._position = results(3)
        self._leaving = results(3 if tracer._record_directions else 0)
        self._outcome = results(1, np.dtype(np.int32))
        self._opl = results(int(tracer._record_opl))
        self._hits = results(3 * len(sequence) if tracer._record_hits else 0)
        self._arguments = (
            rays.origin,
            rays.direction,
            self._elements,
            np.int32(len(sequence)),
            self._table,
            real.type(1.0 if towards == "retina" else -1.0),
            np.int32(rays.padded),
            self._position,
            self._leaving,
            self._outcome,
            self._opl,
            self._hits,
        )

    def run(self) -> pyopencl.Event:
        """Enqueue the kernel; returns its event."""
        import pyopencl as cl

        kernel = self._tracer._kernel
        kernel.set_args(*self._arguments)
        device = self._tracer._device
        items = self._rays.padded // self._tracer._width
        return cl.enqueue_nd_range_kernel(device.queue, kernel, (items,), (device.work_group_size,))

    def fetch(self) -> RayBundle:
        """The results on the host."""
        n = self._rays.count
        outcome = self._read(self._outcome, 1, np.dtype(np.int32))[0]
        positions = self._read(self._position, 3).T[:n]
        directions = np.full_like(positions, np.nan)
        if self._tracer._record_directions:
            directions = self._read(self._leaving, 3).T[:n]
        opl = None
        if self._tracer._record_opl:
            opl = self._read(self._opl, 1)[0, :n]
        hits = None
        if self._tracer._record_hits:
            planes = self._read(self._hits, 3 * len(self._names))
            hits = planes.reshape(len(self._names), 3, -1).transpose(0, 2, 1)[:, :n]
        return RayBundle(
            positions,
            directions,
            (outcome[:n] % 256).astype(np.uint8),
            outcome[:n] // 256 - 1,
            self._names,
            opl,
            hits,
        )

    def _read(
        self, buffer: pyopencl.Buffer, planes: int, dtype: np.dtype | None = None
    ) -> np.ndarray:
        import pyopencl as cl

        dtype = real_dtype(self._tracer._precision) if dtype is None else dtype
        array = np.empty((planes, self._rays.padded), dtype=dtype)
        cl.enqueue_copy(self._tracer._device.queue, array, buffer)
        return array
