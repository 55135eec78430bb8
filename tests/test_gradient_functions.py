"""Functions of lib/gradient.cl and lib/power.cl, one by one, against numpy in float64."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from test_device_functions import EPSILON, Probe

from isetcl.device import program
from isetcl.device.gradients import kernel_step, profile_numbers
from isetcl.eye.gradient import PolynomialGradient, ShellGradient
from isetcl.eye.gradient_path import PlacedGradient, propagate
from isetcl.eye.prescription import Element, ElementKind
from isetcl.render import pack

pytestmark = pytest.mark.usefixtures("one_register")

PROBES = Path(__file__).parent / "probes" / "gradients.cl"
CUBIC = PolynomialGradient(((1.37, -0.002, 1e-5), (0.049, 3e-4), (-0.015, 2e-5), (1e-3,)))
SHELLS = ShellGradient(1.415, 1.370, 1.7, 1.7, 4.6, 3.3)
WHOLE = ShellGradient(1.415, 1.370, 1.7, 1.7, 4.6, 7.0)


class GradientProbe(Probe):
    """Probes of gradients, whose features a plain configuration leaves out."""

    def __init__(self, device, precision, real_powers):
        super().__init__(device, precision)
        self.config = dataclasses.replace(
            self.config,
            has_polynomial_gradients=True,
            has_shell_gradients=True,
            has_real_powers=real_powers,
            gradient_degree=5,
        )
        defines = self.config.defines(device)
        self.source = program.assemble(PROBES, defines, pack.declarations(self.config))
        self.source_with_opl = program.assemble(
            PROBES, defines | {"HAS_OPL": 1}, pack.declarations(self.config)
        )


@pytest.fixture(params=[False, True], ids=["whole", "real"])
def probe(request, device, precision):
    return GradientProbe(device, precision, request.param)


def numbers(profile, probe):
    placed = PlacedGradient(profile, 0.0, None, ())
    element = Element(ElementKind.REFRACT, "front", 0.0, 0.0, 0.0, 5.0, 1.4, 1.4)
    return profile_numbers(placed, element, 5).astype(probe.real)


def points(probe, count=200):
    rng = np.random.default_rng(5)
    xyz = rng.uniform([-2.5, -2.5, 0.4], [2.5, 2.5, 2.0], (count, 3))
    return xyz.astype(probe.real).astype(float)


def test_logarithms_exponentials_and_powers(probe, precision):
    x = np.concatenate([np.geomspace(1e-6, 50.0, 2000), np.linspace(0.7, 1.4, 2000)])
    y = np.linspace(-30.0, 30.0, len(x))
    x, y = x.astype(probe.real).astype(float), y.astype(probe.real).astype(float)
    p = float(probe.real.type(2.3))
    log, exp, power, whole = probe(
        "probe_power", np.stack([x, y]), 4, probe.real.type(p), np.int32(6)
    )
    scale = EPSILON[precision]
    assert np.max(np.abs(log - np.log2(x)) / np.maximum(np.abs(np.log2(x)), 0.5)) < 3 * scale
    assert np.max(np.abs(exp / 2.0**y - 1.0)) < 4 * scale
    # An error of the logarithm counts by its size times p.
    allowed = scale * (4.0 + 3.0 * p * np.abs(np.log2(x)))
    assert np.all(np.abs(power / x**p - 1.0) < allowed)
    assert np.max(np.abs(whole / x**6 - 1.0)) < 8 * scale


def test_zero_to_a_power_is_zero_and_to_none_is_one(probe, precision):
    for p, expected in ((1.5, 0.0), (0.0, 1.0)):
        got = probe("probe_power", np.zeros((2, 8)), 4, probe.real.type(p), np.int32(int(p)))
        np.testing.assert_allclose(got[2], expected, atol=1e-12)
        assert np.all(got[3] == expected)


def profiles(probe):
    return (CUBIC, SHELLS if probe.config.has_real_powers else WHOLE)


def test_profiles_and_their_slopes(probe, precision):
    xyz = points(probe)
    for profile in profiles(probe):
        got = probe("probe_index_force", xyz.T, 4, first=(numbers(profile, probe),))
        squared, slope = profile.squared_and_half_gradient(*xyz.T)
        assert np.max(np.abs(got[0] - squared)) < 16 * EPSILON[precision]
        assert np.max(np.abs(got[1:].T - slope)) < 16 * EPSILON[precision]


def test_slopes_are_the_differences_of_the_index():
    rng = np.random.default_rng(7)
    xyz = rng.uniform([-2.5, -2.5, 0.4], [2.5, 2.5, 2.0], (50, 3))
    h = 1e-5
    for profile in (CUBIC, SHELLS, WHOLE):
        squared, slope = profile.squared_and_half_gradient(*xyz.T)
        np.testing.assert_allclose(profile.index(*xyz.T) ** 2, squared, rtol=1e-14)
        for axis in range(3):
            step = h * np.eye(3)[axis]
            up, down = (profile.index(*(xyz + s * step).T) ** 2 for s in (1, -1))
            np.testing.assert_allclose((up - down) / (4 * h), slope[:, axis], atol=1e-9)
        z = np.linspace(0.5, 2.0, 9)
        n0, n1 = profile.axial(z)
        near = profile.index(0.01 + 0 * z, 0 * z, z)
        np.testing.assert_allclose(n0, profile.index(0 * z, 0 * z, z), rtol=1e-15)
        np.testing.assert_allclose((near - n0) / 1e-4, n1, atol=1e-6)


def rays_inside(probe, profile):
    xyz = points(probe, 64) * [0.7, 0.7, 0.4]
    rng = np.random.default_rng(9)
    tilt = rng.normal(0.0, 0.1, (64, 2))
    unit = np.concatenate([tilt, np.ones((64, 1))], axis=1)
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    rays = profile.index(*xyz.T)[:, None] * unit
    return xyz.astype(probe.real).astype(float), rays.astype(probe.real).astype(float)


def test_steps_of_the_method_of_each_precision(probe, precision):
    for profile in profiles(probe):
        xyz, rays = rays_inside(probe, profile)
        span, steps = 0.75, 12
        p, t = xyz, rays
        for _ in range(steps):
            p, t = kernel_step(profile, p, t, np.full(64, span / steps), precision)
        exact = propagate(profile, xyz, rays, np.full(64, span), 16)
        probe.source = probe.source_with_opl
        got = probe(
            "probe_steps",
            np.concatenate([xyz, rays], axis=1).T,
            7,
            probe.real.type(span / steps),
            np.int32(steps),
            first=(numbers(profile, probe),),
        )
        limit = 16 * EPSILON[precision]
        assert np.max(np.abs(got[:3].T - p)) < limit
        assert np.max(np.abs(got[3:6].T - t)) < limit
        # And it is right, to its order.
        assert np.max(np.abs(p - exact[0])) < 1e-7
        assert np.max(np.abs(got[6] - exact[2])) < 1e-7 + limit


def test_the_kernels_steps_are_of_order_6(device):
    # n^2 = n0^2 - a^2 r^2 to r^6: at r <= 0.1 mm the rest changes n by 2e-14.
    n0, a = 1.41, 0.5
    u = (a / n0) ** 2
    root = PolynomialGradient(((n0, -n0 * u / 2, -n0 * u**2 / 8, -n0 * u**3 / 16),))
    probe = GradientProbe(device, "double", real_powers=False)
    probe.config = dataclasses.replace(probe.config, gradient_degree=6)
    probe.source = program.assemble(
        PROBES, probe.config.defines(device), pack.declarations(probe.config)
    )
    placed = PlacedGradient(root, 0.0, None, ())
    element = Element(ElementKind.REFRACT, "front", 0.0, 0.0, 0.0, 5.0, 1.4, 1.4)
    i = np.arange(16)
    xyz = np.stack([0.05 * np.cos(i), 0.05 * np.sin(2 * i), 0.0 * i], axis=1)
    rays = np.stack([0.025 * np.cos(3 * i), 0.025 * np.sin(i), 0.0 * i], axis=1)
    rays[:, 2] = np.sqrt(n0**2 - a**2 * np.sum(xyz[:, :2] ** 2, axis=1) - np.sum(rays**2, axis=1))
    span, errors = 4.0, []
    for steps in (4, 8, 16):
        got = probe(
            "probe_steps",
            np.concatenate([xyz, rays], axis=1).T,
            7,
            np.float64(span / steps),
            np.int32(steps),
            first=(profile_numbers(placed, element, 6),),
        )
        exact = xyz[:, :2] * np.cos(a * span) + rays[:, :2] * np.sin(a * span) / a
        errors.append(np.max(np.abs(got[:2].T - exact)))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders - 6.0) < 0.3), (errors, orders)
