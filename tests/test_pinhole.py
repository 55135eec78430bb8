"""The pinhole view and the layers of an image, against geometry."""

import numpy as np
import pytest

import isetcl as ic

pytestmark = pytest.mark.usefixtures("shared_kernels")

EYE = ic.eyes.navarro(3.0)
UNIT = ic.Spectrum.constant(1.0)
TWO = np.array([500.0, 600.0])
WHERE = {"fov_deg": 4.0, "resolution": 24, "wavelengths_nm": TWO}
RED = ic.Spectrum(np.array([400.0, 700.0]), np.array([0.2, 0.8]), "red")


def facing(distance, half=1.0):
    return ic.Quad((-half, -half, -distance), (2 * half, 0, 0), (0, 2 * half, 0))


def lit(material, distance, half=1.0, name="wall"):
    return ic.SceneObject(name, facing(distance, half), material)


def scene():
    """A small red card before a wall under an even sky, with a shining ball behind the wall."""
    return ic.Scene(
        (
            lit(ic.Diffuse(RED), 0.5, 0.005, "card"),
            lit(ic.Diffuse(ic.Spectrum.constant(0.5)), 2.0, 5.0),
            ic.SceneObject("ball", ic.Sphere((0, 0, -4.0), 1.0), ic.Emission(UNIT.scaled(3.0))),
        ),
        UNIT,
    )


@pytest.mark.parametrize("precision", ["single", pytest.param("double", marks=pytest.mark.slow)])
def test_layers_are_the_surfaces_along_each_ray(precision):
    view = ic.pinhole(scene(), EYE, layers="all", spp=64, precision=precision, **WHERE)
    # Card and wall have two sides each but no thickness; the ball is entered and left.
    assert view.layers == 4
    assert view.object_names == ("card", "wall", "ball")
    x = np.radians(view.dataset.x.values)
    y = np.radians(view.dataset.y.values)
    theta = np.hypot(*np.meshgrid(x, y))
    pupil = float(EYE.entrance_pupil(550.0).z_mm) / 1000
    on_card = view.dataset["object"].values[0] == 0
    half_deg = np.degrees(np.arctan(0.005 / (0.5 + pupil)))
    assert on_card.sum() == pytest.approx((2 * half_deg / (4 / 24)) ** 2, abs=12)
    first = view.vergence_dpt.values[0]
    np.testing.assert_allclose(first[on_card], 2.0, rtol=1e-5)
    np.testing.assert_allclose(first[~on_card], 0.5, rtol=1e-5)
    np.testing.assert_allclose(view.vergence_dpt.values[1][on_card], 0.5, rtol=1e-5)
    assert np.all(view.dataset["object"].values[1][~on_card] == 2)
    # A chord of the ball along the ray, from the pupil.
    centre = 4.0 + pupil
    chord = np.sqrt(1.0 - (centre * np.sin(theta)) ** 2)
    expected = centre * np.cos(theta) - chord
    found = view.dataset["distance_m"].values
    np.testing.assert_allclose(found[1][~on_card], expected[~on_card], rtol=1e-4)
    np.testing.assert_allclose(found[2][~on_card], (expected + 2 * chord)[~on_card], rtol=1e-4)
    np.testing.assert_allclose(found[2][on_card], expected[on_card], rtol=1e-4)
    assert np.all(view.dataset["object"].values[3][~on_card] == -1)


def test_radiance_of_layers_is_what_would_be_seen():
    view = ic.pinhole(scene(), EYE, layers=3, spp=256, **WHERE)
    radiance, error = view.radiance.values, view.dataset["standard_error"].values
    on_card = view.dataset["object"].values[0] == 0
    # The wall and the card face the sky on their side: half of it is the wall's light on the card.
    card = radiance[0][:, on_card].mean(axis=1)
    assert card[1] / card[0] == pytest.approx(RED.at(TWO)[1] / RED.at(TWO)[0], rel=0.02)
    assert error[0].max() < 0.1
    np.testing.assert_array_equal(radiance[1][:, ~on_card], 3.0)
    np.testing.assert_array_equal(radiance[2][:, on_card], 3.0)
    # Wall 10 m wide: the sky before it, less the card's shadow, which is too small to matter.
    wall = radiance[0][:, ~on_card].mean()
    assert wall == pytest.approx(0.5, rel=2e-3)


