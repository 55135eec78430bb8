"""Rays against a mesh of 81,920 triangles: the kernels against Embree (embreex), in one run.

An icosphere of radius 1; a million random rays from a sphere of radius 3 towards points within 1.2,
a parallel grid, and the rays of a lens of 4 mm that is focused on the ball 3 m away: 256 x 256
pixels, 16 samples each. Both sides are watertight (embreex asks for Embree's robust mode) and
give the triangle of each hit. Rays lie in memory before the clock starts; runs alternate.
"""

from __future__ import annotations

import argparse
import statistics
import time

import numpy as np
import trimesh
from common import interleave, save, show, versions

from isetcl.device.choose import find_device
from isetcl.device.mesh import DeviceMesh, build_tree_on, fast_builder
from isetcl.scene.bvh import collapse

RAYS = 1 << 20


def random_rays() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    origins = rng.normal(size=(RAYS, 3))
    origins *= 3.0 / np.linalg.norm(origins, axis=1, keepdims=True)
    targets = rng.normal(size=(RAYS, 3))
    targets *= (
        1.2
        * rng.uniform(size=(RAYS, 1)) ** (1 / 3)
        / np.linalg.norm(targets, axis=1, keepdims=True)
    )
    directions = targets - origins
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def grid_rays() -> tuple[np.ndarray, np.ndarray]:
    side = np.linspace(-1.2, 1.2, 1024)
    x, y = np.meshgrid(side, side)
    origins = np.stack([x.ravel(), y.ravel(), np.full(RAYS, 3.0)], axis=1)
    return origins, np.tile([0.0, 0.0, -1.0], (RAYS, 1))


def lens_rays() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(2)
    pixel = np.repeat(np.arange(256 * 256), RAYS // (256 * 256))
    jitter = rng.uniform(size=(2, RAYS))
    slope = 0.42 / 256
    x, y = ((p + j - 128) * slope for p, j in zip((pixel % 256, pixel // 256), jitter, strict=True))
    radius, turn = 0.002 * np.sqrt(rng.uniform(size=RAYS)), 2 * np.pi * rng.uniform(size=RAYS)
    origins = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.full(RAYS, 3.0)], axis=1)
    focus = np.stack([3.0 * x, 3.0 * y, np.zeros(RAYS)], axis=1)
    directions = focus - origins
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def leaks(mesh: DeviceMesh) -> int:
    """Rays from inside that find nothing."""
    rng = np.random.default_rng(1)
    origins = rng.uniform(-0.5, 0.5, size=(RAYS, 3))
    return int(np.sum(mesh.trace(origins, rng.normal(size=(RAYS, 3))).triangle < 0))


def build_seconds(triangles: np.ndarray, rounds: int = 5) -> float:
    """Median time of building and collapsing the tree."""
    builder = fast_builder()
    if builder is None:
        return float("nan")
    corners = triangles.astype(np.float32)
    lo, hi = corners.min(axis=1), corners.max(axis=1)
    seconds = []
    for _ in range(rounds):
        start = time.perf_counter()
        collapse(build_tree_on(builder, lo, hi))
        seconds.append(time.perf_counter() - start)
    return statistics.median(seconds)


def main() -> None:
    import pyopencl as cl

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=11)
    rounds = parser.parse_args().rounds
    triangles = np.asarray(trimesh.creation.icosphere(subdivisions=6).triangles)
    large = np.asarray(trimesh.creation.icosphere(subdivisions=8).triangles)
    device = find_device()
    mesh = DeviceMesh(device, triangles, "single")
    candidates = {}
    rays = {"random": random_rays(), "grid": grid_rays(), "lens": lens_rays()}
    for name, (origins, directions) in rays.items():
        n, *uploaded = mesh.upload(origins, directions, 0.0, np.inf)
        results = [
            cl.Buffer(device.context, cl.mem_flags.WRITE_ONLY, RAYS * size) for size in (4, 4, 8)
        ]
        arguments = (*uploaded, mesh.nodes, mesh.blocks, *results)
        candidates[f"isetcl, {name}"] = lambda n=n, a=arguments: mesh.enqueue(
            mesh._trace, n, a
        ).wait()
    differing = {}
    try:
        from embreex import rtcore_scene
        from embreex.mesh_construction import TriangleMesh

        scene = rtcore_scene.EmbreeScene()
        TriangleMesh(scene, triangles.astype(np.float32))
        for name, (origins, directions) in rays.items():
            o, d = origins.astype(np.float32), directions.astype(np.float32)
            candidates[f"embreex, {name}"] = lambda o=o, d=d: scene.run(o, d)
            ours, theirs = mesh.trace(origins, directions).triangle, scene.run(o, d)
            differing[name] = {
                "triangle": int(np.sum(ours != theirs)),
                "hit": int(np.sum((ours < 0) != (theirs < 0))),
            }
    except ImportError:
        pass
    timings = interleave(candidates, rounds)
    results = {name: timing.summary(RAYS) for name, timing in timings.items()}
    ratios = {
        name: statistics.median(timings[f"embreex, {name}"].cpu_s)
        / statistics.median(timings[f"isetcl, {name}"].cpu_s)
        for name in rays
        if f"embreex, {name}" in timings
    }
    builds = {str(len(t)): build_seconds(t) for t in (triangles, large)}
    leaked = leaks(mesh)
    show(
        "closest hits on 81,920 triangles",
        [("", "M rays/s (median)", "CPU ns/ray", "spread")]
        + [
            (n, r["million_per_s_median"], r["cpu_ns_each_median"], r["spread"])
            for n, r in results.items()
        ],
    )
    show("CPU time of embreex over ours", [("rays", "times"), *ratios.items()])
    show("seconds to build", [("triangles", "s"), *builds.items()])
    print(f"\nrays of a million that differ: {differing}; that leak: {leaked}")
    path = save(
        "mesh",
        {
            "command": "python benchmarks/mesh.py",
            "rays": RAYS,
            "versions": versions("embreex"),
            "results": results,
            "cpu_time_of_embreex_over_ours": ratios,
            "build_s": builds,
            "differing": differing,
            "leaks": leaked,
        },
    )
    print(f"{path.name} written")


if __name__ == "__main__":
    main()
