"""What a feature costs: left out, compiled in but not used, and used.

Kernel time of one replicate (256 x 256 pixels, 32 samples, 8 bands), all variants interleaved.
"left out" is the kernel the plan makes for the plain scene (two uniform planes, Le Grand's
spherical eye); "unused" compiles one more feature in; "used" changes scene or eye so that it is
needed.
"""

from __future__ import annotations

import argparse
import dataclasses
import statistics

import numpy as np
from common import interleave, save, show

import isetcl as ic
from isetcl.device.eye_features import EyeFeatures
from isetcl.render import sobol
from isetcl.render.direct import DirectPipeline
from isetcl.render.plan import Plan, plan

PIXELS, SPP, BANDS = 256, 32, 8
PATHS = PIXELS * PIXELS * SPP * BANDS
WHITE = ic.Spectrum.equal_energy(100.0)


def make(scene: ic.Scene, eye: ic.Eye, **options) -> Plan:
    options = {"fov_deg": 6.0, "resolution": PIXELS, "bands": BANDS} | options
    return plan(scene, eye, **options)


def with_object(shape, material) -> ic.Scene:
    plain = ic.scenes.two_planes(texture="uniform")
    return ic.Scene((ic.SceneObject("more", shape, material), *plain.objects), None)


def used_variants() -> dict[str, Plan]:
    """Plans that need one feature each."""
    eye = ic.eyes.legrand(4.0)
    plain = ic.scenes.two_planes(texture="uniform")
    y, x = np.mgrid[0:128, 0:128] / 128.0
    grey = ic.Image(0.5 + 0.4 * np.sin(20 * x) * np.sin(15 * y))
    colours = ic.Image(np.stack([grey.texels, grey.texels.T, 1 - grey.texels], axis=-1))
    board = ic.Checkerboard(4, 4, 1.0, 0.2)
    ball = ic.Sphere((-0.01, 0.0, -0.4), 0.008)
    corner, right, up = (-0.02, -0.01, -0.45), (0.02, 0, 0), (0, 0.02, 0)
    aspheric = dataclasses.replace(eye, retina=ic.Retina.from_radius(24.19655, -13.4, 0.1))
    conic = dataclasses.replace(
        eye, surfaces=(dataclasses.replace(eye.surfaces[0], conic=-0.2), *eye.surfaces[1:])
    )
    return {
        "has_conics": make(plain, conic),
        "has_aspheric_retina": make(plain, aspheric),
        "has_discs": make(with_object(ic.Disc((0, 0, -0.4), 0.01), ic.Emission(WHITE)), eye),
        "has_spheres": make(with_object(ball, ic.Emission(WHITE)), eye),
        "has_textured_spheres": make(with_object(ball, ic.Emission(WHITE, board)), eye),
        "has_checkerboards": make(ic.scenes.two_planes(), eye),
        "has_images": make(with_object(ic.Quad(corner, right, up), ic.Emission(WHITE, grey)), eye),
        "three spectra": make(
            with_object(ic.Quad(corner, right, up), ic.scenes.picture(colours)), eye
        ),
        "double precision": make(plain, eye, precision="double"),
    }


OF_OTHER_EYES = {f.name for f in dataclasses.fields(EyeFeatures)} - {"has_conics"} | {
    "has_asymmetry",
    "has_relief",
    "has_scatter",
}
"""Features that cannot stand unused in another eye: the records they read would be empty. What they
cost is measured by `surfaces.py` and `gradients.py`."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=9)
    rounds = parser.parse_args().rounds
    base = make(ic.scenes.two_planes(texture="uniform"), ic.eyes.legrand(4.0))
    plans = {"left out": base}
    switches = [
        f.name
        for f in dataclasses.fields(base.config)
        if f.name.startswith("has_")
        and f.name not in OF_OTHER_EYES
        and not getattr(base.config, f.name)
    ]
    for switch in switches:
        needs = {"has_textured_spheres": {"has_spheres": True}}.get(switch, {})
        config = dataclasses.replace(base.config, **{switch: True}, **needs)
        plans[f"unused {switch}"] = dataclasses.replace(base, config=config)
    for name, needed in used_variants().items():
        plans[f"used {name}"] = needed
    stream = sobol.stream(0, 0)
    pipelines = {name: DirectPipeline(p) for name, p in plans.items()}

    def launch(pipeline: DirectPipeline) -> None:
        for tile in pipeline.tiles():
            pipeline._launch(tile, 0, SPP, SPP, stream)

    timings = interleave({n: lambda p=p: launch(p) for n, p in pipelines.items()}, rounds)
    least = {name: statistics.median(t.cpu_s) / PATHS * 1e9 for name, t in timings.items()}
    reference = least["left out"]
    rows = [("feature", "left out", "in, unused", "used")]
    table = {}
    for name in [*switches, "three spectra", "double precision"]:
        unused, used = least.get(f"unused {name}"), least.get(f"used {name}")
        table[name] = {"left_out_ns": reference, "unused_ns": unused, "used_ns": used}
        rows.append((name, reference, unused or "", used or ""))
    show("CPU ns a path (median)", rows)
    path = save(
        "features",
        {"command": "python benchmarks/features.py", "cpu_ns_a_path": table, "rounds": rounds},
    )
    print(f"\n{path.name} written")


if __name__ == "__main__":
    main()
