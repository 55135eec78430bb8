"""Triangle meshes: trees that hold everything, and rays that never slip through."""

import numpy as np
import pytest
import trimesh

from isetcl.device.mesh import DeviceMesh, build_tree_on, fast_builder
from isetcl.scene import bvh


def soup(count, seed=0, size=0.1):
    """Random triangles (count, 3, 3) in the unit cube."""
    rng = np.random.default_rng(seed)
    return rng.uniform(size=(count, 1, 3)) + size * rng.uniform(-1, 1, size=(count, 3, 3))


def boxes(triangles):
    corners = triangles.astype(np.float32)
    return corners.min(axis=1), corners.max(axis=1)


def clustered(count):
    """Triangles whose distances shrink geometrically: SAH peels them off a few at a time."""
    scale = 0.5 ** np.linspace(0, 100, count)
    return soup(count, 3) * scale[:, None, None]


INPUTS = {
    "soup": soup(3000),
    "one": soup(1),
    "eight": soup(8),
    "nine": soup(9),
    "all alike": np.repeat(soup(1), 500, axis=0),
    "in a plane": soup(700) * [1.0, 1.0, 0.0],
    "geometric": clustered(2000),
    "icosphere": np.asarray(trimesh.creation.icosphere(subdivisions=4).triangles),
}


def trees(triangles):
    lo, hi = boxes(triangles)
    yield bvh.build_binary_tree(lo, hi)
    builder = fast_builder()
    if builder is not None:
        yield build_tree_on(builder, lo, hi)


@pytest.mark.parametrize("name", INPUTS)
def test_every_triangle_is_in_one_leaf_and_every_node_holds_what_is_below_it(name):
    lo, hi = boxes(INPUTS[name])
    for tree in trees(INPUTS[name]):
        assert sorted(tree.order) == list(range(len(lo)))
        held = np.zeros(len(lo), dtype=int)
        for node in range(len(tree.count)):
            first, count = tree.first[node], tree.count[node]
            if count > 0:
                members = tree.order[first : first + count]
                held[members] += 1
                assert count <= bvh.LEAF_SIZE
                assert np.all(tree.lo[node] <= lo[members])
                assert np.all(tree.hi[node] >= hi[members])
            else:
                pair = [first, first + 1]
                np.testing.assert_array_equal(tree.lo[node], tree.lo[pair].min(axis=0))
                np.testing.assert_array_equal(tree.hi[node], tree.hi[pair].max(axis=0))
        assert np.all(held == 1)


@pytest.mark.parametrize("name", ["soup", "icosphere", "in a plane"])
def test_the_kernel_builds_trees_as_good_as_those_of_numpy(name):
    made = list(trees(INPUTS[name]))
    if len(made) < 2:
        pytest.skip("no CPU device")
    np.testing.assert_allclose(made[1].cost(), made[0].cost(), rtol=0.01)


@pytest.mark.parametrize("name", INPUTS)
def test_the_wide_tree_keeps_all_leaves(name):
    for tree in trees(INPUTS[name]):
        wide = bvh.collapse(tree)
        members = wide.members[wide.members >= 0]
        assert sorted(members) == list(range(len(INPUTS[name])))
        seen_nodes, seen_blocks = [0], []
        for node in range(len(wide.child)):
            used = np.isfinite(wide.lo[node, 0])
            references = wide.child[node][used]
            seen_nodes += list(references[references >= 0])
            seen_blocks += list(-1 - references[references < 0])
        assert sorted(seen_nodes) == list(range(len(wide.child)))
        assert sorted(seen_blocks) == list(range(len(wide.members)))
        assert wide.depth <= 80


