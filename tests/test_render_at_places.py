"""Rendering at apertures: against closed forms, against images, and what is refused."""

import numpy as np
import pytest
from scipy.special import erf

import isetcl as ic
from isetcl.cones import ConeMosaic
from isetcl.errors import FileError, InvalidInputError, OutOfMemoryError
from isetcl.eye.throughput import axial_irradiance_per_radiance
from isetcl.render.plan import plan
from isetcl.retina.places import IrradianceAtPlaces, PlaceGrid, Places, mean_and_error

pytestmark = pytest.mark.filterwarnings("ignore:this light was rendered without")

EYE = ic.eyes.navarro(pupil_diameter_mm=3.0, accommodation_dpt=1.0)
WAVES = np.array([450.0, 500.0, 550.0, 600.0, 650.0])
EDGE = ic.scenes.slanted_edge(1.0, 0.0, contrast=1.0)


def tilted():
    """An eye that is no figure of revolution."""
    return ic.eyes.liou_brennan(3.0)


@pytest.mark.parametrize("make", [lambda: EYE, tilted])
def test_apertures_are_discs_on_the_retina(make):
    # Points that the shapes make of a circle lie at the radius from the middle, in space.
    eye = make()
    at = np.array([[0.0, 0.0], [3.0, 0.0], [6.0, -8.0], [-0.3, 9.0]])
    places = Places(at, np.array([1.0, 2.0, 4.0, 5.0]))
    grid = PlaceGrid.around(eye, places)
    chart = eye.field_map()
    for turn in np.linspace(0.0, 2 * np.pi, 7):
        field = at + grid.shapes_deg @ np.array([np.cos(turn), np.sin(turn)])
        apart = chart.retinal_point_mm(*field.T) - chart.retinal_point_mm(*at.T)
        length = np.linalg.norm(apart, axis=-1)
        np.testing.assert_allclose(1e3 * length, places.radius_um, rtol=2e-3)


@pytest.fixture(scope="module")
def edge_shares():
    """Share of the bright side in apertures far wider than blur, by offset in radii."""
    radius_um = 60.0
    per_deg = EYE.field_map().axial_scale_mm_per_deg()
    offset = np.linspace(-1.2, 1.2, 13)
    across = np.array([np.cos(np.pi / 6), np.sin(np.pi / 6)])
    at = (offset * 1e-3 * radius_um / per_deg)[:, None] * across
    edge = ic.scenes.slanted_edge(1.0, 30.0, contrast=1.0)
    shares = {}
    for is_gaussian in (False, True):
        light = ic.render(
            edge,
            EYE,
            at=Places(at, np.full(13, radius_um), is_gaussian),
            wavelengths_nm=[550.0],
            spp=1 << 15,
        )
        whole = axial_irradiance_per_radiance(EYE, 550.0)
        radiance = EDGE.objects[0].material.radiance.at([550.0])[0]
        shares[is_gaussian] = light.irradiance.values[0] / (whole * radiance)
    return offset, shares


@pytest.mark.slow
def test_samples_are_uniform_over_a_disc(edge_shares):
    # The part of a disc left of a line at a distance d: (arccos d - d sqrt(1 - d^2)) / pi.
    # The samples' own error is 4e-4.
    offset, shares = edge_shares
    d = np.clip(offset, -1.0, 1.0)
    expected = (np.arccos(d) - d * np.sqrt(1.0 - d**2)) / np.pi
    np.testing.assert_allclose(shares[False], expected, atol=1.2e-3)


@pytest.mark.slow
def test_samples_of_a_gaussian_follow_the_error_function(edge_shares):
    offset, shares = edge_shares
    np.testing.assert_allclose(shares[True], 0.5 * (1.0 - erf(offset)), atol=1.5e-3)


