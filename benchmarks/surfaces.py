"""What shapes of surfaces cost: rays through eyes that differ in one surface.

Rays that fill the stop of Navarro's eye go to the retina, and paths leave it through the direct
pipeline; the front of the cornea, or the lens, has another shape. Everything is interleaved. "own
kernel" knows what the eye needs, as `isetcl.trace_rays` and a plan arrange it; "everything" is one
kernel for all eyes.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import statistics
from collections.abc import Callable

import numpy as np
from common import interleave, save, show, versions

import isetcl as ic
from isetcl.device.choose import find_device
from isetcl.device.eye_features import EyeFeatures
from isetcl.device.tracer import RayTracer
from isetcl.eye.placement import Placement
from isetcl.eye.prescription import elements
from isetcl.eye.shapes.biconic import Biconic
from isetcl.eye.shapes.even_asphere import EvenAsphere
from isetcl.eye.shapes.height_map import HeightMap
from isetcl.eye.shapes.toric import Toric
from isetcl.eye.shapes.zernike_sag import ZernikeSag
from isetcl.render import sobol
from isetcl.render.direct import DirectPipeline
from isetcl.render.plan import plan

RAYS = 1 << 19
BEAM_RADIUS_MM = 2.2
PIXELS, SPP, BANDS = 128, 32, 4
PATHS = PIXELS * PIXELS * SPP * BANDS
FORMS = (
    *("has_placements", "has_placed_stop", "has_quadrics", "has_biconics", "has_torics"),
    *("has_even_aspheres", "has_zernike_sags", "has_height_maps"),
)
EVERYTHING = EyeFeatures(**dict.fromkeys(FORMS, True))


def with_cornea(shape, **parts) -> ic.Eye:
    eye = ic.eyes.navarro(4.0)
    front = dataclasses.replace(eye.surfaces[0], shape=shape, semi_diameter_mm=4.3, **parts)
    return dataclasses.replace(eye, surfaces=(front, *eye.surfaces[1:]), accommodation_model=None)


def eyes() -> dict[str, ic.Eye]:
    """Eyes by what they need; eyes with gradients join them where the package has some."""
    navarro = ic.eyes.navarro(4.0)
    curvature = navarro.surfaces[0].curvature
    zernikes = np.zeros(28)
    zernikes[[3, 5, 7, 8, 12, 24]] = 1e-3, 3e-3, -5e-3, 2e-3, 2e-3, 5e-4
    y, x = np.mgrid[4.5:-4.5:64j, -4.5:4.5:64j]
    cone = HeightMap(-0.03 * np.exp(-((x - 1.0) ** 2 + (y + 1.2) ** 2) / 2.0), 9.0, 9.0)
    place = Placement((0.1, 0.0), (0.0, 4.0))
    tilted = tuple(dataclasses.replace(s, placement=place) for s in navarro.surfaces[2:])
    matched = curvature * (1.0 + navarro.surfaces[0].conic) / (curvature * 1.03) - 1.0
    found = {
        "spheres": ic.eyes.legrand(4.0),
        "conics": navarro,
        "tilted lens": dataclasses.replace(
            navarro, surfaces=(*navarro.surfaces[:2], *tilted), accommodation_model=None
        ),
        "decentred elliptical stop": dataclasses.replace(
            navarro, stop=ic.Stop(3.6, 4.0, (0.2, 0.0), 3.6), accommodation_model=None
        ),
        "ellipsoid": with_cornea(Biconic(curvature * 1.03, matched)),
        "biconic": with_cornea(Biconic(curvature * 1.03, -0.2)),
        "toric": with_cornea(Toric(curvature * 1.03)),
        "even asphere": with_cornea(EvenAsphere((0.0, -1e-4, 1e-6))),
        "Zernike, order 6": with_cornea(ZernikeSag(zernikes, 4.3)),
        "height map": with_cornea(cone),
    }
    for name in ("liou_brennan", "atchison"):
        if hasattr(ic.eyes, name):
            found[f"gradient ({name})"] = getattr(ic.eyes, name)()
    return found


def beam() -> tuple[np.ndarray, np.ndarray]:
    i = np.arange(RAYS)
    r = BEAM_RADIUS_MM * np.sqrt((i + 0.5) / RAYS)
    turn = i * math.pi * (3 - math.sqrt(5))
    origins = np.stack([r * np.cos(turn), r * np.sin(turn), np.full(RAYS, -1.0)], axis=1)
    return origins, np.tile([0.0, 0.0, 1.0], (RAYS, 1))


def ray_runs(known: dict[str, ic.Eye]) -> dict[str, Callable[[], object]]:
    """Traces to the retina: positions and status, one direction."""
    device, (origins, directions) = find_device(), beam()
    runs = {}
    for precision in ("single", "double"):
        for name, eye in known.items():
            sequence = elements(eye, 550.0)
            own = EyeFeatures.of([sequence])
            kernels = {"own": own}
            if not name.startswith("gradient"):
                kernels["all"] = EVERYTHING
            for kernel, features in kernels.items():
                tracer = RayTracer(
                    device,
                    precision,
                    record_directions=False,
                    shared_direction=True,
                    features=features,
                )
                trace = tracer.prepare(tracer.upload(origins, directions), sequence, "retina")
                runs[f"{precision}|{kernel}|{name}"] = lambda t=trace: t.run().wait()
    return runs


def path_runs(known: dict[str, ic.Eye]) -> dict[str, Callable[[], object]]:
    """Launches of the direct pipeline."""
    runs = {}
    stream = sobol.stream(0, 0)
    for precision in ("single", "double"):
        for name, eye in known.items():
            prepared = plan(
                ic.scenes.two_planes(texture="uniform"),
                eye,
                fov_deg=6.0,
                resolution=PIXELS,
                bands=BANDS,
                precision=precision,
            )
            pipeline = DirectPipeline(prepared)
            runs[f"{precision}|paths|{name}"] = lambda p=pipeline: [
                p._launch(tile, 0, SPP, SPP, stream) for tile in p.tiles()
            ]
    return runs


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=9)
    rounds = parser.parse_args().rounds
    known = eyes()
    runs = ray_runs(known) | path_runs(known)
    timings = interleave(runs, rounds)
    table: dict[str, dict[str, float]] = {name: {} for name in known}
    for key, timing in timings.items():
        precision, kernel, name = key.split("|")
        work = PATHS if kernel == "paths" else RAYS
        table[name][f"{precision} {kernel}"] = statistics.median(timing.cpu_s) / work * 1e9
    columns = [f"{p} {k}" for p in ("single", "double") for k in ("own", "all", "paths")]
    rows = [(name, *(row.get(column, "") for column in columns)) for name, row in table.items()]
    show("CPU ns a ray or path (median)", [("", *columns), *rows])
    path = save(
        "surfaces",
        {
            "command": "python benchmarks/surfaces.py",
            "rays": RAYS,
            "paths": PATHS,
            "rounds": rounds,
            "versions": versions(),
            "cpu_ns": table,
        },
    )
    print(f"\n{path.name} written")


if __name__ == "__main__":
    main()
