"""Surfaces of all shapes in the pipelines that render: rays that leave, images, plans."""

import dataclasses

import numpy as np
import pytest
from form_oracles import ZERNIKES, bump_map, irregular_eye
from leaving_rays import leave

import isetcl as ic
from isetcl.device.eye_features import EyeFeatures
from isetcl.eye.placement import Placement
from isetcl.eye.sequential import trace
from isetcl.eye.shapes.biconic import Biconic
from isetcl.eye.shapes.even_asphere import EvenAsphere
from isetcl.eye.shapes.toric import Toric
from isetcl.eye.shapes.zernike_sag import ZernikeSag
from isetcl.render import sobol
from isetcl.render.direct import DirectPipeline, Tile
from isetcl.render.paths import PathPipeline
from isetcl.render.plan import plan

MATCHED = Biconic(1 / 8.5, 8.5 * 0.75 / 7.8 - 1.0)


def with_surface(number, **parts):
    eye = ic.eyes.navarro(3.0)
    surfaces = list(eye.surfaces)
    surfaces[number] = dataclasses.replace(surfaces[number], **parts)
    return dataclasses.replace(eye, surfaces=tuple(surfaces), accommodation_model=None)


def eyes():
    """An eye that needs each feature, by the feature."""
    plain = ic.eyes.navarro(3.0)
    cornea = {"semi_diameter_mm": 4.3}
    return {
        "has_placements": with_surface(2, placement=Placement((0.1, 0.0), (3.0, -4.0))),
        "has_placed_stop": dataclasses.replace(
            plain, stop=ic.Stop(3.6, 3.0, (0.2, -0.1), 2.0, 35.0), accommodation_model=None
        ),
        "has_quadrics": with_surface(0, curvature=1 / 7.8, conic=-0.25, shape=MATCHED, **cornea),
        "has_biconics": with_surface(0, shape=Biconic(1 / 7.5, -0.1), **cornea),
        "has_torics": with_surface(0, shape=Toric(1 / 7.5), **cornea),
        "has_even_aspheres": with_surface(0, shape=EvenAsphere((0.0, -1e-4, 1e-6)), **cornea),
        "has_zernike_sags": with_surface(0, shape=ZernikeSag(ZERNIKES, 4.3), **cornea),
        "has_height_maps": with_surface(0, shape=bump_map(), **cornea),
    }


def planned(eye, **options):
    scene = ic.scenes.two_planes()
    return plan(scene, eye, **{"fov_deg": 5.0, "resolution": 16, "bands": 2} | options)


@pytest.mark.parametrize(
    "feature",
    [
        name if name == "has_biconics" else pytest.param(name, marks=pytest.mark.slow)
        for name in eyes()
    ],
)
def test_a_plan_compiles_in_what_an_eye_needs_and_says_why(feature):
    eye = eyes()[feature]
    prepared = planned(eye)
    forms = {f.name for f in dataclasses.fields(EyeFeatures)} - {"gradient_degree"}
    needed = {name for name in forms if getattr(prepared.config, name)}
    assert needed == {"has_conics", feature}
    owner = {"has_placements": "lens front", "has_placed_stop": "stop"}.get(feature, "cornea front")
    assert any(line.split("  in ")[-1].strip() == owner for line in prepared.explain().splitlines())


def test_eyes_of_spheres_and_conics_need_none_of_the_shapes():
    for eye in (ic.eyes.legrand(3.0), ic.eyes.navarro(3.0)):
        prepared = planned(eye)
        for name in eyes():
            assert not getattr(prepared.config, name)
        for word in ("surface shapes", "placed surfaces", "placed stop", "gradient index"):
            line = next(x for x in prepared.explain().splitlines() if x.startswith(word))
            assert "left out" in line


@pytest.mark.parametrize(
    ("name", "precision", "field"),
    [
        ("irregular", "single", (12.0, -7.0)),
        pytest.param("has_height_maps", "single", (3.0, 2.0), marks=pytest.mark.slow),
        pytest.param("irregular", "double", (12.0, -7.0), marks=pytest.mark.slow),
        *(pytest.param(name, "double", (3.0, 2.0), marks=pytest.mark.slow) for name in eyes()),
    ],
)
def test_rays_that_leave_an_eye_lead_back_to_their_point_of_the_retina(name, precision, field):
    eye = irregular_eye() if name == "irregular" else eyes()[name]
    rays = leave(eye, field_deg=field, fov_deg=1e-9, samples=1, precision=precision)
    inwards = -np.stack([rays.x, rays.y, -np.ones_like(rays.x)], axis=1)
    back = trace(eye, 1e3 * rays.position_m, inwards, 550.0)
    lit = rays.weight > 0
    assert lit.sum() > 55
    assert back.passed[lit].all()
    expected = eye.field_map(550.0).retinal_point_mm(*np.array(field))
    error = np.linalg.norm(back.positions_mm - expected, axis=1)[lit]
    # The polynomials of the camera are right to 1e-8 mm.
    assert error.max() < (1e-4 if precision == "single" else 1e-7)


@pytest.mark.slow
def test_direct_and_path_pipelines_draw_the_same_image_through_an_irregular_eye():
    films = []
    for pipeline, kernel in (("auto", DirectPipeline), ("paths", PathPipeline)):
        prepared = planned(
            irregular_eye(),
            bands=1,
            pipeline=pipeline,
            wavelengths_nm=[550.0],
            precision="double",
        )
        film = kernel(prepared).sample(Tile(0, 0, 16, 16), 8, sobol.stream(3, 0))
        films.append(np.einsum("wc,cyx->wyx", prepared.expansion, film))
    assert films[0].min() > 0
    np.testing.assert_allclose(films[1], films[0], rtol=1e-9)


@pytest.mark.slow
def test_lanes_do_not_change_a_bit_of_an_image(device):
    if not device.is_cpu:
        pytest.skip("vectors wider than one lane are for CPUs")
    films = []
    for width in (1, 16, 64):
        prepared = planned(irregular_eye(), bands=1)
        config = dataclasses.replace(prepared.config, vector_width=width)
        pipeline = DirectPipeline(dataclasses.replace(prepared, config=config))
        films.append(pipeline.sample(Tile(0, 0, 16, 16), 8, 5))
    np.testing.assert_array_equal(films[0], films[1])
    np.testing.assert_array_equal(films[0], films[2])