def brute_force(triangles, origins, directions):
    """Closest distances and triangles by float64 Moeller-Trumbore over all pairs, and margins.

    The margin is 0 where an edge is so near that the hit is a matter of rounding, else 1.
    """
    a, b, c = (triangles[:, i].astype(np.float64) for i in range(3))
    e1, e2 = b - a, c - a
    best = np.full(len(origins), np.inf)
    which = np.full(len(origins), -1)
    margin = np.full(len(origins), np.inf)
    weights = np.zeros((len(origins), 2))
    for i, (o, d) in enumerate(zip(origins, directions, strict=True)):
        p = np.cross(d, e2)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = 1.0 / np.einsum("ij,ij->i", e1, p)
            s = o - a
            u = np.einsum("ij,ij->i", s, p) * inverse
            q = np.cross(s, e1)
            v = (q @ d) * inverse
            t = np.einsum("ij,ij->i", e2, q) * inverse
        inside = np.minimum(np.minimum(u, v), 1 - u - v)
        hits = (inside >= 0) & (t > 0)
        # A near miss of something nearer also makes the ray undecidable.
        close = np.abs(inside) < 1e-3
        if hits.any():
            k = np.flatnonzero(hits)[np.argmin(t[hits])]
            best[i], which[i], weights[i] = t[k], k, (u[k], v[k])
        nearer = close & (t > 0) & (t <= best[i] * (1 + 1e-6))
        margin[i] = 0.0 if nearer.any() else 1.0
    return best, which, weights, margin


def random_rays(count, seed=0):
    rng = np.random.default_rng(seed)
    origins = rng.uniform(-1, 2, size=(count, 3))
    targets = rng.uniform(0, 1, size=(count, 3))
    return origins, targets - origins


@pytest.mark.parametrize("name", ["soup", "in a plane", "icosphere", "nine", "one"])
def test_closest_hits_are_those_of_brute_force(name, precision, device):
    triangles = INPUTS[name]
    origins, directions = random_rays(600)
    mesh = DeviceMesh(device, triangles, precision)
    found = mesh.trace(origins, directions)
    real = np.float32 if precision == "single" else np.float64
    distance, which, weights, margin = brute_force(
        triangles.astype(real), origins.astype(real), directions.astype(real)
    )
    sure = margin > 0
    assert sure.mean() > 0.9
    np.testing.assert_array_equal(found.triangle[sure] >= 0, which[sure] >= 0)
    if name != "in a plane":
        # There triangles overlap, and which of them is nearest is a matter of rounding.
        np.testing.assert_array_equal(found.triangle[sure], which[sure])
    hit = sure & (which >= 0) & (found.triangle == which)
    assert hit.any()
    tolerance = 2e-5 if precision == "single" else 1e-12
    np.testing.assert_allclose(found.distance[hit], distance[hit], rtol=tolerance, atol=tolerance)
    loose = 100 * tolerance
    np.testing.assert_allclose(found.weights[hit], weights[hit], rtol=0, atol=loose)
    assert np.all(np.isinf(found.distance[sure & (which < 0)]))


def test_anything_in_the_way_is_what_closest_hits_say(precision, device):
    mesh = DeviceMesh(device, INPUTS["soup"], precision)
    origins, directions = random_rays(3000, seed=4)
    distance = mesh.trace(origins, directions).distance
    np.testing.assert_array_equal(mesh.occluded(origins, directions), np.isfinite(distance))
    hit = np.isfinite(distance)
    origins, directions, distance = origins[hit], directions[hit], distance[hit]
    assert not mesh.occluded(origins, directions, 0.0, distance * 0.999).any()
    assert mesh.occluded(origins, directions, 0.0, distance * 1.001).all()
    beyond = mesh.trace(origins, directions, distance * 1.001)
    assert np.all(beyond.distance > distance)


@pytest.mark.parametrize("shift_m", [0.0, 1.0, 1000.0])
def test_no_ray_slips_out_of_a_closed_mesh(shift_m, device):
    """Rays from inside aimed at vertices and at points of edges, where two triangles meet."""
    sphere = trimesh.creation.icosphere(subdivisions=4)
    vertices = sphere.vertices + shift_m
    edges = vertices[sphere.edges_unique]
    rng = np.random.default_rng(1)
    along = rng.uniform(size=(len(edges), 1))
    targets = np.concatenate([vertices, edges[:, 0] * (1 - along) + edges[:, 1] * along])
    targets = np.concatenate([targets] * 4)
    origins = shift_m + rng.uniform(-0.4, 0.4, size=targets.shape)
    mesh = DeviceMesh(device, vertices[sphere.faces], "single")
    found = mesh.trace(origins, targets - origins)
    assert np.all(found.triangle >= 0)
    assert np.allclose(found.distance, 1.0, atol=2e-3 if shift_m > 100 else 1e-4)


