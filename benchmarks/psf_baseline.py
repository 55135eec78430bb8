"""PSF baselines: layers blurred by isetcl and by scipy.signal.fftconvolve, in one run.

512 x 512 pixels, 31 wavelengths, 16 cards at 16 depths, wave PSFs that were made before. The plain
version has the same layers and PSFs, does the same sums, and blurs every layer at every wavelength
by `scipy.signal.fftconvolve` in single precision; it is timed at every eighth wavelength and
counted for all. A whole render takes the views of the scene as well. Memory is that of a process of
its own, of a whole render.

With `--deeplens PYTHON`, an interpreter that has the package deeplens-core, its layered rendering
`conv_psf_occlusion` of the same layers joins in, by a process of that interpreter. Its method is
M5, and so is isetcl's here, and it knows no shares: every sample is given to the layer that has
most of it, for both. It convolves directly with the square kernels, all as large as the largest,
where both others use Fourier transforms: it is timed once, at one wavelength, and counted for all.
deeplens-core 2.5.6 is under the Apache licence 2.0 and needs Python 3.12 and torch.
"""

from __future__ import annotations

import argparse
import json
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from common import save, show, versions
from scipy.signal import fftconvolve

import isetcl as ic
from isetcl.psf_baseline import Psf, PsfBank, PsfCache, methods
from isetcl.psf_baseline.depths import plan_depths
from isetcl.psf_baseline.patch_image import Job
from isetcl.psf_baseline.patches import tiles
from isetcl.psf_baseline.view import Layer
from isetcl.scene.basis import spectral_basis

METHODS = ("layered_sum", "layered_over")
FOV_DEG = 10.0
STRIDE = 8


def cards(count: int) -> ic.Scene:
    """A wide card far away and small ones before it, at even steps of vergence."""
    rng = np.random.default_rng(1)
    y, x = np.mgrid[0:128, 0:128] / 128.0
    objects = []
    for i, vergence in enumerate(np.linspace(0.25, 3.0, count)):
        depth = 1.0 / vergence
        half = np.tan(np.radians(12.0 if i == 0 else 2.0)) * depth
        angle = np.zeros(2) if i == 0 else rng.uniform(-4.0, 4.0, 2)
        cx, cy = np.tan(np.radians(angle)) * depth
        picture = ic.Image(0.5 + 0.4 * np.sin((20 + 5 * i) * x + i) * np.sin(25 * y))
        shape = ic.Quad((cx - half, cy - half, -depth), (2 * half, 0, 0), (0, 2 * half, 0))
        light = ic.Emission(ic.Spectrum.equal_energy(100.0), picture)
        objects.append(ic.SceneObject(f"card {i}", shape, light))
    return ic.Scene(tuple(objects))


def scene_options(args: argparse.Namespace) -> dict[str, object]:
    return {
        "fov_deg": FOV_DEG,
        "resolution": args.resolution,
        "wavelengths_nm": np.linspace(400.0, 700.0, args.wavelengths),
    }


def make_job(args: argparse.Namespace, method: str, cache: PsfCache) -> Job:
    scene, eye = cards(args.layers), ic.eyes.navarro(4.0, 1.0)
    wavelengths = np.linspace(400.0, 700.0, args.wavelengths)
    grid = ic.RetinalGrid.of(eye, FOV_DEG, args.resolution)
    bank = PsfBank(eye, args.psf, grid.pitch_deg[0] / 2, cache=cache)
    depths = plan_depths(scene, grid, "auto", wavelengths, bank, 0.0)
    basis = spectral_basis(scene, wavelengths)
    return Job(
        scene, grid, wavelengths, basis, depths, bank, methods()[method], "auto", 2, None, None, 0.0
    )


Layers = tuple[list[list[Psf]], list[Layer], list[int]]


def taken(job: Job) -> Layers:
    """PSFs, layers and their numbers."""
    (patch,) = tiles(job.grid, 1)
    psfs = job.psfs(patch)
    return psfs, *job.layers(job.view(patch, psfs))


