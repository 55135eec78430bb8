"""Paths through the fused kernel per second: retina, eye, scene, film; against Mitsuba's thin lens.

The scene of the paper's Figure 12 at 10 degrees, 256 x 256 pixels, 64 samples, 8 bands: 33.6
million paths a run. A path is one sample of one band of one pixel; all that pass the stop are
useful. Mitsuba's scene is emission only too, through a thin lens of the same aperture; its path
carries four wavelengths and no eye.
"""

from __future__ import annotations

import argparse
import dataclasses
import statistics

import numpy as np
from common import Timing, interleave, load_mitsuba, save, show, versions

import isetcl as ic
from isetcl.render import sobol
from isetcl.render.direct import DirectPipeline
from isetcl.render.plan import plan

PIXELS, SPP, BANDS = 256, 64, 8
PATHS = PIXELS * PIXELS * SPP * BANDS
STREAM = sobol.stream(0, 0)


def scenes() -> dict[str, ic.Scene]:
    rng = np.random.default_rng(0)
    y, x = np.mgrid[0:256, 0:256] / 256.0
    waves = [
        0.5 + 0.5 * np.sin(2 * np.pi * (rng.uniform(2, 20) * x + rng.uniform(2, 20) * y))
        for _ in range(3)
    ]
    picture = ic.Image(np.stack(waves, axis=-1))
    return {
        "checkerboards": ic.scenes.two_planes(),
        "pictures": ic.scenes.image_planes(picture, picture, 0.5, 2.0, 10.0),
        "grey pictures": ic.scenes.image_planes(
            ic.Image(waves[0]), ic.Image(waves[1]), 0.5, 2.0, 10.0
        ),
    }


def pipeline(scene: ic.Scene, precision: str, width: int | None) -> tuple[DirectPipeline, float]:
    """A pipeline, and the fraction of its paths that pass the stop."""
    eye = ic.eyes.navarro(4.0, 2.0)
    prepared = plan(scene, eye, fov_deg=10.0, resolution=PIXELS, bands=BANDS, precision=precision)
    if width is not None:
        config = dataclasses.replace(prepared.config, vector_width=width)
        prepared = dataclasses.replace(prepared, config=config)
    return DirectPipeline(prepared), min(p.fill for p in prepared.pupils)


def launch(made: DirectPipeline, samples: int) -> None:
    """One replicate of the whole image."""
    for tile in made.tiles():
        made._launch(tile, 0, samples, samples, STREAM)


def mitsuba_candidate(samples: int):
    """Two emitting planes with checkerboards behind a thin lens in Mitsuba 3, spectral."""
    mi = load_mitsuba()
    if mi is None:
        return None

    def board(scale):
        return {
            "type": "area",
            "radiance": {
                "type": "checkerboard",
                "to_uv": mi.ScalarTransform4f().scale([scale, scale, 1]),
            },
        }

    def plane(z, half, shift, scale):
        to_world = mi.ScalarTransform4f().translate([shift, 0, -z]).scale([half, half, 1])
        return {"type": "rectangle", "to_world": to_world, "emitter": board(scale)}

    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 1},
            "sensor": {
                "type": "thinlens",
                "fov": 10.0,
                "aperture_radius": 0.00226,
                "focus_distance": 0.5,
                "to_world": mi.ScalarTransform4f().look_at([0, 0, 0], [0, 0, -1], [0, 1, 0]),
                "film": {
                    "type": "hdrfilm",
                    "width": PIXELS,
                    "height": PIXELS,
                    "rfilter": {"type": "box"},
                },
            },
            "near": plane(0.5, 0.2, -0.2, 20),
            "far": plane(2.0, 0.8, 0.0, 80),
        }
    )
    number = iter(range(1_000_000))

    def run():
        np.array(mi.render(scene, spp=samples, seed=next(number)))

    return run


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=11)
    rounds = parser.parse_args().rounds
    candidates, fills = {}, {}
    for name, scene in scenes().items():
        for precision in ("single", "double"):
            made, fills[f"{name}, {precision}"] = pipeline(scene, precision, None)
            candidates[f"{name}, {precision}"] = lambda p=made: launch(p, SPP)
    work = {name: PATHS * fills[name] for name in candidates}
    mitsuba = mitsuba_candidate(256)
    if mitsuba is not None:
        name = "Mitsuba thin lens, spectral, single"
        candidates[name] = mitsuba
        work[name] = PIXELS * PIXELS * 256
    timings: dict[str, Timing] = interleave(candidates, rounds)
    results = {name: t.summary(work[name]) for name, t in timings.items()}
    ratios = {}
    if mitsuba is not None:
        theirs = statistics.median(timings["Mitsuba thin lens, spectral, single"].cpu_s)
        theirs /= work["Mitsuba thin lens, spectral, single"]
        for name in candidates:
            if not name.startswith("Mitsuba"):
                ratios[name] = theirs / (statistics.median(timings[name].cpu_s) / work[name])
    widths = {}
    for precision, tried in (("single", (1, 8, 16, 32, 64)), ("double", (1, 8, 16, 32, 64))):
        made = {
            f"{precision}, {w} lanes": pipeline(scenes()["checkerboards"], precision, w)[0]
            for w in tried
        }
        short = {name: lambda p=p: launch(p, 16) for name, p in made.items()}
        for name, timing in interleave(short, 5).items():
            widths[name] = timing.summary(PATHS / 4)
    rows = [("", "M paths/s (median)", "CPU ns/path", "spread")]
    show(
        "useful paths",
        rows
        + [
            (n, r["million_per_s_median"], r["cpu_ns_each_median"], r["spread"])
            for n, r in results.items()
        ],
    )
    show("CPU time of Mitsuba's path over that of ours", [("", "times"), *ratios.items()])
    show(
        "vector widths, checkerboards",
        rows
        + [
            (n, r["million_per_s_median"], r["cpu_ns_each_median"], r["spread"])
            for n, r in widths.items()
        ],
    )
    path = save(
        "direct",
        {
            "command": "python benchmarks/direct.py",
            "paths_a_run": PATHS,
            "useful_fraction": fills,
            "versions": versions("mitsuba", "drjit"),
            "results": results,
            "cpu_time_of_mitsuba_over_ours": ratios,
            "vector_widths": widths,
        },
    )
    print(f"\n{path.name} written")


if __name__ == "__main__":
    main()
