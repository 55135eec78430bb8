"""Rays through an eye: isetcl.trace_rays against plain C and against batoid, in one run.

The beam of the comparison: 1e6 collimated rays at 550 nm that fill the 4 mm stop of Navarro's eye
(indices 1.376, 1.3374, 1.42, 1.336), traced to the retina. Rays and results lie on the device.
"""

from __future__ import annotations

import argparse
import math
import shutil
import statistics
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from common import Timing, interleave, save, show, versions

import isetcl as ic
from isetcl.device.choose import find_device
from isetcl.device.tracer import RayTracer
from isetcl.eye.prescription import elements

RAYS = 1_000_000
BEAM_RADIUS_MM = 2.2449628747094808
RMS_SPOT_MM = 0.0076965677733493855
BATOID_ROUNDS = 5
# 40-digit references (mpmath): height, y on the retina, mm.
DIGITS = (
    (0.001, 3.7839421307428795e-6),
    (0.5, 0.0016283600264415013),
    (1.0, 0.0016371094498218435),
    (1.5, -0.0017854517751460182),
    (2.0, -0.010848100463140873),
    (2.25, -0.018350801803235426),
)


def eye(stop_diameter_mm: float = 4.0) -> ic.Eye:
    index = {"cornea": 1.376, "aqueous": 1.3374, "lens": 1.42, "vitreous": 1.336}
    navarro = ic.eyes.navarro(4.0)
    surfaces = tuple(
        ic.Surface(
            s.name,
            s.vertex_z_mm,
            s.curvature,
            s.conic,
            s.semi_diameter_mm,
            ic.Medium(name, ic.ConstantIndex(n)),
        )
        for s, (name, n) in zip(navarro.surfaces, index.items(), strict=True)
    )
    return ic.Eye(
        "navarro, fixed indices", surfaces, ic.Stop(3.6, stop_diameter_mm), navarro.retina
    )


def beam() -> tuple[np.ndarray, np.ndarray]:
    i = np.arange(RAYS)
    r = BEAM_RADIUS_MM * np.sqrt((i + 0.5) / RAYS)
    turn = i * math.pi * (3 - math.sqrt(5))
    origins = np.stack([r * np.cos(turn), r * np.sin(turn), np.full(RAYS, -1.0)], axis=1)
    return origins, np.tile([0.0, 0.0, 1.0], (RAYS, 1))


def accuracy() -> dict[str, float]:
    heights = np.array([d[0] for d in DIGITS])
    origins = np.stack([0 * heights, heights, 0 * heights - 1], axis=1)
    errors = {}
    for precision in ("single", "double"):
        rays = ic.trace_rays(eye(4.02), origins, [0, 0, 1], 550.0, precision=precision)
        errors[precision] = float(np.max(np.abs(rays.positions_mm[:, 1] - [d[1] for d in DIGITS])))
    return errors


def isetcl_candidates() -> dict[str, object]:
    """isetcl with what plain C computes, and with everything a user gets."""
    device, sequence = find_device(), elements(eye(), 550.0)
    origins, directions = beam()
    candidates = {}
    for precision in ("single", "double"):
        for name, options in {
            "positions and status": {"record_directions": False, "shared_direction": True},
            "own directions in and out, status, path length": {"record_opl": True},
        }.items():
            tracer = RayTracer(device, precision, **options)
            trace = tracer.prepare(tracer.upload(origins, directions), sequence, "retina")
            candidates[f"isetcl {precision}, {name}"] = lambda t=trace: t.run().wait()
    return candidates


