"""What a feature costs in a lit scene: left out, compiled in but not used, and used.

The scene "planes" of paths.py, 128 x 128 pixels, 16 samples, 8 bands; all variants interleaved.
"left out" is the kernel that the plan makes for it; "unused" compiles one more feature in; "used"
changes the scene so that it is needed. Then a forest: 400 instances of a tree, against the same
triangles in place.
"""

from __future__ import annotations

import argparse
import dataclasses
import statistics
import time

import numpy as np
import trimesh
from common import interleave, save, show
from paths import scene as lit_scene

import isetcl as ic
from isetcl.render import sobol
from isetcl.render.paths import PathPipeline
from isetcl.render.plan import Plan, plan

PIXELS, SPP, BANDS = 128, 16, 8
STREAM = sobol.stream(0, 0)
GREY = ic.Spectrum.constant(0.5)


def make(scene: ic.Scene, **options) -> Plan:
    options = {"fov_deg": 9.8, "resolution": PIXELS, "bands": BANDS, "max_bounces": 1} | options
    return plan(scene, ic.eyes.navarro(4.0, 1.0), **options)


def with_material(material, **parts) -> ic.Scene:
    """The scene with another far board."""
    base = lit_scene("planes")
    near, far, lamp = base.objects
    changed = dataclasses.replace(far, material=material, **parts)
    return dataclasses.replace(base, objects=(near, changed, lamp))


def with_shape(shape, texture=None) -> ic.Scene:
    """The scene with another near object."""
    base = lit_scene("planes")
    near = ic.SceneObject("near", shape, ic.Diffuse(GREY, texture))
    return dataclasses.replace(base, objects=(near, *base.objects[1:]))


def tree_mesh(*, smooth=False, uv=False) -> ic.Mesh:
    mesh = trimesh.creation.icosphere(subdivisions=5, radius=0.05)
    mesh.apply_translation([-0.05, 0.0, -0.5])
    normals = np.asarray(mesh.vertex_normals) if smooth else None
    coordinates = np.asarray(mesh.vertices)[:, :2] * 10 if uv else None
    return ic.Mesh(mesh.vertices, mesh.faces, normals, coordinates)


def used_variants() -> dict[str, Plan]:
    """Plans that need one feature each."""
    y, x = np.mgrid[0:128, 0:128] / 128.0
    picture = ic.Image(0.5 + 0.4 * np.sin(20 * x) * np.sin(15 * y))
    board = ic.Checkerboard(4, 4, 1.0, 0.2)
    metal = ic.ComplexIndex([300.0, 900.0], [0.5, 0.5], [3.0, 3.0], "a metal")
    glass = ic.Medium("glass", ic.ConstantIndex(1.5))
    ball = ic.Sphere((-0.05, 0.0, -0.5), 0.05)
    base = lit_scene("planes")
    spot = ic.SpotLight((0.0, 1.0, -0.5), (0.0, -1.0, -1.0), ic.Spectrum.constant(1.0))
    sky = ic.Environment(ic.Spectrum.constant(0.3), ic.Image(np.ones((64, 128))))
    additive = ic.SceneObject(
        "veil",
        ic.Quad((-0.1, -0.1, -0.4), (0.2, 0, 0), (0, 0.2, 0)),
        ic.Emission(ic.Spectrum.constant(0.1), is_additive=True),
    )
    field = ic.LightField(np.ones((32, 32, 5, 5)), (30.0, 30.0))
    panel = ic.SceneObject(
        "panel",
        ic.Quad((-0.1, -0.06, -0.5), (0.1, 0, 0), (0, 0.12, 0)),
        ic.Emission(ic.Spectrum.constant(1.0), field),
    )
    return {
        "has_balls": make(with_shape(ball)),
        "has_textured_balls": make(with_shape(ball, board)),
        "has_triangles": make(with_shape(tree_mesh())),
        "has_instances": make(with_shape(ic.Instance(tree_mesh(), np.eye(4)))),
        "has_normals": make(with_shape(tree_mesh(smooth=True))),
        "has_uv": make(with_shape(tree_mesh(uv=True), board)),
        "has_pictures": make(with_material(ic.Diffuse(GREY, picture))),
        "has_grids": make(with_material(ic.Diffuse(GREY, ic.Grid(20, 20)))),
        "has_light_fields": make(dataclasses.replace(base, objects=(panel, *base.objects[1:]))),
        "has_translucent": make(with_material(ic.Diffuse(GREY, None, GREY))),
        "has_mirrors": make(with_material(ic.Mirror(GREY, 0.2))),
        "has_conductors": make(with_material(ic.Conductor(metal, 0.2))),
        "has_dielectrics": make(with_material(ic.Dielectric(glass, 0.2))),
        "has_coated": make(with_material(ic.Coated(GREY, roughness=0.2))),
        "combined_depth": make(with_material(ic.TwoSided(ic.Diffuse(GREY), ic.Diffuse(GREY)))),
        "has_spots": make(dataclasses.replace(base, lights=(spot,))),
        "has_environment": make(dataclasses.replace(base, background=sky)),
        "has_cutouts": make(with_material(ic.Diffuse(GREY), opacity=board)),
        "has_additive": make(dataclasses.replace(base, objects=(additive, *base.objects))),
        "double precision": make(base, precision="double"),
        "4 bounces": make(base, max_bounces=4),
    }


