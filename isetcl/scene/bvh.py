"""Bounding volume hierarchies: binned SAH in numpy, and the eight-wide tree of the kernels.

A binary tree is built first (here, or faster on a CPU device by `isetcl.device.mesh`), then
collapsed to eight children a node, with the members of each leaf in a block of eight.

Source: I. Wald (2007), "On fast construction of SAH-based bounding volume hierarchies" (binning);
Wald, Benthin & Boulos (2008), "Getting rid of packets" (wide nodes by opening the largest child).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

BINS = 16
LEAF_SIZE = 8
WIDTH = 8
SAH_DEPTH = 48
"""Below this depth nodes are halved by number, so that no input makes the tree deeper than 80."""


@dataclass(frozen=True, eq=False)
class BinaryTree:
    """A binary tree over boxes; node 0 is the root.

    Attributes
    ----------
    lo, hi : ndarray, (nodes, 3)
        Bounds of each node.
    first : ndarray of int, (nodes,)
        Of a leaf the place of its first box in `order`; of an inner node its left child, the right
        one follows it.
    count : ndarray of int, (nodes,)
        Boxes in a leaf; 0 for an inner node.
    order : ndarray of int, (boxes,)
        Box numbers, those of a leaf side by side.
    """

    lo: np.ndarray
    hi: np.ndarray
    first: np.ndarray
    count: np.ndarray
    order: np.ndarray

    def cost(self) -> tuple[float, float]:
        """Expected inner nodes and leaves that a random ray through the root meets."""
        area = half_area(self.lo, self.hi)
        share = area / area[0] if area[0] > 0 else np.zeros_like(area)
        return float(share[self.count == 0].sum()), float(share[self.count > 0].sum())


@dataclass(frozen=True, eq=False)
class WideTree:
    """An eight-wide tree as the kernels read it.

    Attributes
    ----------
    lo, hi : ndarray, (nodes, 3, 8)
        Bounds of the children; an empty place has lo = +inf and hi = -inf.
    child : ndarray of int32, (nodes, 8)
        An inner child's node, or -1 - b for the leaf with block b.
    members : ndarray of int32, (blocks, 8)
        Box numbers of each leaf, -1 where there are fewer than eight.
    depth : int
        Nodes on the longest way from the root to a leaf.
    """

    lo: np.ndarray
    hi: np.ndarray
    child: np.ndarray
    members: np.ndarray
    depth: int


def half_area(lo: np.ndarray, hi: np.ndarray) -> np.ndarray:
    """Half the surface of boxes (..., 3); 0 for empty ones."""
    size = np.maximum(hi.astype(np.float64) - lo, 0.0)
    x, y, z = size[..., 0], size[..., 1], size[..., 2]
    return x * y + y * z + z * x


def build_binary_tree(lo: np.ndarray, hi: np.ndarray) -> BinaryTree:
    """The binary tree of boxes (n, 3), n >= 1, level by level.

    All boxes of a level are binned at once: nodes keep their boxes side by side, and a bin is a
    number node * 16 + slot.
    """
    order = np.arange(len(lo))
    first, count = np.array([0]), np.array([len(lo)])
    levels: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = []
    next_node = 1
    while len(first):
        places, node = _members(first, count)
        boxes = order[places]
        starts = np.concatenate([[0], np.cumsum(count)[:-1]])
        is_leaf = count <= LEAF_SIZE
        child = first.copy()
        inner = np.flatnonzero(~is_leaf)
        child[inner] = next_node + 2 * np.arange(len(inner))
        next_node += 2 * len(inner)
        levels.append(
            (
                np.minimum.reduceat(lo[boxes], starts),
                np.maximum.reduceat(hi[boxes], starts),
                child,
                np.where(is_leaf, count, 0),
            )
        )
        first, count = first[inner], count[inner]
        if len(inner) == 0:
            break
        places, node = _members(first, count)
        boxes = order[places]
        goes_left = _sah_side(lo[boxes], hi[boxes], node, count, len(levels) <= SAH_DEPTH)
        left = np.bincount(node, goes_left, len(first)).astype(np.int64)
        order[_partition(first, left, node, goes_left)] = boxes
        first = np.stack([first, first + left], axis=1).ravel()
        count = np.stack([left, count - left], axis=1).ravel()
    parts = [np.concatenate([level[i] for level in levels]) for i in range(4)]
    return BinaryTree(parts[0], parts[1], parts[2], parts[3], order)


def _members(first: np.ndarray, count: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places in the order of all boxes of some nodes, and the number of the node of each."""
    node = np.repeat(np.arange(len(first)), count)
    start = np.cumsum(count) - count
    return first[node] + np.arange(len(node)) - start[node], node


