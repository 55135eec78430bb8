"""One eye's transfer by three ways, against Zemax, and drawn beside people's."""

import csv
import math

import numpy as np
import pytest
from typer.testing import CliRunner

import isetcl as ic
from isetcl import cli
from isetcl.eye.people.human_mtf import watson_2013_mtf
from isetcl.eye.people.population import Population
from isetcl.eye.people.virtual_eye import radial_mtf
from isetcl.eye.waves.zernike import ZernikeFit
from isetcl.validation import three_mtfs
from isetcl.validation.transfer.population_band import population_band, published_band

# Zemax: Navarro eye, stop 4 mm, object at infinity, without diffraction; at these cycles/mm.
ZEMAX_CPMM = np.array([10.0, 20.0, 30.0, 50.0, 100.0])
ZEMAX_550 = [0.869452, 0.594879, 0.391965, 0.326540, 0.220863]
ZEMAX_PHOTOPIC = [0.847766, 0.598627, 0.452803, 0.336307, 0.201237]
PHOTOPIC = {
    "wavelengths_nm": [470.0, 510.0, 555.0, 610.0, 650.0],
    "weights": [0.091, 0.503, 1.0, 0.503, 0.107],
}


def check_agreement(found, tolerance=0.01):
    """All three agree within the tolerance and three standard errors of the edge."""
    error = 3.0 * found.slanted_edge_error
    assert np.all(np.abs(found.slanted_edge - found.line_spread) < tolerance + error)
    assert np.all(np.abs(found.slanted_edge - found.wavefront) < tolerance + error)
    assert np.max(np.abs(found.line_spread - found.wavefront)) < tolerance
    # The errors leave the claim something to say.
    assert np.max(error[found.frequency_cpd <= found.frequency_cpd[-1] / 2.0]) < 0.01


def test_the_rendered_edge_of_the_navarro_eye_has_the_transfer_that_zemax_gives():
    found = three_mtfs(ic.eyes.navarro(4.0), largest_cpd=40.0, spp=512)
    for values in (found.slanted_edge, found.line_spread, found.wavefront):
        at = np.interp(ZEMAX_CPMM, found.measured.frequency_cpmm, values)
        np.testing.assert_allclose(at, ZEMAX_550, rtol=0.0, atol=0.01)
    check_agreement(found)


@pytest.mark.slow
def test_in_photopic_light_the_rendered_edge_has_the_transfer_that_zemax_gives():
    found = three_mtfs(ic.eyes.navarro(4.0), spp=512, **PHOTOPIC)
    for values in (found.slanted_edge, found.line_spread, found.wavefront):
        at = np.interp(ZEMAX_CPMM, found.measured.frequency_cpmm, values)
        np.testing.assert_allclose(at, ZEMAX_PHOTOPIC, rtol=0.0, atol=0.01)
    check_agreement(found)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("eye", "options"),
    [
        (lambda: ic.eyes.navarro(3.0), {"field_deg": 10.0}),
        (lambda: ic.eyes.navarro(3.0), {"field_deg": 10.0, "section": "tangential"}),
        (lambda: ic.eyes.navarro(3.0), {"field_deg": -15.0, "edge_angle_deg": 20.0, **PHOTOPIC}),
        (
            lambda: ic.eyes.navarro(3.0),
            {"field_deg": -15.0, "edge_angle_deg": 20.0, "section": "tangential", **PHOTOPIC},
        ),
        (
            lambda: ic.eyes.arizona(3.0, 2.0),
            {"object_distance_m": 0.5, "field_deg": 8.0, "section": "tangential"},
        ),
        (lambda: ic.eyes.arizona(3.0, 2.0), {"object_distance_m": 0.5, "edge_angle_deg": 12.0}),
        (lambda: ic.eyes.liou_brennan(4.0), {"wavelengths_nm": 600.0}),
    ],
)
def test_three_ways_agree_off_the_axis_and_for_other_eyes(eye, options):
    check_agreement(three_mtfs(eye(), largest_cpd=40.0, spp=1024, **options))


def test_the_sections_of_the_edge_are_those_of_the_eye():
    """At 10 degrees the tangential transfer of 10 cycles/degree is 0.18 below the sagittal one.

    Of an eye of revolution they are those of a field angle upwards, across stripes that lie.
    """
    eye = ic.eyes.navarro(3.0)
    for section, orientation in (("sagittal", 0.0), ("tangential", 90.0)):
        found = three_mtfs(eye, largest_cpd=40.0, field_deg=10.0, section=section, spp=64)
        f = found.frequency_cpd
        wanted = eye.mtf(f, 10.0, model="geometric", orientation_deg=orientation)
        np.testing.assert_allclose(found.line_spread, wanted, atol=1e-6)
        off = np.abs(found.slanted_edge - wanted)
        assert np.all((off < 0.01 + 4.0 * found.slanted_edge_error)[f <= 20.0])
        assert np.max(found.slanted_edge_error[f <= 10.0]) < 0.01
        assert found.measured.edge.position == pytest.approx(found.field_deg, abs=0.05)


