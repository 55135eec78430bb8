"""Drawings show what was computed."""

import numpy as np
import pytest
from matplotlib.figure import Figure

import isetcl as ic
from isetcl.eye import drawing, geometric


@pytest.fixture
def axes():
    return Figure().subplots()


def test_the_section_of_an_eye_shows_surfaces_stop_retina_and_rays(axes):
    eye = ic.eyes.navarro(3.0)
    eye.plot(axes, fields_deg=(0.0, 20.0), rays=5)
    # 4 surfaces, 2 blades, the retina and 10 rays.
    assert len(axes.lines) == 4 + 2 + 1 + 10
    axial = axes.lines[9]
    np.testing.assert_allclose(axial.get_ydata(), 0.0, atol=1e-9)
    assert axial.get_xdata()[-1] == pytest.approx(eye.axial_length_mm)
    with pytest.raises(ic.InvalidInputError, match="option of plot"):
        eye.plot(axes, colour="red")
    with pytest.raises(ic.InvalidInputError, match="matplotlib axes"):
        eye.plot("here")


def test_image_quality_is_drawn_with_its_units():
    eye = ic.eyes.navarro(3.0)
    front = eye.wavefront(5.0, samples=32)
    for draw, thing, x_label in (
        (drawing.draw_opd, front, "pupil, x (cycles/degree)"),
        (drawing.draw_psf, front.psf(8.0, 32), "x (arcmin)"),
        (drawing.draw_mtf, front.otf(), "spatial frequency (cycles/degree)"),
        (drawing.draw_spot, geometric.spot(eye, 5.0, rings=10), "x (arcmin)"),
    ):
        ax = Figure().subplots()
        assert draw(thing, ax) is ax
        assert ax.get_xlabel() == x_label
    ax = drawing.draw_through_focus(np.array([0.0, 1.0]), np.array([1.0, 0.5]), Figure().subplots())
    assert ax.get_xlabel() == "vergence of the object (dpt)"


def test_the_ray_fan_is_antisymmetric_on_axis(axes):
    drawing.draw_ray_fan(ic.eyes.navarro(3.0), axes)
    for line in axes.lines:
        height, error = line.get_xdata(), line.get_ydata()
        np.testing.assert_allclose(error, -error[::-1], atol=1e-9)
        # Undercorrected: rays from the upper rim land where things lower in the field are seen.
        assert abs(height[-1]) == pytest.approx(1.69, abs=0.03)
        assert np.ptp(error) > 1
