"""Drawings show what was computed."""

import math

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

import isetcl as ic
from isetcl.eye.pictures import curve_pictures, wave_pictures
from isetcl.eye.pictures.overview import Overview
from isetcl.eye.pictures.picture_parts import round_length, wavelength_colour
from isetcl.eye.pictures.ray_fan import half_chord_mm
from isetcl.eye.waves import zernike


@pytest.fixture
def axes():
    return Figure().subplots()


@pytest.fixture(scope="module")
def eye():
    return ic.eyes.navarro(3.0)


def test_the_section_of_an_eye_shows_surfaces_stop_retina_and_rays(axes, eye):
    eye.plot(axes, fields_deg=(0.0, 20.0), rays=5)
    # 4 surfaces, the rims of cornea and lens, 2 blades, the retina and 10 rays.
    assert len(axes.lines) == 4 + 4 + 2 + 1 + 10
    # Only cornea and lens are tinted.
    assert len(axes.patches) == 2
    axial = axes.lines[13]
    np.testing.assert_allclose(axial.get_ydata(), 0.0, atol=1e-9)
    assert axial.get_xdata()[-1] == pytest.approx(eye.axial_length_mm)
    with pytest.raises(ic.InvalidInputError, match="option of plot"):
        eye.plot(axes, colour="red")
    with pytest.raises(ic.InvalidInputError, match="matplotlib axes"):
        eye.plot("here")


def test_a_tilted_and_shifted_surface_is_drawn_where_it_lies(axes, eye):
    front = eye.surfaces[2]
    tilt = ic.Placement((0.0, 0.3), (10.0, 0.0), 90.0)
    moved = ic.Surface(
        front.name,
        front.vertex_z_mm,
        front.curvature,
        front.conic,
        2.0,
        front.medium_after,
        placement=tilt,
    )
    other = ic.Eye("one", (eye.surfaces[0], moved), ic.Stop(1.0, 0.5), eye.retina)
    other.plot(axes, rays=1)
    z, y = axes.lines[1].get_data()
    middle = len(z) // 2
    assert (z[middle], y[middle]) == pytest.approx((front.vertex_z_mm, 0.3))
    # A rotation by +10 degrees about x turns +y towards +z.
    sag = float(front.sag_mm(2.0))
    c, s = math.cos(math.radians(10)), math.sin(math.radians(10))
    ends = {(z[0], y[0]), (z[-1], y[-1])}
    for side in (2.0, -2.0):
        expected = (front.vertex_z_mm + s * side + c * sag, 0.3 + c * side - s * sag)
        assert min(math.dist(expected, end) for end in ends) < 1e-9


def test_the_chord_of_an_elliptical_stop_follows_the_ellipse():
    # x^2 / a^2 + y^2 / b^2 = 1, a = 2, b = 1, turned by 30 degrees: 1/r^2 along y.
    stop = ic.Stop(3.0, 4.0, (0.5, -0.2), 2.0, 30.0)
    along_y = (math.sin(math.radians(30)) / 2) ** 2 + math.cos(math.radians(30)) ** 2
    assert half_chord_mm(stop, 1) == pytest.approx(along_y**-0.5)
    assert half_chord_mm(ic.Stop(3.0, 4.0), 0) == pytest.approx(2.0)


def test_the_ray_fan_is_antisymmetric_on_axis_and_shows_undercorrection(eye):
    fan = eye.ray_fan(0.0)
    np.testing.assert_allclose(fan.tangential_arcmin, fan.sagittal_arcmin, atol=1e-9)
    error = fan.tangential_arcmin
    np.testing.assert_allclose(error, -error[::-1], atol=1e-9)
    assert (fan.pupil[0], fan.pupil[-1]) == (-1.0, 1.0)
    # Myopic: upper rays cross the axis before the retina and land low there, which is seen high.
    assert error[-1] > 1.0


def test_the_slope_of_the_fan_is_the_defocus(eye):
    # d(angle) / d(height) = defocus: the refraction of narrow pencils less the object's vergence.
    fan = eye.ray_fan(0.0, object_distance_m=0.4, rays=2001)
    slope = (fan.tangential_arcmin[1001] - fan.tangential_arcmin[999]) / 0.002
    defocus = float(eye.oblique_foci(0.0).tangential_dpt[0]) + 2.5
    height_m = eye.entrance_pupil().radius_mm / 1000.0
    # Vergences are measured at the cornea and at the entrance pupil, 3 mm behind: 1 %.
    assert slope == pytest.approx(-defocus * height_m * 60 * 180 / math.pi, rel=0.02)


