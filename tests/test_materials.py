"""Materials: samplers against their densities, Fresnel's equations, energy, and furnaces."""

from pathlib import Path

import numpy as np
import pytest

import isetcl as ic
from isetcl.device import program
from isetcl.device.layout import real_dtype
from isetcl.render import pack, pack_paths
from isetcl.render.kernel_config import PathConfig, path_width
from isetcl.render.pack_looks import SubstanceKind, inner_reflectance
from isetcl.validation.stats import chi_square_p

PROBES = Path(__file__).parent / "probes" / "materials.cl"
GOLD = (0.16, 0.25, 0.4, 1.3), (3.6, 2.9, 2.4, 1.8)


class Material:
    """One material on a device, seen at a fixed angle from its normal."""

    def __init__(self, device, precision, kind, alpha=0.0, index=1.0, albedo=1.0, other=0.0):
        self.device, self.real = device, real_dtype(precision)
        self.width = path_width(device, precision)
        config = PathConfig(precision, device.vector_width(precision), 4)
        declarations = pack_paths.declarations() + pack.sobol_declaration()
        self.source = program.assemble(PROBES, config.path_defines(device), declarations)
        self.index = index
        inner = float(inner_reflectance(np.array(index))) if index > 1 else 0.0
        self.record = [float(kind), alpha, index, inner]
        self.record += list(np.broadcast_to(albedo, 4)) + list(np.broadcast_to(other, 4))

    def _run(self, name, angle_deg, planes, n_out):
        import pyopencl as cl

        angle = np.radians(angle_deg)
        towards = [np.sin(angle) * np.cos(0.4), np.sin(angle) * np.sin(0.4), np.cos(angle)]
        record = np.array(self.record + towards, dtype=self.real)
        n = planes.shape[1]
        padded = -(-n // self.width) * self.width
        data = np.zeros((len(planes), padded), dtype=self.real)
        data[:, :n] = planes
        out = np.empty((n_out, padded), dtype=self.real)
        flags = cl.mem_flags
        buffers = [
            cl.Buffer(self.device.context, flags.COPY_HOST_PTR, hostbuf=b) for b in (record, data)
        ]
        result = cl.Buffer(self.device.context, flags.READ_WRITE, out.nbytes)
        kernel = program.kernel(self.device, self.source, name)
        kernel.set_args(*buffers, np.int32(padded), result)
        cl.enqueue_nd_range_kernel(self.device.queue, kernel, (padded // self.width,), (1,))
        cl.enqueue_copy(self.device.queue, out, result)
        return out[:, :n].astype(np.float64)

    def sample(self, angle_deg, numbers):
        """Directions (3, n), densities and weights (4, n) for numbers (3, n)."""
        out = self._run("probe_sample", angle_deg, numbers, 8)
        return out[:3], out[3], out[4:]

    def eval(self, angle_deg, directions):
        """Densities and values (4, n) towards directions (3, n)."""
        out = self._run("probe_eval", angle_deg, directions, 5)
        return out[0], out[1:]


K = SubstanceKind
CASES = {
    "matt": {"kind": K.DIFFUSE, "albedo": 0.7},
    "translucent": {"kind": K.DIFFUSE, "albedo": 0.3, "other": 0.5},
    "rough mirror": {"kind": K.MIRROR, "alpha": 0.4, "albedo": 0.9},
    "satin mirror": {"kind": K.MIRROR, "alpha": 0.15},
    "rough gold": {"kind": K.CONDUCTOR, "alpha": 0.3, "albedo": GOLD[0], "other": GOLD[1]},
    "rough glass from outside": {"kind": K.DIELECTRIC, "alpha": 0.3, "index": 1.5},
    "rough glass from inside": {"kind": K.DIELECTRIC, "alpha": 0.3, "index": 1 / 1.5},
    "lacquer": {"kind": K.COATED, "index": 1.5, "albedo": 0.6},
    "satin lacquer": {"kind": K.COATED, "index": 1.5, "albedo": 0.6, "alpha": 0.3},
}
POLISHED = {
    "mirror": {"kind": K.MIRROR, "albedo": (0.9, 0.5, 0.2, 1.0)},
    "gold": {"kind": K.CONDUCTOR, "albedo": GOLD[0], "other": GOLD[1]},
    "glass from outside": {"kind": K.DIELECTRIC, "index": 1.5},
    "glass from inside": {"kind": K.DIELECTRIC, "index": 1 / 1.5},
}


def numbers(count, seed=0):
    return np.random.default_rng(seed).random((3, count))


def sphere_grid(rows, columns, down=96, along=8):
    """Directions in `rows` x `columns` cells of equal area, (3, cells, down * along)."""
    cosine = 1 - 2 * (np.arange(rows * down) + 0.5) / (rows * down)
    turn = 2 * np.pi * (np.arange(columns * along) + 0.5) / (columns * along)
    z, phi = np.meshgrid(cosine, turn, indexing="ij")
    sine = np.sqrt(1 - z**2)
    d = np.stack([sine * np.cos(phi), sine * np.sin(phi), z])
    d = d.reshape(3, rows, down, columns, along).transpose(0, 1, 3, 2, 4)
    return d.reshape(3, rows * columns, down * along)


@pytest.mark.parametrize("angle_deg", [5.0, 45.0, 75.0])
@pytest.mark.parametrize("name", CASES)
def test_samples_are_drawn_with_their_density(name, angle_deg, device, precision):
    """Chi-square over cells of equal solid angle; a density off by 2 % is found (see below)."""
    material = Material(device, precision, **CASES[name])
    assert density_p(material, angle_deg) > 1e-4


def density_p(material, angle_deg, exponent=1.0):
    rows, columns, count = 24, 24, 60_000
    grid = sphere_grid(rows, columns)
    density, _ = material.eval(angle_deg, grid.reshape(3, -1))
    cell = 4 * np.pi / (rows * columns)
    expected = count * cell * (density.reshape(rows * columns, -1) ** exponent).mean(axis=1)
    d, pdf, _ = material.sample(angle_deg, numbers(count))
    drawn = pdf > 0
    row = np.clip(((1 - d[2]) / 2 * rows).astype(int), 0, rows - 1)
    column = (np.arctan2(d[1], d[0]) / (2 * np.pi) % 1.0 * columns).astype(int) % columns
    found = np.bincount((row * columns + column)[drawn], minlength=rows * columns)
    # What is not drawn is a cell, too. Quadrature is not exact where the density is steep.
    observed = np.append(found, count - drawn.sum())
    wanted = np.append(expected, max(0.0, count - expected.sum()))
    return chi_square_p(observed, wanted, inexact=2e-3)


def test_the_chi_square_test_finds_a_wrong_density(device):
    material = Material(device, "single", **CASES["rough mirror"])
    assert density_p(material, 45.0, exponent=1.03) < 1e-6


@pytest.mark.parametrize("angle_deg", [5.0, 60.0, 80.0])
@pytest.mark.parametrize("name", CASES)
def test_weights_are_eval_over_pdf(name, angle_deg, device, precision):
    material = Material(device, precision, **CASES[name])
    d, pdf, weight = material.sample(angle_deg, numbers(4000))
    drawn = pdf > 1e-3
    assert drawn.mean() > 0.3
    again, value = material.eval(angle_deg, d[:, drawn])
    tolerance = 2e-3 if precision == "single" else 1e-9
    np.testing.assert_allclose(again, pdf[drawn], rtol=tolerance, atol=tolerance)
    np.testing.assert_allclose(value / pdf[drawn], weight[:, drawn], rtol=tolerance, atol=tolerance)


@pytest.mark.parametrize("name", [n for n in CASES if "glass" not in n])
def test_light_is_reflected_alike_both_ways(name, device):
    """Helmholtz: f(o, i) = f(i, o)."""
    material = Material(device, "double", **CASES[name])
    for first, second in ((10.0, 50.0), (30.0, 75.0)):
        towards = [np.sin(np.radians(second)), 0.0, np.cos(np.radians(second))]
        turn = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
        across = np.array(towards)
        across[:2] = turn @ across[:2]
        _, there = material.eval(first, across[:, None])
        back_direction = np.array([np.sin(np.radians(first)), 0.0, np.cos(np.radians(first))])
        back_direction[:2] = turn @ back_direction[:2]
        _, back = material.eval(second, back_direction[:, None])
        there = there / np.cos(np.radians(second))
        back = back / np.cos(np.radians(first))
        np.testing.assert_allclose(there, back, rtol=1e-9)


def test_rough_glass_keeps_basic_radiance(device):
    """f(o, i) n_o^2 = f(i, o) n_i^2 across the surface."""
    outside = Material(device, "double", **CASES["rough glass from outside"])
    inside = Material(device, "double", **CASES["rough glass from inside"])
    a, b = np.radians(20.0), np.radians(25.0)
    turn = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    below = np.array([-np.sin(b), 0.0, -np.cos(b)])
    below[:2] = turn @ below[:2]
    _, there = outside.eval(20.0, below[:, None])
    # From inside the frame is turned over: z points into the glass.
    above = np.array([-np.sin(a), 0.0, -np.cos(a)])
    above[:2] = turn @ above[:2]
    _, back = inside.eval(25.0, above[:, None])
    assert there[0] > 0
    np.testing.assert_allclose(
        there / np.cos(b) * 1.0, back / np.cos(a) * (1 / 1.5) ** 2, rtol=1e-9
    )


def fresnel(cosine, index):
    """Reflectance from the amplitude formulas with complex numbers."""
    index = np.asarray(index, dtype=complex)
    inner = np.sqrt(1 - (1 - cosine**2) / index**2 + 0j)
    s = (cosine - index * inner) / (cosine + index * inner)
    p = (index * cosine - inner) / (index * cosine + inner)
    return (abs(s) ** 2 + abs(p) ** 2) / 2


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 56.3, 80.0, 89.0])
@pytest.mark.parametrize("name", POLISHED)
def test_polished_surfaces_obey_fresnel(name, angle_deg, device, precision):
    material = Material(device, precision, **POLISHED[name])
    d, pdf, weight = material.sample(angle_deg, numbers(2000))
    angle = np.radians(angle_deg)
    assert np.all(pdf == -1)
    tolerance = 1e-5 if precision == "single" else 1e-12
    up = d[2] > 0
    np.testing.assert_allclose(d[2][up], np.cos(angle), atol=tolerance)
    if name == "mirror":
        np.testing.assert_allclose(weight[:, 0], POLISHED[name]["albedo"], rtol=tolerance)
    elif name == "gold":
        expected = fresnel(np.cos(angle), np.array(GOLD[0]) + 1j * np.array(GOLD[1]))
        np.testing.assert_allclose(weight[:, 0], expected, rtol=20 * tolerance)
    else:
        index = material.index
        expected = float(fresnel(np.cos(angle), index))
        choice = numbers(2000)[2]
        clear = np.abs(choice - expected) > 1e-3
        np.testing.assert_array_equal(up[clear], (choice < expected)[clear])
        sine = np.hypot(d[0], d[1])[~up]
        np.testing.assert_allclose(sine * index, np.sin(angle), atol=2 * tolerance)
        np.testing.assert_allclose(weight[0][~up], 1 / index**2, rtol=tolerance)


def test_the_inner_reflectance_of_a_coat_is_known():
    """Egan & Hilgeman's and Duntley's value for n = 1.5: 0.596."""
    assert float(inner_reflectance(np.array(1.5))) == pytest.approx(0.5964, abs=2e-4)
    # 1 - inner = (1 - outer) / n^2, with the outer value by another quadrature.
    cosine = (np.arange(200_000) + 0.5) / 200_000
    outer = np.mean(2 * cosine * fresnel(cosine, 1.33))
    assert float(inner_reflectance(np.array(1.33))) == pytest.approx(
        1 - (1 - outer) / 1.33**2, abs=1e-7
    )


@pytest.mark.parametrize("name", [*CASES, *POLISHED])
def test_no_material_makes_light(name, device):
    spec = CASES.get(name) or POLISHED[name]
    material = Material(device, "single", **spec)
    for angle_deg in (0.5, 40.0, 70.0, 85.0):
        d, _, weight = material.sample(angle_deg, numbers(40_000, seed=3))
        # Radiance grows with the square of the index; power does not.
        scale = np.where(d[2] < 0, material.index**2, 1.0) if "glass" in name else 1.0
        assert np.max((weight * scale).mean(axis=1)) < 1.005


def test_a_white_lacquer_loses_nothing(device):
    """What enters the coat of a white surface comes out again."""
    material = Material(device, "double", K.COATED, index=1.5, albedo=1.0)
    for angle_deg in (10.0, 60.0, 80.0):
        _, _, weight = material.sample(angle_deg, numbers(200_000, seed=1))
        error = weight[0].std() / np.sqrt(weight.shape[1])
        assert weight[0].mean() == pytest.approx(1.0, abs=4 * error + 1e-3)
        assert error < 3e-3


UNIT = ic.Spectrum.constant(1.0)
EYE = ic.eyes.navarro(3.0)


def radiance_of(scene, spp=64, fov_deg=3.0, **options):
    """Mean radiance of a scene in the middle, and its standard error."""
    where = {"fov_deg": fov_deg, "resolution": 8, "wavelengths_nm": [550.0], "bands": 1}
    image = ic.render(scene, EYE, spp=spp, **where, **options)
    even = ic.render(ic.scenes.uniform(spectrum=UNIT), EYE, spp=64, **where)
    ratio = image.irradiance.values / even.irradiance.values
    error = image.standard_error.values / even.irradiance.values
    return float(ratio.mean()), float(np.sqrt((error**2).sum())) / error.size, ratio, error


def metal(n=0.2, k=3.0):
    return ic.ComplexIndex([300.0, 900.0], [n, n], [k, k], "test metal")


GLASS = ic.Medium("glass", ic.ConstantIndex(1.5))
WHITE_FURNACE = {
    "smooth glass": ic.Dielectric(GLASS),
    "white lacquer": ic.Coated(UNIT),
    "mirror": ic.Mirror(UNIT),
    "white": ic.Diffuse(UNIT),
    "sheet": ic.Diffuse(ic.Spectrum.constant(0.4), None, ic.Spectrum.constant(0.6)),
    "mix": ic.Mix(ic.Mirror(UNIT), ic.Diffuse(UNIT), 0.3),
    "two-sided": ic.TwoSided(ic.Mirror(UNIT), ic.Diffuse(UNIT)),
}


@pytest.mark.usefixtures("shared_kernels")
@pytest.mark.parametrize("name", WHITE_FURNACE)
def test_lossless_bodies_cannot_be_seen_under_an_even_sky(name):
    ball = ic.SceneObject("ball", ic.Sphere((0.0, 0.0, -0.5), 0.1), WHITE_FURNACE[name])
    mean, error, _, _ = radiance_of(ic.Scene((ball,), UNIT), max_bounces=200)
    assert mean == pytest.approx(1.0, abs=4 * error + 2e-4)
    assert error < 0.01


BOX = {
    "matt": ic.Diffuse(ic.Spectrum.constant(0.6)),
    "mirror": ic.Mirror(ic.Spectrum.constant(0.6)),
    "mix": ic.Mix(ic.Mirror(ic.Spectrum.constant(0.6)), ic.Diffuse(ic.Spectrum.constant(0.6)), 0.4),
}


def closed_box(material, emission, side=2.0):
    """Six quads around the origin that shine and reflect."""
    h = side / 2
    corners = []
    for axis in range(3):
        for sign in (-1, 1):
            u, v = np.eye(3)[(axis + 1) % 3] * side, np.eye(3)[(axis + 2) % 3] * side
            corner = sign * h * np.eye(3)[axis] - u / 2 - v / 2
            corners.append((corner, u, v))
    return ic.Scene(
        tuple(
            ic.SceneObject(
                f"wall {i}", ic.Quad(*(tuple(x) for x in c)), material, emission=emission
            )
            for i, c in enumerate(corners)
        )
    )


@pytest.mark.usefixtures("shared_kernels")
@pytest.mark.parametrize("name", BOX)
def test_a_closed_box_is_a_furnace(name):
    """Radiance Le / (1 - rho) on every pixel."""
    scene = closed_box(BOX[name], ic.Emission(UNIT))
    mean, error, pixels, errors = radiance_of(scene, spp=1024, fov_deg=20.0, max_bounces=200)
    assert error < 0.004 * 2.5
    assert mean == pytest.approx(2.5, abs=3 * error)
    # Student's t over all pixels: 64 of them, at 1 in 1000.
    assert np.all(np.abs(pixels - 2.5) < 7 * errors + 0.01 * 2.5)
