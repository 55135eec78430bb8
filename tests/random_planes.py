"""Random scenes of textured planes and a textured mesh, for tests of predicted errors."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter

import isetcl as ic
from isetcl.scene.targets.planes import facing_quad, half_plane

FOV_DEG = 1.6
LIGHT = ic.Spectrum.equal_energy(100.0)


def texture(rng, n=256):
    """Smooth noise, squares or bars of a random scale and contrast."""
    kind = rng.integers(3)
    noise = rng.random((n, n))
    if kind == 0:
        noise = gaussian_filter(noise, rng.uniform(1.0, 8.0), mode="wrap")
        noise = (noise - noise.min()) / np.ptp(noise)
    elif kind == 1:
        squares = int(rng.integers(6, 40))
        noise = np.kron(rng.random((squares, squares)), np.ones((n // squares + 1,) * 2))[:n, :n]
    else:
        y, x = np.mgrid[:n, :n] / n
        turn, frequency = rng.uniform(0.0, np.pi), rng.uniform(3.0, 30.0)
        across = x * np.cos(turn) + y * np.sin(turn)
        noise = (np.sin(2.0 * np.pi * frequency * across) > 0).astype(float)
    low, high = np.sort(rng.random(2))
    return ic.Image(0.5 * low + (max(high, 0.5 * low + 0.2) - 0.5 * low) * noise)


def planes(seed):
    """Two or three planes at random depths, and an eye of random focus and pupil."""
    rng = np.random.default_rng(seed)
    count = 2 + seed % 2
    dioptres = np.sort(rng.uniform(0.2, 3.5, count))[::-1]
    while np.min(-np.diff(dioptres)) < 0.3:
        dioptres = np.sort(rng.uniform(0.2, 3.5, count))[::-1]
    items = []
    for k, vergence in enumerate(dioptres):
        distance = 1.0 / vergence
        size = 2.0 * distance * np.tan(np.radians(1.2 * FOV_DEG))
        if k == count - 1:
            quad = facing_quad(distance, size, size)
        else:
            turn = np.radians(rng.uniform(0.0, 360.0))
            quad = half_plane(distance, float(np.degrees(turn)), size)
            move = np.radians(rng.uniform(-0.3, 0.3)) * distance
            corner = np.array(quad.corner_m) + move * np.array([np.cos(turn), np.sin(turn), 0.0])
            quad = ic.Quad(tuple(corner), quad.edge_u_m, quad.edge_v_m)
        emission = ic.Emission(LIGHT, texture(rng))
        items.append(ic.SceneObject(f"plane {k}", quad, emission))
    eye = ic.eyes.navarro(float(rng.uniform(2.0, 6.0)), float(rng.uniform(0.5, 4.0)))
    return ic.Scene(tuple(items), None, f"random planes {seed}"), eye


def sheet(seed=100, steps=25):
    """A wavy, slanted textured mesh before a textured plane, and an eye between them."""
    rng = np.random.default_rng(seed)
    u, v = np.meshgrid(np.linspace(0.0, 1.0, steps), np.linspace(0.0, 1.0, steps))
    z = -1.0 / (1.4 + 0.9 * (u - 0.5) + 0.25 * np.sin(7.0 * u + 2.0 * v) * np.cos(5.0 * v))
    x = -z * np.tan(np.radians(u - 0.7))
    y = -z * np.tan(np.radians(-0.45 + 0.9 * v + 0.15 * u))
    k = np.arange(steps * steps).reshape(steps, steps)
    a, b, c, d = (part.ravel() for part in (k[:-1, :-1], k[:-1, 1:], k[1:, 1:], k[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    mesh = ic.Mesh(points, faces, uv=np.stack([u.ravel(), v.ravel()], axis=1))
    size = 5.0 * np.tan(np.radians(1.2 * FOV_DEG))
    shapes = (("sheet", mesh), ("far", facing_quad(2.5, size, size)))
    items = tuple(
        ic.SceneObject(name, shape, ic.Emission(LIGHT, texture(rng))) for name, shape in shapes
    )
    return ic.Scene(items, None, "sheet"), ic.eyes.navarro(4.0, 1.0)