def plain(job: Job, every: int, of: Layers) -> list[np.ndarray]:
    """The method by its formula, one layer after another, at some wavelengths."""
    psfs, layers, numbers = of
    images = []
    for i in range(0, len(psfs), every):
        mix = job.basis.spectra[:, i].astype(np.float32)
        image = np.zeros(layers[0].coverage.shape, dtype=np.float32)
        for k, layer in zip(numbers, layers, strict=True):
            kernel = psfs[i][k].kernel.astype(np.float32)
            outside = np.float32(psfs[i][k].energy_outside)
            sharp = np.tensordot(mix, layer.colour, axes=1)
            colour = fftconvolve(sharp, kernel, mode="same") + outside * sharp.mean()
            if job.method.name == "layered_over":
                cover = fftconvolve(layer.coverage, kernel, mode="same")
                image = image * (1.0 - cover - outside * layer.coverage.mean())
            image = image + colour
        images.append(image)
    return images


def ours(job: Job, of: Layers) -> list[np.ndarray]:
    """The same by isetcl, without the way onto the retina."""
    from concurrent.futures import ThreadPoolExecutor

    from isetcl.psf_baseline.convolve import WORKERS, LayerSpectra, SpectralBlur

    psfs, layers, numbers = of
    spectra = LayerSpectra(layers)

    def at(i: int) -> np.ndarray:
        mix = job.basis.spectra[:, i].astype(np.float32)
        own = [psfs[i][k] for k in numbers]
        return job.method.combine(SpectralBlur(spectra, own, None, mix), len(layers))[0]

    with ThreadPoolExecutor(WORKERS) as pool:
        return list(pool.map(at, range(len(psfs))))


def deeplens(job: Job, of: Layers, args: argparse.Namespace, folder: str) -> dict[str, object]:
    """M5 by DeepLens at the middle wavelength, counted for all, and by isetcl at all."""
    psfs, layers, numbers = of
    hard = one_layer_each(layers)
    i = len(psfs) // 2
    mix = job.basis.spectra[:, i].astype(np.float32)
    own = [psfs[i][k] for k in numbers]
    reach = max(psf.radius for psf in own)
    path = str(Path(folder) / "layers.npz")
    np.savez(
        path,
        picture=sum(np.tensordot(mix, layer.colour, axes=1) for layer in hard),
        layer=np.argmax([layer.coverage for layer in hard], axis=0),
        psfs=np.stack([np.pad(p.kernel, reach - p.radius) for p in own]).astype(np.float32),
    )
    peer = Path(__file__).with_name("deeplens_peer.py")
    command = [args.deeplens, str(peer), path]
    found = json.loads(
        subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()[-1]
    )
    image = ours(job, (psfs, hard, numbers))
    times = [seconds(lambda: ours(job, (psfs, hard, numbers))) for _ in range(args.rounds)]
    # Beyond the view it has nothing, isetcl the mean of the view.
    inner = (slice(2 * reach, -2 * reach),) * 2
    away = np.abs(image[i] - np.load(f"{path}.npy"))[inner]
    return {
        "deeplens_s": found["seconds"] * len(psfs),
        "blur_s": statistics.median(times),
        "kernel_samples": 2 * reach + 1,
        "largest_difference": float(away.max()) / float(np.mean(image[i])),
        "versions": found["versions"] | {"python": found["python"]},
    }


def one_layer_each(layers: list[Layer]) -> list[Layer]:
    """Layers of samples that belong to one alone, of the whole radiance."""
    most = np.argmax([layer.coverage for layer in layers], axis=0)
    colour = sum(layer.colour for layer in layers)
    return [
        Layer(layer.vergence_dpt, colour * (most == k), (most == k).astype(np.float32))
        for k, layer in enumerate(layers)
    ]


def seconds(function: Callable[[], object]) -> float:
    start = time.perf_counter()
    function()
    return time.perf_counter() - start


