"""Generated mosaics: densities, lattices, types, and the kernels behind them."""

import numpy as np
import pytest

import isetcl as ic
from isetcl.cones.cone_types import choose_s
from isetcl.cones.density import (
    MERIDIANS,
    ConeDensity,
    by_meridians,
    in_optic_disc,
    on_meridian,
)
from isetcl.cones.lattice import Sector, rings
from isetcl.cones.quality import VoronoiCells, meridian_density
from isetcl.cones.receptors import ReceptorType
from isetcl.cones.retinal_scale import RetinalScale
from isetcl.device.lattice import LatticeKernels, Tiles
from isetcl.errors import InvalidInputError, OutOfMemoryError

SCALE = RetinalScale.of("watson2014")

# Curcio 1990, Fig. 6 (digitised): cones/mm^2 at 0.2, 1, 3 and 10 mm, typed in a second time.
AT_MM = np.array([0.2, 1.0, 3.0, 10.0])
CURCIO = {
    "nasal": [75256, 20343, 8976, 5730],
    "temporal": [80340, 20346, 9188, 4035],
    "superior": [66552, 18719, 7804, 4409],
    "inferior": [69954, 18719, 7696, 4195],
}


@pytest.fixture(scope="module")
def kernels():
    from isetcl.device.choose import find_device

    return LatticeKernels(find_device())


@pytest.fixture(scope="module")
def parafovea():
    """A quarter of a degree that holds the edge of the centre without S cones."""
    return ic.cones.mosaic(0.6, (0.2, 0.0), seed=5)


def places_of(meridian, eye="right"):
    return SCALE.to_mm(on_meridian(meridian, SCALE.eccentricity_deg(AT_MM), eye))


@pytest.mark.parametrize("eye", ["right", "left"])
@pytest.mark.parametrize("meridian", MERIDIANS)
def test_densities_on_the_meridians_are_curcios(meridian, eye):
    density = ConeDensity.of("curcio1990", eye, SCALE).per_mm2(places_of(meridian, eye))
    np.testing.assert_allclose(density, CURCIO[meridian], rtol=1e-6)


def test_the_nasal_retina_of_a_right_eye_sees_the_right_field():
    x, y = on_meridian("nasal", np.array([10.0]), "right")[0]
    assert (x, y) == (10.0, 0.0)
    assert on_meridian("nasal", np.array([10.0]), "left")[0][0] == -10.0
    assert on_meridian("superior", np.array([10.0]), "left")[0][1] == -10.0


def test_halfway_between_two_meridians_the_density_is_halfway():
    density = ConeDensity.of("curcio1990", "right", SCALE)
    for one, two in zip(MERIDIANS, (*MERIDIANS[1:], MERIDIANS[0]), strict=True):
        between = (places_of(one) + places_of(two)) / np.sqrt(2.0)
        expected = 0.5 * (np.array(CURCIO[one]) + np.array(CURCIO[two]))
        np.testing.assert_allclose(density.per_mm2(between), expected, rtol=1e-6)


def test_watsons_density_has_his_peak_per_square_degree():
    # Watson 2014: 14804.6 cones/deg^2; the chart has 0.268^2 mm^2/deg^2 at the fovea.
    density = ConeDensity.of("watson2014", "right", SCALE).per_mm2(np.array([[1e-9, 0.0]]))
    assert density[0] * 0.268**2 == pytest.approx(14804.6, rel=1e-5)


def test_watsons_cones_per_square_degree_do_not_depend_on_the_scale():
    deg = np.array([[3.0, 2.0], [-7.0, 1.0]])
    ecc = np.hypot(*deg.T)
    per_deg2 = [
        ConeDensity.of("watson2014", "right", scale).per_mm2(scale.to_mm(deg))
        * scale.mm2_per_deg2(ecc)
        for scale in (SCALE, RetinalScale.of(0.3))
    ]
    np.testing.assert_allclose(*per_deg2, rtol=1e-6)


