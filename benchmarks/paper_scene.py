"""The paper's Figure 12 at its own size: 800 x 800 pixels, 31 wavelengths, 8 bands, to 1 %.

The paper's renderer needs over an hour for 800 x 800 pixels on 8 cores. Every repetition is a new
process; its time includes starting Python and building kernels, its memory is the peak of the
process as the operating system saw it.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import time

from common import save, show

JOB = """
import json, resource, time
start = time.perf_counter()
import isetcl as ic
eye = ic.eyes.navarro(4.0, 2.0)
image = ic.render(
    ic.scenes.two_planes(), eye, fov_deg=2, resolution=800, bands=8, target_error=TARGET, seed=SEED,
    progress=False,
)
print(json.dumps({
    "seconds": time.perf_counter() - start,
    "error": image.relative_error,
    "samples": image.provenance["samples_per_pixel"],
    "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
}))
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    rounds = parser.parse_args().rounds
    results = {}
    rows = [("target", "process s", "reached", "samples", "peak MB")]
    for target in (0.02, 0.01, 0.005):
        runs = []
        for seed in range(rounds):
            code = JOB.replace("TARGET", str(target)).replace("SEED", str(seed))
            start = time.perf_counter()
            output = subprocess.run(
                [sys.executable, "-c", code], capture_output=True, text=True, check=True
            ).stdout
            runs.append(json.loads(output) | {"process_s": time.perf_counter() - start})
        middle = {k: statistics.median(r[k] for r in runs) for k in runs[0]}
        results[str(target)] = {"median": middle, "runs": runs}
        rows.append(
            (target, middle["process_s"], middle["error"], middle["samples"], middle["peak_mb"])
        )
    show("800 x 800 pixels, 31 wavelengths, 8 bands", rows)
    path = save("paper_scene", {"command": "python benchmarks/paper_scene.py", "results": results})
    print(f"\n{path.name} written")


if __name__ == "__main__":
    main()