def test_an_image_has_layers_on_request(precision):
    image = ic.render(scene(), EYE, spp=4, layers=True, precision=precision, **WHERE).dataset
    assert image["object"].dims == ("y", "x")
    on_card = image["object"].values == 0
    albedo = image["albedo"].values
    np.testing.assert_allclose(albedo[:, on_card].mean(axis=1), RED.at(TWO), rtol=1e-5)
    np.testing.assert_allclose(albedo[:, ~on_card], 0.5, rtol=1e-6)
    np.testing.assert_allclose(image["normal"].values[2], 1.0, atol=1e-6)
    position = image["position_m"].values
    np.testing.assert_allclose(position[2][on_card], -0.5, rtol=1e-5)
    across = np.degrees(np.arctan2(position[0], 0.00304 - position[2]))
    expected = np.meshgrid(image.x.values, image.y.values)[0]
    np.testing.assert_allclose(across, expected, atol=0.01)
    assert set(np.unique(image["material"].values)) == {0, 1}


def test_emitting_scenes_have_layers_too():
    flat = ic.scenes.two_planes(near_m=0.5, far_m=2.0, edge_angle_deg=20.0)
    image = ic.render(flat, EYE, spp=4, layers=True, **WHERE)
    plain = ic.render(flat, EYE, spp=4, **WHERE)
    np.testing.assert_array_equal(image.irradiance.values, plain.irradiance.values)
    np.testing.assert_allclose(
        image.dataset["vergence_dpt"].values, plain.vergence_dpt.values, rtol=1e-4
    )
    assert "object" not in plain.dataset
    assert set(np.unique(image.dataset["object"].values)) <= {0, 1}


def test_layers_of_mixed_coated_metal_and_glass_have_their_reflectance():
    metal = ic.ComplexIndex([300.0, 900.0], [0.5, 0.5], [3.0, 3.0], "test")
    normal = ((0.5 - 1) ** 2 + 9) / ((0.5 + 1) ** 2 + 9)
    glass = ic.Dielectric(ic.Medium("glass", ic.ConstantIndex(1.5)))
    grey = ic.Diffuse(ic.Spectrum.constant(0.4))
    cases = {
        "coat": (ic.Coated(ic.Spectrum.constant(0.3)), 0.3),
        "metal": (ic.Conductor(metal), normal),
        "glass": (glass, 0.0),
        "mix": (ic.Mix(grey, ic.Conductor(metal), 0.25), 0.75 * 0.4 + 0.25 * normal),
    }
    for material, expected in cases.values():
        s = ic.Scene((lit(material, 1.0),), UNIT)
        albedo = ic.render(s, EYE, spp=2, layers=True, fov_deg=1.0, resolution=4).dataset["albedo"]
        np.testing.assert_allclose(albedo.values, expected, rtol=1e-4, atol=1e-7)


def test_a_view_is_saved_and_loaded(tmp_path):
    view = ic.pinhole(scene(), EYE, layers=2, spp=2, **WHERE)
    again = ic.PinholeView.load(view.save(tmp_path / "view.nc"))
    np.testing.assert_array_equal(again.radiance.values, view.radiance.values)
    assert again.object_names == view.object_names
    with pytest.raises(ic.FileError, match="does not exist"):
        ic.PinholeView.load(tmp_path / "none.nc")
    (tmp_path / "junk.nc").write_bytes(b"junk")
    with pytest.raises(ic.FileError, match="no pinhole view"):
        ic.PinholeView.load(tmp_path / "junk.nc")


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"layers": 0}, "layers must be"),
        ({"layers": "some"}, "layers must be"),
        ({"layers": 1000}, "layers must be"),
        ({"spp": 1}, "spp must be"),
    ],
)
def test_bad_views_are_refused(options, match):
    with pytest.raises(ic.InvalidInputError, match=match):
        ic.pinhole(scene(), EYE, **options)