def test_song_counts_fewer_cones_than_curcio_near_the_fovea():
    # Song 2011, Table 1: 68 200 at 0.18 mm nasal.
    song = ConeDensity.of("song2011", "right", SCALE)
    assert song.per_mm2(np.array([[-0.18, 0.0]]))[0] == pytest.approx(68200)


def test_a_field_may_reach_to_the_very_end_of_what_is_known():
    # Song's data begin at 0.18 mm, which is 0.671 deg: this field's corner is 0.68 deg out.
    assert len(ic.cones.mosaic(0.2, (0.78, 0.0), density="song2011")) > 100
    density = ConeDensity.of("song2011", "right", SCALE)
    angle = np.linspace(0.0, 2.0 * np.pi, 1001)
    for end in density.range_mm:
        places = end * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        assert np.all(np.isfinite(density.per_mm2(places)))


def test_a_user_s_density_is_asked_in_degrees():
    density = ConeDensity.of(lambda x, y: 5000.0 + 100.0 * x + 10.0 * y, "right", SCALE)
    assert density.per_mm2(SCALE.to_mm(np.array([[3.0, -2.0]]))) == pytest.approx(5280.0)


def test_the_optic_disc_is_where_and_as_large_as_it_was_measured():
    centre = SCALE.to_mm(np.array([[15.5, -1.5]]))
    angle = np.linspace(0.0, 2.0 * np.pi, 721)[:-1]
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    grid = np.stack(np.meshgrid(*2 * [np.linspace(-1.2, 1.2, 601)]), axis=-1).reshape(-1, 2)
    area = in_optic_disc(grid + centre, "right", SCALE).sum() * (2.4 / 600) ** 2
    # An ellipse of 1.77 x 1.88 mm.
    assert area == pytest.approx(np.pi / 4 * 1.77 * 1.88, rel=2e-3)
    assert np.all(in_optic_disc(centre + 0.88 * around, "right", SCALE))
    assert not np.any(in_optic_disc(centre + 0.945 * around, "right", SCALE))
    assert not in_optic_disc(centre, "left", SCALE)[0]


def brute_push(places, size, is_fixed, range_, step):
    """One step of the law of repulsion, over all pairs."""
    apart = places[:, None] - places[None]
    distance = np.hypot(*np.moveaxis(apart, -1, 0))
    np.fill_diagonal(distance, np.inf)
    excess = np.maximum(range_ * 0.5 * (size[:, None] + size[None]) - distance, 0.0)
    move = step * np.sum(apart * (excess / distance)[..., None], axis=1)
    length = np.hypot(*move.T)
    limit = 0.25 * size
    move *= np.where(length > limit, limit / np.maximum(length, 1e-30), 1.0)[:, None]
    return np.where(is_fixed[:, None], places, places + move)


def scattered(n, seed=0):
    """Points of a lattice shaken by a third of their spacing, and sizes that vary by a factor 3."""
    random = np.random.default_rng(seed)
    side = int(np.sqrt(n))
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
    warped = 1e-3 * (grid + 0.03 * grid**2) + 7.0
    size = 1e-3 * (1.0 + 0.06 * grid.max(axis=1))
    return warped + 0.3 * size[:, None] * random.standard_normal(warped.shape), size


def test_points_are_pushed_as_the_sum_over_all_pairs_says(device, precision):
    places, size = scattered(900)
    is_fixed = np.random.default_rng(1).uniform(size=len(places)) < 0.1
    kernels = LatticeKernels(device, precision)
    got = kernels.relax(places, lambda _: size, is_fixed, rounds=1, steps=1)
    expected = brute_push(places, size, is_fixed, 1.2, 0.2)
    moved = np.hypot(*(expected - places).T)
    assert np.median(moved[~is_fixed] / size[~is_fixed]) > 0.05
    tolerance = {"single": 3e-8, "double": 1e-15}[precision]
    np.testing.assert_allclose(got, expected, rtol=0, atol=tolerance)


