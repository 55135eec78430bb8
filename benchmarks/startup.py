"""Time to import isetcl, and to the first retinal image of a process, with and without caches.

Every measurement is a new process. The first image is 128 x 128 pixels, 16 samples, of the paper's
Figure 12 scene.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from common import save, show

IMPORT = "import time; t = time.perf_counter(); import isetcl; print(time.perf_counter() - t)"
FIRST_IMAGE = """
import time
start = time.perf_counter()
import isetcl as ic
imported = time.perf_counter()
eye = ic.eyes.navarro(4.0, 2.0)
scene = ic.scenes.two_planes()
prepared = time.perf_counter()
image = ic.render(scene, eye, fov_deg=2, resolution=128, spp=16, progress=False)
done = time.perf_counter()
import json
parts = {"import": imported - start, "eye": prepared - imported, "render": done - prepared}
print(json.dumps(parts))
"""


def run(code: str, cache: Path) -> tuple[str, float]:
    environment = os.environ | {"XDG_CACHE_HOME": str(cache), "POCL_CACHE_DIR": str(cache / "pocl")}
    (cache / "pocl").mkdir(parents=True, exist_ok=True)
    start = time.perf_counter()
    output = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    ).stdout
    return output, time.perf_counter() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=7)
    rounds = parser.parse_args().rounds
    folder = Path(tempfile.mkdtemp())
    warm = folder / "warm"
    run(FIRST_IMAGE, warm)
    imports, cold, full, parts = [], [], [], []
    for i in range(rounds):
        imports.append(float(run(IMPORT, warm)[0]))
        empty = folder / f"empty{i}"
        cold.append(run(FIRST_IMAGE, empty)[1])
        shutil.rmtree(empty)
        output, seconds = run(FIRST_IMAGE, warm)
        full.append(seconds)
        parts.append(json.loads(output))
    shutil.rmtree(folder)
    results = {
        "import_s": statistics.median(imports),
        "cold_process_to_first_image_s": statistics.median(cold),
        "warm_process_to_first_image_s": statistics.median(full),
        "warm_parts_s": {k: statistics.median(p[k] for p in parts) for k in parts[0]},
        "all": {"import_s": imports, "cold_s": cold, "warm_s": full},
    }
    show(
        "start-up, whole processes",
        [
            ("", "s (median)"),
            ("import isetcl", results["import_s"]),
            ("to the first image, empty caches", results["cold_process_to_first_image_s"]),
            ("to the first image, full caches", results["warm_process_to_first_image_s"]),
        ],
    )
    path = save("startup", {"command": "python benchmarks/startup.py", **results})
    print(f"\n{path.name} written")


if __name__ == "__main__":
    main()
