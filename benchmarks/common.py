"""What all benchmarks share: interleaved timing, the machine's description, the JSON record."""

from __future__ import annotations

import json
import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

RESULTS = Path(__file__).parent / "results"


@dataclass
class Timing:
    """Wall-clock and process CPU seconds of repetitions."""

    wall_s: list[float] = field(default_factory=list)
    cpu_s: list[float] = field(default_factory=list)

    def add(self, function: Callable[[], object]) -> None:
        wall, cpu = time.perf_counter(), time.process_time()
        function()
        self.wall_s.append(time.perf_counter() - wall)
        self.cpu_s.append(time.process_time() - cpu)

    def summary(self, work: float) -> dict[str, float]:
        """Rates for `work` units a repetition: median and best wall clock, least CPU time."""
        median = statistics.median(self.wall_s)
        return {
            "million_per_s_median": work / median / 1e6,
            "million_per_s_best": work / min(self.wall_s) / 1e6,
            "cpu_ns_each_median": statistics.median(self.cpu_s) / work * 1e9,
            "cpu_ns_each_least": min(self.cpu_s) / work * 1e9,
            "spread": (median - min(self.wall_s)) / min(self.wall_s),
            "repetitions": len(self.wall_s),
        }


def interleave(candidates: dict[str, Callable[[], object]], rounds: int) -> dict[str, Timing]:
    """Every candidate once a round, in turn, after one round that is not counted."""
    timings = {name: Timing() for name in candidates}
    for function in candidates.values():
        function()
    for _ in range(rounds):
        for name, function in candidates.items():
            timings[name].add(function)
    return timings


def machine() -> dict[str, Any]:
    """The processor and the software, without names of hosts or folders."""
    model = platform.processor()
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                model = line.split(":", 1)[1].strip()
                break
    except OSError:
        pass
    from isetcl.device.choose import find_device

    return {
        "processor": model,
        "processors": os.cpu_count(),
        "load_before": os.getloadavg()[0],
        "python": sys.version.split()[0],
        "compiler": _first_line(["gcc", "--version"]),
        **find_device().describe(),
    }


def versions(*packages: str) -> dict[str, str]:
    """Installed versions of packages; those that are missing are left out."""
    from importlib.metadata import PackageNotFoundError, version

    found = {}
    for package in ("isetcl", "pyopencl", "numpy", *packages):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def _first_line(command: list[str]) -> str:
    try:
        output = subprocess.run(command, capture_output=True, text=True, check=False).stdout
    except OSError:
        return "none"
    return output.splitlines()[0] if output else "none"


def load_mitsuba() -> Any:
    """Mitsuba 3 in its spectral LLVM variant; None where it or an LLVM library is missing."""
    libraries = sorted(Path("/usr/lib").glob("*/libLLVM*.so*"))
    if libraries:
        os.environ.setdefault("DRJIT_LIBLLVM_PATH", str(libraries[-1]))
    try:
        import mitsuba

        mitsuba.set_variant("llvm_ad_spectral")
    except (ImportError, AttributeError, RuntimeError):
        return None
    return mitsuba


def save(name: str, record: dict[str, Any]) -> Path:
    """Write benchmarks/results/NAME.json with the machine's description."""
    RESULTS.mkdir(exist_ok=True)
    path = RESULTS / f"{name}.json"
    record = {"date": time.strftime("%Y-%m-%d"), "machine": machine(), **record}
    path.write_text(json.dumps(record, indent=1) + "\n")
    return path


def show(title: str, rows: list[tuple[object, ...]]) -> None:
    """Print rows as aligned columns; the first is the head."""
    texts = [[f"{c:.3g}" if isinstance(c, float) else str(c) for c in row] for row in rows]
    widths = [max(len(row[i]) for row in texts) for i in range(len(texts[0]))]
    print(f"\n{title}")
    for row in texts:
        print("  " + "  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)))
