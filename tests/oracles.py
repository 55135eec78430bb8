"""Second implementations that tests compare isetcl with. They share no code with what they check.

`MpTracer` traces rays with textbook formulas at 50 digits. `owen_sobol` and `estimate` compute,
sample by sample in float64 numpy, the number that the fused kernel is meant to compute.
"""

from __future__ import annotations

import mpmath as mp
import numpy as np

mp.mp.dps = 50

# mpmath, 40 digits: collimated rays at 550 nm through Navarro's eye with indices
# 1.376, 1.3374, 1.42, 1.336: height, y and z on the retina.
PEERS_RAYS = (
    (0.001, 3.7839421307428795e-6, 23.920299999999403),
    (0.5, 0.0016283600264415013, 23.920299889518484),
    (1.0, 0.0016371094498218435, 23.920299888328027),
    (1.5, -0.0017854517751460182, 23.920299867173414),
    (2.0, -0.010848100463140873, 23.920295096612179),
    (2.25, -0.018350801803235426, 23.920285968661512),
)


def mp_trace(sequence, origin, direction, sense):
    """One ray through elements (isetcl.eye.prescription.Element), 50 digits.

    Textbook quadratic for the distance; of its two roots the one that crosses in the direction of
    travel; Snell's law with the angle of incidence. Returns (point, direction, opl) or None.
    """
    p = [mp.mpf(float(v)) for v in origin]
    d = [mp.mpf(float(v)) for v in direction]
    norm = mp.sqrt(sum(v * v for v in d))
    d = [v / norm for v in d]
    opl = mp.mpf(0)
    for e in sequence:
        n1, n2 = mp.mpf(e.n_before), mp.mpf(e.n_after)
        if sense < 0:
            n1, n2 = n2, n1
        c, k = mp.mpf(e.curvature), mp.mpf(e.conic)
        x, y, z = p[0], p[1], p[2] - mp.mpf(e.vertex_z_mm)
        a = c * (d[0] ** 2 + d[1] ** 2 + (1 + k) * d[2] ** 2)
        b = 2 * (c * (x * d[0] + y * d[1] + (1 + k) * z * d[2]) - d[2])
        g0 = c * (x * x + y * y + (1 + k) * z * z) - 2 * z
        if abs(a) < mp.mpf(10) ** -45:
            roots = [-g0 / b] if b != 0 else []
        else:
            disc = b * b - 4 * a * g0
            if disc < 0:
                return None
            roots = [(-b + mp.sqrt(disc)) / (2 * a), (-b - mp.sqrt(disc)) / (2 * a)]
        chosen = None
        for t in roots:
            h = [x + t * d[0], y + t * d[1], z + t * d[2]]
            g = [-c * h[0], -c * h[1], 1 - (1 + k) * c * h[2]]
            if sense * sum(u * v for u, v in zip(g, d, strict=True)) > 0:
                chosen = t, h, g
        if chosen is None:
            return None
        t, h, g = chosen
        opl += n1 * t
        if h[0] ** 2 + h[1] ** 2 > mp.mpf(e.semi_diameter_mm) ** 2:
            return None
        p = [h[0], h[1], h[2] + mp.mpf(e.vertex_z_mm)]
        if n1 != n2:
            length = mp.sqrt(sum(v * v for v in g))
            normal = [sense * v / length for v in g]
            cos_i = sum(u * v for u, v in zip(normal, d, strict=True))
            ratio = n1 / n2
            inside = 1 - ratio**2 * (1 - cos_i**2)
            if inside < 0:
                return None
            step = mp.sqrt(inside) - ratio * cos_i
            d = [ratio * u + step * v for u, v in zip(d, normal, strict=True)]
    return p, d, opl


def _reverse(x):
    x = np.asarray(x, dtype=np.uint32)
    out = np.zeros_like(x)
    for bit in range(32):
        out |= ((x >> np.uint32(bit)) & np.uint32(1)) << np.uint32(31 - bit)
    return out