def peak(args: argparse.Namespace, folder: str, method: str, **changes: object) -> dict[str, float]:
    """Seconds and largest memory of a whole render in a new process."""
    values = {**vars(args), **changes, "folder": folder, "method": method}
    code = "import json, sys, psf_baseline as b; b.child(json.loads(sys.argv[1]))"
    output = subprocess.run(
        [sys.executable, "-c", code, json.dumps(values)],
        cwd=Path(__file__).parent,
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    return json.loads(output.splitlines()[-1])


def child(values: dict[str, object]) -> None:
    args = argparse.Namespace(**values)
    scene, eye = cards(args.layers), ic.eyes.navarro(4.0, 1.0)
    cache = PsfCache(Path(args.folder))
    took = []
    for _ in range(2):
        start = time.perf_counter()
        ic.psf_baseline.render(
            scene, eye, method=args.method, psf=args.psf, psf_cache=cache, **scene_options(args)
        )
        took.append(time.perf_counter() - start)
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(json.dumps({"seconds": took[-1], "peak_mb": used}))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--resolution", type=int, default=512)
    parser.add_argument("--wavelengths", type=int, default=31)
    parser.add_argument("--layers", type=int, default=16)
    parser.add_argument("--psf", default="wave")
    parser.add_argument("--deeplens", metavar="PYTHON")
    args = parser.parse_args()
    results: dict[str, dict[str, float]] = {}
    ratios, differences = {}, {}
    with tempfile.TemporaryDirectory() as folder:
        for method in METHODS:
            job = make_job(args, method, PsfCache(Path(folder)))
            of = taken(job)
            expected = plain(job, STRIDE, of)
            found = ours(job, of)[::STRIDE]
            (patch,) = tiles(job.grid, 1)
            view = job.view(patch, job.psfs(patch))
            inner = slice(view.margin, -view.margin)
            level = float(np.mean(expected[0]))
            differences[method] = max(
                float(np.abs(a - b)[inner, inner].max()) / level
                for a, b in zip(found, expected, strict=True)
            )
            times: dict[str, list[float]] = {"isetcl": [], "fftconvolve": []}
            share = args.wavelengths / len(expected)
            for _ in range(args.rounds):
                times["isetcl"].append(seconds(lambda j=job, x=of: ours(j, x)))
                times["fftconvolve"].append(seconds(lambda j=job, x=of: plain(j, STRIDE, x)))
            blur = statistics.median(times["isetcl"])
            other = share * statistics.median(times["fftconvolve"])
            whole = peak(args, folder, method)
            results[method] = {
                "blur_s": blur,
                "fftconvolve_s": other,
                "render_s": whole["seconds"],
                "render_peak_mb": whole["peak_mb"],
            }
            ratios[method] = other / blur
        peer = None
        if args.deeplens is not None:
            job = make_job(args, "layered_over_visible", PsfCache(Path(folder)))
            peer = deeplens(job, taken(job), args, folder)
        large = {"resolution": 1024, "layers": 41, "wavelengths": 3, "psf": "geometric"}
        results["layered_over, 1024 x 1024, 41 layers, 3 wavelengths"] = {
            f"render_{k}" if k == "peak_mb" else "render_s": v
            for k, v in peak(args, folder, "layered_over", **large).items()
        }
    show(
        "seconds",
        [("", "blur", "fftconvolve", "render", "peak MB")]
        + [
            (n, *(r.get(k, "-") for k in ("blur_s", "fftconvolve_s", "render_s", "render_peak_mb")))
            for n, r in results.items()
        ],
    )
    show("times faster than fftconvolve", [("", "times"), *ratios.items()])
    show("largest difference, of the mean", [("", "share"), *differences.items()])
    if peer is not None:
        ratios_of_deeplens = peer["deeplens_s"] / peer["blur_s"]
        show("DeepLens, layered_over_visible", [("", "value"), *peer.items()])
        show("times faster than DeepLens", [("", "times"), ("", ratios_of_deeplens)])
    path = save(
        "psf_baseline",
        {
            "command": "python benchmarks/psf_baseline.py",
            "versions": versions("scipy"),
            "results": results,
            "times_of_fftconvolve_over_ours": ratios,
            "largest_difference": differences,
            "deeplens": peer,
        },
    )
    print(f"{path.name} written")


if __name__ == "__main__":
    main()