@pytest.mark.slow
def test_no_ray_slips_out_of_a_large_closed_mesh(device):
    sphere = trimesh.creation.icosphere(subdivisions=6)
    mesh = DeviceMesh(device, sphere.triangles, "single")
    rng = np.random.default_rng(2)
    directions = rng.normal(size=(1_000_000, 3))
    origins = rng.uniform(-0.5, 0.5, size=(1_000_000, 3))
    assert np.all(mesh.trace(origins, directions).triangle >= 0)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_axis_parallel_rays_hit_what_lies_in_a_plane_of_coordinates(axis, sign, precision, device):
    """A grid of squares at coordinate 0; rays run along the axis and lie in faces of the boxes."""
    n = 6
    corner = np.stack(np.meshgrid(np.arange(n), np.arange(n)), axis=-1).reshape(-1, 2) - n / 2
    square = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], dtype=float)
    flat = (corner[:, None, None] + square[None]).reshape(-1, 3, 2)
    triangles = np.insert(flat, axis, 0.0, axis=2)
    lattice = np.stack(np.meshgrid(np.arange(-2, 3), np.arange(-2, 3)), axis=-1).reshape(-1, 2)
    origins = np.insert(lattice.astype(float), axis, -sign * 2.0, axis=1)
    direction = np.zeros(3)
    direction[axis] = sign
    for shift in (0.0, 0.1, 12.3):
        mesh = DeviceMesh(device, triangles + shift, precision)
        found = mesh.trace(origins + shift, np.tile(direction, (len(origins), 1)))
        assert np.all(found.triangle >= 0)
        np.testing.assert_allclose(found.distance, 2.0, rtol=1e-6)


def test_rays_inside_a_flat_mesh_s_plane_give_no_nan(precision, device):
    mesh = DeviceMesh(device, INPUTS["in a plane"], precision)
    origins = np.array([[-1.0, 0.5, 0.0], [0.5, -1.0, 0.0], [0.3, 0.3, 0.0]])
    found = mesh.trace(origins, np.eye(3)[[0, 1, 2]])
    assert not np.isnan(found.distance).any()
    assert np.isfinite(found.weights).all()


def test_degenerate_triangles_are_never_hit(precision, device):
    rng = np.random.default_rng(5)
    # Multiples of 1/1024: the point between two of them is exact, so the triangle has no area.
    p, q = rng.integers(0, 512, size=(2, 150, 3)) / 512
    degenerate = np.concatenate(
        [
            np.stack([p, p, p], axis=1),
            np.stack([p, q, p], axis=1),
            np.stack([p, q, q], axis=1),
            np.stack([p, (p + q) / 2, q], axis=1),
        ]
    )
    behind = np.array([[[-50, -50, -5], [50, -50, -5], [0, 80, -5]]], dtype=float)
    mesh = DeviceMesh(device, np.concatenate([degenerate, behind]), precision)
    targets = np.concatenate([p, q, (p + q) / 2])
    origins = targets + np.array([0.0, 0.0, 3.0])
    found = mesh.trace(origins, np.tile([0.0, 0.0, -1.0], (len(origins), 1)))
    assert np.all(found.triangle == 600)
    assert np.isfinite(found.distance).all()


@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1e3, 1e6])
def test_scale_does_not_matter(scale, device):
    triangles = INPUTS["icosphere"]
    origins, directions = random_rays(2000, seed=9)
    origins *= 3
    one = DeviceMesh(device, triangles, "single").trace(origins, directions)
    other = DeviceMesh(device, triangles * scale, "single").trace(
        origins * scale, directions * scale
    )
    same = one.triangle == other.triangle
    assert same.mean() > 0.999
    hit = same & (one.triangle >= 0)
    np.testing.assert_allclose(one.distance[hit], other.distance[hit], rtol=1e-4)
