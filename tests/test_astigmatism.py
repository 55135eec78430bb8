"""Astigmatic eyes: powers, refractions and focal lines, from formulas and by real rays."""

import dataclasses

import numpy as np
import pytest
from test_asymmetric_eyes import NM, changed, crooked

import isetcl as ic
from isetcl.eye import astigmatism
from isetcl.eye.aberrations.refraction_error import oblique_foci
from isetcl.eye.placement import Placement
from isetcl.eye.prescription import elements
from isetcl.eye.sequential import trace_elements


def reduced_toric(radius_x, radius_y, axis_deg=0.0, stop_mm=0.1):
    """One toric surface in front of water, focused on infinity by its y section."""
    water = ic.Medium("water", ic.ConstantIndex(4.0 / 3.0))
    surface = ic.Surface.toric(
        "cornea",
        0.0,
        (radius_x, radius_y),
        axis_deg=axis_deg,
        semi_diameter_mm=4.0,
        medium_after=water,
    )
    stop = ic.Stop(0.01, stop_mm)
    return ic.Eye("toric", (surface,), stop, ic.Retina.from_radius(22.2, -12.0))


@pytest.mark.parametrize("axis_deg", [0.0, 30.0, 90.0, 135.0])
def test_a_toric_cornea_has_the_cylinder_of_its_radii(axis_deg):
    radius_x, radius_y = 5.3, 5.7
    eye = reduced_toric(radius_x, radius_y, axis_deg)
    vergence = 1000.0 * (4.0 / 3.0) / 22.2
    in_x, in_y = (vergence - 1000.0 / 3.0 / r for r in (radius_x, radius_y))
    mean, half = (in_x + in_y) / 2.0, (in_x - in_y) / 2.0
    turn = np.radians(2.0 * axis_deg)
    expected = (mean, half * np.cos(turn), half * np.sin(turn))
    got = astigmatism.paraxial_refraction(eye, NM)
    assert dataclasses.astuple(got) == pytest.approx(expected, abs=1e-9)
    # Real rays of a narrow pupil; their entrance pupil lies 10 um behind the vertex.
    real = eye.wavefront((0.0, 0.0), NM, samples=64).refraction()
    assert dataclasses.astuple(real) == pytest.approx(expected, abs=2e-3)
    power = [1000.0 / 3.0 / r for r in (radius_x, radius_y)]
    meridians = astigmatism.principal_meridians(eye, NM)
    assert meridians.power_dpt == pytest.approx((power[0], power[1]), abs=1e-9)
    assert meridians.axis_deg == pytest.approx(axis_deg % 180.0, abs=1e-6)
    assert eye.power_dpt(NM) == pytest.approx(sum(power) / 2.0, abs=1e-9)


def test_the_power_matrix_of_a_whole_eye_turns_real_rays():
    eye = crooked()
    eye = changed(
        eye,
        surfaces=tuple(
            dataclasses.replace(
                s,
                placement=None if s.placement is None else Placement(axis_deg=s.placement.axis_deg),
            )
            for s in eye.surfaces
        ),
    )
    h = 1e-4
    origins = np.array([(h, 0.0, -1.0), (0.0, h, -1.0)])

    refracting = tuple(e for e in elements(eye, NM)[:-1] if e.name != "stop")
    rays = trace_elements(refracting, origins, np.array([(0.0, 0.0, 1.0)] * 2), "retina")
    slope = rays.directions[:, :2] / rays.directions[:, 2:]
    got = -slope.T * float(eye.indices(NM)[-1]) / h * 1000.0
    expected = astigmatism.power_matrix_dpt(eye, NM)
    np.testing.assert_allclose(got, expected, atol=1e-4)
    assert abs(expected[0, 1]) > 0.3


def test_focal_lines_of_sturm_s_interval_lie_where_the_powers_say():
    eye = reduced_toric(5.3, 5.7)
    source = eye.wavefront((0.0, 0.0), NM)  # the eye is legal
    assert source.rms_um > 0

    cornea = elements(eye, NM)[:1]
    turn = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    h = 0.01
    origins = np.stack([h * np.cos(turn), h * np.sin(turn), np.full(16, -1.0)], axis=1)
    rays = trace_elements(cornea, origins, np.broadcast_to([0.0, 0.0, 1.0], (16, 3)), "retina")
    for axis, radius in ((0, 5.3), (1, 5.7)):
        z = 4.0 * radius  # n' / F = (4/3) / ((1/3) / R)
        along = (z - rays.positions_mm[:, 2]) / rays.directions[:, 2]
        place = rays.positions_mm + along[:, None] * rays.directions
        # A line: no width across, and that of similar triangles along.
        assert np.max(np.abs(place[:, axis])) < 1e-6 * 10
        other = 4.0 * (5.7 if axis == 0 else 5.3)
        assert np.max(np.abs(place[:, 1 - axis])) == pytest.approx(h * abs(1 - z / other), rel=1e-3)


def test_narrow_pencils_have_the_oblique_foci_of_a_figure_of_revolution():
    eye = ic.eyes.navarro(3.0)
    foci = oblique_foci(eye, 20.0, NM)
    tangential, sagittal = float(foci.tangential_dpt[0]), float(foci.sagittal_dpt[0])
    mean, half = (tangential + sagittal) / 2.0, (tangential - sagittal) / 2.0
    for turn in (0.0, 35.0, 90.0):
        angle = np.radians(turn)
        field = (20.0 * np.cos(angle), 20.0 * np.sin(angle))
        got = astigmatism.pencil_refraction(eye, field, NM)
        expected = (mean, half * np.cos(2.0 * angle), half * np.sin(2.0 * angle))
        assert dataclasses.astuple(got) == pytest.approx(expected, abs=1e-4)


def test_a_narrow_pencil_sees_the_cylinder_of_a_toric_cornea():
    eye = reduced_toric(5.3, 5.7, 30.0)
    got = astigmatism.pencil_refraction(eye, (0.0, 0.0), NM)
    expected = astigmatism.paraxial_refraction(eye, NM)
    # The entrance pupil lies 10 um behind the vertex.
    assert dataclasses.astuple(got) == pytest.approx(dataclasses.astuple(expected), abs=1e-4)


def test_an_astigmatic_eye_is_in_focus_at_the_circle_of_least_confusion():
    eye = reduced_toric(5.5, 5.7)
    # The mean square is (P_x + V)^2 + (P_y + V)^2: least at the mean.
    mean = -astigmatism.paraxial_refraction(eye, NM).m_dpt
    assert eye.focus_vergence_dpt(NM) == pytest.approx(mean, abs=2e-3)


def test_an_eye_tells_its_meridians_and_pencils():
    eye = crooked()
    assert eye.principal_meridians(NM) == astigmatism.principal_meridians(eye, NM)
    assert eye.pencil_refraction(5.0, NM) == astigmatism.pencil_refraction(eye, (0.0, 5.0), NM)
    with pytest.raises(ic.InvalidInputError, match="figures of revolution"):
        eye.longitudinal_spherical_aberration_dpt([1.0])