def test_cells_hold_every_point_once_and_where_it_lies():
    places, size = scattered(400)
    tiles = Tiles.of(places, size)
    assert sorted(tiles.order) == list(range(len(places)))
    assert tiles.cell_first[-1] == len(places)
    low = np.array(tiles.origin_mm)
    for tile in range(tiles.columns * tiles.rows):
        corner = low + tiles.tile_mm * np.array([tile % tiles.columns, tile // tiles.columns])
        n = tiles.tile_cells[tile]
        for cell in range(n * n):
            number = tiles.tile_first[tile] + cell
            own = places[tiles.order[tiles.cell_first[number] : tiles.cell_first[number + 1]]]
            left = corner + tiles.tile_mm / n * np.array([cell % n, cell // n])
            assert np.all(own >= left - 1e-12)
            assert np.all(own <= left + tiles.tile_mm / n + 1e-12)


def test_points_kept_apart_are_those_of_taking_them_one_by_one(device, precision):
    places, size = scattered(900, seed=3)
    rank = np.random.default_rng(4).permutation(len(places))
    distance = 2.3 * size
    expected = np.zeros(len(places), dtype=bool)
    for i in np.argsort(rank):
        taken = np.flatnonzero(expected)
        apart = np.hypot(*(places[taken] - places[i]).T)
        expected[i] = np.all(apart >= np.minimum(distance[taken], distance[i]))
    got = LatticeKernels(device, precision).choose_apart(places, rank, distance)
    np.testing.assert_array_equal(got, expected)


def test_work_groups_of_any_size_give_the_same_bits(device):
    places, size = scattered(400)
    is_fixed = np.zeros(len(places), dtype=bool)
    results = [
        LatticeKernels(device, "single", group).relax(
            places, lambda _: size, is_fixed, rounds=2, steps=3
        )
        for group in (1, 16, 64)
    ]
    np.testing.assert_array_equal(results[0], results[1])
    np.testing.assert_array_equal(results[0], results[2])


def test_the_same_seed_gives_the_same_mosaic_and_another_seed_another(parafovea):
    again = ic.cones.mosaic(0.6, (0.2, 0.0), seed=5)
    for name, array in parafovea.arrays().items():
        np.testing.assert_array_equal(getattr(again, name), array)
    other = ic.cones.mosaic(0.6, (0.2, 0.0), seed=6)
    assert not np.array_equal(other.positions_deg[:100], parafovea.positions_deg[:100])


def test_a_seed_may_be_any_whole_number():
    plain, as_float = (ic.cones.mosaic(0.05, seed=s) for s in (3, 3.0))
    np.testing.assert_array_equal(plain.positions_deg, as_float.positions_deg)


def test_rings_have_the_wanted_number_of_points_within_every_radius():
    # An even density of 10 000 per mm^2: pi r^2 D points, to the ring's own share.
    density = ConeDensity.of(lambda x, y: 1e4 + 0.0 * x, "right", SCALE)
    arc = np.sort(np.hypot(*rings(density, Sector(0.0, 0.5, -np.pi, np.pi), 0).T))
    for radius in (0.1, 0.2, 0.3, 0.45):
        row = 2.0 * np.pi * radius / 0.0107
        assert abs(np.searchsorted(arc, radius) - np.pi * radius**2 * 1e4) < row


def test_an_even_density_gives_area_times_density_cones():
    # 1 deg^2 at 0.3 mm/deg: 0.09 mm^2 of the chart, which is 4 % denser there than polar.
    field = ic.cones.mosaic(1.2, (4.0, 1.0), density=lambda x, y: 2e4 + 0.0 * x, scale=0.3)
    assert len(field) == pytest.approx(2e4 * (0.3 * 1.2) ** 2, rel=0.01)
    assert ic.cones.estimate_mosaic(
        1.2, (4.0, 1.0), density=lambda x, y: 2e4 + 0.0 * x, scale=0.3
    ).n_cones == pytest.approx(2e4 * (0.3 * 1.2) ** 2, rel=1e-3)


def test_seven_cones_in_ten_are_six_sided_at_the_fovea_as_measured(parafovea):
    # Pum, Ahnelt & Grasl 1990: 30 % of the central 300 cones are out of order, fewer around them.
    quality = parafovea.quality(bands=2)
    np.testing.assert_allclose(quality.six_sided, 0.7, atol=0.05)
    np.testing.assert_array_equal(quality.measured_six_sided, 0.7)
    assert np.max(np.abs(quality.density_error)) < 0.02
    assert "70 % six-sided, here" in str(quality)


def test_few_cones_are_not_divided_into_bands_of_fewer(parafovea):
    few = ic.cones.mosaic(0.3, (5.0, 0.0)).quality()
    assert few.n_cones < 200
    assert few.six_sided.shape == (1,)
    many = parafovea.quality()
    assert many.six_sided.shape == (min(many.n_cones // 200, 10),)


def test_half_of_the_cones_are_six_sided_in_the_parafovea_as_measured():
    # Li & Roorda 2007 and Legras et al. 2018: about half; Lombardo et al. 2013: 40 to 50 %.
    quality = ic.cones.mosaic(1.0, (4.0, 0.0), seed=3).quality(bands=1)
    assert 0.45 < quality.six_neighbour_fraction < 0.56
    assert abs(quality.density_error[0]) < 0.01


def test_peripheral_cones_keep_six_to_eight_micrometres_apart_however_few_they_are():
    # Curcio & Sloan 1992: the distance of neighbours grows with eccentricity, the least does not.
    found = [ic.cones.mosaic(3.0, (x, 0.0), seed=3).quality(bands=1) for x in (-20.0, -45.0)]
    for quality in found:
        assert 6.0 < quality.least_distance_um[0] < 8.0
        assert abs(quality.density_error[0]) < 0.01
        assert np.isnan(quality.measured_six_sided[0])
        assert "6 to 8 um apart at least, here 7." in str(quality)
    # Fewer are six-sided than in the parafovea (Lombardo et al. 2013; Chui et al. 2008).
    assert max(q.six_neighbour_fraction for q in found) < 0.48


def test_no_two_peripheral_cones_are_nearer_than_they_can_be():
    # Curcio & Sloan 1992: 6 to 8 um at the least, which is what inner segments measure there.
    cells = VoronoiCells.of(ic.cones.mosaic(3.0, (-35.0, 0.0), seed=1))
    assert 1e3 * cells.nearest_mm[cells.is_inside].min() > 6.0


def test_a_lattice_is_as_disordered_as_it_is_asked_to_be_all_over():
    regular, irregular = (
        ic.cones.mosaic(0.8, (4.0, 0.0), disorder=d).quality(bands=1) for d in (0.05, 0.35)
    )
    assert regular.six_neighbour_fraction > 0.75
    assert irregular.six_neighbour_fraction < 0.46


def test_without_disorder_most_cones_are_six_sided():
    quality = ic.cones.mosaic(0.5, (2.0, 0.0), disorder=0.0).quality(bands=1)
    assert quality.six_neighbour_fraction > 0.85
    assert quality.spacing_cv < 0.08


def test_a_hexagonal_lattice_is_perfect_and_a_random_one_is_poor():
    row, column = np.mgrid[-15:16, -15:16]
    lattice = np.stack([column + 0.5 * (row % 2), np.sqrt(0.75) * row], axis=-1).reshape(-1, 2)
    hexagons = ic.cones.ConeMosaic.from_positions(0.01 * lattice, np.zeros(len(lattice), int))
    quality = hexagons.quality(density=None, bands=1)
    assert quality.six_neighbour_fraction == 1.0
    assert quality.spacing_cv < 1e-2  # Watson's scale is not quite even
    random = np.random.default_rng(0).uniform(-1.0, 1.0, (6000, 2))
    chance = ic.cones.ConeMosaic.from_positions(random, np.zeros(6000, int), spacing_um=100.0)
    cells = VoronoiCells.of(chance)
    degree = cells.degree[cells.is_inside]
    # Voronoi cells of a Poisson process have six sides in 29.5 % of all cases (Drouffe & Itzykson
    # 1984).
    assert np.mean(degree == 6) == pytest.approx(0.295, abs=0.025)


def test_no_s_cone_lies_in_the_centre_and_a_tenth_are_s_outside(parafovea):
    is_s = parafovea.types == ReceptorType.S
    outside = parafovea.eccentricity_deg >= 0.15
    assert not np.any(is_s & ~outside)
    assert abs(np.sum(is_s) - 0.1 * np.sum(outside)) <= 1
    others = np.sum(~is_s)
    assert abs(np.sum(parafovea.types == ReceptorType.M) - others / 3) <= 1


def test_l_and_m_cones_lie_among_each_other_as_by_chance(parafovea):
    cells = VoronoiCells.of(parafovea)
    types = parafovea.types[cells.numbers][cells.pairs]
    both = types[np.all(types != ReceptorType.S, axis=1)]
    like = np.mean(both[:, 0] == both[:, 1])
    # Neighbours are like with probability p^2 + q^2. Pairs share cones, but by chance their
    # likeness is as good as independent: s.d. of the share sqrt(p q / pairs) and less.
    share = np.mean(both == ReceptorType.M)
    expected = share**2 + (1.0 - share) ** 2
    assert abs(like - expected) < 4.0 * np.sqrt(expected * (1.0 - expected) / len(both))


def test_s_cones_are_more_regular_than_chance(kernels):
    from scipy.spatial import cKDTree

    row, column = np.mgrid[0:60, 0:60]
    places = 1e-3 * np.stack([column + 0.5 * (row % 2), np.sqrt(0.75) * row], axis=-1)
    places = places.reshape(-1, 2) + 1e-4 * np.random.default_rng(1).standard_normal((3600, 2))
    size = np.full(len(places), 1e-3)
    share = np.full(len(places), 0.1)
    ecc = np.hypot(*places.T)
    is_s = choose_s(places, ecc, size, share, kernels, np.random.default_rng(0))
    assert is_s.sum() == 360
    nearest = cKDTree(places[is_s]).query(places[is_s], k=2)[0][:, 1]
    least = 0.68 * size[0] / np.sqrt(0.1)
    # Cones have their own distances, from a half of it up; where a band lacks places for all, S
    # cones come nearer by a step of 7 %.
    assert nearest.min() >= 0.93 * 0.5 * least * (1 - 1e-6)
    # By chance the mean over the standard deviation is 1.91 (exponential areas).
    assert nearest.mean() / nearest.std() > 3.0


def test_s_cones_follow_a_share_that_depends_on_eccentricity():
    patch = ic.cones.mosaic(1.0, (3.0, 0.0), s_fraction=lambda e: np.where(e < 3.0, 0.05, 0.15))
    near = patch.eccentricity_deg < 3.0
    for where, share in ((near, 0.05), (~near, 0.15)):
        assert np.mean(patch.types[where] == ReceptorType.S) == pytest.approx(share, abs=0.006)


@pytest.mark.parametrize("ratios", [(0.0, 0.9, 0.1), (0.93, 0.0, 0.07), (0.7, 0.3, 0.0)])
def test_dichromats_lack_a_type(ratios):
    counts = ic.cones.mosaic(0.3, (3.0, 0.0), ratios=ratios).counts
    for name, share in zip("LMS", ratios, strict=True):
        assert (counts[name] == 0) == (share == 0.0)


def test_the_blind_spot_holds_no_cone_and_only_on_its_side():
    right = ic.cones.mosaic((3.0, 1.0), (11.5, -1.5))
    left = ic.cones.mosaic((3.0, 1.0), (11.5, -1.5), eye="left")
    assert not np.any(in_optic_disc(right.positions_mm, "right", SCALE))
    assert right.extent_deg[1][0] < 12.5
    assert left.extent_deg[1][0] > 12.9


def test_cones_of_the_left_eye_are_the_mirror_image_in_number():
    right = ic.cones.mosaic(1.0, (8.0, 0.0))
    left = ic.cones.mosaic(1.0, (-8.0, 0.0), eye="left")
    assert len(left) == pytest.approx(len(right), rel=0.02)


def test_spacing_is_that_of_the_density(parafovea):
    wanted = 1e3 * ConeDensity.of("curcio1990", "right", SCALE).spacing_mm(parafovea.positions_mm)
    ratio = parafovea.spacing_um / wanted
    assert np.median(ratio) == pytest.approx(1.0, abs=0.05)
    np.testing.assert_allclose(parafovea.aperture_um, 0.79 * parafovea.spacing_um)


def test_the_scale_of_an_eye_sets_the_number_of_cones():
    # An even density per mm^2 of retina: as many more as the eye's square degree is larger.
    even = {"density": lambda x, y: 1e5 + 0.0 * x}
    eye = ic.eyes.navarro(3.0)
    found = ic.cones.estimate_mosaic(0.2, scale=eye, **even).n_cones
    assert found == pytest.approx(
        1e5 * (0.2 * eye.field_map().axial_scale_mm_per_deg()) ** 2, abs=1.0
    )
    assert len(ic.cones.mosaic(0.2, scale=eye, **even)) == pytest.approx(found, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["horizontal", "vertical"])
def test_density_along_the_meridians_is_within_three_percent_of_curcio(axis):
    fov, meridians = {
        "horizontal": ((42.0, 1.6), ("nasal", "temporal")),
        "vertical": ((1.6, 42.0), ("superior", "inferior")),
    }[axis]
    strip = ic.cones.mosaic(fov, has_optic_disc=False)
    ecc = np.array([0.1, 0.15, 0.2, 0.3, 0.5, 0.7, 1, 1.5, 2, 3, 4, 5, 7, 10, 12, 15, 18, 20])
    curcio = ConeDensity.of("curcio1990", "right", SCALE)
    for meridian in meridians:
        density, counted = meridian_density(strip, meridian, ecc)
        # Curcio's over the area of the same 300 cones, which near the fovea span many densities.
        wanted = [1.0 / np.mean(1.0 / curcio.per_mm2(strip.positions_mm[c])) for c in counted]
        assert np.max(np.abs(density / wanted - 1.0)) < 0.03


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"fov_deg": 0.0}, "fov_deg must be > 0 deg"),
        ({"fov_deg": (1.0, -2.0)}, r"fov_deg \(height\) must be > 0 deg"),
        ({"fov_deg": (150.0, 10.0)}, "known from 0 to .* deg from the fovea"),
        ({"fov_deg": 300.0}, "scale 'watson2014' ends at 90 deg"),
        ({"density": "song2011"}, "'song2011' is known from 0.671 to 7.99 deg"),
        ({"density": "oesterberg"}, "unknown density 'oesterberg'"),
        (
            {"density": lambda x, y: np.zeros_like(x)},
            r"> 0 cones/mm\^2 all over the field, got 0 at",
        ),
        (
            {"density": lambda x, y: 1e4 * (x - 0.1)},
            r"got -.* at \(.*\) deg from function <lambda>",
        ),
        ({"density": lambda x, y: 1e4 / np.zeros_like(x)}, "got inf at"),
        ({"density": lambda x, y: np.nan * x}, "got nan at"),
        ({"density": lambda x: x}, "must be a function of arrays"),
        ({"density": lambda x, y: 1 / 0}, "must be a function of arrays.*division by zero"),
        ({"centre_deg": (15.0, -1.0)}, "centre_deg must not lie in the optic disc"),
        ({"ratios": (0.6, 0.3, 0.2)}, r"must sum to 1, got 1.1; pass \(0.5455, 0.2727, 0.1818\)"),
        ({"ratios": (0.6, 0.4)}, "ratios must be three numbers"),
        ({"ratios": (1.2, -0.3, 0.1)}, r"ratios \(L\) must lie between 0 and 1"),
        ({"ratios": (0.0, 0.0, 1.0)}, "ratios has neither"),
        ({"s_fraction": lambda e: 1.0 + e}, "s_fraction must return values between 0 and 1"),
        ({"rods": lambda x, y: x - 1.0}, r"rods must be finite and >= 0 .* got -.* at \("),
        ({"rods": lambda x, y: np.nan * x}, "rods must be finite and >= 0 .* got nan"),
        ({"rods": lambda x, y: 1 / 0}, "rods must be a function of arrays.*division by zero"),
        ({"disorder": 0.9}, "disorder must lie between 0 and 0.4"),
        ({"disorder": "random"}, "'measured' or a number from 0 to 0.4, got 'random'"),
        ({"rods": "oesterberg"}, "rods must be True or 'curcio1990', None, or a function"),
        ({"rods": 1e5}, "rods must be True or 'curcio1990', None, or a function"),
        ({"seed": -1}, "seed must be >= 0"),
        ({"eye": "third"}, "unknown eye 'third'"),
    ],
)
@pytest.mark.filterwarnings("ignore:divide by zero")
def test_mosaics_that_cannot_be_are_refused(options, message):
    with pytest.raises(InvalidInputError, match=message):
        ic.cones.mosaic(**{"fov_deg": 0.3, **options})


def test_a_field_too_sparse_for_a_cone_is_refused_as_empty():
    """Not by the memory of the margin, which is as wide as the cones are far apart."""
    with pytest.raises(InvalidInputError, match="a field of 1 x 1 deg holds no cone"):
        ic.cones.mosaic(1.0, density=lambda x, y: np.full(np.shape(x), 1e-30))


def test_a_mosaic_too_large_for_the_memory_is_refused_with_its_size(monkeypatch):
    monkeypatch.setattr("isetcl.memory.available_bytes", lambda: 2**28)
    with pytest.raises(
        OutOfMemoryError, match=r"a mosaic of 30 x 40 deg \(.*e\+05 cones\) needs .* GiB, 0.25"
    ):
        ic.cones.mosaic((30.0, 40.0))


def test_quality_needs_cones_that_have_neighbours():
    few = ic.cones.ConeMosaic.from_positions([[0, 0], [1, 0], [2, 0]], [0, 0, 0])
    with pytest.raises(InvalidInputError, match="four cones that are not on a line"):
        few.quality()


def test_a_picture_shows_every_type_with_its_number(parafovea):
    import matplotlib.pyplot as plt

    axes = parafovea.plot()
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels == [f"{k} ({v})" for k, v in parafovea.counts.items() if v]
    discs = axes.collections
    drawn = sum(len(d.get_offsets()) for d in discs if d.__class__.__name__.startswith("Ellipse"))
    assert drawn == len(parafovea)
    plt.close("all")


def test_unknown_units_of_a_picture_are_refused(parafovea):
    with pytest.raises(InvalidInputError, match="unknown units"):
        parafovea.plot(units="arcmin")


def test_by_meridians_is_nan_beyond_the_tables():
    tables = dict.fromkeys(MERIDIANS, ((1.0, 2.0), (5.0, 6.0)))
    density = by_meridians(tables, np.array([[3.0, 0.0], [0.0, 0.5]]), "right")
    assert np.all(np.isnan(density))
