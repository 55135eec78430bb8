"""Mosaics of cones: how long they take, how near they are to the densities, and how regular.

Three sizes, a foveal degree, 10 x 10 and 30 x 40 degrees, are timed from the call to the finished
mosaic, kernels built beforehand by a small one. The relaxation alone, of the same start with the
same sizes by the same law, is compared in the same run with numpy and scipy's cKDTree, which a
user would pick instead; it may use all processors for its searches, as the kernels do.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from common import interleave, machine, save, show, versions

import isetcl as ic
from isetcl.cones.density import MERIDIANS, ConeDensity
from isetcl.cones.lattice import ROUNDS, STEPS, Sector, rings
from isetcl.cones.quality import meridian_density
from isetcl.cones.retinal_scale import RetinalScale
from isetcl.device.choose import find_device
from isetcl.device.lattice import LatticeKernels

FIELDS: dict[str, tuple[float, float]] = {
    "1 x 1 deg": (1.0, 1.0),
    "10 x 10 deg": (10.0, 10.0),
    "30 x 40 deg": (30.0, 40.0),
}
ECCENTRICITY_DEG = (0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0, 12.0, 15.0, 20.0)
SCALE = RetinalScale.of("watson2014")
RADIUS_MM = 0.3
DISORDER = 0.18
"""Of the lattices whose relaxation is compared: half of the cones are six-sided."""


def timed(fov: tuple[float, float]) -> tuple[Any, dict[str, float]]:
    """A mosaic, and what it took."""
    wall, cpu = time.perf_counter(), time.process_time()
    mosaic = ic.cones.mosaic(fov)
    record = {
        "cones": len(mosaic),
        "wall_s": time.perf_counter() - wall,
        "cpu_s": time.process_time() - cpu,
        "peak_gib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20,
    }
    return mosaic, record


def along_meridians() -> dict[str, list[float]]:
    """Relative density errors against Curcio over the same 300 cones, by meridian."""
    curcio = ConeDensity.of("curcio1990", "right", SCALE)
    errors = {}
    for fov, names in (((42.0, 1.6), MERIDIANS[::2]), ((1.6, 42.0), MERIDIANS[1::2])):
        strip = ic.cones.mosaic(fov, has_optic_disc=False)
        for name in names:
            density, counted = meridian_density(strip, name, ECCENTRICITY_DEG)
            wanted = [1.0 / np.mean(1.0 / curcio.per_mm2(strip.positions_mm[c])) for c in counted]
            errors[name] = (density / wanted - 1.0).tolist()
    return errors


def scipy_relax(
    places: np.ndarray, size_of: Callable[[np.ndarray], np.ndarray], is_fixed: np.ndarray
) -> np.ndarray:
    """The same repulsion with numpy, neighbours from cKDTree."""
    from scipy.spatial import cKDTree

    places = places.copy()
    for _ in range(ROUNDS):
        size = size_of(places)
        distance, near = cKDTree(places).query(places, k=19, workers=-1)
        near = np.where(distance < 1.65 * size[:, None], near, np.arange(len(places))[:, None])
        wanted = 1.2 * 0.5 * (size[:, None] + size[near])
        for _ in range(STEPS):
            apart = places[:, None] - places[near]
            length = np.hypot(apart[..., 0], apart[..., 1])
            excess = np.where(length > 0, np.maximum(wanted - length, 0.0), 0.0)
            move = 0.2 * np.einsum("ik,ikc->ic", excess / np.where(length > 0, length, 1), apart)
            far = np.hypot(*move.T) / (0.25 * size)
            move /= np.maximum(far, 1.0)[:, None]
            places[~is_fixed] += move[~is_fixed]
    return places


def comparison(rounds: int) -> dict[str, Any]:
    """The relaxation of a patch about the fovea: the kernels against numpy and scipy."""
    curcio = ConeDensity.of("curcio1990", "right", SCALE)
    start = rings(curcio, Sector(0.0, RADIUS_MM, -np.pi, np.pi), 0)
    spacing = curcio.spacing_mm(start)
    random = np.random.default_rng(0)
    is_fixed = np.hypot(*start.T) > RADIUS_MM - 3.0 * spacing
    shake = 0.5 * spacing[:, None] * random.standard_normal(start.shape)
    start += np.where(is_fixed[:, None], 0.0, shake)
    factor = np.exp(DISORDER * random.standard_normal(len(start)))

    def size_of(places: np.ndarray) -> np.ndarray:
        return factor * curcio.spacing_mm(places)

    kernels = LatticeKernels(find_device())
    candidates = {
        "isetcl": lambda: kernels.relax(start, size_of, is_fixed, rounds=ROUNDS, steps=STEPS),
        "numpy and scipy": lambda: scipy_relax(start, size_of, is_fixed),
    }
    timings = interleave(candidates, rounds)
    apart = np.hypot(*(candidates["isetcl"]() - candidates["numpy and scipy"]()).T) / spacing
    return {
        "points": len(start),
        "seconds": {name: float(np.median(t.wall_s)) for name, t in timings.items()},
        "cpu_seconds": {name: float(np.median(t.cpu_s)) for name, t in timings.items()},
        "ratio": float(
            np.median(timings["numpy and scipy"].wall_s) / np.median(timings["isetcl"].wall_s)
        ),
        "median_difference_in_spacings": float(np.median(apart)),
    }


def picture(path: str, mosaic: Any) -> None:
    """The fovea and ten degrees from it, coloured by type."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(15, 6.6), layout="constrained")
    mosaic.within(0.7).plot(axes[0])
    ic.cones.mosaic(1.4, (10.0, 0.0)).plot(axes[1])
    axes[0].set_title("fovea")
    axes[1].set_title("10 degrees towards the nasal retina")
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--picture", help="where to save a picture of two mosaics")
    parser.add_argument("--small", action="store_true", help="leave out 30 x 40 degrees")
    options = parser.parse_args()
    before = machine()
    ic.cones.mosaic(0.2)
    records, quality = {}, {}
    for name, fov in FIELDS.items():
        if options.small and name.startswith("30"):
            continue
        mosaic, records[name] = timed(fov)
        if name.startswith("1 x"):
            first = mosaic
        if not name.startswith("30"):
            found = mosaic.quality(bands=5)
            quality[name] = {
                "six_neighbours": found.six_neighbour_fraction,
                "spacing_cv": found.spacing_cv,
                "nearest_neighbour_regularity": found.nearest_neighbour_regularity,
                "density_error": found.density_error.tolist(),
            }
    errors = along_meridians()
    baseline = comparison(options.rounds)
    show(
        "mosaics",
        [("field", "cones", "wall s", "CPU s", "peak GiB")]
        + [(n, r["cones"], r["wall_s"], r["cpu_s"], r["peak_gib"]) for n, r in records.items()],
    )
    show(
        "density error along the meridians, %",
        [("deg", *errors)]
        + [(e, *(100.0 * errors[m][i] for m in errors)) for i, e in enumerate(ECCENTRICITY_DEG)],
    )
    show(
        "regularity",
        [("field", *next(iter(quality.values())))[:4]]
        + [(n, *list(q.values())[:3]) for n, q in quality.items()],
    )
    show(
        f"relaxation of {baseline['points']} points",
        [("", "seconds"), *baseline["seconds"].items(), ("ratio", baseline["ratio"])],
    )
    path = save(
        "mosaic",
        {
            "command": "python benchmarks/mosaic.py",
            "load_before": before["load_before"],
            "versions": versions("scipy"),
            "mosaics": records,
            "quality": quality,
            "eccentricity_deg": ECCENTRICITY_DEG,
            "density_error": errors,
            "relaxation": baseline,
        },
    )
    print(f"\nwrote {path}")
    if options.picture:
        picture(options.picture, first)


if __name__ == "__main__":
    main()
