"""Cases 12 and 18 to 28: whole eyes, and where light comes from."""

from __future__ import annotations

import dataclasses
import decimal
import math
from decimal import Decimal

import numpy as np

from isetcl.eye import catalog
from isetcl.eye.object_point import ObjectPoint
from isetcl.eye.prescription import Element, elements
from isetcl.render.trace import trace_rays
from isetcl.scene.gaze import seen_from
from isetcl.scene.material import Emission
from isetcl.scene.model import Quad, Scene, SceneObject, Sphere
from isetcl.spectrum import Spectrum
from isetcl.validation.stability import fifty_digits
from isetcl.validation.stability.case import UM_PER_MM, Bench, case

WAVELENGTH_NM = 550.0
_WAVE_MM = WAVELENGTH_NM * 1e-6


def field_rays(fields_deg: tuple[float, ...], count: int, reach_mm: float = 0.9) -> tuple[
    np.ndarray, np.ndarray
]:  # fmt: skip
    """Rays from field angles towards places of the entrance pupil, (n, 3) each."""
    rng = np.random.default_rng(7)
    origins, directions = [], []
    for field in fields_deg:
        angle = math.radians(field)
        for _ in range(count):
            d = np.array([0.0, math.sin(angle), math.cos(angle)])
            origins.append(np.array([*rng.uniform(-reach_mm, reach_mm, 2), 2.6]) - 12.0 * d)
            directions.append(d)
    return np.array(origins), np.array(directions)


