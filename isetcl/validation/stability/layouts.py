"""Cases 34 to 38: the same bits whatever the layout, and rays that are no rays."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from isetcl.device.devices import list_devices
from isetcl.eye import catalog
from isetcl.eye.model import Eye
from isetcl.eye.prescription import elements
from isetcl.eye.rays import RayStatus
from isetcl.render.trace import trace_rays
from isetcl.validation.stability.case import Bench, NotApplicableError, case
from isetcl.validation.stability.eyes import WAVELENGTH_NM, field_rays

_FIELDS = (0.0, 25.0, 50.0, 75.0, 95.0)


def _different(one: np.ndarray, other: np.ndarray) -> int:
    """Numbers that are not the same bits."""
    return int(np.sum(one != other))


@case(34, "mirrored rays", "mirrored bits", "numbers different", single=0, double=0)
def _mirrored(bench: Bench) -> int:
    flip = np.array([-1.0, 1.0, 1.0])
    sequence = elements(catalog.arizona(8.0), WAVELENGTH_NM)
    origins, directions = bench.rays(*field_rays(_FIELDS, 16))
    one = bench.trace(sequence, origins, directions)
    other = bench.trace(sequence, origins * flip, directions * flip)
    return _different(one.positions_mm * flip, other.positions_mm) + _different(
        one.status, other.status
    )


@case(35, "rays in another order, lanes of other widths", "the same bits", "numbers different",
      single=0, double=0)  # fmt: skip
def _reordered(bench: Bench) -> tuple[int, str]:
    sequence = elements(catalog.navarro(8.0), WAVELENGTH_NM)
    origins, directions = bench.rays(*field_rays(_FIELDS, 40))
    one = bench.trace(sequence, origins, directions)
    order = np.random.default_rng(3).permutation(len(origins))
    mixed = bench.trace(sequence, origins[order], directions[order])
    different = _different(one.positions_mm[order], mixed.positions_mm)
    widths = (1, 8, 16) if bench.device.is_cpu and not bench.device.is_interpreter else ()
    for width in widths:
        other = bench.trace(sequence, origins, directions, width=width)
        different += _different(one.positions_mm, other.positions_mm)
        different += _different(one.status, other.status)
    return different, f"widths {widths}" if widths else "one lane only here"


@case(36, "another OpenCL implementation", "the same points", "spacings of 24 mm",
      single=4.0, double=16.0)  # fmt: skip
def _elsewhere(bench: Bench) -> tuple[float, str]:
    sequence = elements(catalog.navarro(8.0), WAVELENGTH_NM)
    rays = bench.rays(*field_rays(_FIELDS[:-1], 40))
    own = bench.trace(sequence, *rays)
    worst, names = 0.0, []
    for device in list_devices():
        if device.index == bench.device.index:
            continue
        if bench.precision == "double" and not device.has_double:
            continue
        other = Bench(device, bench.precision).trace(sequence, *rays)
        both = own.passed & other.passed
        if both.sum() < 0.9 * max(own.passed.sum(), other.passed.sum()):
            return math.inf, f"other rays pass on {device.name}"
        apart = np.abs(own.positions_mm - other.positions_mm)[both].max()
        worst = max(worst, float(apart) / float(np.spacing(bench.real.type(24.0))))
        names.append(device.platform)
    if not names:
        raise NotApplicableError("only one device is present")
    return worst, ", ".join(names)


@case(37, "NaN, infinite, zero, denormal and unnormalised rays", "flagged, neighbours unharmed",
      "rays wrong", single=0, double=0)  # fmt: skip
def _no_rays(bench: Bench) -> int:
    def run(origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rays = trace_rays(
            catalog.navarro(4.0),
            origins,
            directions,
            WAVELENGTH_NM,
            precision=bench.precision,
            record_hits=False,
            device=bench.device.index,
        )
        return rays.status, rays.positions_mm

    good = np.array([0.1, 0.5, -1.0]), np.array([0.01, 0.0, 1.0])
    bad = [
        (np.array([np.nan, 0, -1.0]), good[1]),
        (np.array([0, 0, np.inf]), good[1]),
        (good[0], np.zeros(3)),
        (good[0], np.array([0.0, np.nan, 1.0])),
        (good[0], np.array([-np.inf, 0.0, 1.0])),
    ]
    # Any length will do, and what is almost nothing counts as nothing.
    same = [(good[0], 7.5 * good[1]), (good[0], 1e-12 * good[1])]
    tiny = [(np.array([1e-40, 1e-320, -1.0]), np.array([1e-40, 0.0, 1.0]))]
    rows = [row for pair in zip(bad, [good] * len(bad), strict=True) for row in pair]
    rows += same + tiny
    status, positions = run(*(np.array(part) for part in zip(*rows, strict=True)))
    alone = run(good[0][None], good[1][None])[1]
    n = 2 * len(bad)
    wrong = int(np.sum(status[:n:2] != RayStatus.INVALID)) + int(np.sum(~np.isfinite(positions)))
    wrong += int(np.sum(status[1:n:2] != RayStatus.OK)) + int(np.sum(positions[1:n:2] != alone))
    limit = 1e-5 if bench.precision == "single" else 1e-12
    wrong += int(np.sum(np.abs(positions[n:-1] - alone) > limit))
    return wrong + int(np.abs(positions[-1, :2]).max() > limit)


@case(38, "a ray exactly on the edge of the stop", "passes", "rays wrong", single=0, double=0)
def _on_the_edge(bench: Bench) -> int:
    eye = catalog.navarro(4.0)
    stop = dataclasses.replace(elements(eye, WAVELENGTH_NM)[eye.stop_index], vertex_z_mm=0.0)
    assert isinstance(eye, Eye)
    radius = stop.semi_diameter_mm
    spacing = float(np.spacing(bench.real.type(radius)))
    heights = np.array([radius, -radius, radius + spacing, radius - spacing])
    origins = np.stack([0 * heights, heights, 0 * heights - 1.0], axis=1)
    got = bench.trace((stop,), origins, np.tile([0.0, 0.0, 1.0], (4, 1)))
    expected = [RayStatus.OK, RayStatus.OK, RayStatus.STOPPED, RayStatus.OK]
    return int(np.sum(got.status != expected))