def test_fans_and_spots_of_other_wavelengths_are_displaced_by_the_transverse_aberration(eye):
    shift = eye.tca_arcmin(10.0, [450.0], 550.0)[0]
    fan = eye.ray_fan(10.0, 450.0, reference_nm=550.0, rays=3)
    assert fan.tangential_arcmin[1] == pytest.approx(shift[1], abs=1e-6)
    blue, green = eye.spots(10.0, [450.0, 550.0], reference_nm=550.0, rings=9)
    alone = eye.spot(10.0, 450.0, rings=9, scale_wavelength_nm=550.0)
    np.testing.assert_allclose(blue.y_arcmin - alone.y_arcmin, shift[1], atol=1e-9)
    np.testing.assert_array_equal(green.y_arcmin, eye.spot(10.0, 550.0, rings=9).y_arcmin)


def test_a_spot_needs_spokes_enough_for_the_map_of_its_pupil(eye):
    # 8 rings have 24 spokes, between which cos(12 phi) vanishes: no fit of degree 12.
    few, many = eye.spot(5.0, rings=9), eye.spot(5.0, rings=24)
    assert few.rms_arcmin == pytest.approx(many.rms_arcmin, rel=1e-6)
    with pytest.raises(ic.InvalidInputError, match="rings must be between 9 and 400"):
        eye.spot(5.0, rings=8)


def test_spot_diagrams_have_a_panel_for_each_field_on_one_scale(eye):
    figure = eye.plot_spots((0.0, 8.0), (500.0, 600.0), Figure())
    assert len(figure.axes) == 2
    widths = [np.ptp(ax.get_xlim()) for ax in figure.axes]
    heights = [np.ptp(ax.get_ylim()) for ax in figure.axes]
    np.testing.assert_allclose(widths + heights, widths[0])
    # The Airy ring: 1.22 lambda / D, D the entrance pupil.
    ring = figure.axes[0].lines[-1]
    expected = 1.2197 * 600e-6 / eye.entrance_pupil(600.0).diameter_mm * 60 * 180 / math.pi
    assert np.max(ring.get_ydata()) == pytest.approx(expected, rel=0.01)
    assert "RMS" in figure.axes[0].get_title()


def test_the_mtf_curves_are_those_of_the_wavefront(axes, eye):
    eye.plot_mtf((0.0, 10.0), ax=axes, largest_cpd=40.0)
    lines = {line.get_label(): line for line in axes.lines}
    frequency = lines["10° tangential"].get_xdata()
    # A field upwards: its tangential section is that of y.
    for section, orientation in (("tangential", 90.0), ("sagittal", 0.0)):
        expected = eye.mtf(frequency, 10.0, orientation_deg=orientation)
        np.testing.assert_allclose(lines[f"10° {section}"].get_ydata(), expected, atol=1e-9)
    # Without aberrations: the overlap of two discs.
    u = frequency / (math.pi / 180 * eye.entrance_pupil().diameter_mm / 550e-6)
    limit = 2 / math.pi * (np.arccos(u) - u * np.sqrt(1 - u * u))
    np.testing.assert_allclose(lines["diffraction limit"].get_ydata(), limit, atol=5e-3)


def test_the_wavefront_is_drawn_in_mm_of_the_entrance_pupil_without_tilt(eye):
    front = eye.wavefront(10.0, samples=32)
    ax = wave_pictures.draw_opd(front, Figure().subplots())
    left, right, _, _ = ax.images[0].get_extent()
    assert right - left == pytest.approx(eye.entrance_pupil().diameter_mm, rel=0.03)
    shown = np.ma.filled(ax.images[0].get_array(), np.nan)[front.inside]
    flux = front.flux[front.inside]
    assert np.sqrt(np.sum(flux * shown**2)) == pytest.approx(front.rms_um, rel=1e-9)
    assert "10°: RMS" in ax.get_title()


def test_zernike_bars_leave_out_piston_and_tilt(axes):
    fit = zernike.from_sparse({(1, 1): 9.0, (2, 0): 0.5, (4, 0): -0.2}, 2.0, 550.0)
    wave_pictures.draw_zernikes(fit, axes)
    widths = [bar.get_width() for bar in axes.patches]
    assert len(widths) == 12
    assert sorted(widths)[0] == -0.2
    assert sorted(widths)[-1] == 0.5
    assert axes.get_yticklabels()[1].get_text() == "Z(2, 0)  defocus"


def test_a_psf_is_cut_to_where_its_light_is(axes, eye):
    psf = eye.wavefront(5.0).psf(20.0, 128)
    wave_pictures.draw_psf(psf, axes, share=0.9)
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    x, y = np.meshgrid(psf.x_arcmin, psf.y_arcmin)
    within = (x > left) & (x < right) & (y > low) & (y < high)
    light = psf.density_per_arcmin2
    assert np.sum(light[within]) / np.sum(light) == pytest.approx(0.9, abs=0.02)
    bar = axes.lines[0].get_xdata()
    assert f"{bar[1] - bar[0]:g} arcmin" == axes.texts[0].get_text()
    with pytest.raises(ic.InvalidInputError, match="decades must be > 0"):
        wave_pictures.draw_psf(psf, Figure().subplots(), decades=-1.0)


