"""Error against run time on the paper's Figure 12: ray tracing in both precisions, and PSF methods.

`isetcl.validation.work_precision` does the measuring: an independent reference in float64 with
random samples, 16 replicates, methods in turn, kinds of error apart. Writes JSON, CSV and a picture
to benchmarks/results/. A machine whose times differ by more than 20 % is refused, unless
--allow-noise marks them.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np
from common import RESULTS, save

import isetcl as ic
from isetcl.validation import SceneMethod, WorkPrecision, work_precision
from isetcl.validation.work_precision import NoisyTimingError

SAMPLES = (4, 16, 64, 256)
PSF_METHODS = ("layered_sum", "layered_over_visible", "layered_over", "pupil_clipped")


def measured(arguments: argparse.Namespace) -> WorkPrecision:
    traced = {"bands": 3 if arguments.draft else arguments.bands}
    samples = SAMPLES[:3] if arguments.draft else SAMPLES
    methods = [
        SceneMethod(
            knobs=samples, options=traced | {"precision": "single"}, label="ray tracing f32"
        ),
        SceneMethod(
            knobs=samples, options=traced | {"precision": "double"}, label="ray tracing f64"
        ),
        *(
            SceneMethod(name, knobs=(1, 2) if arguments.draft else (1, 2, 4))
            for name in PSF_METHODS
        ),
    ]
    return work_precision(
        methods,
        scene=ic.scenes.two_planes(),
        eye=ic.eyes.navarro(4.0, 2.0),
        fov_deg=2.0,
        resolution=32 if arguments.draft else 64,
        wavelengths_nm=np.arange(400.0, 701.0, 60.0 if arguments.draft else 10.0),
        replicates=arguments.replicates,
        time=arguments.time,
        allow_noise=arguments.allow_noise,
        on_step=lambda text, fraction: print(f"{100 * fraction:5.1f} % {text}", flush=True),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--replicates", type=int, default=16)
    parser.add_argument("--bands", type=int, default=8)
    parser.add_argument("--time", choices=("wall", "cpu"), default="wall")
    parser.add_argument("--allow-noise", action="store_true")
    parser.add_argument("--draft", action="store_true", help="fewer of everything, in a minute")
    parser.add_argument("--name", default="work_precision", help="of the files it writes")
    arguments = parser.parse_args()
    try:
        result = measured(arguments)
    except NoisyTimingError as error:
        print(f"\n{error.result.table()}")
        sys.exit(f"nothing written: {error}")
    print(f"\n{result.table()}")
    command = " ".join(["python benchmarks/work_precision.py", *sys.argv[1:]])
    record = {"command": command, **result.record()}
    path = save(arguments.name, record)
    result.to_csv(RESULTS / f"{arguments.name}.csv")
    result.plot().figure.savefig(RESULTS / f"{arguments.name}.png", dpi=120)
    print(f"\n{path.name}, .csv and .png written")


if __name__ == "__main__":
    main()
