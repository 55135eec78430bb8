"""Eyes are validated when they are made, and describe themselves."""

import json
import math

import pytest

import isetcl as ic
from isetcl.eye.surface import conic_sag

WATER = ic.Medium("water", ic.ConstantIndex(1.33))


def surface(**changes):
    arguments = {
        "name": "cornea",
        "vertex_z_mm": 0.0,
        "radius_mm": 7.8,
        "semi_diameter_mm": 4.0,
        "medium_after": WATER,
    } | changes
    name, z, radius = (arguments.pop(k) for k in ("name", "vertex_z_mm", "radius_mm"))
    return ic.Surface.from_radius(name, z, radius, **arguments)


def eye(**changes):
    arguments = {
        "name": "test",
        "surfaces": (
            surface(),
            surface(name="lens", vertex_z_mm=4.0, radius_mm=-6.0, semi_diameter_mm=3.5),
        ),
        "stop": ic.Stop(3.0, 3.0),
        "retina": ic.Retina.from_radius(24.0, -12.0),
    } | changes
    return ic.Eye(**arguments)


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: surface(radius_mm=0.0), "radius_mm must be a non-zero"),
        (lambda: surface(radius_mm=float("nan")), "radius_mm"),
        (
            lambda: surface(semi_diameter_mm=-5.0),
            r"surface 'cornea': semi_diameter_mm must be > 0 mm, got -5",
        ),
        (lambda: surface(semi_diameter_mm=float("nan")), "finite"),
        (lambda: surface(semi_diameter_mm=7.9), "must be < 7.8 mm, where this conic ends"),
        (lambda: surface(conic=float("inf")), "conic must be finite"),
        (lambda: surface(vertex_z_mm=float("nan")), "vertex_z_mm must be finite"),
        (lambda: ic.Stop(3.0, 0.0), "stop: diameter_mm must be > 0"),
        (lambda: ic.Stop(3.0, -1.0), "stop: diameter_mm must be > 0"),
        (lambda: ic.Stop(float("nan"), 1.0), "stop: z_mm must be finite"),
        (lambda: ic.Retina.from_radius(24.0, 12.0), "negative radius"),
        (lambda: ic.Retina.from_radius(-24.0, -12.0), "vertex_z_mm must be > 0"),
        (lambda: eye(surfaces=()), "at least one refracting surface"),
        (lambda: eye(surfaces=(surface(vertex_z_mm=1.0),)), "must have vertex_z_mm = 0"),
        (lambda: eye(surfaces=(surface(), surface(name="lens", vertex_z_mm=-1.0))), "they cross"),
        (
            lambda: eye(
                surfaces=(surface(), surface(name="lens", vertex_z_mm=0.3, radius_mm=-6.0))
            ),
            "'lens' must lie behind 'cornea'.*cross",
        ),
        (lambda: eye(retina=ic.Retina.from_radius(3.5, -12.0)), "retina must lie behind"),
        (lambda: eye(stop=ic.Stop(0.5, 7.0)), "cuts surface 'cornea'"),
        (lambda: ic.eyes.navarro(0.0), "pupil_diameter_mm must be > 0"),
        (lambda: ic.eyes.navarro(float("nan")), "pupil_diameter_mm must be finite"),
        (lambda: ic.eyes.navarro(3.0, pupil_plane="exit"), "unknown pupil_plane"),
        (lambda: ic.eyes.navarro(3.0, -1.0), "accommodation_dpt must be >= 0"),
        (lambda: ic.eyes.navarro(3.0, 2.0, focus_criterion="strehl"), "focus criterion"),
        (lambda: ic.eyes.navarro(3.0, hold="lens"), "unknown hold"),
        (lambda: ic.eyes.navarro(3.0, accommodation_parameter=11.0), "between 0 and 10"),
        (lambda: ic.eyes.arizona(3.0, interpolation="lineal"), "did you mean linear"),
        (lambda: ic.eyes.legrand(3.0, state="asleep"), "unknown state"),
        (lambda: ic.eyes.by_name("navaro"), "did you mean navarro"),
        (lambda: ic.eyes.by_name("legrand", 3.0, 2.0), "accommodation_dpt must be left out"),
    ],
)
def test_bad_eyes_are_refused_with_the_rule(make, match):
    with pytest.raises(ic.InvalidInputError, match=match):
        make()


def test_a_plane_has_an_infinite_radius():
    assert surface(radius_mm=math.inf).curvature == 0.0
    assert surface(radius_mm=math.inf).radius_mm == math.inf


def test_the_sag_of_a_paraboloid_is_quadratic_and_of_a_sphere_circular():
    assert conic_sag(3.0, 0.125, -1.0) == pytest.approx(0.5 * 0.125 * 9.0)
    assert conic_sag(3.0, 0.2, 0.0) == pytest.approx(1.0)
    assert math.isnan(conic_sag(6.0, 0.2, 0.0))