def _mix(x):
    x = np.asarray(x, dtype=np.uint32)
    with np.errstate(over="ignore"):
        x = x ^ (x >> np.uint32(16))
        x = x * np.uint32(0x7FEB352D)
        x = x ^ (x >> np.uint32(15))
        x = x * np.uint32(0x846CA68B)
        return x ^ (x >> np.uint32(16))


def sobol_integers(count, dimension):
    """The first points of a dimension of scipy's unscrambled Sobol' sequence, as 32-bit words."""
    from scipy.stats import qmc

    number = np.arange(1 << int(np.ceil(np.log2(max(count, 1)))))
    points = qmc.Sobol(8, scramble=False, bits=30).random(len(number))[:, dimension]
    # scipy lists the points in Gray-code order; put them into the order of their numbers.
    ordered = np.empty(len(number))
    ordered[number ^ (number >> 1)] = points
    ordered = ordered[:count]
    return np.asarray(ordered * 2.0**30, dtype=np.uint64).astype(np.uint32) << np.uint32(2)


def _owen(digits, seed):
    """The digit tree of words, first digit lowest, permuted as the kernels do."""
    with np.errstate(over="ignore"):
        x = digits ^ (digits * np.uint32(0x3D20ADEA))
        x = x + seed
        x = x * ((seed >> np.uint32(16)) | np.uint32(1))
        x = x ^ (x * np.uint32(0x05526C56))
        return x ^ (x * np.uint32(0x53A22864))


def owen_sobol(index, dimension, stream, bits):
    """Scrambled coordinate of sample numbers `index` in a stream, as the kernels define it."""
    words = sobol_integers(int(np.max(index)) + 1, dimension)[index]
    with np.errstate(over="ignore"):
        seed = _mix(
            np.asarray(stream, np.uint32) + np.uint32((dimension * 0x632BE5AB) & 0xFFFFFFFF)
        )
    x = _owen(_reverse(words), seed)
    return (_reverse(x) >> np.uint32(32 - bits)).astype(np.float64) * 2.0**-bits


def bounce_numbers(sample, index_bits, pixel_stream, bounce, bits):
    """Eight numbers of a bounce for sample numbers, (8, samples), as the kernels define them."""
    numbers = []
    for set_ in range(2):
        word = np.uint32(((2 * bounce + set_ + 1) * 0x9E3779B9) & 0xFFFFFFFF)
        stream = _mix(np.uint32(pixel_stream) ^ _mix(word))
        order = _reverse(_owen(_reverse(sample), stream)) & np.uint32((1 << index_bits) - 1)
        numbers += [owen_sobol(order, d, np.full(len(order), stream), bits) for d in range(4)]
    return np.array(numbers)


def concentric(u, v):
    """Shirley's map of the unit square to the unit disc."""
    a, b = 2 * u - 1, 2 * v - 1
    wide = np.abs(a) > np.abs(b)
    r = np.where(wide, a, b)
    other = np.where(wide, b, a)
    phi = np.pi / 4 * other / np.where(r == 0, 1, r)
    x = np.where(wide, r * np.cos(phi), r * np.sin(phi))
    y = np.where(wide, r * np.sin(phi), r * np.cos(phi))
    return x, y


