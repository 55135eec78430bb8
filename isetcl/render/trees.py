"""The hierarchies of a scene on a device: of triangles in place, and of instanced meshes."""

from __future__ import annotations

import numpy as np

from isetcl.device.devices import Device
from isetcl.device.layout import Precision
from isetcl.device.mesh import block_dtype, build_tree, node_dtype, stack_size
from isetcl.render.pack_paths import INSTANCE, PackedScene
from isetcl.scene.bvh import WIDTH, build_binary_tree, collapse
from isetcl.scene.mesh import Instance


class SceneTrees:
    """All hierarchies of a scene, one behind the other, as lib/instances.cl reads them.

    Attributes
    ----------
    nodes, blocks
        Buffers; this owns them.
    instances : ndarray
        Blocks of eight instances, the leaves of the hierarchy over them.
    records : dict of ndarray
        The scene's records with the places of hierarchies and instances filled in.
    stack_size
        Entries the stack of a ray may need.
    """

    def __init__(self, device: Device, packed: PackedScene, precision: Precision) -> None:

        nodes, blocks = [], []
        depth, nodes_at, blocks_at = 1, 0, 0
        places = []
        ranges = [(0, packed.n_placed)]
        ranges += [(p.first_triangle, p.first_triangle + len(p.mesh.faces)) for p in packed.parts]
        for first, last in ranges:
            places.append((nodes_at, blocks_at))
            if last == first:
                nodes.append(_empty_node(precision))
                nodes_at += 1
                continue
            own_nodes, own_blocks, own_depth = build_tree(packed.triangles[first:last], precision)
            nodes.append(own_nodes)
            blocks.append(own_blocks)
            depth = max(depth, own_depth)
            nodes_at += len(own_nodes)
            blocks_at += len(own_blocks)
        self.records = {name: array.copy() for name, array in packed.records.items()}
        self.records["world"]["instances_at"] = nodes_at
        self.records["world"]["meshes_low"], self.records["world"]["meshes_high"] = _bounds(packed)
        self.instances = np.zeros(1, dtype=INSTANCE.dtype(precision))
        if not packed.instances:
            nodes.append(_empty_node(precision))
        else:
            upper, self.instances, own_depth = _upper_tree(packed, places[1:], precision)
            nodes.append(upper)
            depth = max(depth, own_depth)
            for place in np.flatnonzero(self.instances["object"] >= 0):
                self.records["objects"][self.instances[place]["object"]]["instance"] = place
        self.stack_size = stack_size(depth)
        blocks = blocks or [np.zeros(1, block_dtype(precision))]
        self.nodes = device.upload(_joined(nodes))
        self.blocks = device.upload(_joined(blocks))


def _bounds(packed: PackedScene) -> np.ndarray:
    """The box around all triangles and instances, (2, 3), a little too large."""
    boxes = [_box(instance) for _, _, instance in packed.instances]
    if packed.n_placed:
        placed = packed.triangles[: packed.n_placed]
        boxes.append((placed.min(axis=(0, 1)), placed.max(axis=(0, 1))))
    if not boxes:
        return np.zeros((2, 3))
    low, high = np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
    slack = 4e-7 * np.maximum(np.abs(low), np.abs(high))
    return np.array([low - slack, high + slack])


def _empty_node(precision: Precision) -> np.ndarray:
    """A root that no ray enters: what rays are asked about must exist."""
    node = np.zeros(1, dtype=node_dtype(precision))
    node["bounds"][:, 0::2], node["bounds"][:, 1::2] = np.inf, -np.inf
    return node


def _joined(parts: list[np.ndarray]) -> np.ndarray:
    """Records one behind the other as bytes: numpy would leave out their padding."""
    return np.concatenate([part.view(np.uint8) for part in parts])


def _upper_tree(
    packed: PackedScene, places: list[tuple[int, int]], precision: Precision
) -> tuple[np.ndarray, np.ndarray, int]:
    """Nodes over all instances, the instances in blocks of eight, and the depth."""
    boxes = np.array([_box(instance) for _, _, instance in packed.instances], dtype=np.float32)
    # Boxes in float32 must hold corners that were rounded another way.
    slack = 4e-7 * np.abs(boxes).max(axis=(1, 2))[:, None]
    tree = collapse(build_binary_tree(boxes[:, 0] - slack, boxes[:, 1] + slack))
    nodes = np.zeros(len(tree.child), dtype=node_dtype(precision))
    nodes["bounds"][:, 0::2], nodes["bounds"][:, 1::2] = tree.lo, tree.hi
    nodes["child"] = tree.child
    records = np.zeros((len(tree.members), WIDTH), dtype=INSTANCE.dtype(precision))
    records["object"] = -1
    for record, number in zip(records.ravel(), tree.members.ravel(), strict=True):
        if number < 0:
            continue
        item, part, instance = packed.instances[number]
        record["object"] = item
        record["nodes_at"], record["blocks_at"] = places[part]
        record["first_triangle"] = packed.parts[part].first_triangle
        matrix = packed.parts[part].matrix(instance)
        record["matrix"] = matrix[:3].ravel()
        record["inverse"] = np.linalg.inv(matrix)[:3].ravel()
    return nodes, records.ravel(), tree.depth


def _box(instance: Instance) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of an instance in the world."""
    corners = instance.mesh.vertices_m @ instance.matrix[:3, :3].T + instance.matrix[:3, 3]
    return corners.min(axis=0), corners.max(axis=0)