@pytest.mark.slow
def test_an_even_field_gives_the_closed_form(precision):
    # E = pi (n'/n)^2 L sin^2 theta' on axis, by the eye's exact aperture.
    at = np.array([[0.0, 0.0], [0.05, 0.0], [0.0, -0.05]])
    scene = ic.scenes.uniform()
    light = ic.render(
        scene,
        EYE,
        at=Places(at, np.array([1.0, 2.0, 3.0])),
        wavelengths_nm=WAVES,
        spp=256,
        precision=precision,
    )
    radiance = scene.background.at(WAVES) if scene.background is not None else None
    if radiance is None:
        radiance = scene.objects[0].emitted.spectra()[0].at(WAVES)
    exact = [axial_irradiance_per_radiance(EYE, nm) for nm in WAVES]
    expected = np.broadcast_to((radiance * exact)[:, None], (5, 3))
    np.testing.assert_allclose(light.irradiance.values, expected, rtol=2e-4)


@pytest.fixture(scope="module")
def cones():
    return ic.cones.mosaic(0.1, s_free_radius_deg=0.0)


@pytest.fixture(scope="module")
def at_the_cones(cones):
    options = {"wavelengths_nm": WAVES, "bands": 5}
    return cones.excitations(ic.render(EDGE, EYE, at=cones, spp=512, **options))


def test_cones_agree_with_the_image_route_within_their_error(cones, at_the_cones):
    # 165 cones, of which some 50 lie on the edge. Errors have 7 degrees of freedom, so that z^2 of
    # independent errors is 7 / 5 on average, and 1.7 with the image's own, which has four times the
    # samples in an aperture. An aperture moved by a tenth of its radius would give 10.
    image = ic.render(
        EDGE, EYE, fov_deg=0.12, resolution=80, spp=512, wavelengths_nm=WAVES, bands=5, seed=9
    )
    by_image = cones.excitations(image).mean.values[0]
    mean, error = at_the_cones.mean.values[0], at_the_cones.standard_error.values[0]
    z = (mean - by_image) / error
    assert mean.sum() == pytest.approx(by_image.sum(), rel=2e-3)
    steep = error > 0.2 * error.max()
    assert steep.sum() > 30
    assert np.mean(z[steep] ** 2) < 2.2
    assert np.abs(z[steep]).max() < 6.0


@pytest.mark.slow
def test_images_of_finer_pixels_come_nearer_to_the_cones_off_the_axis():
    # Pixels smear apertures by the square of their width: from one to four in an aperture the
    # difference must fall 8 times or more (16 without noise), at depth edges 15 deg from the axis.
    scene, mosaic = ic.scenes.two_planes(0.5, 2.0), ic.cones.mosaic(0.4, (12.0, 9.0))
    options = {"wavelengths_nm": WAVES[[0, 2]], "bands": 2}
    light = ic.render(scene, EYE, at=mosaic, spp=4096, **options)
    wanted = mosaic.excitations(light).mean.values[0]
    differences = []
    for pixels in (14, 56):
        image = ic.render(
            scene,
            EYE,
            fov_deg=0.44,
            resolution=pixels,
            centre_deg=(12.0, 9.0),
            spp=4096 * 14**2 // pixels**2 * 2,
            **options,
        )
        found = mosaic.excitations(image).mean.values[0]
        differences.append(np.sqrt(np.mean((found - wanted) ** 2)) / wanted.mean())
    assert differences[1] < differences[0] / 8
    assert differences[1] < 0.01


@pytest.mark.slow
def test_the_standard_error_is_the_spread_of_other_seeds(cones):
    # Eight seeds: the variance of 170 cones has over 1000 degrees of freedom together.
    runs = [
        cones.excitations(ic.render(EDGE, EYE, at=cones, spp=128, wavelengths_nm=WAVES, seed=s))
        for s in range(8)
    ]
    spread = np.var([run.mean.values[0] for run in runs], axis=0, ddof=1).sum()
    told = np.mean([np.square(run.standard_error.values[0]) for run in runs], axis=0).sum()
    assert told == pytest.approx(spread, rel=0.35)


