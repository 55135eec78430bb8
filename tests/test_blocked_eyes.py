"""Eyes that cannot be, and eyes that light does not get through: errors that name the surface."""

import dataclasses

import numpy as np
import pytest

import isetcl as ic
from isetcl.eye.placement import Placement
from isetcl.eye.shapes.biconic import Biconic
from isetcl.eye.shapes.even_asphere import EvenAsphere
from isetcl.eye.shapes.height_map import HeightMap
from isetcl.eye.shapes.toric import Toric
from isetcl.eye.shapes.zernike_sag import ZernikeSag


def with_surface(number, **parts):
    eye = ic.eyes.navarro(3.0)
    surfaces = list(eye.surfaces)
    surfaces[number] = dataclasses.replace(surfaces[number], **parts)
    return dataclasses.replace(eye, surfaces=tuple(surfaces), accommodation_model=None)


@pytest.mark.parametrize(
    ("number", "parts", "match"),
    [
        (1, {"placement": Placement(tilt_deg=(15.0, 0.0))}, "'cornea back' must lie behind"),
        (0, {"placement": Placement((1.5, 0.0))}, "'cornea back' must lie"),
        (2, {"placement": Placement(tilt_deg=(0.0, 40.0))}, "'lens front' must lie behind"),
        (
            0,
            {"shape": Biconic(1 / 5.5), "semi_diameter_mm": 4.8},
            "'cornea back' must lie behind 'cornea front'",
        ),
        (
            3,
            {"shape": EvenAsphere((-0.4,)), "semi_diameter_mm": 2.9},
            "'lens back' must lie behind",
        ),
        (0, {"shape": EvenAsphere((0.0, 3e-3)), "semi_diameter_mm": 5.0}, "'cornea back' must lie"),
    ],
)
def test_surfaces_that_cross_are_named(number, parts, match):
    with pytest.raises(ic.InvalidInputError, match=match):
        with_surface(number, **parts)


def test_a_tilted_cornea_that_reaches_into_the_stop_is_named():
    eye = ic.eyes.navarro(8.0)
    one = dataclasses.replace(
        eye.surfaces[0],
        placement=Placement(tilt_deg=(40.0, 0.0)),
        medium_after=eye.surfaces[1].medium_after,
    )
    with pytest.raises(ic.InvalidInputError, match="cuts surface 'cornea front'"):
        dataclasses.replace(eye, surfaces=(one,), accommodation_model=None)


@pytest.mark.parametrize(
    "shape",
    [
        Biconic(1 / 6.0, 3.0),
        Toric(1 / 3.0),
        EvenAsphere((0.0, 1e-4)),
        ZernikeSag((0.0, 0.0, 0.0, 1e-3), 4.0),
    ],
    ids=lambda shape: type(shape).__name__,
)
def test_a_surface_that_ends_within_its_semi_diameter_is_named(shape):
    # The y section, of radius 6 mm and conic 3, ends 3 mm from the vertex.
    with pytest.raises(ic.InvalidInputError, match=r"'front'.*semi_diameter_mm"):
        ic.Surface(
            "front", 0.0, 1 / 6.0, 3.0, 3.5, ic.Medium("water", ic.ConstantIndex(1.33)), shape
        )


def test_a_surface_outside_its_height_map_is_named():
    water = ic.Medium("water", ic.ConstantIndex(1.33))
    small = HeightMap(np.zeros((5, 5)), 6.0, 5.0)
    with pytest.raises(ic.InvalidInputError, match=r"'front'.*within the height map, 2.5 mm"):
        ic.Surface("front", 0.0, 1 / 7.8, 0.0, 2.6, water, small)


def decentred_lens():
    """A lens beside the light of a stop: no chief ray meets it."""
    away = Placement((4.0, 0.0))
    eye = ic.eyes.navarro(1.0)
    lens = tuple(
        dataclasses.replace(s, placement=away, semi_diameter_mm=2.0) for s in eye.surfaces[2:]
    )
    return dataclasses.replace(eye, surfaces=(*eye.surfaces[:2], *lens), accommodation_model=None)


def reflecting_lens():
    """A lens so tilted that all light is reflected at its rear."""
    eye = ic.eyes.navarro(1.0)
    leaning = Placement(tilt_deg=(55.0, 0.0))
    dense = ic.Medium("flint", ic.ConstantIndex(1.9))
    front, back = (
        dataclasses.replace(s, curvature=0.0, conic=0.0, semi_diameter_mm=4.0)
        for s in eye.surfaces[2:]
    )
    front = dataclasses.replace(front, medium_after=dense)
    back = dataclasses.replace(back, placement=leaning, vertex_z_mm=11.0)
    return dataclasses.replace(
        eye, surfaces=(*eye.surfaces[:2], front, back), accommodation_model=None
    )


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (decentred_lens, "at 'lens front', the ray met a surface outside its semi-diameter"),
        (reflecting_lens, "at 'lens back', total internal reflection"),
    ],
)
def test_what_blocks_the_light_is_named_before_anything_is_rendered(make, match):
    eye = make()
    for ask in (
        lambda: eye.field_map(550.0),
        lambda: ic.RetinalGrid.of(eye, 5.0, 8),
        lambda: ic.plan(ic.scenes.uniform(), eye, fov_deg=5.0, resolution=8),
        lambda: ic.render(ic.scenes.uniform(), eye, fov_deg=5.0, resolution=8, spp=2),
    ):
        with pytest.raises(ic.InvalidInputError, match=match):
            ask()


def test_a_surface_of_revolution_that_blocks_the_light_is_named_too():
    # Total reflection needs a slant; a small rear surface cuts off all but a few chief rays.
    eye = ic.eyes.navarro(1.0)
    tiny = dataclasses.replace(eye.surfaces[3], semi_diameter_mm=1e-3)
    small = dataclasses.replace(eye, surfaces=(*eye.surfaces[:3], tiny), accommodation_model=None)
    with pytest.raises(ic.InvalidInputError, match=r"at 'lens back'.*outside its semi-diameter"):
        small.field_map(550.0)


def test_a_ray_that_is_blocked_has_a_status_of_its_own():
    rays = ic.trace_rays(decentred_lens(), [0.0, 0.0, -1.0], [0.0, 0.0, 1.0], 550.0)
    assert rays.status[0] == ic.RayStatus.OUTSIDE
    assert rays.elements[rays.surface[0]] == "lens front"
