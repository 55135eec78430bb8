"""Paths in device memory, and the stages that take turns over them: the path pipeline of GPUs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from isetcl.device import program
from isetcl.device.devices import Device
from isetcl.device.layout import real_dtype
from isetcl.render.kernel_config import PathConfig, path_width, paths_an_item

if TYPE_CHECKING:
    import pyopencl


@dataclass(frozen=True)
class SceneArguments:
    """Kernel arguments that describe a scene.

    Attributes
    ----------
    surfaces, looks
        What find_hits and connect read.
    shading
        What shade reads.
    """

    surfaces: tuple[Any, ...]
    looks: tuple[Any, ...]
    shading: tuple[Any, ...]


class PathStages:
    """Planes of paths on a device, and the kernels that work on them.

    Parameters
    ----------
    slots
        Paths there is room for.
    find, shade
        Source texts of the stages.
    """

    def __init__(
        self, device: Device, config: PathConfig, slots: int, find: str, shade: str
    ) -> None:
        self._device, self._config = device, config
        self._real = real_dtype(config.precision)
        stages = {"find_hits": find, "shade": shade, "gather": shade}
        if config.has_lights:
            stages["connect"] = find
        self._kernels = {
            name: program.kernel(device, source, name) for name, source in stages.items()
        }
        self._allocate(slots)

    def _buffer(self, values: int, dtype: type | None = None) -> pyopencl.Buffer:
        return self._device.allocate(values, self._real if dtype is None else np.dtype(dtype))

    def _allocate(self, n: int) -> None:
        """Planes of paths; this owns them."""
        self._origin, self._direction = self._buffer(3 * n), self._buffer(3 * n)
        self._weight, self._distance = self._buffer(n), self._buffer(n)
        self._hit_object, self._hit_triangle = self._buffer(n, np.int32), self._buffer(n, np.int32)
        self._hit_uv = self._buffer(2 * n)
        self._throughput, self._radiance = self._buffer(4 * n), self._buffer(4 * n)
        passing = n if self._config.has_additive or self._config.starts_given else 1
        self._passed, self._bounces = self._buffer(passing), self._buffer(passing, np.int32)
        self._width = self._buffer(n if self._config.has_levels else 1)
        self._last_density = self._buffer(n)
        self._alive = [self._buffer(n, np.int32), self._buffer(n, np.int32)]
        self._shadowed = self._buffer(n, np.int32)
        self._counts = self._buffer(2, np.int32)
        lit = n if self._config.has_lights else 1
        self._shadow = [self._buffer(k * lit) for k in (3, 3, 1, 4)]

    def run(
        self,
        start: tuple[pyopencl.Kernel, tuple[Any, ...]],
        scene: SceneArguments,
        samples: tuple[int, int, int, int, int],
        size: tuple[int, int],
        film: pyopencl.Buffer,
    ) -> None:
        """Follow all paths of a launch into a film.

        Parameters
        ----------
        start
            The kernel that leaves the eye, and its arguments for the eye.
        samples
            First sample, number of samples, samples of the replicate, digits, stream.
        size
            Pixels (padded) and bands.
        """
        padded, n_bands = size
        first, count, block, bits, stream = samples
        n_slots = padded * n_bands * count
        assert n_slots < 1 << 24, "paths of a launch are numbered by single-precision quotients"
        self._start(*start, samples, size, n_slots)
        alive = n_slots
        for bounce in range(self._config.most_segments):
            self._find_hits(scene, alive, n_slots, bounce, stream)
            alive, shadowed = self._shade(
                scene, alive, n_slots, bounce, (first, block, bits, stream)
            )
            if shadowed:
                self._connect(scene, shadowed, n_slots)
            if alive == 0:
                break
        self._gather(size, count, n_slots, film)

    def _start(
        self,
        kernel: pyopencl.Kernel,
        eye: tuple[Any, ...],
        samples: tuple[int, int, int, int, int],
        size: tuple[int, int],
        n_slots: int,
    ) -> None:
        import pyopencl as cl

        padded, n_bands = size
        first, count, block, _, stream = samples
        kernel.set_args(
            *eye,
            np.uint32(first),
            np.uint32(block),
            np.uint32(stream),
            np.int32(padded),
            np.int32(n_slots),
            self._origin,
            self._direction,
            self._weight,
            self._passed,
        )
        work = (padded // self._config.vector_width, n_bands, count)
        group = 1 if self._device.is_cpu else self._device.work_group_size
        cl.enqueue_nd_range_kernel(self._device.queue, kernel, work, (group, 1, 1))

    def _launch(self, name: str, items: int, *arguments: Any) -> None:
        import pyopencl as cl

        kernel = self._kernels[name]
        kernel.set_args(*arguments)
        group = self._device.work_group_size
        cl.enqueue_nd_range_kernel(
            self._device.queue, kernel, (-(-items // group) * group,), (group,)
        )

    def _groups(self, paths: int) -> int:
        return -(-paths // path_width(self._device, self._config.precision))

    def _find_hits(
        self, scene: SceneArguments, alive: int, n_slots: int, bounce: int, stream: int
    ) -> None:
        self._launch(
            "find_hits",
            self._groups(alive),
            np.int32(alive),
            self._alive[bounce % 2],
            np.int32(n_slots),
            self._origin,
            self._direction,
            self._weight,
            *scene.surfaces,
            *scene.looks,
            self._passed,
            self._distance,
            self._hit_object,
            self._hit_triangle,
            self._hit_uv,
            np.int32(bounce == 0),
            np.uint32(stream),
        )

    def _shade(
        self,
        scene: SceneArguments,
        alive: int,
        n_slots: int,
        bounce: int,
        samples: tuple[int, int, int, int],
    ) -> tuple[int, int]:
        """Shade all living paths; returns how many go on and how many wait for a light."""
        import pyopencl as cl

        first, block, bits, stream = samples
        queue = self._device.queue
        cl.enqueue_copy(queue, self._counts, np.zeros(2, dtype=np.int32))
        self._launch(
            "shade",
            -(-alive // paths_an_item(self._device)),
            np.int32(alive),
            self._alive[bounce % 2],
            np.int32(n_slots),
            self._weight,
            self._distance,
            self._hit_object,
            self._hit_triangle,
            self._hit_uv,
            self._origin,
            self._direction,
            self._throughput,
            self._radiance,
            self._last_density,
            self._passed,
            self._bounces,
            self._width,
            *scene.shading,
            np.uint32(first),
            np.uint32(block),
            np.int32(bits),
            np.uint32(stream),
            np.int32(bounce),
            np.int32(self._config.max_bounces),
            self._alive[(bounce + 1) % 2],
            self._shadowed,
            self._counts,
            *self._shadow,
        )
        numbers = np.zeros(2, dtype=np.int32)
        cl.enqueue_copy(queue, numbers, self._counts)
        return int(numbers[0]), int(numbers[1])

    def _connect(self, scene: SceneArguments, shadowed: int, n_slots: int) -> None:
        self._launch(
            "connect",
            self._groups(shadowed),
            np.int32(shadowed),
            self._shadowed,
            np.int32(n_slots),
            *self._shadow,
            self._radiance,
            *scene.surfaces,
            *scene.looks,
        )

    def _gather(
        self, size: tuple[int, int], count: int, n_slots: int, film: pyopencl.Buffer
    ) -> None:
        import pyopencl as cl

        padded, n_bands = size
        kernel = self._kernels["gather"]
        kernel.set_args(
            np.int32(count),
            np.int32(n_bands),
            np.int32(padded),
            np.int32(n_slots),
            self._weight,
            self._radiance,
            film,
        )
        columns = padded // path_width(self._device, self._config.precision)
        cl.enqueue_nd_range_kernel(self._device.queue, kernel, (columns, n_bands), (1, 1))
