"""Points that repel each other, and points that keep apart, on an OpenCL device; see lattice.cl."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from isetcl.device import program
from isetcl.device.devices import Device
from isetcl.device.layout import Precision, real_dtype

if TYPE_CHECKING:
    import pyopencl

MOST_NEIGHBOURS = 24
"""Neighbours a point may have on the device; a hexagonal lattice has 18 within two spacings."""

_CELL_IN_SIZES = 1.1
_POINTS_OF_A_TILE = 600
_MOST_TILES = 1 << 20


@dataclass(frozen=True, eq=False)
class Tiles:
    """Points sorted into cells; see lattice.cl.

    Attributes
    ----------
    order : ndarray
        Numbers of the points in the order of their cells, (n,).
    origin_mm, tile_mm, columns, rows
        Lower left corner of the tiles, their width, and how many there are.
    tile_first, tile_cells, cell_first : ndarray
        int32: the first cell of each tile, its cells along one axis, the first point of each cell.
    """

    order: np.ndarray
    origin_mm: tuple[float, float]
    tile_mm: float
    columns: int
    rows: int
    tile_first: np.ndarray
    tile_cells: np.ndarray
    cell_first: np.ndarray

    @classmethod
    def of(cls, places_mm: np.ndarray, size_mm: np.ndarray) -> Tiles:
        """Tiles and cells for points (n, 2) whose neighbours are at distances (n,), mm."""
        low, high = places_mm.min(axis=0), places_mm.max(axis=0)
        extent = np.maximum(high - low, float(size_mm.max()))
        wanted = np.sqrt(extent[0] * extent[1] * _POINTS_OF_A_TILE / len(places_mm))
        tile_mm = max(float(wanted), float(np.sqrt(extent[0] * extent[1] / _MOST_TILES)))
        columns, rows = (int(n) for n in np.floor(extent / tile_mm) + 1)
        place = np.floor((places_mm - low) / tile_mm).astype(np.int64)
        place = np.clip(place, 0, (columns - 1, rows - 1))
        tile = place[:, 1] * columns + place[:, 0]
        n_tiles = columns * rows
        count = np.bincount(tile, minlength=n_tiles)
        mean = np.bincount(tile, weights=size_mm, minlength=n_tiles) / np.maximum(count, 1)
        cells = np.ones(n_tiles, dtype=np.int64)
        used = count > 0
        cells[used] = np.clip(np.rint(tile_mm / (_CELL_IN_SIZES * mean[used])), 1, 4096)
        first = np.concatenate([[0], np.cumsum(cells**2)])
        own = cells[tile]
        inside = (places_mm - low - place * tile_mm) * (own / tile_mm)[:, None]
        cell = np.clip(np.floor(inside).astype(np.int64), 0, (own - 1)[:, None])
        number = first[tile] + cell[:, 1] * own + cell[:, 0]
        begin = np.concatenate([[0], np.cumsum(np.bincount(number, minlength=int(first[-1])))])
        return cls(
            np.argsort(number, kind="stable"),
            (float(low[0]), float(low[1])),
            tile_mm,
            columns,
            rows,
            first[:-1].astype(np.int32),
            cells.astype(np.int32),
            begin.astype(np.int32),
        )


class LatticeKernels:
    """The kernels of lattice.cl on one device.

    Parameters
    ----------
    device, precision
        Where and how to compute.
    work_group_size
        Work-items of a work-group; None is the device's own. It changes no result.
    """

    def __init__(
        self,
        device: Device,
        precision: Precision = "single",
        work_group_size: int | None = None,
    ) -> None:
        device.check_precision(precision)
        self._device = device
        self._real = real_dtype(precision)
        self._local = device.work_group_size if work_group_size is None else work_group_size
        # A point takes its neighbours one by one: lanes are left to the compiler.
        defines = device.defines(precision, 1) | {"MOST": MOST_NEIGHBOURS}
        source = program.assemble("lattice.cl", defines, "#define FARTHEST R(0.25)\n")
        self._kernels = {
            name: program.kernel(device, source, name)
            for name in ("find_neighbours", "push", "choose_apart")
        }

    def relax(
        self,
        places_mm: np.ndarray,
        size_mm: Callable[[np.ndarray], np.ndarray],
        is_fixed: np.ndarray,
        *,
        rounds: int,
        steps: int,
        range_in_sizes: float = 1.2,
        step: float = 0.2,
    ) -> np.ndarray:
        """The points after `rounds` times `steps` steps of repulsion, (n, 2), mm, in their order.

        Parameters
        ----------
        places_mm
            The points, (n, 2).
        size_mm
            Wanted distance to the neighbours, mm, (n,), of the points at places (n, 2); asked anew
            in every round.
        is_fixed
            Points that stay where they are, (n,).
        rounds, steps
            Neighbours are looked for once a round.
        range_in_sizes, step
            See `push` in lattice.cl.
        """
        middle = 0.5 * (places_mm.min(axis=0) + places_mm.max(axis=0))
        places = places_mm - middle
        for _ in range(rounds):
            size = size_mm(places + middle)
            tiles = Tiles.of(places, size)
            at = places[tiles.order].astype(self._real)
            moved = self._push(
                at,
                size[tiles.order].astype(self._real),
                is_fixed[tiles.order],
                tiles,
                steps,
                (range_in_sizes, step),
            )
            places[tiles.order] = moved
        return np.where(is_fixed[:, None], places_mm, places + middle)

    def choose_apart(
        self, places_mm: np.ndarray, rank: np.ndarray, distance_mm: np.ndarray
    ) -> np.ndarray:
        """Which points are chosen, taken by rank if none chosen before is too near, (n,) bool.

        Parameters
        ----------
        places_mm
            The points, (n, 2).
        rank
            A permutation of 0..n-1.
        distance_mm
            The least distance to others that are chosen, (n,), mm; of two points' the smaller.
        """
        places = places_mm - 0.5 * (places_mm.min(axis=0) + places_mm.max(axis=0))
        tiles = Tiles.of(places, distance_mm)
        order, n = tiles.order, np.int32(len(places))
        given = self._device.upload
        state, after = (self._device.allocate(int(n), np.dtype(np.int32)) for _ in range(2))
        self._write(state, np.zeros(n, dtype=np.int32))
        fixed = (
            n,
            given(places[order].astype(self._real)),
            given(rank[order].astype(np.int32)),
            given(distance_mm[order].astype(self._real)),
        )
        tiles_there = self._tiles(tiles)
        left = np.ones(n, dtype=np.int32)
        left_there = self._device.allocate(int(n), np.dtype(np.int32))
        while left.any():
            self._run("choose_apart", int(n), *fixed, state, *tiles_there, after, left_there)
            state, after = after, state
            self._read(left, left_there)
        result = np.empty(n, dtype=np.int32)
        self._read(result, state)
        chosen = np.zeros(n, dtype=bool)
        chosen[order] = result == 1
        return chosen

    def _push(
        self,
        places: np.ndarray,
        size: np.ndarray,
        is_fixed: np.ndarray,
        tiles: Tiles,
        steps: int,
        law: tuple[float, float],
    ) -> np.ndarray:
        """Points, already in the order of their cells, after some steps."""
        n = len(places)
        whole = np.dtype(np.int32)
        size_there = self._device.upload(size)
        fixed_there = self._device.upload(is_fixed.astype(np.uint8))
        before, after = (self._device.allocate(2 * n, self._real) for _ in range(2))
        self._write(before, places)
        neighbour = self._device.allocate(MOST_NEIGHBOURS * n, whole)
        found = self._device.allocate(n, whole)
        range_, step = (self._real.type(value) for value in law)
        # Half a bar longer than the range: sizes differ, and points come nearer before the next
        # look.
        reach = self._real.type(law[0] + 0.45)
        count = np.int32(n)
        tiles_there = self._tiles(tiles)
        self._run(
            "find_neighbours", n, count, before, size_there, reach, *tiles_there, neighbour, found
        )
        for _ in range(steps):
            self._run(
                "push",
                n,
                count,
                before,
                size_there,
                fixed_there,
                range_,
                step,
                neighbour,
                found,
                after,
            )
            before, after = after, before
        result = np.empty_like(places)
        self._read(result, before)
        return result

    def _tiles(self, tiles: Tiles) -> tuple[Any, ...]:
        """The arguments that kernels call TILES."""
        import pyopencl.cltypes as cltypes

        vector = cltypes.float2 if self._real == np.float32 else cltypes.double2
        corner = np.zeros((), dtype=vector)
        corner["x"], corner["y"] = tiles.origin_mm
        return (
            corner[()],
            self._real.type(tiles.tile_mm),
            np.int32(tiles.columns),
            np.int32(tiles.rows),
            *(self._device.upload(a) for a in (tiles.tile_first, tiles.tile_cells)),
            self._device.upload(tiles.cell_first),
        )

    def _run(self, name: str, n: int, *arguments: Any) -> None:
        import pyopencl as cl

        kernel = self._kernels[name]
        kernel.set_args(*arguments)
        size = -(-n // self._local) * self._local
        cl.enqueue_nd_range_kernel(self._device.queue, kernel, (size,), (self._local,))

    def _read(self, array: np.ndarray, there: pyopencl.Buffer) -> None:
        import pyopencl as cl

        cl.enqueue_copy(self._device.queue, array, there)

    def _write(self, there: pyopencl.Buffer, array: np.ndarray) -> None:
        import pyopencl as cl

        cl.enqueue_copy(self._device.queue, there, np.ascontiguousarray(array))
