"""Rods: how many there are where, against published counts, and how they lie among the cones."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

import isetcl as ic
from isetcl.cones.density import MERIDIANS, curcio_per_mm2
from isetcl.cones.receptors import ReceptorType
from isetcl.cones.retinal_scale import RetinalScale
from isetcl.cones.rod_density import (
    RETINA_ENDS_MM,
    RETINA_RADIUS_MM,
    rods_per_mm2,
    wanted_rods,
)
from isetcl.errors import InvalidInputError

SCALE = RetinalScale.of("watson2014")
ROUND = np.linspace(0.0, RETINA_ENDS_MM, 4001)


def of_all_meridians(density, arc_mm):
    return np.mean([density(m, arc_mm) for m in MERIDIANS], axis=0)


def on_the_sphere(density):
    """Receptors of a retina that is part of a sphere, to 20 mm from the fovea."""
    ring = 2.0 * np.pi * RETINA_RADIUS_MM * np.sin(ROUND / RETINA_RADIUS_MM)
    return np.trapezoid(ring * of_all_meridians(density, ROUND), ROUND)


@pytest.fixture(scope="module")
def mixed():
    """Cones and rods 10 degrees out, where the disc is not."""
    return ic.cones.mosaic(0.4, (-10.0, 0.0), rods=True, seed=2)


def test_a_retina_has_the_counted_rods_and_cones():
    # Curcio et al. 1990: 92 million rods (77.9 to 107.3), 4.6 million cones (4.08 to 5.29). The
    # slow decline of the rods is chosen for the first; the second shows that the sphere is right.
    assert on_the_sphere(rods_per_mm2) == pytest.approx(92e6, rel=0.02)
    assert on_the_sphere(curcio_per_mm2) == pytest.approx(4.6e6, rel=0.02)
    # Curcio et al. 1993: 8 mm around the fovea are 5 % of the retina.
    area = on_the_sphere(lambda meridian, arc_mm: np.ones_like(arc_mm))
    assert np.pi * 16.0 / area == pytest.approx(0.05, abs=0.005)


def test_no_rod_lies_in_the_rod_free_zone_and_cones_are_as_many_half_a_millimetre_out():
    # Curcio et al. 1990: a zone of 0.350 mm; rods and cones are equal at 0.4 to 0.5 mm or so.
    for meridian in MERIDIANS:
        assert np.all(rods_per_mm2(meridian, np.array([0.0, 0.1, 0.175])) == 0.0)
        arc = np.linspace(0.2, 1.0, 801)
        more = rods_per_mm2(meridian, arc) > curcio_per_mm2(meridian, arc)
        assert 0.4 < arc[np.argmax(more)] < 0.6


def test_the_rod_ring_is_where_and_as_dense_as_it_was_found():
    # Curcio et al. 1990: highest in the superior retina, at the eccentricity of the optic disc
    # (15.5 deg), and 15 to 25 % less on the horizontal meridian. Curcio et al. 1993: more than
    # 150 000 per mm^2, 2 to 5 mm from the fovea. Jonas et al. 1992: a peak of 150 000 at 3 to 5 mm.
    highest = {m: rods_per_mm2(m, ROUND).max() for m in MERIDIANS}
    assert max(highest, key=highest.get) == "superior"
    assert 150e3 < highest["superior"] < 180e3
    for meridian in MERIDIANS:
        peak_mm = ROUND[np.argmax(rods_per_mm2(meridian, ROUND))]
        assert 3.0 < peak_mm < 5.0
        assert 10.0 < SCALE.eccentricity_deg(np.array([peak_mm]))[0] < 18.0
    lower = np.mean([highest["nasal"], highest["temporal"]]) / highest["superior"]
    assert 0.75 < lower < 0.9


def test_the_central_eight_millimetres_hold_the_rods_of_a_person_of_34():
    # Curcio, Millican, Allen & Kalina 1993: 648 rods/mm^2 are lost every year, 31 % from 34 to 90.
    at_34 = 648.0 * (90 - 34) / 0.31
    inner = ROUND[ROUND <= 4.0]
    rods = np.trapezoid(2.0 * np.pi * inner * of_all_meridians(rods_per_mm2, inner), inner)
    assert rods / (np.pi * inner[-1] ** 2) == pytest.approx(at_34, rel=0.08)


def test_rods_rise_fastest_in_the_superior_and_slowest_in_the_nasal_retina():
    # Curcio et al. 1990, abstract.
    near = {m: rods_per_mm2(m, np.array([0.6]))[0] for m in MERIDIANS}
    assert max(near, key=near.get) == "superior"
    assert min(near, key=near.get) == "nasal"


def test_the_far_periphery_has_the_rods_that_others_counted():
    # Jonas et al. 1992: 30 000 to 40 000 near the edge, of 60.1 million in all; Curcio has 92.
    edge = of_all_meridians(rods_per_mm2, np.array([RETINA_ENDS_MM]))[0]
    assert 30e3 < edge * 60.1 / 92.0 < 40e3


def test_rods_are_on_the_side_of_the_retina_that_was_counted():
    # The lower field falls on the superior retina, the right field of a right eye on the nasal one.
    right, left = (wanted_rods(True, eye, SCALE) for eye in ("right", "left"))
    deg = SCALE.eccentricity_deg(np.array([3.475]))[0]
    assert right(np.array([0.0]), np.array([-deg]))[0] == pytest.approx(156.3e3)
    assert right(np.array([0.0]), np.array([deg]))[0] == pytest.approx(144.0e3)
    assert right(np.array([deg]), np.array([0.0]))[0] == pytest.approx(129.9e3)
    assert left(np.array([deg]), np.array([0.0]))[0] == pytest.approx(135.4e3)


def test_a_field_has_the_rods_of_its_own_eye():
    # 3.475 mm: 129 900 rods per mm^2 of the nasal retina, 135 400 of the temporal one.
    deg = float(SCALE.eccentricity_deg(np.array([3.475]))[0])
    counts = [
        ic.cones.estimate_mosaic(0.1, (deg, 0.0), eye=eye, rods=True).n_rods
        for eye in ("right", "left")
    ]
    assert counts[0] / counts[1] == pytest.approx(129.9 / 135.4, abs=0.005)


def test_rods_are_as_many_as_wanted_and_stand_clear_of_the_cones(mixed):
    is_rod = mixed.types == ReceptorType.ROD
    area = 0.16 * float(SCALE.mm2_per_deg2(np.array(10.0)))
    # 121.4 and 129.8 thousand per mm^2 of the temporal retina at 2.506 and 2.865 mm.
    assert np.sum(is_rod) == pytest.approx(126.1e3 * area, rel=0.03)
    cones, rods = mixed.positions_mm[~is_rod], mixed.positions_mm[is_rod]
    # Inner segments at 9.92 deg are 1.58 / 2.25 of the cones' spacing (Banks 1991); Curcio has
    # 11740 and 9188 cones per mm^2 at 2 and 3 mm, 9938 at 2.706 mm.
    least = 0.5 * 1.58 / 2.25 * np.sqrt(2.0 / np.sqrt(3.0) / 9938.0)
    assert cKDTree(cones).query(rods)[0].min() > 0.97 * least
    # Polyak 1941: rods are 1 um wide in the fovea and 2.5 um in the far periphery.
    assert np.all((mixed.aperture_um[is_rod] >= 0.99) & (mixed.aperture_um[is_rod] < 2.5))
    assert mixed.provenance["rods"] == "curcio1990"


def test_cones_are_the_same_with_rods_and_without(mixed):
    alone = ic.cones.mosaic(0.4, (-10.0, 0.0), has_rod_intrusion=True, seed=2)
    is_rod = mixed.types == ReceptorType.ROD
    np.testing.assert_array_equal(mixed.positions_deg[~is_rod], alone.positions_deg)
    np.testing.assert_array_equal(mixed.types[~is_rod], alone.types)


def test_receptors_share_the_light_and_take_none_twice(mixed):
    is_rod = mixed.types == ReceptorType.ROD
    area_um2 = 1e6 * 0.16 * float(SCALE.mm2_per_deg2(np.array(10.0)))
    cones, rods = (np.sum(np.pi / 4 * mixed.aperture_um[k] ** 2) for k in (~is_rod, is_rod))
    # Cones alone would be 0.79 of their spacing wide, 0.566 of the area; inner segments narrow
    # them by 1.58 / 2.25 each way (Banks 1991).
    assert cones / area_um2 == pytest.approx(0.566 * (1.58 / 2.25) ** 2, rel=0.08)
    assert (cones + rods) / area_um2 < 0.75
    assert mixed.provenance["has_rod_intrusion"]


def test_an_even_density_of_rods_is_met():
    mixed = ic.cones.mosaic(0.3, (10.0, 0.0), rods=lambda x, y: 1e5 + 0.0 * x)
    area = 0.09 * float(SCALE.mm2_per_deg2(np.array(10.0)))
    assert mixed.counts["ROD"] == pytest.approx(1e5 * area, rel=0.04)
    assert mixed.provenance["rods"] == "function"


def test_there_is_no_retina_beyond_twenty_millimetres():
    cones = {"density": lambda x, y: 5e3 + 0.0 * x, "scale": 0.28}
    with pytest.raises(InvalidInputError, match=r"known to 20 mm .* reaches 20\.44 mm"):
        ic.cones.mosaic(2.0, (72.0, 0.0), rods=True, **cones)


def test_there_are_no_rods_where_none_are_wanted():
    mixed = ic.cones.mosaic(0.4, (0.7, 0.0), rods=lambda x, y: np.where(x > 0.7, 2e4, 0.0))
    is_rod = mixed.types == ReceptorType.ROD
    assert np.sum(is_rod) > 50
    # Rods give way to cones by less than their own spacing, 7 um or 0.03 deg.
    assert mixed.positions_deg[is_rod, 0].min() > 0.7 - 0.03


def test_a_field_within_the_rod_free_zone_has_cones_alone():
    # 0.175 mm are 0.65 deg.
    assert ic.cones.mosaic(0.1, rods=True).counts["ROD"] == 0


def test_rods_are_part_of_what_is_said_beforehand():
    # 126 100 per mm^2 of the temporal retina at 10 deg.
    few = ic.cones.estimate_mosaic(3.0, (-10.0, 0.0))
    many = ic.cones.estimate_mosaic(3.0, (-10.0, 0.0), rods=True)
    area = 9.0 * float(SCALE.mm2_per_deg2(np.array(10.0)))
    assert few.n_rods == 0
    assert many.n_rods == pytest.approx(126.1e3 * area, rel=0.02)
    assert many.memory_bytes > few.memory_bytes + 500.0 * many.n_rods


@pytest.mark.slow
@pytest.mark.parametrize("centre", [(2.0, 0.0), (5.0, 0.0), (-20.0, 0.0), (0.0, -12.0)])
def test_rods_are_as_many_as_wanted_wherever_the_field_lies(centre):
    mixed = ic.cones.mosaic(0.6, centre, rods=True, seed=1)
    x, y = (c + 0.6 * np.linspace(-0.5, 0.5, 61) for c in centre)
    x, y = np.meshgrid(x, y)
    per_deg2 = wanted_rods(True, "right", SCALE)(x, y) * SCALE.mm2_per_deg2(np.hypot(x, y))
    step = 0.01
    expected = np.trapezoid(np.trapezoid(per_deg2, dx=step), dx=step)
    assert mixed.counts["ROD"] == pytest.approx(expected, rel=0.04)


@pytest.mark.slow
def test_rods_near_their_free_zone_fit_into_the_gaps_between_cones():
    # From 0.7 to 1.3 deg, where rods are farther apart than cones.
    field = (0.6, 0.4), (1.0, 0.0)
    counts = [ic.cones.mosaic(*field, rods=True, seed=s).counts["ROD"] for s in range(8)]
    x, y = np.meshgrid(np.linspace(0.7, 1.3, 61), np.linspace(-0.2, 0.2, 41))
    per_deg2 = wanted_rods(True, "right", SCALE)(x, y) * SCALE.mm2_per_deg2(np.hypot(x, y))
    expected = np.trapezoid(np.trapezoid(per_deg2, dx=0.01), dx=0.01)
    # 164 by the densities: counts that scattered as by chance would tell their mean to 3 %.
    assert np.mean(counts) == pytest.approx(expected, rel=0.12)
