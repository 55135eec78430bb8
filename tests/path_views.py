"""Views of scenes in units of radiance, for tests of the path pipeline."""

import dataclasses
import functools

import numpy as np

import isetcl as ic
from isetcl.device.eye_features import EyeFeatures
from isetcl.eye.field import direction_from_field
from isetcl.render.kernel_config import PathConfig
from isetcl.render.paths import PathPipeline
from isetcl.units import MM_PER_M

UNIT = ic.Spectrum.constant(1.0)
HALF = ic.Diffuse(ic.Spectrum.constant(0.5))
DARK = ic.Emission(ic.Spectrum.constant(0.0))
EYE = ic.eyes.navarro(3.0)
PINHOLE = ic.eyes.navarro(0.05)
ONE = {"wavelengths_nm": [550.0], "bands": 1}
_OF_THE_EYE = {field.name for field in dataclasses.fields(EyeFeatures)} | {
    "has_aspheric_retina",
    "has_asymmetry",
    "has_relief",
    "has_far_side",
    "has_semi_diameters",
    "has_scatter",
}
EVERYTHING = {
    field.name: True
    for field in dataclasses.fields(PathConfig)
    if field.name.startswith("has_") and field.name not in _OF_THE_EYE
} | {"combined_depth": 3}
"""Changes of a configuration that compile all features of scenes in, so that scenes share one
kernel."""


@functools.cache
def _uniform(eye, fov_deg, resolution, spp, seed, precision):
    where = {"fov_deg": fov_deg, "resolution": resolution, "spp": spp, "seed": seed}
    scene = ic.scenes.uniform(spectrum=UNIT)
    return ic.render(scene, eye, precision=precision, **where, **ONE).irradiance.values[0]


def pixels_of(
    scene, *, eye=EYE, fov_deg=0.05, resolution=4, spp=64, seed=0, precision="single", **options
):
    """Radiance and its standard error in every pixel, from the same samples of an even scene."""
    image = ic.render(
        scene,
        eye,
        fov_deg=fov_deg,
        resolution=resolution,
        spp=spp,
        seed=seed,
        precision=precision,
        **ONE,
        **options,
    )
    even = _uniform(eye, fov_deg, resolution, spp, seed, precision)
    values, errors = image.irradiance.values[0], image.standard_error.values[0]
    assert np.isfinite(values).all()
    assert np.isfinite(errors).all()
    return values / even, errors / even


def radiance_of(scene, **options):
    """Mean radiance over the view, and its standard error."""
    values, errors = pixels_of(scene, **options)
    return float(values.mean()), float(np.sqrt(np.sum(errors**2))) / errors.size


def chief_rays(*, eye=PINHOLE, fov_deg, resolution, across=8, margin=0.0):
    """Origins and directions of chief rays, (rows, columns, across, across, 3).

    They fill pixels and a margin around them, in pixels.
    """
    grid = ic.RetinalGrid.of(eye, fov_deg, resolution, (0.0, 0.0))
    inside = ((np.arange(across) + 0.5) / across - 0.5) * (1.0 + 2.0 * margin)
    x = grid.x_deg[:, None] + inside * grid.pitch_deg[0]
    y = grid.y_deg[:, None] + inside * grid.pitch_deg[1]
    x, y = x[None, :, None, :], y[:, None, :, None]
    origin = np.array([0.0, 0.0, eye.entrance_pupil(550.0).z_mm / MM_PER_M])
    return origin, direction_from_field(*np.broadcast_arrays(x, y))


def pipeline_of(scene, changes=None, *, eye=EYE, fov_deg=8.0, resolution=8, **options):
    """A path pipeline with fields of its configuration replaced, and its only tile."""
    prepared = ic.plan(scene, eye, fov_deg=fov_deg, resolution=resolution, **ONE, **options)
    config = dataclasses.replace(prepared.config, **(changes or {}))
    pipeline = PathPipeline(dataclasses.replace(prepared, config=config))
    (tile,) = pipeline.tiles()
    return pipeline, tile


def replicates_of(pipeline, tile, samples=64, count=8):
    """Mean of a film, its standard error, from independent replicates."""
    films = [pipeline.sample(tile, samples, stream)[0].mean() for stream in range(1, count + 1)]
    return np.mean(films), np.std(films, ddof=1) / np.sqrt(count)


def quad_mesh(quad, *, uv=True, steps=1):
    """A parallelogram as a mesh of 2 steps^2 triangles with its texture coordinates."""
    corner, u, v = (np.array(x) for x in (quad.corner_m, quad.edge_u_m, quad.edge_v_m))
    a, b = (g.ravel() for g in np.meshgrid(*[np.linspace(0.0, 1.0, steps + 1)] * 2))
    first = (np.arange(steps)[:, None] * (steps + 1) + np.arange(steps)).ravel()
    right, up = first + 1, first + steps + 1
    faces = np.concatenate(
        [np.column_stack([first, right, up + 1]), np.column_stack([first, up + 1, up])]
    )
    points = corner + a[:, None] * u + b[:, None] * v
    return ic.Mesh(points, faces, uv=np.column_stack([a, b]) if uv else None)


def placed(scale=1.0, turn_deg=0.0, axis=(0.0, 1.0, 0.0), at=(0.0, 0.0, 0.0)):
    """An affine map: scaled, turned about an axis, moved."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.radians(turn_deg)
    turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    matrix = np.eye(4)
    matrix[:3, :3] = turn @ np.diag(np.broadcast_to(scale, 3).astype(float))
    matrix[:3, 3] = at
    return matrix
