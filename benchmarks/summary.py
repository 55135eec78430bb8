"""Write benchmarks/README.md, and the README's section, from the JSON in benchmarks/results/.

No number is typed.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
Record = dict[str, Any]


def load(name: str) -> Record:
    return json.loads((HERE / "results" / f"{name}.json").read_text(encoding="utf-8"))


def number(value: object) -> str:
    if value is None:
        return "–"
    if isinstance(value, float):
        text = f"{value:.3g}"
        return f"{float(text):g}" if 1e-4 <= abs(value) < 1e6 else text
    return str(value)


def table(head: tuple[str, ...], rows: list[tuple[object, ...]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    lines += ["| " + " | ".join(number(cell) for cell in row) + " |" for row in rows]
    return "\n".join(lines)


def where(record: Record) -> str:
    """The machine of a record, in a line."""
    m = record["machine"]
    return (
        f"`{record['command']}`, {record['date']}: {m['processor']}, {m['processors']} processors, "
        f"{m['platform']} {m['driver']} (kernels for {m['target'] or 'its own processor'}), "
        f"Python {m['python']}."
    )


def rates(record: Record) -> list[tuple[object, ...]]:
    """Rows of name, median rate, CPU time and spread."""
    return [
        (name, r["million_per_s_median"], r["cpu_ns_each_median"], r["spread"])
        for name, r in record["results"].items()
    ]


def trace_rays() -> str:
    record = load("trace_rays")
    rows = rates(record)
    errors = record["error_mm"]
    return "\n\n".join(
        [
            "## Rays through an eye\n\n" + where(record),
            "A million collimated rays through Navarro's eye to the retina, rays and results on "
            "the device. Plain C is `roofline.c`, compiled beside it with `-O3 -march=native "
            "-ffast-math -fopenmp`: it reads positions of rays with one direction and writes "
            "positions and status. batoid traces the same surfaces in float64.",
            table(("", "million rays/s", "CPU ns a ray", "spread"), rows),
            table(("ratio of CPU times", "times faster"), list(record["cpu_time_ratios"].items())),
            f"Largest error against 40-digit references: {number(errors['single'])} mm in single, "
            f"{number(errors['double'])} mm in double precision.",
        ]
    )


def direct() -> str:
    record = load("direct")
    rows = rates(record)
    ratios = [(name, value) for name, value in record["cpu_time_of_mitsuba_over_ours"].items()]
    widths = [(n, r["million_per_s_median"]) for n, r in record["vector_widths"].items()]
    parts = [
        "## Paths from the retina to the scene\n\n" + where(record),
        "Two planes (the paper's Figure 12) through Navarro's eye, 256 x 256 pixels, 64 samples, 8 "
        "bands, one launch. A path is one sample of one band of one pixel; the useful ones pass "
        "the stop. Mitsuba 3 (`llvm_ad_spectral`, four wavelengths a path) sees the same planes, "
        "emission only, through a thin lens, without an eye.",
        table(("", "million useful paths/s", "CPU ns a path", "spread"), rows),
    ]
    if ratios:
        parts.append(table(("CPU time of Mitsuba's path over ours", "times"), ratios))
    parts.append(table(("lanes of the vectors, checkerboards", "million paths/s"), widths))
    return "\n\n".join(parts)


def features() -> str:
    record = load("features")
    rows = [
        (name.removeprefix("has_").replace("_", " "), *costs.values())
        for name, costs in record["cpu_ns_a_path"].items()
    ]
    return "\n\n".join(
        [
            "## What a feature costs\n\n" + where(record),
            "CPU ns a path: left out (the kernel the plan makes), compiled in but not used, used. "
            "The plan compiles in what is used and nothing else, so the middle column is what it "
            "saves.",
            table(("feature", "left out", "in, unused", "used"), rows),
        ]
    )


def surfaces() -> str:
    record = load("surfaces")
    columns = [f"{p} {k}" for p in ("single", "double") for k in ("own", "all", "paths")]
    rows = [(name, *(row.get(c) for c in columns)) for name, row in record["cpu_ns"].items()]
    return "\n\n".join(
        [
            "## What shapes of surfaces cost\n\n" + where(record),
            "CPU ns of a ray through Navarro's eye to the retina, where the front of the cornea, "
            'the lens or the stop is of another kind; "own" is the kernel that knows what this '
            'eye needs, "all" one kernel for all of these eyes but those with gradients, which '
            'are eyes of their own. "paths" are those of the direct pipeline (retina to scene, '
            "four bands), with its own kernel.",
            table(("", *columns), rows),
        ]
    )


def path_features() -> str:
    record = load("path_features")
    rows = [
        (name.removeprefix("has_").replace("_", " "), *costs.values())
        for name, costs in record["cpu_ns_a_path"].items()
    ]
    forest = [
        (name, r["ns_a_path"], r["hierarchy_mb"], r["prepare_s"])
        for name, r in record["forest"].items()
    ]
    return "\n\n".join(
        [
            "## What a feature of a lit scene costs\n\n" + where(record),
            'The scene "planes" of the section above, and what one more feature costs it: left '
            "out (the kernel the plan makes), compiled in but not used, used. A used feature may "
            "change how many paths are scattered: its column is not the price of the code alone.",
            table(("feature, CPU ns a path", "left out", "in, unused", "used"), rows),
            "A forest of 400 alike trees of 20,480 triangles, as instances of one mesh and with "
            "all triangles in place.",
            table(("", "CPU ns a path", "hierarchies (MB)", "seconds to prepare"), forest),
        ]
    )


def mesh() -> str:
    record = load("mesh")
    rows = rates(record)
    differing = "; ".join(
        f"{name}: {d['triangle']} in another triangle, {d['hit']} hit by one side only"
        for name, d in record["differing"].items()
    )
    return "\n\n".join(
        [
            "## Rays against a mesh\n\n" + where(record),
            "Closest hits of 1,048,576 rays on an icosphere of 81,920 triangles: from random "
            "places, parallel on a grid, and from a lens of 4 mm focused on the ball. Both sides "
            "are watertight. embreex calls Embree ray by ray on one thread: compare CPU time.",
            table(("", "million rays/s", "CPU ns a ray", "spread"), rows),
            table(
                ("CPU time of embreex over ours", "times"),
                list(record["cpu_time_of_embreex_over_ours"].items()),
            ),
            f"Rays that differ from Embree's: {differing}. Rays from inside that find no triangle: "
            f"{record['leaks']}.",
            table(("triangles", "seconds to build the tree"), list(record["build_s"].items())),
        ]
    )


def paths() -> str:
    record = load("paths")
    rows = rates(record)
    ratios = [(name, value) for name, value in record["cpu_time_of_mitsuba_over_ours"].items()]
    parts = [
        "## Paths in a lit scene\n\n" + where(record),
        'An even sky and a lamp; "planes": two boards, one scattering; "mesh": a ball of 81,920 '
        "triangles on a floor before a wall, up to four. A path carries four wavelengths on both "
        "sides; Mitsuba's starts at a thin lens.",
        table(("", "million camera paths/s", "CPU ns a path", "spread"), rows),
    ]
    if ratios:
        parts.append(table(("CPU time of Mitsuba's path over ours", "times"), ratios))
    parts.append(table(("peak memory of isetcl's process", "MB"), list(record["peak_mb"].items())))
    return "\n\n".join(parts)


def huygens() -> str:
    record = load("huygens")
    rows = [
        (name, record["seconds"][name], r["million_per_s_median"], r["cpu_ns_each_median"])
        for name, r in record["results"].items()
    ]
    ratios = list(record["wall_time_of_optiland_over_ours"].items())
    parts = [
        "## Huygens' point spread function\n\n" + where(record),
        f"{record['rays']} rays (a disc, 128 across) onto 128 x 128 points, Navarro's eye in "
        'focus. "sum" is the summation with its copies to and from the device; "whole" starts '
        "from the eye and traces the rays as well. optiland's sum is compiled by numba and uses "
        "all processors, too.",
        table(("", "seconds", "million pairs/s", "CPU ns a pair"), rows),
    ]
    if ratios:
        parts.append(table(("wall time of optiland over ours", "times"), ratios))
        parts.append(
            "Largest difference of both PSFs, of their peaks: "
            f"{number(record['largest_difference'])}; optiland has an obliquity factor and "
            "samples the pupil on another grid."
        )
    return "\n\n".join(parts)


def mosaic() -> str:
    record = load("mosaic")
    rows = [
        (name, m["cones"], m["wall_s"], m["cpu_s"], m["peak_gib"])
        for name, m in record["mosaics"].items()
    ]
    regular = [
        (name, *(q[k] for k in ("six_neighbours", "spacing_cv", "nearest_neighbour_regularity")))
        for name, q in record["quality"].items()
    ]
    errors = record["density_error"]
    worst = {m: 100.0 * max(map(abs, e)) for m, e in errors.items()}
    ecc, relax = record["eccentricity_deg"], record["relaxation"]
    return "\n\n".join(
        [
            "## Mosaics of cones\n\n" + where(record),
            "From the call to the finished mosaic, types and sizes included; peak memory is the "
            "whole process's.",
            table(("field", "cones", "s", "CPU s", "peak GiB"), rows),
            f"Density along the meridians from {ecc[0]:g} to {ecc[-1]:g} degrees: 300 cones over "
            "the area of their Voronoi cells, against Curcio 1990 over the same area.",
            table(("meridian", "largest error, %"), list(worst.items())),
            "Regularity: the share of cones with six neighbours, the spread of the distances "
            "between neighbours, and mean over spread of the distance to the nearest.",
            table(("field", "six neighbours", "spacing CV", "nearest-neighbour"), regular),
            f"The relaxation alone, {relax['points']} points of one start, by the same law: the "
            f"kernels take {number(relax['seconds']['isetcl'])} s, numpy with scipy's cKDTree "
            f"{number(relax['seconds']['numpy and scipy'])} s, {number(relax['ratio'])} times as "
            "long.",
        ]
    )


def gradients() -> str:
    record = load("gradients")
    parts = [
        "## Gradient-index lenses\n\n" + where(record),
        "CPU ns a ray, medians, and how many times the Navarro eye's that is: `trace_rays` in "
        "both precisions, and the direct pipeline with one uniform plane. Shells have the index "
        "1.415 - 0.045 (zeta^2)^power.",
    ]
    kinds = (
        ("trace_rays, single", record["trace_rays"]["single"]),
        ("trace_rays, double", record["trace_rays"]["double"]),
        ("direct, single", record["direct"]["single"]),
    )
    rows = [
        (eye, *(value for _, of in kinds for value in (of[eye]["ns_median"],
                                                       of[eye]["times_navarro_median"])))
        for eye in kinds[0][1]
    ]  # fmt: skip
    head = ("eye", *(cell for name, _ in kinds for cell in (name, "times Navarro")))
    parts.append(table(head, rows))
    parts.append("The two alone, `trace_rays` in single precision, with more and more rays:")
    counts = [
        (count, of["navarro"]["ns_median"], of["liou_brennan"]["ns_median"],
         of["liou_brennan"]["times_navarro_median"])
        for count, of in record["counts"].items()
    ]  # fmt: skip
    parts.append(table(("rays", "navarro", "liou_brennan", "times Navarro"), counts))
    parts.append(
        "Largest error on the retina of rays over a 3.2 mm pupil, um, against steps through each "
        "half of the lens."
    )
    lenses = [(p, eye) for p, of in record["steps"].items() for eye in of]
    steps = [row["steps"] for row in record["steps"]["double"]["liou_brennan"]]
    errors = [
        (n, *(record["steps"][p][eye][i]["error_um"] for p, eye in lenses))
        for i, n in enumerate(steps)
    ]
    parts.append(table(("steps", *(f"{eye}, {p}" for p, eye in lenses)), errors))
    return "\n\n".join(parts)


def startup() -> str:
    record = load("startup")
    rows = [
        ("`import isetcl`", record["import_s"]),
        ("new process to the first image, caches empty", record["cold_process_to_first_image_s"]),
        ("new process to the first image, caches full", record["warm_process_to_first_image_s"]),
    ]
    return "\n\n".join(
        [
            "## Start\n\n" + where(record),
            table(("medians of 7", "seconds"), rows),
        ]
    )


def psf_baseline() -> str:
    record = load("psf_baseline")
    peer = record.get("deeplens")
    keys = ("blur_s", "fftconvolve_s", "render_s", "render_peak_mb")
    rows = [(name, *(r.get(key) for key in keys)) for name, r in record["results"].items()]
    return "\n\n".join(
        [
            "## PSF baselines\n\n" + where(record),
            "Two of the methods on 16 textured cards at 16 depths, 512 x 512 pixels with four "
            "samples each, 31 wavelengths, one wave PSF per depth and wavelength, made before. "
            "`scipy.signal.fftconvolve` blurs the same layers with the same PSFs in single "
            "precision, at every eighth wavelength, counted for all. A whole render takes views "
            "of the scene and maps the blurred view to the retina as well.",
            table(
                ("", "blur (s)", "fftconvolve (s)", "whole render (s)", "peak memory (MB)"), rows
            ),
            table(
                ("time of fftconvolve over ours", "times faster"),
                list(record["times_of_fftconvolve_over_ours"].items()),
            ),
            *(
                [
                    "M5 by `conv_psf_occlusion` of DeepLens (deeplens-core "
                    f"{peer['versions']['deeplens-core']}, torch {peer['versions']['torch']}), at "
                    f"one wavelength counted for all: {peer['deeplens_s']:.3g} s, by isetcl "
                    f"{peer['blur_s']:.3g} s, PSFs of {peer['kernel_samples']} samples a side; "
                    f"largest difference {peer['largest_difference']:.1g} of the mean."
                ]
                if peer is not None
                else []
            ),
        ]
    )


def paper_scene() -> str:
    record = load("paper_scene")
    rows = [
        (
            f"{100 * float(target):g} %",
            100 * r["median"]["error"],
            r["median"]["samples"],
            r["median"]["process_s"],
            r["median"]["peak_mb"],
        )
        for target, r in record["results"].items()
    ]
    return "\n\n".join(
        [
            "## The paper's image\n\n" + where(record),
            "The scene of Figure 12 at 800 x 800 pixels, 31 wavelengths, 8 bands, to a photopic "
            "relative error; a new process each, start and kernel build included. Lian et al. "
            "(2019) report over an hour for such an image on 8 cores.",
            table(("target", "reached (%)", "samples", "seconds", "peak memory (MB)"), rows),
        ]
    )


def convergence() -> str:
    record = load("convergence")
    parts = [
        "## Error against samples\n\n" + where(record),
        "Against an independent reference (another seed, double precision, 65,536 samples), 64 x "
        "64 pixels. The median over pixels shows the smooth part of the image, the root mean "
        "square is that of the edges.",
    ]
    for name, result in record["results"].items():
        rows = [
            (p["spp"], 100 * p["rms_error"], 100 * p["reported_error"], 100 * p["median_error"])
            for p in result["points"]
        ]
        parts.append(table((f"{name}: samples", "rms (%)", "reported rms (%)", "median (%)"), rows))
        parts.append(
            f"Slopes {number(result['slope_rms'])} (rms) and {number(result['slope_median'])} "
            f"(median), where independent random samples have −0.5. Over {record['seeds']} seeds "
            f"the spread of the image is {number(result['spread_over_reported'])} times the "
            "reported standard error."
        )
    return "\n\n".join(parts)


HEAD = """# Benchmarks

