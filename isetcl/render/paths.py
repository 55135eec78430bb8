"""The path pipeline on a device: eye -> find hits -> shade -> connect to lights -> find hits ...

On a CPU a work-item follows a bundle of paths from the retina to their ends, and what they carry
stays in the cache of its core. On a GPU the stages take turns over all paths of a tile, which lie
in device memory; only the numbers of those alive come back. Both give the same image.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from isetcl.device import program
from isetcl.device.bending import add_bends
from isetcl.device.elements import declarations as ray_declarations
from isetcl.device.elements import pack_eye, travel_order
from isetcl.device.layout import real_dtype
from isetcl.errors import OutOfMemoryError
from isetcl.eye.prescription import elements
from isetcl.render import pack, pack_paths
from isetcl.render.device_scene import DeviceScene
from isetcl.render.direct import Tile, tiles
from isetcl.render.kernel_config import GROUP_PIXELS, SAMPLES_AT_ONCE, PathConfig, path_width
from isetcl.render.plan import Plan
from isetcl.render.stages import PathStages, SceneArguments

if TYPE_CHECKING:
    pass


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
            self.scene = DeviceScene(plan)
            self._upload_bands()
            self._film = self._device.allocate(self._n_bands * 4 * self._padded, self._real)
            self._build()
        except (cl.MemoryError, cl.LogicError) as error:
            raise OutOfMemoryError(
                f"device {self._device.name!r} cannot hold the scene and the paths of a tile of "
                f"{plan.tile[0]} x {plan.tile[1]} pixels ({error}); use smaller textures or meshes"
            ) from error

    def _pad(self, pixels: int) -> int:
        # Lanes beyond the tile would follow whole paths for nothing.
        step = max(GROUP_PIXELS, self._config.vector_width, self._device.work_group_size)
        return -(-pixels // step) * step

    def _upload_eye(self) -> None:
        plan, precision = self._plan, self._config.precision
        bands = plan.band_choice.bands
        sequences = [travel_order(elements(plan.eye, b.wavelength_nm), "scene") for b in bands]
        indices = np.array([(s[-1].n_before, s[0].n_after) for s in sequences])
        packed = add_bends(
            pack_eye([*sequences, *pack.relief_sequence(plan.eye)], "scene", precision),
            sequences,
            plan.eye.stop,
            [band.wavelength_nm for band in plan.band_choice.bands],
            diffraction=plan.bends.diffraction,
            scatter=plan.bends.scatter,
        )
        self._camera = pack.pack_camera(plan.grid, precision)
        pupils = pack.pack_pupils(plan.pupils, indices, precision)
        table = pack.pack_planes(plan.grid, plan.pupils, self._camera, pupils, packed)
        self._camera_buffer = self._device.upload(self._camera)
        self._pupils = self._device.upload(pupils)
        self._elements = self._device.upload(packed.elements)
        self._eye_table = self._device.upload(table)
        self._n_elements = len(sequences[0])

    def _upload_bands(self) -> None:
        firsts = np.array([band.first for band in self._plan.band_choice.bands], dtype=np.int32)
        self._band_first = self._device.upload(firsts)
        self._tile_record = np.zeros(1, dtype=pack_paths.TILE.dtype(self._config.precision))
        self._tile_buffer = self._device.upload(self._tile_record)
        if not self._config.starts_given:
            self._tile_record["pixel_rad"] = math.radians(min(self._plan.grid.pitch_deg))
        self._starts = self._device.upload(np.zeros(16, dtype=self._real))

    def start_from(
        self, origins_m: np.ndarray, directions: np.ndarray, least_m: np.ndarray
    ) -> None:
        """Begin the paths of a one-tile image with given rays, those of a pixel with the same.

        Parameters
        ----------
        origins_m, directions : ndarray, (rows, columns, 3)
            Rays of all pixels; directions are unit vectors.
        least_m : ndarray, (rows, columns)
            Distances beyond which they look for surfaces.
        """
        assert self._config.starts_given
        pixels = least_m.size
        planes = np.zeros((7, self._pad(pixels)), dtype=self._real)
        planes[5] = -1.0
        planes[:3, :pixels] = origins_m.reshape(-1, 3).T
        planes[3:6, :pixels] = directions.reshape(-1, 3).T
        planes[6, :pixels] = least_m.ravel()
        self._starts = self._device.upload(planes)

    def _build(self) -> None:
        device, config = self._device, self._config
        defines = config.path_defines(device) | {"STACK_SIZE": self.scene.stack_size}
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
        entry = "given_paths" if config.starts_given else "start_paths"
        self._start = program.kernel(device, start, entry)
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
        self._device.download(film, self._film)
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
        n_elements = np.int32(self._n_elements)
        return (self._camera_buffer, self._pupils, self._elements, n_elements, self._eye_table)

    def _start_arguments(self) -> tuple[Any, ...]:
        if self._config.starts_given:
            return (self._starts,)
        return self._eye_arguments()

    def _follow_all(self, padded: int, samples: tuple[int, int, int, int, int]) -> None:
        """One launch for all bounces."""
        import pyopencl as cl

        first, count, block, bits, stream = samples
        self._follow.set_args(
            *self._eye_arguments(),
            *self.scene.surfaces(),
            *self.scene.looks(),
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
            self._starts,
            self._film,
        )
        size = (padded // GROUP_PIXELS, self._n_bands)
        cl.enqueue_nd_range_kernel(self._device.queue, self._follow, size, (1, 1))

    def _take_turns(self, padded: int, samples: tuple[int, int, int, int, int]) -> None:
        """Launch stage after stage until no path is left."""
        assert self._stages is not None
        scene = SceneArguments(
            self.scene.surfaces(),
            self.scene.openings(),
            (
                *self.scene.shading(),
                self._band_first,
                np.int32(self._n_bands),
                np.int32(padded),
                self._tile_buffer,
            ),
        )
        self._stages.run(
            (self._start, self._start_arguments()),
            scene,
            samples,
            (padded, self._n_bands),
            self._film,
        )
