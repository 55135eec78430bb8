"""Triangle meshes on an OpenCL device: the hierarchy, its kernels, and rays against it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from isetcl.device import program
from isetcl.device.devices import Device, list_devices
from isetcl.device.layout import Precision, real_dtype
from isetcl.scene.bvh import (
    LEAF_SIZE,
    SAH_DEPTH,
    WIDTH,
    BinaryTree,
    WideTree,
    build_binary_tree,
    collapse,
)

if TYPE_CHECKING:
    import pyopencl

_STACK_STEP = 32


@dataclass(frozen=True, eq=False)
class MeshHits:
    """What rays hit on a mesh.

    Attributes
    ----------
    distance : ndarray, (rays,)
        In units of each direction's length; +inf where nothing is hit.
    triangle : ndarray of int32, (rays,)
        Number of the triangle, -1 where nothing is hit.
    weights : ndarray, (rays, 2)
        Barycentric weights of the second and third corner.
    """

    distance: np.ndarray
    triangle: np.ndarray
    weights: np.ndarray


def fast_builder() -> Device | None:
    """A CPU device, on which one work-item builds trees faster than numpy; None without one."""
    for device in list_devices():
        if device.is_cpu and not device.is_interpreter:
            return device
    return None


def build_tree_on(device: Device, lo: np.ndarray, hi: np.ndarray) -> BinaryTree:
    """The tree of `build_binary_tree` for float32 boxes (n, 3), by a kernel of a CPU device."""
    import pyopencl as cl

    n = len(lo)
    defines = device.defines("single", 1) | {"LEAF_SIZE": LEAF_SIZE, "SAH_DEPTH": SAH_DEPTH}
    source = program.assemble("build_bvh.cl", defines)
    kernel = program.kernel(device, source, "build_bvh")
    flags, context, queue = cl.mem_flags, device.context, device.queue
    padded = [np.zeros((n, 4), dtype=np.float32) for _ in range(2)]
    padded[0][:, :3], padded[1][:, :3] = lo, hi
    inputs = [
        cl.Buffer(context, flags.READ_ONLY | flags.USE_HOST_PTR, hostbuf=array) for array in padded
    ]
    most = 2 * n - 1
    outputs = [
        np.empty(n, np.int32),
        np.empty((most, 4), np.float32),
        np.empty((most, 4), np.float32),
        np.empty((most, 2), np.int32),
        np.empty(1, np.int32),
    ]
    buffers = [cl.Buffer(context, flags.WRITE_ONLY, array.nbytes) for array in outputs]
    kernel.set_args(np.int32(n), *inputs, *buffers)
    cl.enqueue_nd_range_kernel(queue, kernel, (1,), (1,))
    cl.enqueue_copy(queue, outputs[4], buffers[4])
    nodes = int(outputs[4][0])
    order, node_lo, node_hi, ranges = (
        array if i == 0 else array[:nodes] for i, array in enumerate(outputs[:4])
    )
    for array, buffer in zip((order, node_lo, node_hi, ranges), buffers, strict=False):
        cl.enqueue_copy(queue, array, buffer)
    return BinaryTree(node_lo[:, :3], node_hi[:, :3], ranges[:, 0], ranges[:, 1], order)


def node_dtype(precision: Precision) -> np.dtype:
    """A node of the wide tree in the kernels' layout: 6 vectors of 8, 8 references, padding."""
    real = real_dtype(precision)
    vectors = {"single": 8, "double": 7}[precision]
    return _record("bounds", real, (6, WIDTH), "child", vectors * WIDTH * real.itemsize)


def block_dtype(precision: Precision) -> np.dtype:
    """A block of eight triangles in the kernels' layout: 9 vectors of 8, 8 numbers, padding."""
    real = real_dtype(precision)
    return _record("corners", real, (9, WIDTH), "number", 10 * WIDTH * real.itemsize)


def _record(name: str, real: np.dtype, shape: tuple[int, int], ints: str, size: int) -> np.dtype:
    offset = shape[0] * shape[1] * real.itemsize
    return np.dtype(
        {
            "names": [name, ints],
            "formats": [(real, shape), (np.int32, WIDTH)],
            "offsets": [0, offset],
            "itemsize": size,
        }
    )