NEEDS = {
    "has_textured_balls": {"has_balls": True},
    "has_normals": {"has_triangles": True},
    "has_uv": {"has_triangles": True},
    "has_conductors": {"has_mirrors": True},
}


def forest(places: int = 400) -> dict[str, ic.Scene]:
    """Trees on a floor, as instances and as triangles in place."""
    tree = trimesh.creation.icosphere(subdivisions=5, radius=0.05)
    mesh = ic.Mesh(tree.vertices, tree.faces)
    rng = np.random.default_rng(0)
    material = ic.Diffuse(GREY)
    floor = ic.SceneObject("floor", ic.Quad((-3, -0.2, -6), (6, 0, 0), (0, 0, 6)), material)
    instances, placed = [floor], [floor]
    for i in range(places):
        matrix = np.eye(4)
        matrix[:3, 3] = rng.uniform([-0.6, -0.15, -6.0], [0.6, 0.3, -1.0])
        one = ic.Instance(mesh, matrix)
        instances.append(ic.SceneObject(f"tree {i}", one, material))
        placed.append(ic.SceneObject(f"tree {i}", one.in_place, material))
    sky = ic.Spectrum.constant(0.3)
    return {
        "instances": ic.Scene(tuple(instances), sky),
        "triangles in place": ic.Scene(tuple(placed), sky),
    }


def run(pipeline: PathPipeline) -> None:
    for tile in pipeline.tiles():
        pipeline.sample(tile, SPP, STREAM)


def measure_forest(rounds: int) -> dict[str, dict[str, float]]:
    made, table = {}, {}
    for name, scene in forest().items():
        prepared = make(scene, max_bounces=4)
        start = time.perf_counter()
        made[name] = PathPipeline(prepared)
        scene_on_device = made[name].scene
        table[name] = {
            "prepare_s": time.perf_counter() - start,
            "hierarchy_mb": (scene_on_device._nodes.size + scene_on_device._blocks.size) / 1e6,
        }
    timings = interleave({n: lambda p=p: run(p) for n, p in made.items()}, rounds)
    for name, timing in timings.items():
        bands = len(made[name]._plan.band_choice.bands)
        table[name]["ns_a_path"] = statistics.median(timing.cpu_s) / (
            PIXELS * PIXELS * SPP * bands * 1e-9
        )
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=7)
    rounds = parser.parse_args().rounds
    base = make(lit_scene("planes"))
    plans = {"left out": base}
    used = used_variants()
    switches = [name for name in used if hasattr(base.config, name)]
    for switch in switches:
        value = 1 if switch == "combined_depth" else True
        config = dataclasses.replace(base.config, **{switch: value}, **NEEDS.get(switch, {}))
        plans[f"unused {switch}"] = dataclasses.replace(base, config=config)
    plans |= {f"used {name}": needed for name, needed in used.items()}
    pipelines = {name: PathPipeline(p) for name, p in plans.items()}
    timings = interleave({n: lambda p=p: run(p) for n, p in pipelines.items()}, rounds)
    cost = {
        name: statistics.median(t.cpu_s)
        / (PIXELS * PIXELS * SPP * len(plans[name].band_choice.bands))
        * 1e9
        for name, t in timings.items()
    }
    table = {
        name: {
            "left_out_ns": cost["left out"],
            "unused_ns": cost.get(f"unused {name}"),
            "used_ns": cost[f"used {name}"],
        }
        for name in used
    }
    trees = measure_forest(rounds)
    rows = [("feature", "left out", "in, unused", "used")]
    rows += [(n, c["left_out_ns"], c["unused_ns"] or "", c["used_ns"]) for n, c in table.items()]
    show("CPU ns a path (median)", rows)
    head = ("", *next(iter(trees.values())))
    show("forest", [head, *((n, *t.values()) for n, t in trees.items())])
    path = save(
        "path_features",
        {
            "command": "python benchmarks/path_features.py",
            "cpu_ns_a_path": table,
            "forest": trees,
            "rounds": rounds,
        },
    )
    print(f"\n{path.name} written")


if __name__ == "__main__":
    main()