def test_a_logarithmic_psf_ends_at_its_decades(eye):
    ax = eye.plot_psf(0.0, ax=Figure().subplots(), fov_arcmin=10.0, decades=3.0)
    values = ax.images[0].get_array()
    assert values.max() - values.min() == pytest.approx(3.0)


def test_through_focus_is_best_at_the_best_focus(axes, eye):
    grid = np.linspace(-0.4, 0.8, 13)
    eye.plot_through_focus(grid, "rms", axes)
    curve, mark = axes.lines
    values, best = curve.get_ydata(), mark.get_xdata()[0]
    assert best == pytest.approx(grid[np.argmin(values)], abs=0.1)
    assert eye.through_focus([best], "rms")[0] <= np.min(values)
    assert axes.get_ylabel() == "RMS wavefront error (µm)"


def test_through_focus_takes_the_samples_that_its_defocus_needs(eye):
    # 4 dpt at 3 mm are 8 waves at the rim: too many for the 64 samples of the eye in focus.
    assert eye.wavefront().samples == 64
    assert 0.0 < eye.through_focus([4.0])[0] < 0.05


def test_chromatic_and_oblique_curves_are_labelled_and_computed(eye):
    ax = ic.eyes.gullstrand().plot_lca(None, Figure().subplots())
    assert ax.get_title() == "no dispersion published"
    ax = eye.plot_lca([450.0, 589.3, 650.0], Figure().subplots())
    assert ax.get_title().startswith("LCA")
    values = ax.lines[1].get_ydata()
    assert values[1] == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(values, eye.lca_dpt([450.0, 589.3, 650.0]))
    ax = eye.plot_oblique_foci([0.0, 20.0], Figure().subplots())
    foci = eye.oblique_foci([0.0, 20.0])
    mean = (foci.tangential_dpt + foci.sagittal_dpt) / 2
    np.testing.assert_allclose(ax.lines[3].get_ydata(), mean)
    assert ax.get_xlabel() == "field angle (°)"
    ax = curve_pictures.draw_through_focus(np.array([0.0, 1.0]), np.ones(2), Figure().subplots())
    assert ax.get_xlabel() == "vergence of the object (dpt)"


def test_an_eye_answers_for_its_modules(eye):
    frequency = [5.0, 20.0]
    near = eye.mtf(frequency, 5.0, model="geometric", orientation_deg=90.0)
    np.testing.assert_array_equal(near, eye.spot(5.0).mtf(frequency, 90.0))
    grid = {"wavelengths_nm": [500.0, 600.0], "model": "geometric"}
    many = eye.polychromatic_mtf(frequency, **grid)
    assert many.shape == (2,)
    assert np.all(many < 1.0)
    with pytest.raises(ic.InvalidInputError, match="option of polychromatic_mtf"):
        eye.polychromatic_mtf(frequency, pupil=3.0)
    with pytest.raises(ic.InvalidInputError, match="option of ray_fan"):
        eye.ray_fan(0.0, stop=3.0)
    with pytest.raises(ic.InvalidInputError, match="unknown model"):
        eye.mtf(frequency, model="both")
    m = eye.refraction(definition="zernike").m_dpt
    assert m == pytest.approx(eye.wavefront().refraction("zernike").m_dpt)
    assert eye.longitudinal_spherical_aberration_dpt([1.0])[0] > 0


def test_all_pictures_together_say_what_cannot_be_drawn(eye):
    overview = Overview(eye, (0.0, 5.0))
    assert "section" in overview.names()
    figure = Figure()
    assert overview.draw_or_say("lca", figure) is None
    # One field angle of two is left out by name; without any there is only the reason.
    assert Overview(eye, (0.0, 170.0)).draw_or_say("mtf", figure) is None
    assert "left out: 170°" in figure.get_suptitle()
    assert len(figure.axes[-1].lines) == 3
    reason = Overview(eye, (170.0,)).draw_or_say("mtf", figure)
    assert "field angle must be at most" in reason
    assert "field angle" in figure.axes[0].texts[0].get_text()
    with pytest.raises(ic.InvalidInputError, match="unknown picture"):
        overview.draw("portrait")
    with pytest.raises(ic.InvalidInputError, match="pass axes as ax"):
        eye.plot_fan(0.0, figure="here")


def test_round_lengths_and_colours():
    assert [round_length(x) for x in (0.9, 1.0, 4.99, 7.0, 23.0)] == [0.5, 1.0, 2.0, 5.0, 20.0]
    blue, red = (np.array(wavelength_colour(w)) for w in (440.0, 680.0))
    assert blue[2] > blue[0]
    assert red[0] > red[2]
    assert to_hex(wavelength_colour(300.0)) == to_hex(wavelength_colour(400.0))
