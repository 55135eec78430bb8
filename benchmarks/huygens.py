"""Huygens' PSF of 128 x 128 rays onto 128 x 128 points: the kernel against optiland's, in one run.

The same Navarro eye (2 mm stop, in focus, 550 nm, on the axis) in both programs. "sum" is the
summation alone, with its copies to and from the device; "whole" starts from the eye, so that rays
and wavefront are part of it. optiland's sum is compiled by numba (parallel, fast-math) and uses
all processors, as the kernel does. Runs alternate.
"""

from __future__ import annotations

import argparse
import statistics
from collections.abc import Callable
from typing import Any

import numpy as np
from common import interleave, save, show, versions

import isetcl as ic
from isetcl.device.choose import find_device
from isetcl.device.huygens import HuygensSum
from isetcl.eye.waves.diffraction_psf import visual_angles_deg

SIZE = 128
FOV_ARCMIN = 10.0
WAVELENGTH_NM = 550.0
OURS = ("double", "single")


def in_focus() -> ic.Eye:
    """Navarro's eye with a retina where the rays of a 2 mm stop meet best, flat as optiland's."""
    eye = ic.eyes.navarro(2.0)
    front = eye.wavefront(0.0, WAVELENGTH_NM, reference="best_focus")
    return ic.Eye(eye.name, eye.surfaces, eye.stop, ic.Retina(float(front.centre_mm[2]), 0.0))


def optiland_eye(eye: ic.Eye) -> Any:
    """The same surfaces in optiland."""
    from optiland.materials import IdealMaterial
    from optiland.optic import Optic

    optic = Optic()
    index = eye.indices(WAVELENGTH_NM)
    parts = [
        (s.vertex_z_mm, s.radius_mm, s.conic, float(n), False)
        for s, n in zip(eye.surfaces, index[1:], strict=True)
    ]
    parts.insert(eye.stop_index, (eye.stop.z_mm, np.inf, 0.0, float(index[eye.stop_index]), True))
    ends = [part[0] for part in parts[1:]] + [eye.retina.vertex_z_mm]
    optic.surfaces.add(index=0, thickness=np.inf)
    for i, ((z, radius, conic, n, is_stop), end) in enumerate(zip(parts, ends, strict=True)):
        optic.surfaces.add(
            index=i + 1,
            radius=radius,
            conic=conic,
            thickness=end - z,
            material=IdealMaterial(n),
            is_stop=is_stop,
        )
    optic.surfaces.add(index=len(parts) + 1)
    optic.set_aperture("float_by_stop_size", eye.stop.diameter_mm)
    optic.fields.set_type("angle")
    optic.fields.add(y=0)
    optic.wavelengths.add(value=WAVELENGTH_NM / 1000.0, is_primary=True)
    return optic


def optiland_psf(optic: Any, pitch_mm: float) -> Any:
    from optiland.psf import HuygensPSF

    return HuygensPSF(
        optic,
        (0, 0),
        WAVELENGTH_NM / 1000.0,
        num_rays=SIZE,
        image_size=SIZE,
        pixel_pitch=pitch_mm,
    )


def optiland_sum(psf: Any) -> Callable[[], object]:
    """The summation of an optiland PSF alone."""
    data = psf.get_data((0, 0), WAVELENGTH_NM / 1000.0)
    wavelength_mm = WAVELENGTH_NM * 1e-6
    image = psf._get_image_coordinates()
    amplitude, opd = np.sqrt(data.intensity), data.opd * wavelength_mm
    return lambda: psf._summation_strategy.compute(
        *image,
        data.pupil_x,
        data.pupil_y,
        data.pupil_z,
        amplitude,
        opd,
        wavelength_mm,
        data.radius,
        data.reference_center,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=7)
    rounds = parser.parse_args().rounds
    eye, device = in_focus(), find_device()
    front = eye.wavefront(0.0, WAVELENGTH_NM, samples=SIZE)
    v = visual_angles_deg(front, FOV_ARCMIN, SIZE)
    candidates: dict[str, Callable[[], object]] = {}
    for precision in OURS:
        ours = HuygensSum(device, front, v, -v, precision)
        candidates[f"isetcl {precision}, sum"] = ours.run
        candidates[f"isetcl {precision}, whole"] = lambda p=precision: ic.huygens_psf(
            eye.wavefront(0.0, WAVELENGTH_NM, samples=SIZE), FOV_ARCMIN, SIZE, precision=p
        )
    difference = None
    try:
        optic = optiland_eye(eye)
        pitch_mm = FOV_ARCMIN / 60.0 * float(np.linalg.norm(front.mm_per_deg[1])) / SIZE
        # optiland's grid has its outermost points on the border of the image.
        theirs = optiland_psf(optic, pitch_mm * (SIZE - 1) / SIZE)
        candidates["optiland double, sum"] = optiland_sum(theirs)
        candidates["optiland double, whole"] = lambda: optiland_psf(optic, pitch_mm)
        mine = ic.huygens_psf(front, FOV_ARCMIN, SIZE).density_per_arcmin2
        difference = float(np.max(np.abs(theirs.psf / np.max(theirs.psf) - mine / np.max(mine))))
    except ImportError:
        pass
    timings = interleave(candidates, rounds)
    rays = int(np.count_nonzero(front.inside))
    pairs = rays * SIZE * SIZE
    results = {name: timing.summary(pairs) for name, timing in timings.items()}
    ratios = {
        f"{precision}, {part}": statistics.median(timings[f"optiland double, {part}"].wall_s)
        / statistics.median(timings[f"isetcl {precision}, {part}"].wall_s)
        for precision in OURS
        for part in ("sum", "whole")
        if "optiland double, sum" in timings
    }
    show(
        f"{rays} rays onto {SIZE} x {SIZE} points",
        [("", "seconds", "M pairs/s", "CPU ns/pair", "spread")]
        + [
            (
                n,
                statistics.median(timings[n].wall_s),
                r["million_per_s_median"],
                r["cpu_ns_each_median"],
                r["spread"],
            )
            for n, r in results.items()
        ],
    )
    show("wall time of optiland over ours", [("", "times"), *ratios.items()])
    print(f"\nlargest difference of the PSFs, of their peaks: {difference}")
    path = save(
        "huygens",
        {
            "command": "python benchmarks/huygens.py",
            "rays": rays,
            "points": SIZE * SIZE,
            "versions": versions("optiland", "numba"),
            "seconds": {n: statistics.median(t.wall_s) for n, t in timings.items()},
            "results": results,
            "wall_time_of_optiland_over_ours": ratios,
            "largest_difference": difference,
        },
    )
    print(f"{path.name} written")


if __name__ == "__main__":
    main()
