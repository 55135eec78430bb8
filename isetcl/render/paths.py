"""The path pipeline on a device: stages take turns over the paths of a tile.

eye -> find hits -> shade -> connect to lights -> find hits ... -> gather. Between the stages paths
lie in device memory; only the numbers of those alive come back.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from isetcl.device import program
from isetcl.device.layout import real_dtype
from isetcl.device.tracer import declarations as ray_declarations
from isetcl.device.tracer import pack_elements, travel_order
from isetcl.errors import OutOfMemoryError
from isetcl.eye.prescription import elements
from isetcl.render import pack, pack_paths
from isetcl.render.direct import Tile, tiles
from isetcl.render.kernel_config import SAMPLES_AT_ONCE, PathConfig, path_width, paths_an_item
from isetcl.render.plan import Plan
from isetcl.render.trees import SceneTrees

if TYPE_CHECKING:
    import pyopencl


class PathPipeline:
    """The kernels of the path pipeline with everything of a plan on its device."""

    def __init__(self, plan: Plan) -> None:
        import pyopencl as cl

        assert isinstance(plan.config, PathConfig)
        self._plan = plan
        self._config = plan.config
        self._device = plan.device
        self._real = real_dtype(plan.config.precision)
        self._n_bands = len(plan.band_choice.bands)
        columns, rows = plan.tile
        self._padded = self._pad(columns * rows)
        self._slots = self._padded * self._n_bands * SAMPLES_AT_ONCE
        try:
            self._upload_eye()
            self._upload_scene()
            self._allocate()
        except (cl.MemoryError, cl.LogicError) as error:
            raise OutOfMemoryError(
                f"device {self._device.name!r} cannot hold the scene and the paths of a tile of "
                f"{plan.tile[0]} x {plan.tile[1]} pixels ({error}); use smaller textures or meshes"
            ) from error
        self._build()

    def _upload(self, array: np.ndarray) -> pyopencl.Buffer:
        import pyopencl as cl

        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
        return cl.Buffer(self._device.context, flags, hostbuf=np.ascontiguousarray(array))

    def _buffer(self, values: int, itemsize: int | None = None) -> pyopencl.Buffer:
        import pyopencl as cl

        size = values * (self._real.itemsize if itemsize is None else itemsize)
        return cl.Buffer(self._device.context, cl.mem_flags.READ_WRITE, size)

    def _pad(self, pixels: int) -> int:
        # Lanes beyond the tile would follow whole paths for nothing.
        step = max(self._config.vector_width, self._device.work_group_size)
        return -(-pixels // step) * step

    def _upload_eye(self) -> None:
        plan, precision = self._plan, self._config.precision
        bands = plan.band_choice.bands
        sequences = [travel_order(elements(plan.eye, b.wavelength_nm), "scene") for b in bands]
        indices = np.array([(s[-1].n_before, s[0].n_after) for s in sequences])
        packed = [pack_elements(s, "scene", precision) for s in sequences]
        self._camera = pack.pack_camera(plan.grid, precision)
        self._camera_buffer = self._upload(self._camera)
        self._pupils = self._upload(pack.pack_pupils(plan.pupils, indices, precision))
        self._elements = self._upload(np.concatenate(packed))
        self._n_elements = len(sequences[0])

    def _upload_scene(self) -> None:
        plan, precision = self._plan, self._config.precision
        assert isinstance(plan.images, dict)
        packed = pack_paths.pack_paths(
            plan.scene, plan.images, plan.wavelengths_nm, plan.band_choice.bands, precision
        )
        none = np.zeros(16, dtype=self._real)
        trees = SceneTrees(self._device, packed, precision)
        self._stack_size = trees.stack_size
        self._nodes, self._blocks = trees.nodes, trees.blocks
        self._instances = self._upload(trees.instances)
        self._records = {name: self._upload(array) for name, array in trees.records.items()}
        self._texels = self._upload(packed.texels)
        self._spectra = self._upload(packed.spectra)
        self._n_columns = packed.spectra.shape[1]
        corners = packed.triangles.reshape(-1, 9).astype(self._real)
        self._corners = self._upload(corners if len(corners) else none)
        self._normals = self._upload(none if packed.normals is None else packed.normals)
        self._uvs = self._upload(none if packed.uvs is None else packed.uvs)
        self._owner = self._upload(packed.triangle_object)
        firsts = np.array([band.first for band in plan.band_choice.bands], dtype=np.int32)
        self._band_first = self._upload(firsts)

    def _allocate(self) -> None:
        """Buffers of the paths; the pipeline owns them."""
        n = self._slots
        self._tile_record = np.zeros(1, dtype=pack_paths.TILE.dtype(self._config.precision))
        self._tile_buffer = self._upload(self._tile_record)
        self._origin, self._direction = self._buffer(3 * n), self._buffer(3 * n)
        self._weight, self._distance = self._buffer(n), self._buffer(n)
        self._hit_object, self._hit_triangle = self._buffer(n, 4), self._buffer(n, 4)
        self._hit_uv = self._buffer(2 * n)
        self._throughput, self._radiance = self._buffer(4 * n), self._buffer(4 * n)
        passing = n if self._config.has_additive else 1
        self._passed, self._bounces = self._buffer(passing), self._buffer(passing, 4)
        self._last_density = self._buffer(n)
        self._alive = [self._buffer(n, 4), self._buffer(n, 4)]
        self._shadowed = self._buffer(n, 4)
        self._counts = self._buffer(2, 4)
        lit = n if self._config.has_lights else 1
        self._shadow = [self._buffer(k * lit) for k in (3, 3, 1, 4)]
        self._film = self._buffer(self._n_bands * 4 * self._padded)

    def _build(self) -> None:
        device, config = self._device, self._config
        start = program.assemble(
            "start_paths.cl",
            config.eye_defines(device),
            ray_declarations() + pack.eye_declarations(),
        )
        defines = config.path_defines(device)
        declarations = pack_paths.declarations() + pack.sobol_declaration()
        stack = {"STACK_SIZE": self._stack_size}
        find = program.assemble("find_hits.cl", defines | stack, declarations)
        shade = program.assemble("shade.cl", defines | stack, declarations)
        self.kernel_digest = program.digest(start + find + shade)
        self._start = program.kernel(device, start, "start_paths")
        stages = {"find_hits": find, "shade": shade, "gather": shade}
        if config.has_lights:
            stages["connect"] = find
        self._kernels = {
            name: program.kernel(device, source, name) for name, source in stages.items()
        }

    def tiles(self) -> list[Tile]:
        """The tiles of the plan's image, row by row."""
        return tiles(self._plan)

    def sample(self, tile: Tile, samples: int, stream: int) -> np.ndarray:
        """Mean film of a tile over samples 0 to `samples` - 1 of every band; see DirectPipeline."""
        film = np.zeros((self._n_bands * 4, tile.rows, tile.columns))
        for part, count in self.parts(tile, samples, stream):
            film += part * (count / samples)
        return film

    def parts(self, tile: Tile, samples: int, stream: int) -> Iterator[tuple[np.ndarray, int]]:
        """What `sample` adds up, launch by launch: mean films with their numbers of samples."""
        for first in range(0, samples, SAMPLES_AT_ONCE):
            count = min(SAMPLES_AT_ONCE, samples - first)
            yield self._trace(tile, first, count, samples, stream), count

    def _trace(self, tile: Tile, first: int, count: int, block: int, stream: int) -> np.ndarray:
        """The film of `count` samples of a tile, from the first bounce to the last."""
        padded = self._pad(tile.columns * tile.rows)
        assert padded <= self._padded, "a tile must not be larger than the plan's"
        n_slots = padded * self._n_bands * count
        self._begin(tile, first, count, block, stream, padded, n_slots)
        alive = n_slots
        bits = max(1, int(block * self._n_bands - 1).bit_length())
        for bounce in range(self._config.most_segments):
            self._find_hits(alive, n_slots, bounce, stream)
            alive, shadowed = self._shade(
                alive, n_slots, bounce, padded, (first, block, bits, stream)
            )
            if shadowed:
                self._connect(shadowed, n_slots)
            if alive == 0:
                break
        return self._gather(tile, count, padded, n_slots)

    def _begin(
        self, tile: Tile, first: int, count: int, block: int, stream: int, padded: int, n_slots: int
    ) -> None:
        import pyopencl as cl

        queue = self._device.queue
        self._camera["tile_x"], self._camera["tile_y"] = tile.x, tile.y
        self._camera["tile_width"] = tile.columns
        cl.enqueue_copy(queue, self._camera_buffer, self._camera)
        record = self._tile_record
        record["x"], record["y"], record["columns"] = tile.x, tile.y, tile.columns
        record["image_width"] = self._plan.grid.resolution[0]
        cl.enqueue_copy(queue, self._tile_buffer, record)
        self._start.set_args(
            self._camera_buffer,
            self._pupils,
            self._elements,
            np.int32(self._n_elements),
            np.uint32(first),
            np.uint32(block),
            np.uint32(stream),
            np.int32(padded),
            np.int32(n_slots),
            self._origin,
            self._direction,
            self._weight,
        )
        size = (padded // self._config.vector_width, self._n_bands, count)
        group = 1 if self._device.is_cpu else self._device.work_group_size
        cl.enqueue_nd_range_kernel(queue, self._start, size, (group, 1, 1))

    def _run(self, name: str, items: int, *arguments: Any) -> None:
        import pyopencl as cl

        kernel = self._kernels[name]
        kernel.set_args(*arguments)
        group = self._device.work_group_size
        cl.enqueue_nd_range_kernel(
            self._device.queue, kernel, (-(-items // group) * group,), (group,)
        )

    def _groups(self, paths: int) -> int:
        return -(-paths // path_width(self._device, self._config.precision))

    def _surfaces(self) -> tuple[Any, ...]:
        """What rays are asked about: arguments that find_hits and connect share."""
        records = self._records
        return (
            records["world"],
            records["flats"],
            records["balls"],
            self._nodes,
            self._blocks,
            self._owner,
            self._instances,
            records["objects"],
            records["textures"],
            self._texels,
            self._corners,
            self._uvs,
        )

    def _find_hits(self, alive: int, n_slots: int, bounce: int, stream: int) -> None:
        self._run(
            "find_hits",
            self._groups(alive),
            np.int32(alive),
            self._alive[bounce % 2],
            np.int32(n_slots),
            self._origin,
            self._direction,
            self._weight,
            *self._surfaces(),
            self._passed,
            self._distance,
            self._hit_object,
            self._hit_triangle,
            self._hit_uv,
            np.int32(bounce == 0),
            np.uint32(stream),
        )

    def _shade(
        self, alive: int, n_slots: int, bounce: int, padded: int, samples: tuple[int, int, int, int]
    ) -> tuple[int, int]:
        """Shade all living paths; returns how many go on and how many wait for a light."""
        import pyopencl as cl

        first, block, bits, stream = samples
        queue, records = self._device.queue, self._records
        cl.enqueue_copy(queue, self._counts, np.zeros(2, dtype=np.int32))
        looks = ("objects", "substances", "textures", "lights")
        self._run(
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
            *(records[name] for name in ("world", "flats", "balls")),
            self._instances,
            *(records[name] for name in looks),
            self._texels,
            self._corners,
            self._normals,
            self._uvs,
            self._spectra,
            np.int32(self._n_columns),
            self._band_first,
            np.int32(self._n_bands),
            np.int32(padded),
            self._tile_buffer,
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

    def _connect(self, shadowed: int, n_slots: int) -> None:
        self._run(
            "connect",
            self._groups(shadowed),
            np.int32(shadowed),
            self._shadowed,
            np.int32(n_slots),
            *self._shadow,
            self._radiance,
            *self._surfaces(),
        )

    def _gather(self, tile: Tile, count: int, padded: int, n_slots: int) -> np.ndarray:
        import pyopencl as cl

        kernel, queue = self._kernels["gather"], self._device.queue
        kernel.set_args(
            np.int32(count),
            np.int32(self._n_bands),
            np.int32(padded),
            np.int32(n_slots),
            self._weight,
            self._radiance,
            self._film,
        )
        columns = padded // path_width(self._device, self._config.precision)
        cl.enqueue_nd_range_kernel(queue, kernel, (columns, self._n_bands), (1, 1))
        film = np.empty((self._n_bands * 4, padded), dtype=self._real)
        cl.enqueue_copy(queue, film, self._film)
        pixels = tile.columns * tile.rows
        return film[:, :pixels].astype(np.float64).reshape(-1, tile.rows, tile.columns)
