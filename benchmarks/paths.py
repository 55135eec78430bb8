"""Camera paths through an eye into a lit scene, per second; against Mitsuba's thin lens.

Two scenes under an even sky of 0.3 and a lamp of 0.6 m x 0.6 m and radiance 8: "planes" (a near
and a far board, one scattering) and "mesh" (a ball of 81,920 triangles on a floor before a wall, up
to four scatterings). isetcl traces Navarro's eye, Mitsuba 3 (llvm_ad_spectral) a thin lens of the
same aperture; a path of either carries four wavelengths, asks one light at every surface and may
end by chance after its third scattering. 256 x 256 pixels; both see the same reflectances.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import subprocess
import sys

import numpy as np
import trimesh
from common import interleave, load_mitsuba, save, show, versions

import isetcl as ic
from isetcl.render import sobol
from isetcl.render.paths import PathPipeline

PIXELS, FOV_DEG, BANDS, SPP = 256, 9.8, 8, 16
STREAM = sobol.stream(0, 0)
LAMP_CORNER, LAMP_SIDE = (-0.3, 1.5, -0.5), 0.6
BOUNCES = {"planes": 1, "mesh": 4}


def ball() -> trimesh.Trimesh:
    mesh = trimesh.creation.icosphere(subdivisions=6, radius=0.06)
    mesh.apply_translation([0.0, 0.0, -1.0])
    return mesh


def scene(name: str) -> ic.Scene:
    def matt(reflectance: float, board: bool = False) -> ic.Diffuse:
        texture = ic.Checkerboard(20, 20, 1.0, 0.25) if board else None
        return ic.Diffuse(ic.Spectrum.constant(reflectance), texture)

    if name == "planes":
        objects = (
            ic.SceneObject(
                "near", ic.Quad((-0.1, -0.06, -0.5), (0.1, 0, 0), (0, 0.12, 0)), matt(0.8, True)
            ),
            ic.SceneObject(
                "far", ic.Quad((-0.4, -0.4, -2.0), (0.8, 0, 0), (0, 0.8, 0)), matt(0.8, True)
            ),
        )
    else:
        mesh = ball()
        objects = (
            ic.SceneObject("ball", ic.Mesh(mesh.vertices, mesh.faces), matt(0.6)),
            ic.SceneObject(
                "floor", ic.Quad((-1, -0.06, -2), (2, 0, 0), (0, 0, 2)), matt(0.8, True)
            ),
            ic.SceneObject("wall", ic.Quad((-1, -1, -2), (2, 0, 0), (0, 2, 0)), matt(0.5)),
        )
    lamp = ic.Quad(LAMP_CORNER, (LAMP_SIDE, 0, 0), (0, 0, LAMP_SIDE))
    light = ic.SceneObject("lamp", lamp, ic.Emission(ic.Spectrum.constant(8.0)))
    return ic.Scene((*objects, light), ic.Spectrum.constant(0.3))


def pipeline(name: str) -> PathPipeline:
    prepared = ic.plan(
        scene(name),
        ic.eyes.navarro(4.0, 1.0),
        fov_deg=FOV_DEG,
        resolution=PIXELS,
        bands=BANDS,
        max_bounces=BOUNCES[name],
    )
    return PathPipeline(prepared)


def mitsuba_scene(name: str):
    """The same scene in Mitsuba 3; None where it is not installed."""
    mi = load_mitsuba()
    if mi is None:
        return None
    transform = mi.ScalarTransform4f

    def uniform(value):
        return {"type": "uniform", "value": value}

    def matt(value, board=False):
        reflectance = uniform(value)
        if board:
            reflectance = {
                "type": "checkerboard",
                "color0": uniform(0.25 * value),
                "color1": uniform(value),
                "to_uv": transform().scale([20, 20, 1]),
            }
        return {"type": "twosided", "material": {"type": "diffuse", "reflectance": reflectance}}

    def rectangle(to_world, **parts):
        return {"type": "rectangle", "to_world": to_world, **parts}

    lamp_z = LAMP_CORNER[2] + LAMP_SIDE / 2
    lamp = transform().translate([0, LAMP_CORNER[1], lamp_z]).rotate([1, 0, 0], 90)
    parts = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": BOUNCES[name] + 1, "rr_depth": 3},
        "sensor": {
            "type": "thinlens",
            "fov": FOV_DEG,
            "aperture_radius": 0.00226,
            "focus_distance": 1.0,
            "to_world": transform().look_at([0, 0, 0], [0, 0, -1], [0, 1, 0]),
            "film": {
                "type": "hdrfilm",
                "width": PIXELS,
                "height": PIXELS,
                "rfilter": {"type": "box"},
            },
        },
        "sky": {"type": "constant", "radiance": uniform(0.3)},
        "lamp": rectangle(
            lamp.scale([LAMP_SIDE / 2, LAMP_SIDE / 2, 1]),
            emitter={"type": "area", "radiance": uniform(8.0)},
        ),
    }
    if name == "planes":
        near = transform().translate([-0.05, 0, -0.5]).scale([0.05, 0.06, 1])
        far = transform().translate([0, 0, -2.0]).scale([0.4, 0.4, 1])
        parts |= {
            "near": rectangle(near, m=matt(0.8, True)),
            "far": rectangle(far, m=matt(0.8, True)),
        }
    else:
        mesh = ball()
        shape = mi.Mesh("ball", len(mesh.vertices), len(mesh.faces), props=_props(mi, matt(0.6)))
        values = mi.traverse(shape)
        values["vertex_positions"] = np.ravel(mesh.vertices).astype(np.float32)
        values["faces"] = np.ravel(mesh.faces).astype(np.uint32)
        values.update()
        floor = transform().translate([0, -0.06, -1]).rotate([1, 0, 0], -90)
        wall = transform().translate([0, 0, -2])
        parts |= {
            "ball": shape,
            "floor": rectangle(floor, m=matt(0.8, True)),
            "wall": rectangle(wall, m=matt(0.5)),
        }
    return mi, mi.load_dict(parts)


def _props(mi, bsdf):
    props = mi.Properties()
    props["mesh_bsdf"] = mi.load_dict(bsdf)
    return props


def peak_mb(name: str) -> float:
    """Peak memory of a process that traces a scene and nothing else, MB."""
    command = [sys.executable, __file__, "--peak", name]
    return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--peak", choices=list(BOUNCES), help="only trace once; print peak MB")
    arguments = parser.parse_args()
    rounds = arguments.rounds
    if arguments.peak:
        made = pipeline(arguments.peak)
        for tile in made.tiles():
            made.sample(tile, SPP, STREAM)
        print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
        return
    peaks = {name: peak_mb(name) for name in BOUNCES}
    candidates, work, means = {}, {}, {}
    for name in BOUNCES:
        made = pipeline(name)
        bands = len(made._plan.band_choice.bands)

        def run(made=made):
            return [made.sample(tile, SPP, STREAM) for tile in made.tiles()]

        candidates[f"isetcl, Navarro's eye, {name}"] = run
        work[f"isetcl, Navarro's eye, {name}"] = PIXELS * PIXELS * SPP * bands
    for name in BOUNCES:
        found = mitsuba_scene(name)
        if found is None:
            continue
        mi, loaded = found
        numbers = iter(range(1_000_000))
        key = f"Mitsuba thin lens, {name}"
        candidates[key] = lambda mi=mi, s=loaded, n=numbers: np.array(
            mi.render(s, spp=128, seed=next(n))
        )
        work[key] = PIXELS * PIXELS * 128
        means[name] = float(np.array(mi.render(loaded, spp=64, seed=9))[..., 1].mean())
    timings = interleave(candidates, rounds)
    results = {name: timing.summary(work[name]) for name, timing in timings.items()}
    ratios = {}
    for name in BOUNCES:
        ours, theirs = f"isetcl, Navarro's eye, {name}", f"Mitsuba thin lens, {name}"
        if theirs in timings:
            ratios[name] = (statistics.median(timings[theirs].cpu_s) / work[theirs]) / (
                statistics.median(timings[ours].cpu_s) / work[ours]
            )
    show(
        "camera paths",
        [("", "M paths/s (median)", "CPU ns/path", "spread")]
        + [
            (n, r["million_per_s_median"], r["cpu_ns_each_median"], r["spread"])
            for n, r in results.items()
        ],
    )
    show("CPU time of Mitsuba's path over ours", [("scene", "times"), *ratios.items()])
    show("peak memory of isetcl's process, MB", [("scene", "MB"), *peaks.items()])
    path = save(
        "paths",
        {
            "command": "python benchmarks/paths.py",
            "versions": versions("mitsuba", "drjit"),
            "results": results,
            "cpu_time_of_mitsuba_over_ours": ratios,
            "peak_mb": peaks,
        },
    )
    print(f"{path.name} written")


if __name__ == "__main__":
    main()