def estimate(plan, band, columns, rows, samples, stream, bits):
    """Mean film of pixels for one band, float64, (basis, pixels), with the kernel's own samples.

    Positions and pupil points come from the field map and the bound directly; rays from the host
    tracer; radiance from the host's scene.
    """
    from isetcl.eye import sequential
    from isetcl.eye.polynomial import evaluate
    from isetcl.scene.view import intersect, weights

    grid, eye = plan.grid, plan.eye
    bound = plan.pupils[band]
    wavelength = plan.band_choice.bands[band].wavelength_nm
    pixel = np.asarray(rows) * grid.resolution[0] + np.asarray(columns)
    streams = _mix(_mix(pixel.astype(np.uint32)) + np.uint32(stream))[:, None]
    index = (band * samples + np.arange(samples))[None, :]
    index = np.broadcast_to(index, (len(pixel), samples))
    u, v, du, dv = (owen_sobol(index, d, streams, bits) for d in range(4))
    x = grid.left_deg + (np.asarray(columns)[:, None] + du) * grid.pitch_deg[0]
    y = grid.top_deg - (np.asarray(rows)[:, None] + dv) * grid.pitch_deg[1]
    start = grid.field_map.retinal_point_mm(x, y)
    gx, gy = x / bound.field_limit_deg, y / bound.field_limit_deg
    s = gx * gx + gy * gy
    px, py = concentric(u, v)
    semi, stretch = evaluate(bound.semi, s), evaluate(bound.stretch, s)
    along = stretch * (gx * px + gy * py) + evaluate(bound.centre, s)
    target = np.stack(
        [semi * px + along * gx, semi * py + along * gy, np.full_like(px, bound.z_mm)], axis=-1
    )
    ray = target - start
    distance2 = np.sum(ray**2, axis=-1)
    retina = eye.retina
    centre = np.array([0.0, 0.0, retina.vertex_z_mm + 1.0 / retina.curvature])
    normal = (centre - start) * -retina.curvature
    cosines = np.sum(ray * normal, axis=-1) * -ray[..., 2] / distance2
    index_ratio = float(eye.indices(wavelength)[-1]) / float(eye.indices(wavelength)[0])
    area = np.pi * semi * (semi + s * stretch)
    weight = index_ratio**2 * area * cosines / distance2
    traced = sequential.trace(
        eye, start.reshape(-1, 3), ray.reshape(-1, 3), wavelength, towards="scene"
    )
    origin = traced.positions_mm.reshape(start.shape) / 1000.0
    direction = traced.directions.reshape(start.shape)
    passed = traced.passed.reshape(weight.shape)
    colour = np.broadcast_to(plan.basis.background, (*weight.shape, len(plan.basis.background)))
    nearest = np.full(weight.shape, np.inf)
    for i, item in enumerate(plan.scene.objects):
        hits = intersect(item.shape, origin, direction)
        closer = hits.distance_m < nearest
        shown = item
        if plan.images[i] is not None:
            material = type(item.material)(item.material.radiance, plan.images[i])
            shown = type(item)(item.name, item.shape, material)
        colour = np.where(closer[..., None], weights(shown, hits) @ plan.basis.objects[i], colour)
        nearest = np.where(closer, hits.distance_m, nearest)
    return np.mean((weight * passed)[..., None] * colour, axis=1).T


def reduced_eye(stop_diameter_mm=4.0, axial_length_mm=22.0, index=4.0 / 3.0, conic=None):
    """A single surface that images an axial point at infinity without aberration.

    An ellipsoid of conic -1/n^2 in front of a medium of index n (Descartes), achromatic; the stop
    at its vertex, so the entrance pupil is the stop itself.
    """
    import isetcl as ic

    medium = ic.Medium("medium", ic.ConstantIndex(index))
    radius = axial_length_mm * (index - 1.0) / index
    surface = ic.Surface.from_radius(
        "surface",
        0.0,
        radius,
        conic=-1.0 / index**2 if conic is None else conic,
        semi_diameter_mm=0.9 * radius,
        medium_after=medium,
    )
    return ic.Eye(
        "reduced",
        (surface,),
        ic.Stop(0.0, stop_diameter_mm),
        ic.Retina.from_radius(axial_length_mm, -axial_length_mm),
    )


def peers_eye(stop_diameter_mm=4.02):
    """Navarro's eye with the fixed indices of the comparison with other programs."""
    import isetcl as ic

    index = {"cornea": 1.376, "aqueous": 1.3374, "lens": 1.42, "vitreous": 1.336}
    eye = ic.eyes.navarro(4.0)
    surfaces = tuple(
        ic.Surface(
            s.name,
            s.vertex_z_mm,
            s.curvature,
            s.conic,
            s.semi_diameter_mm,
            ic.Medium(name, ic.ConstantIndex(n)),
        )
        for s, (name, n) in zip(eye.surfaces, index.items(), strict=True)
    )
    retina = ic.Retina.from_radius(23.9203, -12.0)
    return ic.Eye("peers", surfaces, ic.Stop(3.6, stop_diameter_mm), retina)
