"""Excitations of cones: how long many frames take, and rendering at the cones against images.

Two questions. How long do 100 000 cones, 31 wavelengths and 100 frames of an eye that moves take,
by a fixation with drift and microsaccades, or by gazes all over the place, which share no pixels?
Beside it, in the same run, what a user could do with numpy and scipy instead, as ISETBio does:
weigh the image by the three pigments, blur it by the median aperture, and interpolate it at every
cone in every frame; with how far that is from the means over the cones' own apertures, and how far
single precision is from double.

And which way to the excitations of a still scene is nearer to the truth after the same time: an
image that all cones look at, or rays traced to the apertures alone? Errors are root mean squares
over the cones, relative to their mean, against many samples at the apertures with another seed.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from common import interleave, machine, save, show, versions

import isetcl as ic
from isetcl.cones.light_catch import LightCatch
from isetcl.cones.viewing import Viewing

WAVES = np.arange(400.0, 701.0, 10.0)
EYE = ic.eyes.navarro(pupil_diameter_mm=3.0, accommodation_dpt=1.0)
SCATTER_DEG = 0.8


def many_frames(cones: int, frames: int, pixels: int, rounds: int) -> dict[str, Any]:
    """Time of the excitations of a moving eye, and that of a blurred image interpolated."""
    side = 9.0
    mosaic = ic.cones.mosaic(side)
    near = np.argsort(mosaic.eccentricity_deg, kind="stable")[:cones]
    mosaic = mosaic.select(np.sort(near))
    random = np.random.default_rng(0)
    walk = ic.cones.eye_movements(0.005 * frames, 0.005, seed=1, microsaccades="statistics").path()
    values = random.uniform(1e-4, 1e-3, (len(WAVES), pixels, pixels)).astype(np.float32)
    grid = ic.RetinalGrid.of(EYE, side + 2.0, pixels)
    image = ic.RetinalImage.from_arrays(grid, WAVES, values)
    scattered = random.uniform(-SCATTER_DEG, SCATTER_DEG, (frames, 2))
    candidates: dict[str, Callable[[], np.ndarray]] = {
        "isetcl": lambda: mosaic.excitations(image, gaze_deg=walk).mean.values,
        "isetcl, gazes all over": lambda: mosaic.excitations(image, gaze_deg=scattered).mean.values,
        "blur and interpolate": lambda: blurred(mosaic, image, walk),
    }
    timings = interleave(candidates, rounds)
    exact, other = candidates["isetcl"](), candidates["blur and interpolate"]()
    some = slice(None, None, max(1, len(mosaic) // 2000))
    double = mosaic.select(np.arange(len(mosaic))[some]).excitations(
        image, gaze_deg=walk, precision="double"
    )
    return {
        "cones": len(mosaic),
        "frames": frames,
        "wavelengths": len(WAVES),
        "pixels": pixels,
        "seconds": {name: float(np.median(t.wall_s)) for name, t in timings.items()},
        "cpu_seconds": {name: float(np.median(t.cpu_s)) for name, t in timings.items()},
        "difference_relative_rms": rms(other - exact) / float(exact.mean()),
        "single_from_double_most": float(np.abs(exact[:, some] / double.mean.values - 1.0).max()),
    }


def blurred(mosaic: Any, image: ic.RetinalImage, gaze_deg: np.ndarray) -> np.ndarray:
    """Excitations from an image blurred by the median aperture, (frames, cones).

    Macular pigment and outer segments are those of each cone, as one factor of its own; the
    spectrum of that factor is left out, as ISETBio leaves it out. What no cone looks at is cut off.
    """
    from scipy.ndimage import map_coordinates
    from scipy.signal import oaconvolve

    catch = LightCatch(mosaic, image, Viewing())
    efficiency = catch.efficiencies(slice(None))
    radius = float(np.median(catch.apertures[:, 2]))
    half = int(np.ceil(radius))
    rows, columns = np.mgrid[-half : half + 1, -half : half + 1]
    disc = (np.hypot(rows, columns) <= radius).astype(np.float32)
    result = np.empty((len(gaze_deg), len(mosaic)), dtype=np.float32)
    shifts = catch.shifts(gaze_deg)
    middle = catch.apertures[:, :2]
    first = np.maximum(0, middle.min(axis=0) + shifts.min(axis=0) - half - 2).astype(int)
    end = (middle.max(axis=0) + shifts.max(axis=0) + half + 2).astype(int)
    values = image.irradiance.values[:, first[1] : end[1], first[0] : end[0]]
    for kind in range(3):
        own = mosaic.types == kind
        typical = efficiency[own].mean(axis=0)
        factor = efficiency[own].sum(axis=1) / typical.sum()
        seen = np.tensordot(typical.astype(np.float32), values, axes=1)
        seen = oaconvolve(seen, disc / disc.sum(), mode="same")
        at = middle[own] - first - 0.5
        for frame, (right, down) in enumerate(shifts):
            places = np.stack([at[:, 1] + down, at[:, 0] + right])
            found = map_coordinates(seen, places, order=1, mode="nearest")
            result[frame, own] = 0.005 * factor * found
    return result


def rms(values: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values, dtype=np.float64))))


def cases(is_small: bool) -> dict[str, tuple[ic.Scene, Any, tuple[float, float], float]]:
    """Scene, mosaic, its middle, and the field of an image around it."""
    fovea, away = (0.2, 0.5) if is_small else (0.5, 2.0)
    edge, planes = ic.scenes.slanted_edge(1.0), ic.scenes.two_planes(0.5, 2.0)
    return {
        f"edge, {fovea:g} deg in the fovea": (
            edge, ic.cones.mosaic(fovea), (0.0, 0.0), 1.06 * fovea,
        ),
        f"two planes, {fovea:g} deg in the fovea": (
            planes, ic.cones.mosaic(fovea), (0.0, 0.0), 1.06 * fovea,
        ),
        f"two planes, {away:g} deg, 8 deg away": (
            planes, ic.cones.mosaic(away, (8.0, 0.0)), (8.0, 0.0), 1.06 * away,
        ),
    }  # fmt: skip


def error_against_time(is_small: bool, rounds: int) -> dict[str, Any]:
    """For each case, points (seconds, error) of both ways."""
    samples = (16, 64) if is_small else (64, 512, 4096)
    found = {}
    for name, (scene, mosaic, middle, field) in cases(is_small).items():
        reference = mosaic.excitations(
            ic.render(scene, EYE, at=mosaic, spp=2048 if is_small else 1 << 15, seed=77),
            media="as_is",
        ).mean.values[0]
        finest = 1e3 * float(mosaic.aperture_deg.min())
        ways: dict[str, list[dict[str, float]]] = {}
        candidates: dict[str, Callable[[], np.ndarray]] = {}
        told: dict[str, tuple[str, int]] = {}
        for spp in samples:
            key = f"at the cones, {spp}"
            told[key] = ("at the cones", spp)
            candidates[key] = at_the_cones(scene, mosaic, spp)
            for per_aperture in (1, 3):
                pixels = int(np.ceil(1e3 * field / finest * per_aperture))
                way = f"image, {per_aperture} pixels per smallest aperture"
                # The same samples in an aperture, or nearly so.
                each = max(2, spp // per_aperture**2)
                key = f"{way}, {each}"
                told[key] = (way, each)
                candidates[key] = by_image(scene, mosaic, (middle, field, pixels), each)
        timings = interleave(candidates, rounds)
        for key, run in candidates.items():
            way, spp = told[key]
            ways.setdefault(way, []).append(
                {
                    "spp": spp,
                    "seconds": float(np.median(timings[key].wall_s)),
                    "error": rms(run() - reference) / float(reference.mean()),
                }
            )
        found[name] = {"cones": len(mosaic), "ways": ways, "ratios": ratios(ways)}
    return found


def at_the_cones(scene: ic.Scene, mosaic: Any, spp: int) -> Callable[[], np.ndarray]:
    """Excitations by rays to the apertures, ready to run."""

    def run() -> np.ndarray:
        light = ic.render(scene, EYE, at=mosaic, spp=spp, progress=False)
        return np.asarray(mosaic.excitations(light, media="as_is").mean.values[0])

    return run


def by_image(
    scene: ic.Scene, mosaic: Any, view: tuple[tuple[float, float], float, int], spp: int
) -> Callable[[], np.ndarray]:
    """Excitations by an image, ready to run."""
    middle, field, pixels = view

    def run() -> np.ndarray:
        image = ic.render(
            scene,
            EYE,
            fov_deg=field,
            resolution=pixels,
            centre_deg=middle,
            spp=spp,
            progress=False,
        )
        return np.asarray(mosaic.excitations(image, media="as_is").mean.values[0])

    return run


def ratios(ways: dict[str, list[dict[str, float]]]) -> dict[str, float]:
    """How many times longer an image takes to the smallest error that both ways reach."""
    found = {}
    own = ways["at the cones"]
    for way, points in ways.items():
        if way == "at the cones":
            continue
        target = max(min(p["error"] for p in points), min(p["error"] for p in own))
        times = [time_to(target, each) for each in (points, own)]
        found[way] = times[0] / times[1]
    return found


def time_to(error: float, points: list[dict[str, float]]) -> float:
    """Seconds to an error, on straight lines between the logarithms."""
    order = sorted(points, key=lambda p: p["error"])
    errors = np.log([p["error"] for p in order])
    return float(np.exp(np.interp(np.log(error), errors, np.log([p["seconds"] for p in order]))))


def main() -> None:
    """Run, print and save."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--small", action="store_true", help="a quick look; nothing is saved")
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    before = machine()
    start = time.perf_counter()
    size = (20000, 20, 512) if arguments.small else (100000, 100, 1536)
    frames = many_frames(*size, arguments.rounds)
    studies = error_against_time(arguments.small, arguments.rounds)
    show(
        f"{frames['cones']} cones, {frames['frames']} frames",
        [("way", "s", "CPU s")]
        + [(k, s, frames["cpu_seconds"][k]) for k, s in frames["seconds"].items()],
    )
    print(f"  blur and interpolate differs by {frames['difference_relative_rms']:.2g} (r.m.s.)")
    print(f"  single from double precision by {frames['single_from_double_most']:.2g} at most")
    for name, study in studies.items():
        rows: list[tuple[object, ...]] = [("way", "spp", "s", "error")]
        for way, points in study["ways"].items():
            rows += [(way, p["spp"], p["seconds"], p["error"]) for p in points]
        show(f"{name}: {study['cones']} cones", rows)
        for way, ratio in study["ratios"].items():
            print(f"  {way}: {ratio:.2g} times as long to the same error")
    if not arguments.small:
        record = {
            "seconds_in_all": time.perf_counter() - start,
            "load_before": before["load_before"],
            "versions": versions("scipy"),
            "many_frames": frames,
            "error_against_time": studies,
        }
        print(save("cones", record))


if __name__ == "__main__":
    main()
