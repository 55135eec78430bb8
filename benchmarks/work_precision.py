"""Error against run time on the paper's Figure 12: ray tracing in both precisions, and PSF methods.

`isetcl.validation.work_precision` does the measuring: an independent reference in float64 with
random samples, 16 replicates, methods in turn, kinds of error apart. Writes JSON, CSV and pictures
to benchmarks/results/. A machine whose times differ by more than 20 % is refused, unless
--allow-noise marks them. Kernels are built anew, so that the time to the first image has them.

With --quick it takes under a minute, and with --check as well it writes nothing but compares with
the JSON that --quick wrote: errors that have grown fail it, processor times that have grown by more
than a quarter of ray tracing's are warned of.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from common import RESULTS, save

import isetcl as ic
from isetcl.validation import SceneMethod, WorkPrecision, work_precision
from isetcl.validation.work_precision import NoisyTimingError

PSF_METHODS = ("layered_sum", "layered_over_visible", "layered_over", "pupil_clipped")
QUICK = "work_precision_quick"
LARGEST_SLOWDOWN = 0.25


def traced(label: str, spp: tuple[int, ...], bands: int, precision: str) -> SceneMethod:
    return SceneMethod(knobs=spp, options={"bands": bands, "precision": precision}, label=label)


def full(arguments: argparse.Namespace, on_step: Callable[[str, float], None]) -> WorkPrecision:
    few = arguments.bands
    methods = [
        traced("ray tracing f32", (4, 16, 64, 256), few, "single"),
        traced("ray tracing f64", (4, 16, 64, 256), few, "double"),
        traced("ray tracing f32, all bands", (16, 64, 256, 1024), 16, "single"),
        *(
            SceneMethod(name, knobs=(1, 2) if name == "pupil_clipped" else (1, 2, 4))
            for name in PSF_METHODS
        ),
    ]
    return work_precision(
        methods,
        scene=ic.scenes.two_planes(),
        eye=ic.eyes.navarro(4.0, 2.0),
        fov_deg=2.0,
        resolution=64,
        wavelengths_nm=np.arange(400.0, 701.0, 20.0),
        replicates=arguments.replicates,
        time=arguments.time,
        allow_noise=arguments.allow_noise,
        on_step=on_step,
    )


def quick(on_step: Callable[[str, float], None] | None = None) -> WorkPrecision:
    """The same in small: processor time, which other processes change less, and noise allowed."""
    return work_precision(
        [
            traced("ray tracing f32", (4, 64, 512), 3, "single"),
            traced("ray tracing f32, all bands", (4, 64, 512), 6, "single"),
            traced("ray tracing f64", (4, 64), 3, "double"),
            SceneMethod("layered_sum", knobs=(1, 2)),
            SceneMethod("layered_over", knobs=(1, 2)),
        ],
        scene=ic.scenes.two_planes(),
        eye=ic.eyes.navarro(4.0, 2.0),
        fov_deg=2.0,
        resolution=48,
        wavelengths_nm=np.arange(400.0, 701.0, 60.0),
        targets=(0.02, 0.01),
        time="cpu",
        least_s=0.0,
        allow_noise=True,
        on_step=on_step,
    )


def regressions(record: dict[str, Any], earlier: dict[str, Any]) -> tuple[list[str], list[str]]:
    """What has become worse: errors, certain by their intervals, and times in those of tracing."""

    def points(one: dict[str, Any]) -> dict[tuple[str, float], dict[str, Any]]:
        return {(p["method"], p["value"]): p for p in one["points"]}

    now, then = points(record), points(earlier)
    wrong = [f"{key} is no longer measured" for key in then if key not in now]
    slow = []
    base_now, base_then = (next(iter(p.values()))["time_s"] for p in (now, then))
    for key in then:
        if key not in now:
            continue
        for name in ("rmse", "bias", "cone_noise"):
            low, high = now[key][f"{name}_low"], then[key][f"{name}_high"]
            if low > high:
                wrong.append(f"{key}: {name} {now[key][name]:.3g} was {then[key][name]:.3g}")
        factor = (now[key]["time_s"] / base_now) / (then[key]["time_s"] / base_then)
        if factor > 1.0 + LARGEST_SLOWDOWN:
            slow.append(f"{key} takes {factor:.2f} times as long as before")
    return wrong, slow


def check(result: WorkPrecision) -> None:
    """Compare with the JSON of an earlier quick run; exits with 1 if errors have grown."""
    earlier = json.loads((RESULTS / f"{QUICK}.json").read_text(encoding="utf-8"))
    wrong, slow = regressions(result.record(), earlier)
    for text in slow:
        warnings.warn(text, stacklevel=2)
    if wrong:
        sys.exit("errors have grown: " + "; ".join(wrong))
    print("no error has grown")


def write(result: WorkPrecision, name: str) -> None:
    command = " ".join(["python benchmarks/work_precision.py", *sys.argv[1:]])
    path = save(name, {"command": command, **result.record()})
    result.to_csv(RESULTS / f"{name}.csv")
    result.plot().figure.savefig(RESULTS / f"{name}.png", dpi=120)
    result.plot(error="cone_noise").figure.savefig(RESULTS / f"{name}_cones.png", dpi=120)
    print(f"\n{path.name}, .csv and two .png written")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--replicates", type=int, default=16)
    parser.add_argument("--bands", type=int, default=8)
    parser.add_argument("--time", choices=("wall", "cpu"), default="wall")
    parser.add_argument("--allow-noise", action="store_true")
    parser.add_argument("--quick", action="store_true", help="in small, under a minute")
    parser.add_argument("--check", action="store_true", help="compare with an earlier --quick")
    parser.add_argument("--name", default=None, help="of the files it writes")
    arguments = parser.parse_args()
    if arguments.check and not arguments.quick:
        parser.error("--check compares a --quick run: give both")

    def say(text: str, fraction: float) -> None:
        print(f"{100 * fraction:5.1f} % {text}", flush=True)

    with tempfile.TemporaryDirectory() as cache:
        os.environ.update({"XDG_CACHE_HOME": cache, "POCL_CACHE_DIR": f"{cache}/pocl"})
        os.mkdir(f"{cache}/pocl")
        try:
            result = quick(say) if arguments.quick else full(arguments, say)
        except NoisyTimingError as error:
            print(f"\n{error.result.table()}")
            sys.exit(f"nothing written: {error}")
    print(f"\n{result.table()}")
    if arguments.check:
        check(result)
        return
    standard = QUICK if arguments.quick else "work_precision"
    write(result, standard if arguments.name is None else arguments.name)


if __name__ == "__main__":
    main()