def _partition(
    first: np.ndarray, left: np.ndarray, node: np.ndarray, goes_left: np.ndarray
) -> np.ndarray:
    """New places of boxes when each node's left ones come first, in their old order."""
    before = np.cumsum(goes_left) - goes_left
    position = np.arange(len(node))
    starts = np.searchsorted(node, np.arange(len(first)))
    left_rank = before - before[starts][node]
    right_rank = position - starts[node] - left_rank
    return first[node] + np.where(goes_left, left_rank, left[node] + right_rank)


def _sah_side(
    lo: np.ndarray, hi: np.ndarray, node: np.ndarray, count: np.ndarray, use_sah: bool
) -> np.ndarray:
    """Whether each box goes to the left child: binned SAH, or halves where no split separates."""
    starts = np.cumsum(count) - count
    side = np.arange(len(node)) - starts[node] < (count // 2)[node]
    if not use_sah:
        return side
    centre = lo + hi
    least = np.minimum.reduceat(centre, starts)
    extent = np.maximum.reduceat(centre, starts) - least
    best = np.full(len(count), np.inf)
    for axis in range(3):
        scale = BINS / np.where(extent[:, axis] > 0, extent[:, axis], 1)
        slot = ((centre[:, axis] - least[node, axis]) * scale[node]).astype(np.int64)
        slot = np.minimum(slot, BINS - 1)
        cost = _split_costs(lo, hi, node * BINS + slot, len(count))
        cut = np.argmin(cost, axis=1)
        value = cost[np.arange(len(count)), cut]
        better = value < best
        best = np.where(better, value, best)
        side = np.where(better[node], slot <= cut[node], side)
    return side


def _split_costs(lo: np.ndarray, hi: np.ndarray, key: np.ndarray, nodes: int) -> np.ndarray:
    """SAH cost of cutting each node after each of its first 15 bins; inf if a side is empty."""
    bins = nodes * BINS
    number = np.bincount(key, minlength=bins).reshape(nodes, BINS)
    bin_lo = np.full((bins, 3), np.inf)
    bin_hi = np.full((bins, 3), -np.inf)
    np.minimum.at(bin_lo, key, lo)
    np.maximum.at(bin_hi, key, hi)
    low, high = bin_lo.reshape(nodes, BINS, 3), bin_hi.reshape(nodes, BINS, 3)
    area_left = half_area(np.minimum.accumulate(low, 1), np.maximum.accumulate(high, 1))
    area_right = half_area(
        np.minimum.accumulate(low[:, ::-1], 1), np.maximum.accumulate(high[:, ::-1], 1)
    )[:, ::-1]
    left = np.cumsum(number, axis=1)
    right = left[:, -1:] - left
    cost = area_left[:, :-1] * left[:, :-1] + area_right[:, 1:] * right[:, :-1]
    return np.where((left[:, :-1] > 0) & (right[:, :-1] > 0), cost, np.inf)


def collapse(tree: BinaryTree) -> WideTree:
    """The eight-wide tree of a binary one: the largest child is opened until there are eight.

    A tree that is a single leaf becomes a node with one child.
    """
    area = half_area(tree.lo, tree.hi)
    leaf_nodes = np.flatnonzero(tree.count > 0)
    block = np.full(len(tree.count), -1)
    block[leaf_nodes] = np.arange(len(leaf_nodes))
    roots = np.array([0])
    rows: list[np.ndarray] = []
    refs: list[np.ndarray] = []
    made = 1
    while len(roots):
        children = _open_children(tree, area, roots)
        is_inner = (children >= 0) & (tree.count[children] == 0)
        reference = np.where(children >= 0, -1 - block[children], 0)
        inner = int(is_inner.sum())
        reference[is_inner] = made + np.arange(inner)
        made += inner
        rows.append(children)
        refs.append(reference)
        roots = children[is_inner]
    children = np.concatenate(rows)
    empty = children < 0
    lo = np.where(empty[..., None], np.inf, tree.lo[children]).transpose(0, 2, 1)
    hi = np.where(empty[..., None], -np.inf, tree.hi[children]).transpose(0, 2, 1)
    slots = tree.first[leaf_nodes, None] + np.arange(LEAF_SIZE)
    used = np.arange(LEAF_SIZE) < tree.count[leaf_nodes, None]
    members = np.where(used, tree.order[np.minimum(slots, len(tree.order) - 1)], -1)
    return WideTree(
        np.ascontiguousarray(lo, dtype=tree.lo.dtype),
        np.ascontiguousarray(hi, dtype=tree.hi.dtype),
        np.concatenate(refs).astype(np.int32),
        members.astype(np.int32),
        len(rows),
    )


def _open_children(tree: BinaryTree, area: np.ndarray, roots: np.ndarray) -> np.ndarray:
    """Up to eight descendants of each root that together hold all its boxes, -1 where fewer."""
    children = np.full((len(roots), WIDTH), -1)
    children[:, 0] = roots
    rows = np.arange(len(roots))
    for used in range(1, WIDTH):
        is_inner = (children >= 0) & (tree.count[children] == 0)
        size = np.where(is_inner, area[children], -1.0)
        largest = np.argmax(size, axis=1)
        row = rows[size[rows, largest] >= 0]
        opened = largest[row]
        left = tree.first[children[row, opened]]
        children[row, opened] = left
        children[row, used] = left + 1
    return children


def closest_hits(
    tree: WideTree, triangles: np.ndarray, origins: np.ndarray, directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Closest hits of rays (n, 3) on triangles (m, 3, 3) in float64, all rays side by side.

    Slow and simple, for depth maps and views on the host: every ray meets every box on its way.

    Returns
    -------
    distance : ndarray, (n,)
        In units of each direction's length; inf for a miss.
    triangle : ndarray of int, (n,)
        -1 for a miss.
    weights : ndarray, (n, 2)
        Barycentric weights of the second and third corner.
    """
    n = len(origins)
    distance = np.full(n, np.inf)
    triangle = np.full(n, -1)
    weights = np.zeros((n, 2))
    with np.errstate(divide="ignore"):
        inverse = 1.0 / np.where(directions == 0.0, 1e-300, directions)
    rays, nodes = np.arange(n), np.zeros(n, dtype=np.int64)
    while len(rays):
        o, i = origins[rays][:, :, None], inverse[rays][:, :, None]
        with np.errstate(over="ignore", invalid="ignore"):
            one, other = (tree.lo[nodes] - o) * i, (tree.hi[nodes] - o) * i
        enter = np.maximum(np.minimum(one, other).max(axis=1), 0.0)
        leave = np.minimum(
            np.maximum(one, other).min(axis=1) * (1 + 1e-12), distance[rays][:, None]
        )
        is_used = tree.lo[nodes, 0] <= tree.hi[nodes, 0]
        which, place = np.nonzero(is_used & (enter <= leave))
        rays, child = rays[which], tree.child[nodes[which], place]
        leaf = child < 0
        _hit_leaves(
            tree,
            triangles,
            origins,
            directions,
            rays[leaf],
            -1 - child[leaf],
            (distance, triangle, weights),
        )
        rays, nodes = rays[~leaf], child[~leaf].astype(np.int64)
    return distance, triangle, weights


def _hit_leaves(
    tree: WideTree,
    triangles: np.ndarray,
    origins: np.ndarray,
    directions: np.ndarray,
    rays: np.ndarray,
    blocks: np.ndarray,
    best: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    """Test rays against all triangles of their blocks; keep what is nearer than the best so far."""
    members = tree.members[blocks]
    rays, member = np.repeat(rays, WIDTH)[members.ravel() >= 0], members[members >= 0]
    a, b, c = (triangles[member, k] for k in range(3))
    d = directions[rays]
    e1, e2, s = b - a, c - a, origins[rays] - a
    p = np.cross(d, e2)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / np.einsum("ij,ij->i", e1, p)
        q = np.cross(s, e1)
        u = np.einsum("ij,ij->i", s, p) * inverse
        v = np.einsum("ij,ij->i", d, q) * inverse
        t = np.einsum("ij,ij->i", e2, q) * inverse
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & np.isfinite(t)
    rays, member, t, u, v = (x[hit] for x in (rays, member, t, u, v))
    distance, triangle, weights = best
    # The nearest of each ray comes last, and so is what stays.
    order = np.argsort(-t, kind="stable")
    order = order[t[order] < distance[rays[order]]]
    distance[rays[order]] = t[order]
    triangle[rays[order]] = member[order]
    weights[rays[order]] = np.stack([u[order], v[order]], axis=1)