def pack_tree(
    tree: WideTree, triangles: np.ndarray, precision: Precision
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and blocks of triangles (n, 3 corners, 3) for the kernels.

    Places without a triangle repeat the corner of another: they have no area and are never hit.
    """
    nodes = np.zeros(len(tree.child), dtype=node_dtype(precision))
    nodes["bounds"][:, 0::2] = tree.lo
    nodes["bounds"][:, 1::2] = tree.hi
    nodes["child"] = tree.child
    blocks = np.zeros(len(tree.members), dtype=block_dtype(precision))
    filled = np.where(tree.members < 0, tree.members[:, :1], tree.members)
    corners = triangles[filled].astype(real_dtype(precision))
    corners[tree.members < 0] = corners[tree.members < 0][:, :1]
    blocks["corners"] = corners.reshape(-1, WIDTH, 9).transpose(0, 2, 1)
    blocks["number"] = tree.members
    return nodes, blocks


class MeshTree:
    """A triangle mesh with its hierarchy on a device, as lib/bvh.cl reads it.

    Parameters
    ----------
    device, precision
        Where and how rays are traced.
    triangles : ndarray, (n, 3, 3)
        Corners of each triangle, metres.

    Attributes
    ----------
    nodes, blocks
        Buffers of the tree; it owns them.
    stack_size
        Entries the stack of a ray may need.
    """

    def __init__(self, device: Device, triangles: np.ndarray, precision: Precision) -> None:

        device.check_precision(precision)
        nodes, blocks, depth = build_tree(triangles, precision)
        self.nodes = device.upload(nodes)
        self.blocks = device.upload(blocks)
        self.stack_size = stack_size(depth)


def stack_size(depth: int) -> int:
    """Entries the stack of a ray may need in a tree of a depth."""
    return -(-((WIDTH - 1) * depth + 1) // _STACK_STEP) * _STACK_STEP


def build_tree(triangles: np.ndarray, precision: Precision) -> tuple[np.ndarray, np.ndarray, int]:
    """Nodes and blocks of triangles (n, 3, 3) in the kernels' layout, and the depth of the tree."""
    corners = np.asarray(triangles, dtype=np.float32)
    lo, hi = corners.min(axis=1), corners.max(axis=1)
    if precision == "double":
        # Boxes of the float32 builder must hold the float64 corners.
        lo = np.nextafter(lo, np.float32(-np.inf))
        hi = np.nextafter(hi, np.float32(np.inf))
    builder = fast_builder()
    binary = build_binary_tree(lo, hi) if builder is None else build_tree_on(builder, lo, hi)
    tree = collapse(binary)
    nodes, blocks = pack_tree(tree, triangles, precision)
    return nodes, blocks, tree.depth


class DeviceMesh:
    """Rays against one triangle mesh; see `MeshTree` for the parameters."""

    def __init__(self, device: Device, triangles: np.ndarray, precision: Precision) -> None:
        self._device = device
        self._real = real_dtype(precision)
        tree = MeshTree(device, triangles, precision)
        self.nodes, self.blocks = tree.nodes, tree.blocks
        defines = device.defines(precision, 1) | {"STACK_SIZE": tree.stack_size}
        source = program.assemble("trace_mesh.cl", defines)
        self._trace = program.kernel(device, source, "trace_mesh")
        self._occlude = program.kernel(device, source, "occlude_mesh")

    def upload(
        self, origins: np.ndarray, directions: np.ndarray, least: object, most: object
    ) -> tuple[int, pyopencl.Buffer, pyopencl.Buffer, pyopencl.Buffer]:
        """Copy rays (n, 3) and their ranges to the device."""

        n = len(origins)
        ranges = np.empty((2, n), dtype=self._real)
        ranges[0], ranges[1] = least, most

        def planes(rows: np.ndarray) -> pyopencl.Buffer:
            return self._device.upload(np.asarray(rows.T, dtype=self._real))

        return n, planes(origins), planes(directions), planes(ranges.T)

    def trace(
        self,
        origins: np.ndarray,
        directions: np.ndarray,
        least: np.ndarray | float = 0.0,
        most: np.ndarray | float = np.inf,
    ) -> MeshHits:
        """The closest hits of rays (n, 3) between distances `least` and `most`."""
        import pyopencl as cl

        n, *rays = self.upload(origins, directions, least, most)
        results = (
            np.empty(n, self._real),
            np.empty(n, np.int32),
            np.empty((2, n), self._real),
        )
        buffers = [self._device.allocate(array.size, array.dtype) for array in results]
        self.enqueue(self._trace, n, (*rays, self.nodes, self.blocks, *buffers))
        for array, buffer in zip(results, buffers, strict=True):
            cl.enqueue_copy(self._device.queue, array, buffer)
        return MeshHits(results[0], results[1], results[2].T)

    def occluded(
        self,
        origins: np.ndarray,
        directions: np.ndarray,
        least: np.ndarray | float = 0.0,
        most: np.ndarray | float = np.inf,
    ) -> np.ndarray:
        """Whether anything lies between distances `least` and `most` on rays (n, 3), bool (n,)."""
        import pyopencl as cl

        n, *rays = self.upload(origins, directions, least, most)
        result = np.empty(n, np.int32)
        buffer = self._device.allocate(result.size, result.dtype)
        self.enqueue(self._occlude, n, (*rays, self.nodes, self.blocks, buffer))
        cl.enqueue_copy(self._device.queue, result, buffer)
        return result != 0

    def enqueue(
        self, kernel: pyopencl.Kernel, n: int, arguments: tuple[np.int32 | pyopencl.Buffer, ...]
    ) -> pyopencl.Event:
        """Enqueue a kernel over n rays; returns its event."""
        import pyopencl as cl

        for i, argument in enumerate((np.int32(n), *arguments)):
            kernel.set_arg(i, argument)
        group = self._device.work_group_size
        size = -(-n // group) * group
        return cl.enqueue_nd_range_kernel(self._device.queue, kernel, (size,), (group,))
