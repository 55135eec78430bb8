"""Mosaics of receptors: what a mosaic is, and that what is made of it is what was asked for."""

import dataclasses

import numpy as np
import pytest

import isetcl as ic
from isetcl.cones import ConeMosaic
from isetcl.cones.receptors import neighbour_spacing, outer_segment_um, rod_intrusion
from isetcl.cones.retinal_scale import RetinalScale, watson_mm2_per_deg2
from isetcl.errors import FileError, InvalidInputError


def hexagonal(spacing, n):
    row, column = np.mgrid[-n : n + 1, -n : n + 1]
    x = spacing * (column + 0.5 * (row % 2))
    return np.stack([x.ravel(), (spacing * np.sqrt(0.75) * row).ravel()], axis=1)


@pytest.fixture
def patch():
    rng = np.random.default_rng(1)
    places = rng.uniform(-1.0, 1.0, (300, 2)) + np.array([3.0, -2.0])
    return ConeMosaic.from_positions(places, rng.integers(0, 3, 300), provenance={"seed": 1})


def test_a_hexagonal_lattice_has_its_spacing_everywhere_inside():
    places = hexagonal(0.003, 10)
    spacing = neighbour_spacing(places)
    inside = np.hypot(*places.T) < 0.02
    np.testing.assert_allclose(spacing[inside], 0.003, rtol=1e-12)


def test_spacing_is_a_median_of_medians():
    places = np.random.default_rng(8).uniform(size=(60, 2))
    apart = np.hypot(*(places[:, None] - places).T)
    order = np.argsort(apart, axis=1)
    medians = np.array([np.median(apart[i, order[i, 1:7]]) for i in range(60)])
    expected = [np.median(medians[order[i, :7]]) for i in range(60)]
    np.testing.assert_allclose(neighbour_spacing(places), expected, rtol=1e-12)


def test_a_foveal_cone_of_250000_per_mm2_has_the_worked_example_s_aperture():
    # Spacing 2.1491 um, aperture 1.6978 um, area 2.2640 um^2: the arithmetic of 0.79 and hexagons.
    spacing = 1e3 * np.sqrt(2.0 / (np.sqrt(3.0) * 250000.0))
    mosaic = ConeMosaic.from_positions([[0.0, 0.0]], [0], spacing_um=spacing)
    assert mosaic.spacing_um[0] == pytest.approx(2.1491, abs=5e-5)
    assert mosaic.aperture_um[0] == pytest.approx(1.6978, abs=5e-5)
    assert np.pi / 4 * mosaic.aperture_um[0] ** 2 == pytest.approx(2.2640, abs=1e-4)


def test_a_gaussian_aperture_has_the_area_of_its_characteristic_radius():
    mosaic = ConeMosaic.from_positions([[0.0, 0.0]], [0], spacing_um=3.0, aperture="gaussian")
    # pi rc^2 with rc = sqrt(2) sigma, sigma = 0.204 d (Chen, Makous & Williams 1993).
    assert np.pi / 4 * mosaic.aperture_um[0] ** 2 == pytest.approx(np.pi * 2 * (0.204 * 3.0) ** 2)
    assert mosaic.aperture_shape == "gaussian"


def test_outer_segments_are_those_of_banks_1991():
    np.testing.assert_allclose(outer_segment_um(np.array([0, 4.86, 39.9])), [47.81, 21.2, 13.22])


def test_rods_take_half_the_spacing_at_forty_degrees():
    np.testing.assert_allclose(rod_intrusion(np.array([0.0, 40.17])), [1.0, 1.71 / 3.59])


@pytest.mark.parametrize("scale", ["watson2014", 0.3, "eye"])
def test_degrees_and_millimetres_are_inverses(scale):
    chart = RetinalScale.of(ic.eyes.navarro(3.0) if scale == "eye" else scale)
    angle = np.linspace(0.0, 2 * np.pi, 50)
    places = np.linspace(0.0, 30.0, 50)[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1)
    np.testing.assert_allclose(chart.to_deg(chart.to_mm(places)), places, atol=1e-9)