@pytest.mark.slow
def test_where_diffraction_rules_bent_rays_and_waves_agree():
    """A 1 mm pupil has hardly an aberration, so that the three models are one."""
    found = three_mtfs(ic.eyes.navarro(1.0), model="diffraction", largest_cpd=30.0, spp=1024)
    check_agreement(found)


BAD = [
    ({"model": "wave"}, "unknown model"),
    ({"section": "radial"}, "unknown section"),
    ({"largest_cpd": 0.0}, "largest_cpd must be > 0"),
    ({"largest_cpd": 5000.0}, "lower largest_cpd"),
    ({"edge_angle_deg": 45.0}, "edge_angle_deg must lie between 2 and 40"),
    ({"weights": [1.0, 2.0]}, "weights must be one number"),
    ({"wavelengths_nm": [600.0, 500.0]}, "strictly ascending"),
    ({"wavelengths_nm": 100.0}, "wavelength"),
    ({"object_distance_m": -1.0}, "distance_m must be > 0 m"),
]


@pytest.mark.parametrize(("options", "message"), BAD)
def test_bad_arguments_are_refused_before_any_image_is_rendered(options, message):
    with pytest.raises(ic.InvalidInputError, match=message):
        three_mtfs(ic.eyes.navarro(3.0), **options)


def test_published_percentiles_hold_the_mean_eye():
    """Watson's mean eye of other data lies inside 90 % of the virtual eyes."""
    for pupil in (3.0, 4.0):
        band = published_band(pupil + 0.4)
        assert band.pupil_diameter_mm == pupil
        # Below 5 cycles/degree nothing is tabulated.
        f = np.linspace(5.0, 60.0, 31)
        low, mean, high = band.at(f)
        assert np.all((low <= mean) & (mean <= high))
        watson = watson_2013_mtf(f, pupil)
        assert np.all((low < watson) & (watson < high))
    assert published_band(2.0) is None


@pytest.mark.slow
def test_eyes_of_a_population_make_a_band():
    """Eyes with a random defocus only: percentiles are those of its size."""
    mean = ZernikeFit(np.zeros(6), 1.5, 550.0)
    covariance = np.zeros((6, 6))
    covariance[4, 4] = 0.1**2
    band = population_band(Population(mean, covariance), [0.0, 10.0, 20.0], 3.0, count=20, seed=3)
    eyes = Population(mean, covariance).draw(20, 3)
    worst = max(eyes, key=lambda eye: abs(eye.coefficients_um[4]))
    grid = np.arange(440.0, 681.0, 40.0)
    lowest = radial_mtf(worst, [10.0], pupil_diameter_mm=3.0, wavelengths_nm=grid)[0]
    assert lowest <= band.low[1] < band.mean[1] < band.high[1]
    assert band.mean[0] == pytest.approx(1.0)
    with pytest.raises(ic.InvalidInputError, match="count must be >= 20"):
        population_band(Population(mean, covariance), [0.0], 3.0, count=5)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--section", "radial", "--plot"], "unknown --section 'radial'"),
        (["--section", "tangential"], "add --plot"),
    ],
)
def test_the_command_refuses_a_section_that_it_cannot_draw(options, message):
    result = CliRunner().invoke(cli.app, ["mtf", "navarro", *options])
    assert result.exit_code != 0
    said = str(result.exception) + result.output
    assert message in " ".join(said.split())


@pytest.mark.slow
def test_the_command_draws_and_writes_the_three_transfers(tmp_path):
    result = CliRunner().invoke(
        cli.app,
        [
            *("mtf", "--eye", "navarro", "--pupil", "3", "--plot", "--step", "100"),
            *("--spp", "64", "-o", str(tmp_path)),
        ],
    )
    assert result.exit_code == 0, result.output
    assert "slanted edge and line spread" in result.output
    assert "of its light found beyond the image" in " ".join(result.output.split())
    assert (tmp_path / "three_mtfs.png").stat().st_size > 20000
    rows = list(csv.DictReader((tmp_path / "three_mtfs.csv").open()))
    assert float(rows[0]["slanted_edge"]) == pytest.approx(1.0)
    ten = min(rows, key=lambda row: abs(float(row["frequency_cpd"]) - 10.0))
    assert float(ten["population_low"]) < float(ten["population_mean"])
    assert abs(float(ten["slanted_edge"]) - float(ten["line_spread"])) < 0.03
    # The last tabulated frequency is drawn too.
    assert not math.isnan(float(rows[-1]["population_high"]))
