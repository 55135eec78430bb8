"""What a gradient-index lens costs, and what more steps through it buy.

CPU time a ray through eyes with and without such a lens, in `trace_rays` with several numbers of
rays and in the direct pipeline (one uniform plane), interleaved; and, for Liou & Brennan's eye and
shells of steep powers, the time and the largest error on the retina against the number of steps a
half.
"""

from __future__ import annotations

import argparse
from unittest import mock

import numpy as np
from common import Timing, interleave, save

import isetcl as ic
from isetcl.device.choose import find_device
from isetcl.device.eye_features import EyeFeatures
from isetcl.device.tracer import RayTracer, Trace
from isetcl.eye.gradient import ShellMedium
from isetcl.eye.media import ConstantIndex, Medium
from isetcl.eye.prescription import elements
from isetcl.eye.sequential import trace
from isetcl.eye.surface import Surface
from isetcl.render import sobol
from isetcl.render.direct import DirectPipeline
from isetcl.render.plan import plan

NM = 555.0
RAYS = 1 << 17
COUNTS = (1 << 17, 1 << 19, 1 << 20)
PIXELS, SPP, BANDS = 128, 16, 4
STEPS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)


def shell_eye(power: float) -> ic.Eye:
    """Liou & Brennan's cornea and retina with n = 1.415 - 0.045 (zeta^2)^power in the lens."""
    front, rear, radial = 1.7, 2.3, 4.6
    shells = ShellMedium(
        "lens", ConstantIndex(1.415), ConstantIndex(1.370), front, front, radial, power
    )
    halves = shells.halves(rear, ("lens front half", "lens rear half"))
    vitreous = Medium("vitreous", ConstantIndex(1.336))
    z, make = 3.66, Surface.from_radius
    size = {"semi_diameter_mm": 3.6}
    lens = (
        make("lens front", z, radial**2 / front, conic=(radial / front) ** 2 - 1.0,
             medium_after=halves[0], **size),
        make("lens equator", z + front, np.inf, medium_after=halves[1], **size),
        make("lens back", z + front + rear, -(radial**2) / rear, conic=(radial / rear) ** 2 - 1.0,
             medium_after=vitreous, **size),
    )  # fmt: skip
    start = ic.eyes.liou_brennan(4.0)
    return ic.Eye("shells", (*start.surfaces[:2], *lens), start.stop, start.retina)


def eyes() -> dict[str, ic.Eye]:
    return {
        "navarro": ic.eyes.navarro(4.0),
        "liou_brennan": ic.eyes.liou_brennan(4.0),
        "atchison": ic.eyes.atchison(4.0, is_retina_round=True),
        "shells, power 2": shell_eye(2.0),
        "shells, power 3.3": shell_eye(3.3),
        "shells, power 7": shell_eye(7.0),
    }


def rays(count: int, radius_mm: float = 1.6) -> tuple[np.ndarray, np.ndarray]:
    i = np.arange(count)
    r, turn = radius_mm * np.sqrt((i + 0.5) / count), i * 2.399963
    origins = np.stack([r * np.cos(turn), r * np.sin(turn), np.full(count, -1.0)], axis=1)
    direction = np.array([0.0, np.sin(0.1), np.cos(0.1)])
    return origins, np.broadcast_to(direction, origins.shape)


def prepare(eye: ic.Eye, precision: str, count: int, steps: int | None = None) -> Trace:
    """A launch; `steps` overrules what the plan takes."""
    sequence = elements(eye, NM)
    tracer = RayTracer(
        find_device(), precision, record_directions=False, features=EyeFeatures.of([sequence])
    )
    uploaded = tracer.upload(*rays(count))
    if steps is None:
        return tracer.prepare(uploaded, sequence, "retina")
    with mock.patch("isetcl.device.elements.kernel_steps", return_value=steps):
        return tracer.prepare(uploaded, sequence, "retina")


