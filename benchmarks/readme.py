"""The README's section on speed and exactness, from the JSON in benchmarks/results/.

`python benchmarks/summary.py` writes it between two comments of README.md.
"""

from __future__ import annotations

import textwrap
from pathlib import Path

from summary import Record, load, number, reaches, table

README = Path(__file__).parents[1] / "README.md"
START = "<!-- from benchmarks/results/ by python benchmarks/summary.py -->"
END = "<!-- end of what is from benchmarks/results/ -->"
WIDTH = 105
USED = (
    *("work_precision", "trace_rays", "direct", "paths", "mesh", "huygens", "psf_baseline"),
    *("mosaic", "paper_scene", "convergence", "startup"),
)


def section() -> str:
    return "\n\n".join(
        [
            START,
            "## How fast, how exact",
            wrapped(
                "Every number here is from a file in [benchmarks/results](benchmarks/results), "
                f"{machines()}; each ratio is from a single run in which the programs took turns. "
                "[benchmarks/README.md](benchmarks/README.md) has the rest, and the commands."
            ),
            *against_time(load("work_precision")),
            *against_others(),
            wrapped(exactness()),
            END,
        ]
    )


def against_time(record: Record) -> list[str]:
    """The smallest error of each method, and the times to given errors."""
    told = record["provenance"]
    cone = told.get("cone_noise")
    rows = []
    for method in record["methods"]:
        own = [p for p in record["points"] if p["method"] == method["method"]]
        best = min(own, key=lambda p: p["rmse"])
        row = [f"`{method['method']}`" if "_" in method["method"] else method["method"]]
        row += [number(100.0 * best["rmse"]), number(best["time_s"])]
        row += [reaches(t) for t in method["targets"]]
        if cone is not None:
            row += [number(best["cone_noise"]), reaches(method, "cone_time")]
        rows.append(tuple(row))
    targets = [f"to {100 * t['target']:g} %" for t in record["methods"][0]["targets"]]
    head = ["", "least error (%)", "in (s)", *targets]
    text = (
        "**Error against run time.** Figure 12 of the paper, seen by Navarro's eye, against an "
        f"independent reference ({told['reference']}; standard error "
        f"{number(100.0 * record['points'][0]['reference_error'])} %). The smallest root mean "
        "square error each method came to, the time of that image, and the times to other errors. "
        'What is "extrapolated" lies beyond the longest render; what is "not reached" is bias: '
        "that of few bands in ray tracing, and at the depth edges that of the PSF methods."
    )
    if cone is not None:
        head += ["of cone noise", f"to {cone['ratio']:g} of it"]
        text += (
            " An error in units of cone noise is relative to the Poisson noise of a foveal cone "
            f"within {number(1e3 * cone['integration_time_s'])} ms at "
            f"{number(cone['illuminance_lux'])} lux."
        )
    return [wrapped(text), table(tuple(head), rows)]


def against_others() -> list[str]:
    """How many times longer other programs take."""
    rays = load("trace_rays")["cpu_time_ratios"]
    ways = "own directions in and out, status, path length"
    rows = [
        (
            "batoid",
            "rays through an eye, double precision; CPU time",
            [rays[f"isetcl double, {ways} / batoid"]],
        ),
        (
            "plain C, `-O3 -march=native -ffast-math`",
            "the same, double and single precision; CPU time",
            [rays[f"isetcl {p}, {ways} / plain C"] for p in ("double", "single")],
        ),
        (
            "Mitsuba 3",
            "paths to emitting planes (Mitsuba's from a thin lens), single precision; CPU time",
            _of("direct", "cpu_time_of_mitsuba_over_ours", "single"),
        ),
        (
            "Mitsuba 3",
            "paths in lit scenes; CPU time",
            _of("paths", "cpu_time_of_mitsuba_over_ours"),
        ),
        (
            "Embree, by embreex",
            "rays against a mesh; CPU time",
            _of("mesh", "cpu_time_of_embreex_over_ours"),
        ),
        (
            "optiland",
            "Huygens' point spread function, double precision; wall clock",
            _of("huygens", "wall_time_of_optiland_over_ours", "double"),
        ),
        (
            "`scipy.signal.fftconvolve`",
            "blurring layers by PSFs; wall clock",
            _of("psf_baseline", "times_of_fftconvolve_over_ours"),
        ),
        (
            "numpy and scipy's `cKDTree`",
            "relaxation of a mosaic of cones; wall clock",
            [load("mosaic")["relaxation"]["ratio"]],
        ),
    ]
    cells = [(name, what, _range(values)) for name, what, values in rows if values]
    return [
        "**Against other programs.** How many times as long they take; below 1, isetcl is slower.",
        table(("", "for", "times isetcl's time"), cells),
    ]


def exactness() -> str:
    rays, scene = load("trace_rays")["error_mm"], load("paper_scene")["results"]
    found = load("convergence")["results"]
    start = load("startup")
    honest = [r["spread_over_reported"] for r in found.values()]
    slopes = [r["slope_rms"] for r in found.values()]
    times = ", ".join(
        f"{number(r['median']['process_s'])} s to {100 * float(target):g} %"
        for target, r in scene.items()
    )
    return (
        f"**Exactness.** Rays differ from 40-digit references by at most {number(rays['single'])} "
        f"mm in single and {number(rays['double'])} mm in double precision. The spread of images "
        f"over seeds is {_range(honest)} times the standard error they report, and errors fall as "
        f"the samples to the power of {_range(slopes)}. The paper's image (800 x 800 pixels, 31 "
        f"wavelengths) takes {times}, start included; a first small image in a new process "
        f"{number(start['cold_process_to_first_image_s'])} s, "
        f"{number(start['warm_process_to_first_image_s'])} s once kernels are cached."
    )


def _of(name: str, key: str, only: str = "") -> list[float]:
    """Ratios of a record, of those whose names hold a word; none where the peer was missing."""
    return [value for what, value in load(name)[key].items() if only in what]


def _range(values: list[float]) -> str:
    texts = [number(value) for value in sorted(values, key=abs)]
    return texts[0] if texts[0] == texts[-1] else f"{texts[0]} to {texts[-1]}"


def machines() -> str:
    """Where the records were made: one machine in words, or the number of machines."""
    told = [load(name)["machine"] for name in USED]
    found = {(m["processor"], m["processors"], m["platform"]) for m in told}
    if len(found) > 1:
        return f"made on {len(found)} machines"
    processor, count, platform = found.pop()
    return f"made on {count} processors ({processor}, {platform})"


def wrapped(text: str) -> str:
    return textwrap.fill(text, WIDTH, break_long_words=False, break_on_hyphens=False)


def write() -> None:
    text = README.read_text(encoding="utf-8")
    before, rest = text.split(START)
    after = rest.split(END)[1]
    README.write_text(before + section() + after, encoding="utf-8")
