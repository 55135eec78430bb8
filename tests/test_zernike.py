"""Zernike polynomials against their definition, quadrature and published tables."""

import math

import numpy as np
import pytest
from scipy import integrate

import isetcl as ic
from isetcl.eye.waves import zernike


def test_polynomials_are_orthonormal_on_the_disc():
    # Gauss in rho^2 and even angles integrate products up to order 24 exactly.
    nodes, weights = np.polynomial.legendre.leggauss(16)
    rho, turn = np.sqrt((nodes + 1) / 2), 2 * np.pi * np.arange(40) / 40
    x, y = np.outer(rho, np.cos(turn)), np.outer(rho, np.sin(turn))
    z = zernike.polynomials(12, x, y)
    gram = np.einsum("irp,jrp,r->ij", z, z, weights / 2 / 40)
    np.testing.assert_allclose(gram, np.eye(len(z)), atol=1e-13)


@pytest.mark.parametrize(("first", "second"), [(4, 4), (12, 12), (4, 12), (7, 17), (8, 8)])
def test_orthonormality_by_adaptive_quadrature(first, second):
    def product(turn, rho):
        z = zernike.polynomials(5, np.array(rho * np.cos(turn)), np.array(rho * np.sin(turn)))
        return z[first] * z[second] * rho / np.pi

    got, _ = integrate.dblquad(product, 0, 1, 0, 2 * np.pi, epsabs=1e-8, epsrel=1e-8)
    assert got == pytest.approx(float(first == second), abs=1e-7)


def test_polynomials_are_those_of_the_osa_table():
    # Thibos et al. 2002, table 2; phi runs anticlockwise from x.
    x, y = np.array([0.3, -0.5]), np.array([0.4, 0.2])
    rho, phi = np.hypot(x, y), np.arctan2(y, x)
    z = zernike.polynomials(4, x, y)
    table = {
        1: 2 * rho * np.sin(phi),
        2: 2 * rho * np.cos(phi),
        3: math.sqrt(6) * rho**2 * np.sin(2 * phi),
        4: math.sqrt(3) * (2 * rho**2 - 1),
        5: math.sqrt(6) * rho**2 * np.cos(2 * phi),
        7: math.sqrt(8) * (3 * rho**3 - 2 * rho) * np.sin(phi),
        9: math.sqrt(8) * rho**3 * np.cos(3 * phi),
        12: math.sqrt(5) * (6 * rho**4 - 6 * rho**2 + 1),
        13: math.sqrt(10) * (4 * rho**4 - 3 * rho**2) * np.cos(2 * phi),
    }
    for j, value in table.items():
        np.testing.assert_allclose(z[j], value, atol=1e-14)


def test_radial_recurrence_agrees_with_the_explicit_coefficients():
    rho = np.linspace(0, 1, 11)
    z = zernike.polynomials(24, rho, np.zeros_like(rho))
    for n, m in ((24, 0), (24, 12), (23, 1), (20, 20)):
        explicit = np.polynomial.polynomial.polyval(rho, zernike.radial_coefficients(n, m))
        # Terms of the explicit sum reach 1e8 and lose as many digits.
        atol = 1e-15 * np.abs(zernike.radial_coefficients(n, m)).max() + 1e-12
        got = z[zernike.osa_index(n, m)] / zernike.norm(n, m)
        np.testing.assert_allclose(got, explicit, atol=10 * atol)


def test_noll_order_is_the_published_one():
    # Noll 1976, table I.
    pairs = [(0, 0), (1, 1), (1, -1), (2, 0), (2, -2), (2, 2), (3, -1), (3, 1), (3, -3), (3, 3)]
    pairs += [(4, 0), (4, 2), (4, -2), (4, 4), (4, -4)]
    assert [zernike.noll_nm(j + 1) for j in range(15)] == pairs


def test_indices_and_orders_are_inverse():
    for j in range(120):
        assert zernike.osa_index(*zernike.osa_nm(j)) == j
        assert zernike.noll_index(*zernike.noll_nm(j + 1)) == j + 1


def test_a_fit_returns_the_coefficients_of_a_wavefront():
    rng = np.random.default_rng(1)
    wanted = rng.normal(size=28)
    turn, rho = rng.uniform(0, 2 * np.pi, 400), 2.5 * np.sqrt(rng.uniform(0, 1, 400))
    x, y = rho * np.cos(turn), rho * np.sin(turn)
    values = np.tensordot(wanted, zernike.polynomials(6, x / 2.5, y / 2.5), axes=1)
    fit = zernike.fit(values, x, y, radius_mm=2.5, order=6, wavelength_nm=550.0)
    np.testing.assert_allclose(fit.coefficients_um, wanted, atol=1e-12)
    np.testing.assert_allclose(fit.opd_um(x, y), values, atol=1e-12)
    np.testing.assert_allclose(fit.coefficients_waves, wanted / 0.55, atol=1e-11)
    np.testing.assert_allclose(fit.mirrored().opd_um(-x, y), values, atol=1e-12)
    assert fit.residual_um < 1e-12


def test_noll_and_osa_coefficients_name_the_same_polynomials():
    fit = zernike.from_sparse({(2, 0): 0.5, (3, 1): -0.25}, 3.0, 550.0)
    assert fit.in_order("osa")[4] == 0.5
    assert fit.in_order("osa")[8] == -0.25
    assert fit.in_order("noll")[4 - 1] == 0.5
    assert fit.in_order("noll")[8 - 1] == -0.25
    assert fit.rms_um() == pytest.approx(math.hypot(0.5, 0.25))
    assert fit.rms_um(3) == 0.25


def test_bad_input_is_refused():
    with pytest.raises(ic.InvalidInputError, match="n = 3, m = 2"):
        zernike.osa_index(3, 2)
    with pytest.raises(ic.InvalidInputError, match="needs at least 56"):
        zernike.fit(np.zeros(50), *np.zeros((2, 50)), radius_mm=1.0, order=6, wavelength_nm=550.0)
    with pytest.raises(ic.InvalidInputError, match="do not determine"):
        zernike.fit(np.zeros(99), *np.zeros((2, 99)), radius_mm=1.0, order=6, wavelength_nm=550.0)
    with pytest.raises(ic.InvalidInputError, match="pad with zeros"):
        zernike.ZernikeFit(np.zeros(4), 3.0, 550.0)
    with pytest.raises(ic.InvalidInputError, match="between 0 and 24"):
        zernike.polynomials(25, np.zeros(1), np.zeros(1))
