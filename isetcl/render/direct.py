"""The direct pipeline on a device: constants uploaded once, one launch a tile and replicate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from isetcl.device import program
from isetcl.device.bending import add_bends
from isetcl.device.elements import pack_eye, travel_order
from isetcl.device.layout import real_dtype
from isetcl.errors import OutOfMemoryError
from isetcl.eye.prescription import elements
from isetcl.render import pack
from isetcl.render.kernel_config import KernelConfig
from isetcl.render.plan import Plan

if TYPE_CHECKING:
    pass

SAMPLES_PER_LAUNCH = 256
"""Most samples summed in the kernel's own precision; longer sums are continued in float64.

The same whatever the tile, so that the sums are too; a launch takes about a second at most.
"""


@dataclass(frozen=True)
class Tile:
    """A rectangle of pixels: first column and row, columns and rows."""

    x: int
    y: int
    columns: int
    rows: int

    @property
    def window(self) -> tuple[slice, slice]:
        """The tile as (rows, columns) slices of the image."""
        return slice(self.y, self.y + self.rows), slice(self.x, self.x + self.columns)


def tiles(plan: Plan) -> list[Tile]:
    """The tiles of a plan's image, row by row."""
    columns, rows = plan.grid.resolution
    width, height = plan.tile
    return [
        Tile(x, y, min(width, columns - x), min(height, rows - y))
        for y in range(0, rows, height)
        for x in range(0, columns, width)
    ]


class DirectPipeline:
    """The kernel `render_direct` with everything of a plan on its device."""

    def __init__(self, plan: Plan) -> None:
        import pyopencl as cl

        assert isinstance(plan.config, KernelConfig)
        assert plan.basis is not None
        self._plan = plan
        self._config = plan.config
        self._basis = plan.basis
        self._device = plan.device
        self._real = real_dtype(plan.config.precision)
        source = program.assemble(
            "direct.cl", self._config.defines(plan.device), pack.declarations(self._config)
        )
        self.kernel_digest = program.digest(source)
        self._kernel = program.kernel(plan.device, source, "render_direct")
        self._n_bands = len(plan.band_choice.bands)
        self._channels = self._n_bands * plan.config.n_basis
        try:
            self._camera = pack.pack_camera(plan.grid, plan.config.precision)
            self._arguments = self._constants()
            self._camera_buffer = self._device.upload(self._camera)
            columns, rows = plan.tile
            self._padded = self._pad(columns * rows)
            self._film = self._device.allocate(self._channels * self._padded, self._real)
        except (cl.MemoryError, cl.LogicError) as error:
            raise OutOfMemoryError(
                f"device {self._device.name!r} cannot hold the scene and a tile of "
                f"{plan.tile[0]} x {plan.tile[1]} pixels ({error}); use smaller textures"
            ) from error

    def _pad(self, pixels: int) -> int:
        step = self._plan.config.vector_width * self._device.work_group_size
        return -(-pixels // step) * step

    def _constants(self) -> tuple[object, ...]:
        """The kernel's arguments that stay the same from launch to launch."""
        plan = self._plan
        precision = plan.config.precision
        sequences = [
            travel_order(elements(plan.eye, band.wavelength_nm), "scene")
            for band in plan.band_choice.bands
        ]
        packed = add_bends(
            pack_eye([*sequences, *pack.relief_sequence(plan.eye)], "scene", precision),
            sequences,
            plan.eye.stop,
            [band.wavelength_nm for band in plan.band_choice.bands],
            diffraction=plan.bends.diffraction,
            scatter=plan.bends.scatter,
        )
        indices = np.array([(sequence[-1].n_before, sequence[0].n_after) for sequence in sequences])
        pupils = pack.pack_pupils(plan.pupils, indices, precision)
        table = pack.pack_planes(plan.grid, plan.pupils, self._camera, pupils, packed)
        assert isinstance(plan.images, tuple)
        scene = pack.pack_scene(plan.scene, self._basis, plan.images, self._config)
        return (
            self._device.upload(pupils),
            self._device.upload(packed.elements),
            np.int32(len(sequences[0])),
            self._device.upload(table),
            *(
                self._device.upload(scene[name])
                for name in ("scene", "patches", "spheres", "materials", "images", "texels")
            ),
        )

    def tiles(self) -> list[Tile]:
        """The tiles of the plan's image, row by row."""
        return tiles(self._plan)

    def sample(self, tile: Tile, samples: int, stream: int) -> np.ndarray:
        """Mean film of a tile over samples 0 to `samples` - 1 of every band, float64.

        Parameters
        ----------
        tile
            Part of the image, no larger than the plan's tile.
        samples
            Samples a pixel and band.
        stream
            The word of the replicate, from `sobol.stream`.

        Returns
        -------
        ndarray, (channels, rows, columns)
            Film channels (band, basis): irradiance per unit of each basis spectrum, sr.
        """
        film = np.zeros((self._channels, tile.rows, tile.columns))
        for part, count in self.parts(tile, samples, stream):
            film += part * (count / samples)
        return film

    def parts(self, tile: Tile, samples: int, stream: int) -> Iterator[tuple[np.ndarray, int]]:
        """What `sample` adds up, launch by launch: mean films with their numbers of samples."""
        for first in range(0, samples, SAMPLES_PER_LAUNCH):
            count = min(SAMPLES_PER_LAUNCH, samples - first)
            yield self._launch(tile, first, count, samples, stream), count

    def _launch(self, tile: Tile, first: int, count: int, block: int, stream: int) -> np.ndarray:
        import pyopencl as cl

        self._camera["tile_x"], self._camera["tile_y"] = tile.x, tile.y
        self._camera["tile_width"] = tile.columns
        queue = self._device.queue
        pixels = tile.columns * tile.rows
        padded = self._pad(pixels)
        assert padded <= self._padded, "a tile must not be larger than the plan's"
        cl.enqueue_copy(queue, self._camera_buffer, self._camera)
        self._kernel.set_args(
            self._camera_buffer,
            *self._arguments,
            np.uint32(first),
            np.uint32(count),
            np.uint32(block),
            np.uint32(stream),
            np.int32(padded),
            self._film,
        )
        size = (padded // self._plan.config.vector_width, self._n_bands)
        cl.enqueue_nd_range_kernel(queue, self._kernel, size, (self._device.work_group_size, 1))
        film = np.empty((self._channels, padded), dtype=self._real)
        self._device.download(film, self._film)
        return film[:, :pixels].astype(np.float64).reshape(-1, tile.rows, tile.columns)
