"""Error against samples and seconds: how fast it falls, and whether the reported error is true.

Against an independent reference (another seed, float64, at least 64 times the samples), in the
scenes of the paper's Figure 12: checkerboards, and uniform planes with the same edge. Slopes are
fitted in log-log; random samples would have -0.5. Honesty: over 64 seeds, the spread of the image
over the mean reported error.
"""

from __future__ import annotations

import argparse

import numpy as np
from common import save, show

import isetcl as ic
from isetcl.validation import occlusion_error

COUNTS = (4, 16, 64, 256, 1024)
WHERE = {"fov_deg": 2.0, "resolution": 64, "bands": 8, "progress": False}


def smooth_part(image: ic.RetinalImage, reference: ic.RetinalImage) -> float:
    """Median absolute error over pixels, relative to the mean: edges are a small part of them."""
    off = np.abs(image.illuminance_lux.values - reference.illuminance_lux.values)
    return float(np.median(off) / reference.illuminance_lux.values.mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=64)
    seeds = parser.parse_args().seeds
    eye = ic.eyes.navarro(4.0, 2.0)
    results = {}
    for name, scene in {
        "checkerboards": ic.scenes.two_planes(),
        "uniform planes": ic.scenes.two_planes(texture="uniform"),
    }.items():
        reference = ic.render(
            scene, eye, spp=64 * COUNTS[-1], seed=987_654, precision="double", **WHERE
        )
        rows = [("samples", "rms error", "reported", "median error", "seconds")]
        points = []
        for spp in COUNTS:
            images = [ic.render(scene, eye, spp=spp, seed=s, **WHERE) for s in range(8)]
            rms = float(
                np.sqrt(
                    np.mean(
                        [
                            occlusion_error(i, reference, noise_is_error=True).photopic["all"].rms
                            ** 2
                            for i in images
                        ]
                    )
                )
            )
            point = {
                "spp": spp,
                "rms_error": rms,
                "reported_error": float(np.sqrt(np.mean([i.relative_error**2 for i in images]))),
                "median_error": float(np.mean([smooth_part(i, reference) for i in images])),
                "seconds": float(np.median([i.provenance["elapsed_s"] for i in images])),
            }
            points.append(point)
            rows.append(tuple(point.values()))
        logs = np.log([[p["spp"], p["rms_error"], p["median_error"]] for p in points])
        slopes = [float(np.polyfit(logs[:, 0], logs[:, i], 1)[0]) for i in (1, 2)]
        stack, reported = [], []
        for seed in range(seeds):
            image = ic.render(scene, eye, spp=256, seed=1000 + seed, **WHERE)
            stack.append(image.illuminance_lux.values)
            reported.append(image.dataset["illuminance_standard_error"].values)
        spread = float(np.sqrt(np.mean(np.var(stack, axis=0, ddof=1))))
        honesty = spread / float(np.sqrt(np.mean(np.square(reported))))
        show(f"{name}: slopes {slopes[0]:.2f} (rms), {slopes[1]:.2f} (median)", rows)
        print(f"  spread over {seeds} seeds / reported error: {honesty:.3f}")
        results[name] = {
            "points": points,
            "slope_rms": slopes[0],
            "slope_median": slopes[1],
            "spread_over_reported": honesty,
            "reference_spp": 64 * COUNTS[-1],
            "reference_error": reference.relative_error,
        }
    path = save(
        "convergence",
        {"command": "python benchmarks/convergence.py", "seeds": seeds, "results": results},
    )
    print(f"\n{path.name} written")


if __name__ == "__main__":
    main()