def test_the_retina_has_the_visual_field_upside_down_and_mirrored(patch):
    assert np.all(np.sign(patch.positions_mm) == -np.sign(patch.positions_deg))


def test_the_scale_of_an_eye_is_its_chief_rays_arc():
    eye = ic.eyes.navarro(3.0)
    place = RetinalScale.of(eye).to_mm(np.array([6.0, 8.0]))
    np.testing.assert_allclose(place, eye.field_map().coordinates_mm(6.0, 8.0), rtol=1e-12)


def test_watsons_scales_at_ten_degrees():
    # Arithmetic of eqs A5 and A7 at 10 deg.
    ten = np.array([10.0])
    assert RetinalScale.of("watson2014").arc_mm(ten) == pytest.approx(2.7059391)
    assert watson_mm2_per_deg2(ten) == pytest.approx(0.07476176)


def test_files_keep_every_number(patch, tmp_path):
    again = ConeMosaic.load(patch.save(tmp_path / "patch.nc"))
    for name, array in patch.arrays().items():
        np.testing.assert_array_equal(getattr(again, name), array)
    assert (again.eye, again.aperture_shape) == (patch.eye, patch.aperture_shape)
    assert again.provenance == patch.provenance


def test_parts_merge_to_the_whole(patch):
    left = patch.within((1.0, 2.0), (2.5, -2.0))
    right = patch.within((1.0, 2.0), (3.5, -2.0))
    both = left.merge(right)
    assert len(both) == len(patch)
    assert sum(both.counts.values()) == len(patch)


def test_a_moved_mosaic_stays_where_it_is_on_the_retina(patch):
    moved = patch.moved((0.5, -0.25))
    np.testing.assert_allclose(moved.positions_deg - patch.positions_deg, [[0.5, -0.25]] * 300)
    np.testing.assert_array_equal(moved.positions_mm, patch.positions_mm)
    np.testing.assert_array_equal(moved.eccentricity_deg, patch.eccentricity_deg)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"types": [0, 4]}, r"types must be 0 \(L\), 1 \(M\), 2 \(S\) or 3 \(rod\), got 4"),
        ({"types": [0]}, "types must be 2 whole numbers"),
        ({"positions_deg": [[0, np.nan], [1, 0]]}, "positions_deg must be finite, got nan for rec"),
        ({"positions_deg": [[0, 0, 0]]}, r"positions_deg must have shape \(n, 2\)"),
        ({"spacing_um": [1.0, 0.0]}, "spacing_um must be finite and > 0, got 0 for receptor 1"),
        ({"aperture": "square"}, "unknown aperture 'square'"),
        ({"eye": "middle"}, "unknown eye 'middle'"),
        ({"scale": -0.3}, "scale must be > 0 mm/deg, got -0.3"),
        ({"scale": "drasdo"}, "scale must be 'watson2014'"),
        ({"positions_deg": [[95.0, 0], [1, 0]]}, "reaches 95 deg from the fovea"),
    ],
)
def test_receptors_that_cannot_be_are_refused(change, message):
    given = {"positions_deg": [[0.0, 0.0], [0.1, 0.0]], "types": [0, 1], **change}
    with pytest.raises(InvalidInputError, match=message):
        ConeMosaic.from_positions(given.pop("positions_deg"), given.pop("types"), **given)


def test_receptors_are_chosen_by_mask_or_number(patch):
    mask = patch.types == 1
    np.testing.assert_array_equal(patch.select(mask).types, 1)
    some = patch.select([7, 3, -1])
    np.testing.assert_array_equal(some.positions_deg, patch.positions_deg[[7, 3, -1]])
    np.testing.assert_array_equal(some.spacing_um, patch.spacing_um[[7, 3, -1]])
    for which, message in [
        (np.zeros(300, bool), "no receptor is left"),
        ([], "no receptor is left"),
        (mask[:5], "mask of 300 receptors"),
        ([300], r"0 to 299, got int64 .* from 300 to 300"),
        ("L", "mask of 300 receptors"),
        ([0.5], "mask of 300 receptors"),
    ]:
        with pytest.raises(InvalidInputError, match=message):
            patch.select(which)


