"""The path pipeline on a device: eye -> find hits -> shade -> connect to lights -> find hits ...

On a CPU a work-item follows a bundle of paths from the retina to their ends, and what they carry
stays in the cache of its core. On a GPU the stages take turns over all paths of a tile, which lie
in device memory; only the numbers of those alive come back. Both give the same image.
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
from isetcl.render.kernel_config import GROUP_PIXELS, SAMPLES_AT_ONCE, PathConfig, path_width
from isetcl.render.plan import Plan
from isetcl.render.stages import PathStages, SceneArguments
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
        try:
            self._upload_eye()
            self._upload_scene()
            self._film = self._buffer(self._n_bands * 4 * self._padded)
            self._build()
        except (cl.MemoryError, cl.LogicError) as error:
            raise OutOfMemoryError(
                f"device {self._device.name!r} cannot hold the scene and the paths of a tile of "
                f"{plan.tile[0]} x {plan.tile[1]} pixels ({error}); use smaller textures or meshes"
            ) from error

    def _upload(self, array: np.ndarray) -> pyopencl.Buffer:
        import pyopencl as cl

        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
        return cl.Buffer(self._device.context, flags, hostbuf=np.ascontiguousarray(array))

    def _buffer(self, values: int) -> pyopencl.Buffer:
        import pyopencl as cl

        size = values * self._real.itemsize
        return cl.Buffer(self._device.context, cl.mem_flags.READ_WRITE, size)

    def _pad(self, pixels: int) -> int:
        # Lanes beyond the tile would follow whole paths for nothing.
        step = max(GROUP_PIXELS, self._config.vector_width, self._device.work_group_size)
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
        self._tile_record = np.zeros(1, dtype=pack_paths.TILE.dtype(precision))
        self._tile_buffer = self._upload(self._tile_record)

    def _build(self) -> None:
        device, config = self._device, self._config
        defines = config.path_defines(device) | {"STACK_SIZE": self._stack_size}
        declarations = pack_paths.declarations() + pack.sobol_declaration()
        eye_declarations = ray_declarations() + pack.eye_declarations()
        self._stages = None
        if config.is_fused:
            source = program.assemble(
                "follow_paths.cl",
                defines | config.eye_defines(device, path_width(device, config.precision)),
                declarations + eye_declarations,
            )
            self.kernel_digest = program.digest(source)
            self._follow = program.kernel(device, source, "follow_paths")
            return
        start = program.assemble(
            "start_paths.cl",
            config.eye_defines(device, config.vector_width),
            eye_declarations + pack.sobol_declaration(),
        )
        find = program.assemble("find_hits.cl", defines, declarations)
        shade = program.assemble("shade.cl", defines, declarations)
        self.kernel_digest = program.digest(start + find + shade)
        self._start = program.kernel(device, start, "start_paths")
        slots = self._padded * self._n_bands * SAMPLES_AT_ONCE
        self._stages = PathStages(device, config, slots, find, shade)

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
        import pyopencl as cl

        padded = self._pad(tile.columns * tile.rows)
        assert padded <= self._padded, "a tile must not be larger than the plan's"
        bits = max(1, int(block * self._n_bands - 1).bit_length())
        samples = (first, count, block, bits, stream)
        self._begin(tile)
        if self._stages is None:
            self._follow_all(padded, samples)
        else:
            self._take_turns(padded, samples)
        film = np.empty((self._n_bands * 4, padded), dtype=self._real)
        cl.enqueue_copy(self._device.queue, film, self._film)
        pixels = tile.columns * tile.rows
        return film[:, :pixels].astype(np.float64).reshape(-1, tile.rows, tile.columns)

    def _begin(self, tile: Tile) -> None:
        """Tell the kernels which tile they render."""
        import pyopencl as cl

        queue = self._device.queue
        self._camera["tile_x"], self._camera["tile_y"] = tile.x, tile.y
        self._camera["tile_width"] = tile.columns
        cl.enqueue_copy(queue, self._camera_buffer, self._camera)
        record = self._tile_record
        record["x"], record["y"], record["columns"] = tile.x, tile.y, tile.columns
        record["image_width"] = self._plan.grid.resolution[0]
        cl.enqueue_copy(queue, self._tile_buffer, record)

    def _eye_arguments(self) -> tuple[Any, ...]:
        return (self._camera_buffer, self._pupils, self._elements, np.int32(self._n_elements))

    def _surfaces(self) -> tuple[Any, ...]:
        """What rays are asked about."""
        shapes = (self._records[name] for name in ("world", "flats", "balls"))
        return (*shapes, self._nodes, self._blocks, self._owner, self._instances)

    def _follow_all(self, padded: int, samples: tuple[int, int, int, int, int]) -> None:
        """One launch for all bounces."""
        import pyopencl as cl

        first, count, block, bits, stream = samples
        records = self._records
        self._follow.set_args(
            *self._eye_arguments(),
            *self._surfaces(),
            *(records[name] for name in ("objects", "substances", "textures", "lights")),
            self._texels,
            self._corners,
            self._normals,
            self._uvs,
            self._spectra,
            np.int32(self._n_columns),
            self._band_first,
            self._tile_buffer,
            np.uint32(first),
            np.int32(count),
            np.uint32(block),
            np.int32(bits),
            np.uint32(stream),
            np.int32(self._config.max_bounces),
            np.int32(self._config.most_segments),
            np.int32(padded),
            self._film,
        )
        size = (padded // GROUP_PIXELS, self._n_bands)
        cl.enqueue_nd_range_kernel(self._device.queue, self._follow, size, (1, 1))

    def _take_turns(self, padded: int, samples: tuple[int, int, int, int, int]) -> None:
        """Launch stage after stage until no path is left."""
        assert self._stages is not None
        records = self._records
        scene = SceneArguments(
            self._surfaces(),
            (records["objects"], records["textures"], self._texels, self._corners, self._uvs),
            (
                *(records[name] for name in ("world", "flats", "balls")),
                self._instances,
                *(records[name] for name in ("objects", "substances", "textures", "lights")),
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
            ),
        )
        self._stages.run(
            (self._start, self._eye_arguments()),
            scene,
            samples,
            (padded, self._n_bands),
            self._film,
        )