def exact_error_um(
    bench: Bench, sequence: tuple[Element, ...], origins: np.ndarray, directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Distances from the exact points on the retina, um, infinite where one side loses the ray.

    The second result is the exact points, mm; NaN for lost rays.
    """
    origins, directions = bench.rays(origins, directions)
    got = bench.trace(sequence, origins, directions)
    errors, points = np.zeros(len(origins)), np.full((len(origins), 3), np.nan)
    for i, (o, d) in enumerate(zip(origins, directions, strict=True)):
        exact = fifty_digits.trace(sequence, o, d, 1)
        if (exact is not None) != bool(got.passed[i]):
            errors[i] = np.inf
        elif exact is not None:
            parts = [
                float(v - Decimal(w.item()))
                for v, w in zip(exact[0], got.positions_mm[i], strict=True)
            ]
            errors[i] = UM_PER_MM * math.hypot(*parts)
            points[i] = [float(v) for v in exact[0]]
    return errors, points


@case(12, "an axial ray through all vertices", "x = y = 0 and L = M = 0 exactly", "mm and 1",
      single=0.0, double=0.0)  # fmt: skip
def _axial(bench: Bench) -> float:
    worst = 0.0
    for name in ("navarro", "arizona", "legrand"):
        sequence = elements(catalog.by_name(name, 4.0), WAVELENGTH_NM)
        got = bench.trace(sequence, np.array([[0.0, 0.0, -5.0]]), np.array([[0.0, 0.0, 1.0]]))
        off = [*got.positions_mm[0, :2], *got.directions[0, :2], float(not got.passed[0])]
        worst = max(worst, float(np.abs(off).max()))
    return worst


@case(18, "fields of 90, 95, 100 and 105 deg", "reach the retina", "um", single=0.03, double=3e-10)
def _wide_fields(bench: Bench) -> tuple[float, str]:
    sequence = elements(catalog.navarro(8.0), WAVELENGTH_NM)
    rays = field_rays((90.0, 95.0, 100.0, 105.0), 16)
    errors, points = exact_error_um(bench, sequence, *rays)
    passed = int(np.isfinite(points[:, 0]).sum())
    return (
        float(errors.max()) if passed >= 8 else math.inf
    ), f"{passed} of {len(errors)} rays reach it"


@case(19, "retina met behind its equator", "the far hit", "um", single=0.03, double=3e-10)
def _behind_equator(bench: Bench) -> tuple[float, str]:
    eye = catalog.navarro(4.0)
    sequence = elements(eye, WAVELENGTH_NM)
    errors, points = exact_error_um(bench, sequence, *field_rays((75.0, 85.0, 95.0), 12))
    assert eye.retina.curvature < 0
    equator = eye.retina.vertex_z_mm + 1.0 / eye.retina.curvature
    behind = points[:, 2] < equator
    if behind.sum() < 6:
        return math.inf, f"only {behind.sum()} rays land there"
    return float(errors.max()), f"{behind.sum()} rays land in front of it, at z < {equator:.2f} mm"


def _pupil_rays(stop_mm: float, distance_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Rays of object points at a distance, over the pupil and fields of 0 to 80 deg."""
    eye = catalog.navarro(stop_mm)
    spot = 0.4 * stop_mm * np.array([[0.0, 0.0], [1.0, 0.3], [-0.5, 0.9]])
    parts = []
    for field in range(0, 90, 10):
        point = ObjectPoint(eye, (0.0, float(field)), WAVELENGTH_NM, distance_m)
        origins, directions = point.launch(spot)
        parts.append((origins - 8.0 * directions, directions))
    origins, directions = (np.concatenate(p) for p in zip(*parts, strict=True))
    return origins, directions


def _worst_of_pupils(bench: Bench, stops_mm: tuple[float, ...], distances_m: list[float]) -> float:
    worst = 0.0
    for stop in stops_mm:
        sequence = elements(catalog.navarro(stop), WAVELENGTH_NM)
        for distance in distances_m:
            errors, points = exact_error_um(bench, sequence, *_pupil_rays(stop, distance))
            # A ray on the rim of a surface falls to either side.
            known = np.isfinite(errors) & np.isfinite(points[:, 0])
            if known.sum() < 16:
                return math.inf
            worst = max(worst, float(errors[known].max()))
    return worst


@case(20, "pupils of 0.1 and 8 mm, fields to 80 deg", "hit", "um", single=0.01, double=1e-10)
def _pupils(bench: Bench) -> float:
    return _worst_of_pupils(bench, (0.1, 8.0), [0.5, math.inf])


@case(21, "objects at 0.05 m to 1e9 m and infinity", "hit", "um", single=0.01, double=1e-10)
def _distances(bench: Bench) -> tuple[float, str]:
    worst = _worst_of_pupils(bench, (4.0,), [0.05, 0.1, 1.0, 100.0, 1e6, 1e9, math.inf])
    sequence = elements(catalog.navarro(4.0), WAVELENGTH_NM)
    far, infinite = (
        bench.trace(sequence, *bench.rays(*_pupil_rays(4.0, d))).positions_mm
        for d in (1e6, math.inf)
    )
    apart = UM_PER_MM * float(np.linalg.norm(far - infinite, axis=1).max())
    note = f"1e6 m and infinity are {apart:.1g} um apart"
    return (worst if apart < 0.01 else math.inf), note


@case(22, "rays that start at the object, a kilometre away", "as from near: brought to the eye "
      "before they are rounded", "um", single=2e-3, double=1e-6)  # fmt: skip
def _far_origins(bench: Bench) -> float:
    direction, near = np.array([1e-3, 2e-3, 1.0]), np.array([0.3, 0.5, -1.0])
    ends = [
        trace_rays(
            catalog.navarro(4.0),
            near - away * direction,
            direction,
            WAVELENGTH_NM,
            precision=bench.precision,
            record_hits=False,
            device=bench.device.index,
        ).positions_mm[0]
        for away in (0.0, 1e6)
    ]
    return UM_PER_MM * float(np.linalg.norm(ends[1] - ends[0]))


def _exact_opd_mm(point: ObjectPoint, entrance_mm: np.ndarray, distance_m: float) -> np.ndarray:
    """Path from an object on the axis to the retina less that to the entrance pupil's middle."""
    paths = []
    with decimal.localcontext() as context:
        context.prec = fifty_digits.DIGITS
        middle = Decimal(point.entrance_z_mm)
        for x, y in entrance_mm:
            crossing = [Decimal(x.item()), Decimal(y.item()), middle]
            if math.isinf(distance_m):
                start, away = [*crossing[:2], middle - 20], Decimal(20)
                direction = [Decimal(0), Decimal(0), Decimal(1)]
            else:
                start = [Decimal(0), Decimal(0), -Decimal(distance_m) * 1000]
                away = middle - start[2]
                direction = [u - v for u, v in zip(crossing, start, strict=True)]
            exact = fifty_digits.trace(point.sequence, start, direction, 1)
            assert exact is not None
            paths.append(float(exact[2] - away))
    return np.array(paths)


@case(23, "path differences of objects at 0.05 m to 1e9 m and infinity", "exact", "waves",
      single=None, double=1e-8)  # fmt: skip
def _path_differences(bench: Bench) -> float:
    eye = catalog.navarro(6.0)
    i = np.arange(12)
    entrance = np.stack([0.24 * i * np.cos(i), 0.24 * i * np.sin(i)], axis=1)
    worst = 0.0
    for distance in (0.05, 0.3, 10.0, 1e3, 1e6, 1e9, math.inf):
        point = ObjectPoint(eye, 0.0, WAVELENGTH_NM, distance)
        origins, directions = point.launch(entrance)
        opl = bench.trace(point.sequence, origins, directions).opl_mm
        assert opl is not None
        squared = np.sum(entrance**2, axis=1)
        before = point.per_mm * squared / (1.0 + np.sqrt(1.0 + point.per_mm**2 * squared))
        error = opl + before - _exact_opd_mm(point, entrance, distance)
        worst = max(worst, float(np.abs(error).max()) / _WAVE_MM)
    return worst


@case(24, "a world 1e6 m from its origin", "as at the origin", "float32 spacings",
      single=1.0, double=1.0)  # fmt: skip
def _world_offset(bench: Bench) -> float:
    light = Emission(Spectrum.constant(1.0))
    corner = np.array([0.11, -0.07, -0.3])
    worst = 0.0
    for shift in (np.array([1e6, 0, 0]), np.array([0, 1e6, -1e6])):
        shapes = [
            Scene(
                (
                    SceneObject(
                        "quad", Quad(tuple(corner + at), (0.05, 0, 0), (0, 0.04, 0)), light
                    ),
                    SceneObject("ball", Sphere(tuple(corner + at), 0.01), light),
                )
            )
            for at in (np.zeros(3), shift)
        ]
        moved = seen_from(shapes[1], tuple(shift))
        for one, other in zip(shapes[0].objects, moved.objects, strict=True):
            a, b = (np.array(dataclasses.astuple(o.shape)[0], dtype=float) for o in (one, other))
            spacing = np.spacing(np.abs(a).astype(np.float32)).astype(float)
            worst = max(worst, float(np.max(np.abs(a - b) / spacing)))
    return worst


def _larger(sequence: tuple[Element, ...], scale: float) -> tuple[Element, ...]:
    return tuple(
        dataclasses.replace(
            e,
            vertex_z_mm=scale * e.vertex_z_mm,
            curvature=e.curvature / scale,
            semi_diameter_mm=scale * e.semi_diameter_mm,
        )
        for e in sequence
    )


@case(26, "an eye 128 and 1000 times as large", "the same bits; within 1e-6",
      "of the eye, beyond what is allowed", single=0.0, double=0.0)  # fmt: skip
def _scaled_eye(bench: Bench) -> tuple[float, str]:
    sequence = elements(catalog.navarro(8.0), WAVELENGTH_NM)
    origins, directions = bench.rays(*field_rays((0.0, 30.0, 70.0, 95.0), 12))
    one = bench.trace(sequence, origins, directions)
    off = []
    for scale in (128.0, 1000.0):
        other = bench.trace(_larger(sequence, scale), scale * origins, directions)
        both = one.passed & other.passed
        # On the rim of a surface rounding decides; 128 only moves the point.
        if both.sum() <= 24 or (scale == 128.0 and np.any(one.status != other.status)):
            return math.inf, f"other rays pass at {scale:g} times the size"
        apart = np.abs(other.positions_mm / scale - one.positions_mm)[both].max() / 24.0
        turned = np.abs(one.directions - other.directions)[both].max()
        off.append(float(max(apart, turned)))
    return max(off[0], max(0.0, off[1] - 1e-6)), f"{off[1]:.1g} at 1000 times"


@case(27, "from the object to the retina and back", "where it came from", "um",
      single=0.02, double=1e-10)  # fmt: skip
def _round_trip(bench: Bench) -> float:
    sequence = elements(catalog.navarro(8.0), WAVELENGTH_NM)
    i = np.arange(40)
    pupil = np.stack([0.06 * i * np.cos(i), 0.06 * i * np.sin(i), 0 * i - 2.0], axis=1)
    slope = 0.1 * np.stack([np.cos(2 * i), np.sin(3 * i)], axis=1)
    directions = np.append(slope, np.ones((40, 1)), axis=1)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    pupil, directions = bench.rays(pupil, directions)
    there = bench.trace(sequence, pupil, directions)
    back = bench.trace(
        tuple(reversed(sequence[:-1])), there.positions_mm, -there.directions, "scene"
    )
    both = there.passed & back.passed
    if both.sum() < 30:
        return math.inf
    # The ray comes out on the cornea: how far off the line that it came along?
    apart = back.positions_mm - pupil
    along = np.sum(apart * directions, axis=1, keepdims=True) * directions
    return UM_PER_MM * float(np.linalg.norm((apart - along)[both], axis=1).max())


@case(28, "path lengths forth and back", "equal", "waves", single=None, double=1e-9)
def _path_back(bench: Bench) -> float:
    sequence = elements(catalog.navarro(8.0), WAVELENGTH_NM)
    rng = np.random.default_rng(2)
    origins = np.column_stack([rng.uniform(-2.0, 2.0, (40, 2)), np.full(40, -1.0)])
    directions = np.column_stack([rng.uniform(-0.1, 0.1, (40, 2)), np.ones(40)])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    there = bench.trace(sequence, origins, directions)
    back = bench.trace(
        tuple(reversed(sequence[:-1])), there.positions_mm, -there.directions, "scene"
    )
    assert there.opl_mm is not None
    assert back.opl_mm is not None
    both = there.passed & back.passed
    outside = np.linalg.norm(back.positions_mm - origins, axis=1)
    off = np.abs(there.opl_mm - outside - back.opl_mm)[both]
    return float(off.max()) / _WAVE_MM if both.sum() > 30 else math.inf
