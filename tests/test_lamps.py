"""Lamps light surfaces by their closed forms, also where they are seen at grazing angles."""

import numpy as np
import pytest

import isetcl as ic

pytestmark = pytest.mark.usefixtures("shared_kernels")

UNIT = ic.Spectrum.constant(1.0)
EYE = ic.eyes.navarro(3.0)
WALL = ic.SceneObject(
    "wall", ic.Quad((-5, -5, -1), (10, 0, 0), (0, 10, 0)), ic.Diffuse(ic.Spectrum.constant(0.5))
)


def radiance_of(lamp, precision):
    """Radiance of the middle of the wall, and its standard error."""
    where = {"fov_deg": 0.05, "resolution": 8, "wavelengths_nm": [550.0], "precision": precision}
    scene = ic.Scene((WALL, ic.SceneObject("lamp", lamp, ic.Emission(UNIT, sides="front"))))
    image = ic.render(scene, EYE, spp=4096, max_bounces=1, **where)
    even = ic.render(ic.scenes.uniform(spectrum=UNIT), EYE, spp=64, **where)
    ratio = image.irradiance.values / even.irradiance.values
    error = np.sqrt(np.sum((image.standard_error.values / even.irradiance.values) ** 2))
    return ratio.mean(), error / ratio.size


@pytest.mark.parametrize("radius", [0.12, 0.5])
def test_a_ball_lights_as_if_from_its_centre(radius, precision):
    """Wholly above the horizon: E = pi L (r / d)^2 cos; its rim is seen at grazing angles."""
    centre = np.array([-0.6, 0.5, -0.3])
    away = centre - [0.0, 0.0, -1.0]
    distance = np.linalg.norm(away)
    found, error = radiance_of(ic.Sphere(tuple(centre), radius), precision)
    expected = 0.5 * (radius / distance) ** 2 * away[2] / distance
    assert error < 2.5e-4 * expected
    assert found == pytest.approx(expected, abs=3.5 * error + 1e-4 * expected)


def rectangle_form_factor(corners, place, normal):
    """Lambert's formula for the irradiance of a polygon of radiance 1."""
    towards = corners - place
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    total = 0.0
    for a, b in zip(towards, np.roll(towards, -1, axis=0), strict=True):
        across = np.cross(a, b)
        turn = np.arctan2(np.linalg.norm(across), a @ b)
        total += turn * (across @ normal) / np.linalg.norm(across)
    return abs(total) / 2


def test_a_panel_seen_at_grazing_angles_gives_its_form_factor(precision):
    """A panel that faces the wall, 0.1 m from it and 0.3 to 0.8 m beside the place it lights."""
    corner, u, v = np.array([0.3, -0.4, -0.9]), np.array([0, 0.8, 0]), np.array([0.5, 0, 0])
    panel = ic.Quad(tuple(corner), tuple(u), tuple(v))
    assert np.cross(u, v)[2] < 0
    corners = np.array([corner, corner + u, corner + u + v, corner + v])
    irradiance = rectangle_form_factor(corners, np.array([0, 0, -1.0]), np.array([0, 0, 1.0]))
    found, error = radiance_of(panel, precision)
    expected = 0.5 * irradiance / np.pi
    assert error < 1e-3 * expected
    assert found == pytest.approx(expected, abs=3.5 * error + 1e-4 * expected)