def test_a_rectangle_holds_what_lies_within_half_its_sides(patch):
    part = patch.within((0.6, 1.2), (3.1, -1.9))
    offset = np.abs(part.positions_deg - (3.1, -1.9))
    assert offset[:, 0].max() <= 0.3
    assert offset[:, 1].max() <= 0.6
    every = np.abs(patch.positions_deg - (3.1, -1.9))
    assert len(part) == np.sum((every[:, 0] <= 0.3) & (every[:, 1] <= 0.6))
    with pytest.raises(InvalidInputError, match=r"no receptor lies within .* spans x 2\.\d+ to"):
        patch.within(0.1, (50.0, 0.0))
    with pytest.raises(InvalidInputError, match="by_deg"):
        patch.moved(3.0)


def test_places_decide_the_sizes_of_receptors():
    places = hexagonal(0.01, 6) + np.array([4.86, 0.0])
    mosaic = ConeMosaic.from_positions(places, np.zeros(len(places), int), scale=0.3)
    middle = np.argmin(np.hypot(*(places - (4.86, 0.0)).T))
    # 0.01 deg at 0.3 mm a degree; 21.2 um at 4.86 deg (Banks et al. 1991).
    assert mosaic.spacing_um[middle] == pytest.approx(3.0, rel=1e-6)
    assert mosaic.aperture_um[middle] == pytest.approx(0.79 * 3.0, rel=1e-6)
    assert mosaic.outer_segment_um[middle] == pytest.approx(21.2, rel=1e-6)
    far = ConeMosaic.from_positions(
        [[40.17, 0.0]], [0], spacing_um=10.0, has_rod_intrusion=True, scale=0.3
    )
    # Banks et al. 1991: 1.71 arcmin of 3.59 are inner segment.
    assert far.aperture_um[0] == pytest.approx(0.79 * 10.0 * 1.71 / 3.59)
    np.testing.assert_allclose(
        rod_intrusion(np.array([2.04, 5.08, 9.92, 19.95])), [0.932, 0.735, 0.702, 0.540], atol=6e-4
    )
    np.testing.assert_allclose(outer_segment_um(np.array([1.82, 9.86, 19.78])), [26.16, 21.2, 21.2])


def test_an_eye_without_an_axis_is_no_scale():
    eye = ic.eyes.navarro(3.0)
    retina = ic.Retina.ellipsoid(eye.retina.vertex_z_mm, (12.0, 11.5, 12.0))
    with pytest.raises(InvalidInputError, match=r"axis of symmetry, and 'navarro.*retina"):
        RetinalScale.of(dataclasses.replace(eye, retina=retina))


def test_other_files_are_refused(tmp_path):
    import xarray

    xarray.Dataset({"a": ("x", [1.0])}).to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
    for name, message in [("a.nc", "holds no mosaic"), ("b.nc", "does not exist")]:
        with pytest.raises(FileError, match=message):
            ConeMosaic.load(tmp_path / name)


def test_densities_on_meridians_are_those_of_the_retina_wherever_the_eye_looks():
    from isetcl.cones.quality import meridian_density

    made = ic.cones.mosaic(0.6, seed=4)
    at = [0.1, 0.2]
    still, numbers = meridian_density(made, "nasal", at, cones=50)
    moved, others = meridian_density(made.moved((8.0, -3.0)), "nasal", at, cones=50)
    np.testing.assert_array_equal(numbers, others)
    np.testing.assert_allclose(moved, still, rtol=1e-12)
    # In a right eye the nasal retina receives the right field.
    assert np.all(made.positions_deg[numbers[1], 0].mean() > 0.15)