def test_a_cone_does_not_depend_on_the_others_of_its_list():
    # The same extremes, so that the field angles are counted alike; other cones between.
    ends = [[0.3, 0.2], [-0.3, -0.2]]
    first = Places(np.array([[0.01, 0.02], [0.1, 0.1], *ends]), np.full(4, 2.0))
    other = Places(np.array([[0.01, 0.02], [-0.1, 0.0], *ends, [0.2, 0.0]]), np.full(5, 2.0))
    found = [
        ic.render(EDGE, EYE, at=each, spp=64, wavelengths_nm=WAVES).irradiance.values[:, 0]
        for each in (first, other)
    ]
    np.testing.assert_array_equal(*found)


def test_places_beyond_a_row_of_the_list_are_their_own():
    # 1024 in a row: the last of 1300 equal places are sampled as the first are.
    many = Places(np.tile([0.01, 0.0], (1300, 1)), np.full(1300, 2.0))
    light = ic.render(EDGE, EYE, at=many, spp=64, wavelengths_nm=WAVES).irradiance.values
    assert light.shape == (5, 1300)
    assert len(np.unique(light[2])) > 1000
    early, late = light[:, :1024], light[:, 1024:]
    error = light.std(axis=1) * np.sqrt(1 / 1024 + 1 / 276)
    assert np.all(np.abs(early.mean(axis=1) - late.mean(axis=1)) < 4 * error)