Each section is one script, run alone on a quiet machine; candidates of a table alternate within
one run. Rates are medians; "spread" is how far the median lies above the best. CPU time is the
process's own, over all threads. The peers come with `pip install ".[peers]"` (Mitsuba needs an LLVM
library, for example Debian's `libllvm19`; plain C needs gcc); a peer that is missing is left out.
This page is written by `python benchmarks/summary.py` from the JSON files in `results/`."""


def reaches(target: Record, name: str = "time_to") -> str:
    """When a method gets to a target, in words."""
    seconds, how = target.get(f"{name}_s"), target[f"{name}_how"]
    return how if seconds in (None, "infinite") else f"{number(seconds)} s, {how}"


def work_precision() -> str:
    record = load("work_precision")
    named = ("rmse", "monte_carlo", "bias", "representation", "rounding", "discretisation")
    points = [
        (
            p["method"],
            f"{p['knob']} {p['value']:g}",
            p["time_s"],
            p["cpu_median_s"],
            *(None if p[name] is None else 100.0 * p[name] for name in named),
            p.get("cone_noise"),
            p["spread"],
        )
        for p in record["points"]
    ]
    goals = [
        (
            m["method"],
            *(reaches(t) for t in m["targets"]),
            reaches(m, "cone_time") if "cone_time_how" in m else None,
            *(t["efficiency_at"] or None for t in m["targets"]),
            m["targets"][0].get("times_first"),
            m["slope"],
        )
        for m in record["methods"]
    ]
    firsts = {p["method"]: p for p in reversed(record["points"])}
    apart = [
        (m["method"], *(firsts[m["method"]][k] for k in ("first_s", "build_s", "transfer_s")))
        for m in record["methods"]
    ]
    targets = [f"{100 * t['target']:g} %" for t in record["methods"][0]["targets"]]
    told = record["provenance"]
    clock = {"wall": "wall clock", "cpu": "processor time"}[told["time"]]
    head = ("method", "knob", f"s ({clock})", "CPU s", "rms error (%)", "noise (%)", "bias (%)")
    kinds = ("rounded inputs (%)", "rounding (%)", "discretisation (%)", "of cone noise", "spread")
    cone = told.get("cone_noise")
    ratio = "" if cone is None else f"{cone['ratio']:g} of "
    return "\n\n".join(
        [
            "## Error against run time\n\n" + where(record),
            f"Figure 12 of the paper by ray tracing and by PSF methods, relative to the mean of an "
            f"independent reference ({told['reference']}); {told['replicates']} replicates. "
            "Rounding is the difference of the same samples in both precisions, discretisation "
            "that of fewer bands or coarser views.",
            *(
                []
                if cone is None
                else [
                    "In units of cone noise an error is relative to the Poisson noise of a cone in "
                    f"each pixel, which at the mean has {number(cone['mean_excitations'])} "
                    f"excitations ({number(1e3 * cone['integration_time_s'])} ms at "
                    f"{number(cone['illuminance_lux'])} lux): below 0.1 it cannot be seen.",
                    "![error in units of cone noise](results/work_precision_cones.png)",
                ]
            ),
            "![error against run time](results/work_precision.png)",
            table((*head, *kinds), points),
            table(
                (
                    "time",
                    *(f"to {t}" for t in targets),
                    f"to {ratio}cone noise",
                    *(f"efficiency at {t}, 1/s" for t in targets),
                    f"times the first's time to {targets[0]}",
                    "slope of the error over the knob",
                ),
                goals,
            ),
            table(("seconds", "first image", "of it to build", "copies to the device"), apart),
            *record["notes"],
        ]
    )


def page() -> str:
    sections = (
        trace_rays,
        direct,
        features,
        surfaces,
        mesh,
        paths,
        path_features,
        huygens,
        mosaic,
        gradients,
        startup,
        psf_baseline,
        paper_scene,
        convergence,
        *([work_precision] if (HERE / "results" / "work_precision.json").exists() else []),
    )
    return "\n\n".join([HEAD, *(section() for section in sections)]) + "\n"


if __name__ == "__main__":
    import readme

    readme.write()
    (HERE / "README.md").write_text(page(), encoding="utf-8")