def rates(timings: dict[str, Timing], work: float) -> dict[str, dict[str, float]]:
    """CPU nanoseconds a ray, and the ratio to the Navarro eye's: medians and least times."""
    base = timings["navarro"]
    found = {}
    for name, timing in timings.items():
        median, least = np.median(timing.cpu_s), min(timing.cpu_s)
        found[name] = {
            "ns_median": float(median / work * 1e9),
            "ns_least": float(least / work * 1e9),
            "times_navarro_median": float(median / np.median(base.cpu_s)),
            "times_navarro_least": float(least / min(base.cpu_s)),
        }
        print(f"  {name:20s} " + "  ".join(f"{k} {v:.3g}" for k, v in found[name].items()))
    return found


def time_traces(precision: str, rounds: int) -> dict[str, dict[str, float]]:
    traces = {name: prepare(eye, precision, RAYS) for name, eye in eyes().items()}
    print(f"trace_rays, {precision}")
    runs = {name: lambda t=t: t.run().wait() for name, t in traces.items()}
    return rates(interleave(runs, rounds), RAYS)


def time_counts(rounds: int) -> dict[str, dict[str, dict[str, float]]]:
    """Liou & Brennan's eye beside Navarro's with more and more rays, in single precision."""
    found = {}
    for count in COUNTS:
        pair = {
            name: prepare(eyes()[name], "single", count) for name in ("navarro", "liou_brennan")
        }
        print(f"trace_rays, single, {count} rays")
        runs = {name: lambda t=t: t.run().wait() for name, t in pair.items()}
        found[str(count)] = rates(interleave(runs, rounds), count)
    return found


def time_pipelines(precision: str, rounds: int) -> dict[str, dict[str, float]]:
    scene = ic.scenes.uniform(100.0)
    options = {"fov_deg": 4.0, "resolution": PIXELS, "bands": BANDS, "precision": precision}
    runs = {}
    for name, eye in eyes().items():
        pipeline = DirectPipeline(plan(scene, eye, **options))
        (tile,) = pipeline.tiles()
        stream = sobol.stream(0, 0)
        runs[name] = lambda p=pipeline, t=tile, s=stream: p.sample(t, SPP, s)
    print(f"direct pipeline, {precision}")
    return rates(interleave(runs, rounds), PIXELS * PIXELS * SPP * BANDS)


def work_and_precision(precision: str, rounds: int) -> dict[str, list[dict[str, float]]]:
    """Time a ray and the largest error on the retina against steps a half."""
    found = {}
    cases = {k: e for k, e in eyes().items() if k not in ("navarro", "atchison")}
    for name, eye in cases.items():
        exact = trace(eye, *rays(512), NM)
        runs, rows = {}, []
        for steps in STEPS:
            got = prepare(eye, precision, 512, steps)
            got.run()
            bundle = got.fetch()
            both = exact.passed & bundle.passed
            off = np.linalg.norm(bundle.positions_mm - exact.positions_mm, axis=1)[both]
            rows.append({"steps": steps, "error_um": float(off.max() * 1e3)})
            many = prepare(eye, precision, RAYS // 4, steps)
            runs[str(steps)] = lambda t=many: t.run().wait()
        for row, timing in zip(rows, interleave(runs, rounds).values(), strict=True):
            row["ns_least"] = min(timing.cpu_s) / (RAYS // 4) * 1e9
        found[name] = rows
        print(f"{name}, {precision}: steps, um, ns")
        for row in rows:
            print(f"  {row['steps']:3d} {row['error_um']:9.2e} {row['ns_least']:8.1f}")
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=31)
    rounds = parser.parse_args().rounds
    record = {
        "command": "python benchmarks/gradients.py",
        "rounds": rounds,
        "trace_rays": {p: time_traces(p, rounds) for p in ("single", "double")},
        "counts": time_counts(rounds),
        "direct": {"single": time_pipelines("single", max(5, rounds // 3))},
        "steps": {p: work_and_precision(p, max(5, rounds // 5)) for p in ("single", "double")},
    }
    print(save("gradients", record))


if __name__ == "__main__":
    main()