def test_eyes_are_values():
    assert ic.eyes.navarro(3.0) == ic.eyes.navarro(3.0)
    assert hash(ic.eyes.navarro(3.0, 2.0)) == hash(ic.eyes.navarro(3.0, 2.0))
    assert ic.eyes.navarro(3.0) != ic.eyes.navarro(3.1)
    with pytest.raises(AttributeError):
        ic.eyes.navarro(3.0).name = "mine"


def test_a_stop_in_the_plane_of_a_vertex_acts_before_it_whatever_the_rounding():
    lens_z = 0.55 + 3.05
    assert lens_z != 3.6
    for stop_z in (lens_z, 3.6):
        both = (surface(), surface(name="lens", vertex_z_mm=lens_z, radius_mm=10.0))
        assert eye(surfaces=both, stop=ic.Stop(stop_z, 3.0)).stop_index == 1


@pytest.mark.parametrize("name", ["navarro", "arizona", "legrand"])
def test_the_description_of_an_eye_is_plain_json(name):
    model = ic.eyes.by_name(name)
    described = json.loads(json.dumps(model.describe()))
    assert described["name"] == name
    assert len(described["surfaces"]) == 4
    assert described["surfaces"][2]["curvature"] == model.surfaces[2].curvature
    assert described["surfaces"][0]["medium_after"]["dispersion"]["kind"].endswith("Dispersion")


def test_the_papers_tables_are_what_is_built():
    # Paper, tables 1 to 3: radii, conics, thicknesses, retina.
    tables = {
        "navarro": (
            (7.72, 6.5, 10.2, -6.0),
            (-0.26, 0, -3.1316, -1.0),
            (0, 0.55, 3.6, 7.6),
            23.9203,
            -12.0,
        ),
        "arizona": (
            (7.8, 6.5, 12.0, -5.224557),
            (-0.25, -0.25, -7.518749, -1.353971),
            (0, 0.55, 3.52, 7.287),
            24.0,
            -13.4,
        ),
        "legrand": ((7.8, 6.5, 10.2, -6.0), (0, 0, 0, 0), (0, 0.55, 3.6, 7.6), 24.19655, -13.4),
    }
    for name, (radii, conics, z, length, retina) in tables.items():
        model = ic.eyes.by_name(name)
        assert [s.radius_mm for s in model.surfaces] == pytest.approx(radii, rel=1e-12)
        assert [s.conic for s in model.surfaces] == pytest.approx(conics)
        assert [s.vertex_z_mm for s in model.surfaces] == pytest.approx(z)
        assert model.axial_length_mm == pytest.approx(length)
        assert model.retina.radius_mm == pytest.approx(retina)


def test_accommodation_moves_the_lens_as_the_papers_say():
    a = 5.0
    growth = math.log(a + 1)
    model = ic.eyes.navarro(4.0, accommodation_parameter=a)
    assert model.surfaces[2].radius_mm == pytest.approx(10.2 - 1.75 * growth)
    assert model.surfaces[2].conic == pytest.approx(-3.1316 - 0.34 * growth)
    assert model.surfaces[3].radius_mm == pytest.approx(-6.0 + 0.2294 * growth)
    assert model.surfaces[3].conic == pytest.approx(-1.0 - 0.125 * growth)
    assert model.surfaces[3].vertex_z_mm - model.surfaces[2].vertex_z_mm == pytest.approx(
        4.0 + 0.1 * growth
    )
    arizona = ic.eyes.arizona(4.0, accommodation_parameter=a)
    assert arizona.surfaces[2].radius_mm == pytest.approx(10.0)
    assert arizona.surfaces[3].radius_mm == pytest.approx(-4.224557)
    assert arizona.surfaces[2].conic == pytest.approx(-7.518749 + 6.4286)


def test_iset3d_s_file_for_parameter_4_95_is_reproduced():
    # Its example: R 7.076127, 5.590505; thickness 2.960746, 4.178507; Q -3.738524, -1.223134.
    growth = (10.2 - 7.076127) / 1.75
    model = ic.eyes.navarro(4.0, accommodation_parameter=math.exp(growth) - 1.0)
    assert model.surfaces[3].radius_mm == pytest.approx(-5.590505, abs=1e-5)
    assert model.surfaces[2].vertex_z_mm - 0.55 == pytest.approx(2.960746, abs=1e-6)
    assert model.surfaces[3].vertex_z_mm - model.surfaces[2].vertex_z_mm == pytest.approx(
        4.178507, abs=1e-6
    )
    assert model.surfaces[2].conic == pytest.approx(-3.738524, abs=1e-5)
    assert model.surfaces[3].conic == pytest.approx(-1.223134, abs=1e-5)
