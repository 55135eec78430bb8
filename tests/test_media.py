"""Refractive indices against published tables."""

import numpy as np
import pytest

from isetcl.errors import InvalidInputError
from isetcl.eye.media import AbbeDispersion, ConstantIndex, CornuDispersion, Medium
from isetcl.eye.models import arizona, legrand, navarro
from isetcl.eye.models.parts import PupilSpec

# Escudero-Sanz & Navarro 1999, table of indices at four wavelengths.
NAVARRO_TABLE = {
    "cornea": (1.3828, 1.3777, 1.376, 1.3747),
    "aqueous": (1.3445, 1.3391, 1.3374, 1.336),
    "lens": (1.4292, 1.4222, 1.42, 1.4183),
    "vitreous": (1.3428, 1.3377, 1.336, 1.3347),
}


@pytest.mark.parametrize("name", NAVARRO_TABLE)
def test_navarro_dispersion_reproduces_the_published_table(name):
    media = {m.name: m for m in navarro.NavarroModel(PupilSpec(4.0)).eye(0.0).media()}
    got = media[name].index(np.array([458.0, 543.0, 589.3, 632.8]))
    np.testing.assert_allclose(got, NAVARRO_TABLE[name], atol=2e-4)


def test_navarro_lens_index_follows_the_accommodation_formula_of_1985():
    model = navarro.NavarroModel(PupilSpec(4.0))
    relaxed = model.eye(0.0).media()[3].index(550.0)
    # Weights of the four reference indices add to 1, so the shift passes unchanged.
    for a, expected in ((1.0, 1.42280), (5.0, 1.42856), (10.0, 1.43981)):
        lens = model.eye(a).media()[3].index(550.0)
        assert lens == pytest.approx(expected, abs=2e-5)
        assert lens - relaxed == pytest.approx(9e-5 * (10 * a + a * a), rel=2e-4)


def test_le_grand_dispersion_reproduces_the_paper_at_550_nm():
    eye = legrand.legrand_eye(PupilSpec(4.0))
    np.testing.assert_allclose(eye.indices(550.0)[1:], (1.379, 1.339, 1.422, 1.337), atol=5e-4)


@pytest.mark.parametrize("form", ["shifted_cauchy", "cauchy"])
def test_abbe_dispersion_has_the_index_and_abbe_number_it_was_given(form):
    d = AbbeDispersion(1.377, 57.1, form)
    n = d.evaluate(np.array([486.13, 587.56, 656.27]))
    assert n[1] == pytest.approx(1.377, abs=1e-12)
    assert (n[1] - 1) / (n[0] - n[2]) == pytest.approx(57.1, rel=1e-12)


def test_linear_abbe_dispersion_reproduces_iset3d_s_table():
    # ISET3d arizonaRefractiveIndices: cornea and lens at 400 and 700 nm.
    assert AbbeDispersion(1.377, 57.1, "linear").evaluate(
        np.array([400.0, 700.0])
    ) == pytest.approx([1.38434, 1.37271], abs=1e-5)
    assert AbbeDispersion(1.42, 51.9, "linear").evaluate(np.array([400.0, 700.0])) == pytest.approx(
        [1.42900, 1.41474], abs=1e-5
    )


def test_default_interpolation_of_the_arizona_eye_is_not_the_straight_line():
    assert arizona.ArizonaModel(PupilSpec(4.0)).interpolation == "shifted_cauchy"


@pytest.mark.parametrize(
    ("medium", "wavelength"),
    [
        (navarro.CORNEA, 364.9),
        (navarro.CORNEA, 1014.1),
        (legrand.CORNEA, 379.0),
        (legrand.CORNEA, 781.0),
        (Medium("x", AbbeDispersion(1.4, 50.0)), 790.0),
        (navarro.LENS and Medium("lens", navarro.LENS), float("nan")),
    ],
)
def test_a_wavelength_outside_the_range_of_a_dispersion_is_an_error(medium, wavelength):
    with pytest.raises(InvalidInputError, match="wavelength must lie between"):
        medium.index(wavelength)


@pytest.mark.parametrize("bad", [0.9, -1.0, float("nan"), float("inf")])
def test_an_index_below_one_is_refused(bad):
    with pytest.raises(InvalidInputError):
        ConstantIndex(bad)
    with pytest.raises(InvalidInputError):
        CornuDispersion(bad, 7.0)