def batoid_candidate():
    try:
        import batoid
    except ImportError:
        return {}
    media = [batoid.ConstMedium(n) for n in (1.0, 1.376, 1.3374, 1.42, 1.336)]
    shapes = ((7.72, -0.26, 0.0), (6.5, 0.0, 0.55), (10.2, -3.1316, 3.6), (-6.0, -1.0, 7.6))
    items = []
    for i, (radius, conic, z) in enumerate(shapes):
        # batoid's Quadric divides by 1 + k; its Paraboloid is the k = -1 surface.
        surface = batoid.Paraboloid(radius) if conic == -1 else batoid.Quadric(radius, conic)
        system = batoid.CoordSys(origin=[0, 0, z])
        lens = batoid.RefractiveInterface(
            surface, coordSys=system, inMedium=media[i], outMedium=media[i + 1], name=str(i)
        )
        items.append(lens)
    items.append(
        batoid.Detector(
            batoid.Sphere(-12.0),
            coordSys=batoid.CoordSys(origin=[0, 0, 23.9203]),
            name="retina",
            inMedium=media[4],
            outMedium=media[4],
        )
    )
    optic = batoid.CompoundOptic(items, inMedium=media[0], outMedium=media[4])
    origins, directions = beam()
    template = batoid.RayVector(
        *origins.T,
        *directions.T,
        np.zeros(RAYS),
        np.full(RAYS, 550e-9),
        np.ones(RAYS),
        np.zeros(RAYS, bool),
    )

    # batoid traces in place; the copies are made before the clock starts.
    bundles = [template.copy() for _ in range(BATOID_ROUNDS + 1)]

    def run():
        traced = optic.trace(bundles.pop())
        rms = float(np.sqrt(np.mean(traced.x**2 + traced.y**2)))
        assert abs(rms - RMS_SPOT_MM) < 1e-7, rms

    return {"batoid double": run}


def plain_c() -> dict[str, Path]:
    """The C program, built for both precisions; empty without a compiler."""
    if shutil.which("gcc") is None:
        return {}
    folder = Path(tempfile.mkdtemp())
    source = Path(__file__).parent / "roofline.c"
    programs = {}
    for precision, real in (("single", "float"), ("double", "double")):
        program = folder / f"roofline_{precision}"
        flags = ["-O3", "-march=native", "-ffast-math", "-fopenmp", f"-DREAL={real}"]
        subprocess.run(["gcc", *flags, str(source), "-o", str(program), "-lm"], check=True)
        programs[precision] = program
    return programs


def run_c(program: Path, repetitions: int) -> Timing:
    output = subprocess.run(
        [str(program), str(RAYS), str(repetitions)], capture_output=True, text=True, check=True
    ).stdout
    timing = Timing()
    for line in output.splitlines()[1:-1]:
        wall, cpu = map(float, line.split())
        timing.wall_s.append(wall)
        timing.cpu_s.append(cpu)
    return timing


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=15)
    rounds = parser.parse_args().rounds
    candidates = isetcl_candidates()
    peers = batoid_candidate()
    programs = plain_c()
    totals: dict[str, Timing] = {}
    c_totals = {precision: Timing() for precision in programs}
    # Blocks of a few repetitions in turn: C is another process and cannot alternate call by call.
    for _ in range(rounds):
        for name, timing in interleave(candidates, 3).items():
            total = totals.setdefault(name, Timing())
            total.wall_s += timing.wall_s
            total.cpu_s += timing.cpu_s
        for precision, program in programs.items():
            timing = run_c(program, 3)
            c_totals[precision].wall_s += timing.wall_s
            c_totals[precision].cpu_s += timing.cpu_s
    for name, timing in interleave(peers, BATOID_ROUNDS).items():
        totals[name] = timing
    for precision, timing in c_totals.items():
        totals[f"plain C {precision}"] = timing
    results = {name: timing.summary(RAYS) for name, timing in totals.items()}
    ratios = {}
    for precision in ("single", "double"):
        for name, timing in totals.items():
            if name.startswith(f"isetcl {precision}") and f"plain C {precision}" in totals:
                c = totals[f"plain C {precision}"]
                ratios[f"{name} / plain C"] = statistics.median(c.cpu_s) / statistics.median(
                    timing.cpu_s
                )
        name = f"isetcl {precision}, own directions in and out, status, path length"
        if "batoid double" in totals:
            ratios[f"{name} / batoid"] = statistics.median(
                totals["batoid double"].cpu_s
            ) / statistics.median(totals[name].cpu_s)
    errors = accuracy()
    show(
        "collimated beam through Navarro's eye",
        [("", "M rays/s (median)", "CPU ns/ray", "spread")]
        + [
            (name, r["million_per_s_median"], r["cpu_ns_each_median"], r["spread"])
            for name, r in results.items()
        ],
    )
    show("ratios of CPU time", [("", "times faster"), *ratios.items()])
    show("largest error against 40 digits, mm", [("", "mm"), *errors.items()])
    path = save(
        "trace_rays",
        {
            "command": "python benchmarks/trace_rays.py",
            "rays": RAYS,
            "versions": versions("batoid"),
            "results": results,
            "cpu_time_ratios": ratios,
            "error_mm": errors,
        },
    )
    print(f"\n{path.name} written")


if __name__ == "__main__":
    main()