@pytest.mark.slow
@pytest.mark.parametrize("eye", [EYE, tilted()], ids=["rotational", "tilted"])
def test_paths_give_the_same_as_the_direct_pipeline(eye, precision, shared_kernels):
    # A mesh in front of nothing makes no difference but the pipeline: a wall far off to the side.
    wall = ic.SceneObject(
        "wall",
        ic.Quad((50.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        ic.Diffuse(ic.Spectrum.constant(0.5)),
    )
    scene = ic.Scene((*EDGE.objects, wall), None, "edge and wall")
    places = Places(np.linspace(-0.05, 0.05, 20)[:, None] * [1.0, 0.3], np.full(20, 2.0))
    options = {"at": places, "spp": 128, "wavelengths_nm": WAVES, "bands": 5}
    direct = ic.render(EDGE, eye, precision=precision, **options).irradiance.values
    paths = ic.render(scene, eye, precision=precision, max_bounces=1, **options).irradiance.values
    np.testing.assert_allclose(paths, direct, rtol=2e-3, atol=2e-3 * direct.max())


def test_images_are_compiled_without_places():
    made = plan(EDGE, EYE, fov_deg=1.0, resolution=8, wavelengths_nm=WAVES)
    assert made.config.defines(made.device)["HAS_PLACES"] == 0
    at = Places(np.zeros((2, 2)), np.full(2, 2.0), True)
    made = plan(EDGE, EYE, places=at, wavelengths_nm=WAVES)
    assert made.config.defines(made.device)["HAS_GAUSSIAN_PLACES"] == 1
    assert "2 apertures instead of a grid" in made.explain()


def test_errors_of_weighted_sums_count_what_wavelengths_share_once():
    # Replicates in which two wavelengths err alike: the error of the sum is twice that of one.
    rng = np.random.default_rng(0)
    shared = rng.normal(size=(6, 1, 4)) * [[[1.0], [1.0]]] + 5.0
    light = IrradianceAtPlaces.from_replicates(
        Places(np.zeros((4, 2)), np.ones(4)), np.array([500.0, 600.0]), shared, np.full(6, 32), {}
    )
    _, error = light.weighted(np.ones((4, 2)))
    np.testing.assert_allclose(error, 2 * light.standard_error.values[0], rtol=1e-12)
    expected = shared[:, 0].std(axis=0, ddof=1) / np.sqrt(6)
    np.testing.assert_allclose(light.standard_error.values[0], expected, rtol=1e-12)
    assert np.isnan(mean_and_error(shared[:1], np.array([8]))[1]).all()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_light_at_places_is_saved_whole(tmp_path, dtype):
    rng = np.random.default_rng(3)
    places = Places(rng.normal(size=(5, 2)), rng.uniform(1.0, 4.0, 5), is_gaussian=True)
    values = rng.uniform(size=(3, 2, 5)).astype(dtype)
    made = {"seed": 7, "eye": {"name": "navarro"}}
    light = IrradianceAtPlaces.from_replicates(
        places, np.array([500.0, 600.0]), values, np.array([8, 8, 16]), made
    )
    back = IrradianceAtPlaces.load(light.save(tmp_path / "light.nc"))
    assert back.dataset.identical(light.dataset)
    assert {name: back.dataset[name].dtype for name in back.dataset.variables} == {
        name: light.dataset[name].dtype for name in light.dataset.variables
    }
    assert back.provenance == made
    weights = rng.uniform(size=(5, 2))
    np.testing.assert_array_equal(back.weighted(weights), light.weighted(weights))
    # A mosaic with the same places and radii, but apertures of another shape, is not what was lit.
    mosaic = ConeMosaic.from_positions(places.positions_deg, np.zeros(5, int), spacing_um=3.0)
    same = Places(mosaic.positions_deg, 0.5 * mosaic.aperture_um, is_gaussian=True)
    light = IrradianceAtPlaces.from_replicates(
        same, np.array([500.0, 600.0]), values, np.array([8, 8, 16]), made
    )
    with pytest.raises(InvalidInputError, match="not those of this mosaic"):
        mosaic.excitations(light)


def test_files_without_light_at_places_are_refused(tmp_path):
    image = ic.RetinalImage.from_arrays(
        ic.RetinalGrid.of(EYE, 1.0, 4), np.array([500.0, 600.0]), np.ones((2, 4, 4))
    )
    image.save(tmp_path / "image.nc")
    with pytest.raises(FileError, match="holds no irradiance at places"):
        IrradianceAtPlaces.load(tmp_path / "image.nc")
    with pytest.raises(FileError, match="does not exist"):
        IrradianceAtPlaces.load(tmp_path / "missing.nc")


def test_a_list_that_does_not_fit_is_refused_beforehand(monkeypatch):
    monkeypatch.setattr("isetcl.memory.available_bytes", lambda: 10_000_000)
    many = Places(np.zeros((10_000, 2)), np.full(10_000, 2.0))
    with pytest.raises(OutOfMemoryError, match=r"10000 apertures and 31 wavelengths needs .* GiB"):
        ic.render(EDGE, EYE, at=many)


def test_what_cannot_be_rendered_at_is_refused(cones, at_the_cones):
    with pytest.raises(InvalidInputError, match="must be a mosaic of cones or Places"):
        ic.render(EDGE, EYE, at="cones")
    with pytest.raises(InvalidInputError, match="not both"):
        ic.render(EDGE, EYE, at=cones, fov_deg=1.0)
    with pytest.raises(InvalidInputError, match="leave the outer ones out"):
        ic.render(EDGE, EYE, at=Places(np.array([[0.0, 170.0]]), np.ones(1)))
    with pytest.raises(InvalidInputError, match="finite and > 0"):
        Places(np.zeros((1, 2)), np.zeros(1))
    with pytest.raises(InvalidInputError, match="at least one place"):
        Places(np.zeros((0, 2)), np.zeros(0))
    light = ic.render(EDGE, EYE, at=cones, spp=2, wavelengths_nm=WAVES)
    with pytest.raises(InvalidInputError, match="not those of this mosaic"):
        cones.moved((0.01, 0.0)).excitations(light)
    with pytest.raises(InvalidInputError, match="gaze_deg needs an image"):
        cones.excitations(light, gaze_deg=np.zeros((2, 2)))
    uneven = ic.render(EDGE, EYE, at=cones, spp=2, wavelengths_nm=[500.0, 550.0, 610.0])
    with pytest.raises(InvalidInputError, match="got steps of 50 to 60 nm"):
        cones.excitations(uneven)
    assert cones.excitations(uneven, uneven_wavelengths="bins").mean.shape == (1, len(cones))
    single = ic.render(EDGE, EYE, at=cones, spp=2, wavelengths_nm=[550.0])
    with pytest.raises(InvalidInputError, match="at least 2 wavelengths"):
        cones.excitations(single)
    assert isinstance(cones, ConeMosaic)
    assert at_the_cones.standard_error is not None
