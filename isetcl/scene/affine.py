"""Affine maps, as matrices (4, 4) for column vectors, and what they do to shapes and lights."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_choice, check_finite
from isetcl.eye.turning import cross_matrix
from isetcl.scene.light import DistantLight, Environment, Light, PointLight, SpotLight
from isetcl.scene.mesh import Instance, Mesh, check_affine
from isetcl.scene.model import Disc, Quad, Shape, Sphere, Vector
from isetcl.spectrum import Spectrum

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_TOLERANCE = 1e-9
_AROUND, _UPWARD = 128, 64


def vector(name: str, value: Vector) -> np.ndarray:
    """Three finite numbers as an array (3,).

    Raises
    ------
    InvalidInputError
        If there are not three, or one is not finite.
    """
    array = check_array(name, value)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise InvalidInputError(f"{name} must be three finite numbers, got {value!r}")
    return array


def direction(name: str, value: Vector) -> np.ndarray:
    """A vector that is not zero, at length 1.

    Raises
    ------
    InvalidInputError
        If it is no vector, or zero.
    """
    array = vector(name, value)
    length = float(np.linalg.norm(array))
    if not length > 0:
        raise InvalidInputError(f"{name} must not be zero, got {value!r}")
    return array / length


def translation(offset_m: Vector) -> np.ndarray:
    """The map that moves everything by an offset, metres."""
    matrix = np.eye(4)
    matrix[:3, 3] = vector("offset_m", offset_m)
    return matrix


def about(linear: np.ndarray, point_m: np.ndarray) -> np.ndarray:
    """A linear map (3, 3) that leaves a point where it is."""
    matrix = np.eye(4)
    matrix[:3, :3] = linear
    matrix[:3, 3] = point_m - linear @ point_m
    return matrix


def rotation(axis: str | Vector, angle_deg: float) -> np.ndarray:
    """Matrix (3, 3) of a turn about an axis through the origin, anticlockwise seen against it.

    Parameters
    ----------
    axis
        ``"x"``, ``"y"``, ``"z"`` or a direction.
    angle_deg
        Angle of the turn.

    Raises
    ------
    InvalidInputError
        If the axis is none, or the angle is not finite.
    """
    if isinstance(axis, str):
        unit = np.array(_AXES[check_choice("axis", axis, _AXES)])
    else:
        unit = direction("axis", axis)
    angle = math.radians(check_finite("angle_deg", angle_deg, "deg"))
    # Rodrigues' formula, with the matrix of the cross product.
    k = cross_matrix(unit)
    return np.eye(3) + math.sin(angle) * k + (1.0 - math.cos(angle)) * (k @ k)


def check_map(matrix: np.ndarray) -> np.ndarray:
    """Return an affine map that keeps left and right apart.

    Raises
    ------
    InvalidInputError
        If the matrix is not affine, flattens space or mirrors it.
    """
    checked = check_affine(matrix)
    if np.linalg.det(checked[:3, :3]) < 0:
        raise InvalidInputError(
            "matrix must not mirror: its determinant must be > 0, because the fronts of surfaces "
            "would become backs"
        )
    return checked


def centre_m(shape: Shape) -> np.ndarray:
    """Centre of a shape, metres: of a mesh the middle of its bounding box."""
    if isinstance(shape, (Sphere, Disc)):
        return np.array(shape.centre_m)
    if isinstance(shape, Quad):
        corner, u, v = (np.array(x) for x in (shape.corner_m, shape.edge_u_m, shape.edge_v_m))
        return corner + (u + v) / 2.0
    if isinstance(shape, Instance):
        m = shape.matrix
        return m[:3, :3] @ centre_m(shape.mesh) + m[:3, 3]
    return (shape.vertices_m.min(axis=0) + shape.vertices_m.max(axis=0)) / 2.0


def moved_shape(shape: Shape, matrix: np.ndarray, *, is_patterned: bool = False) -> Shape:
    """A shape under an affine map.

    A sphere stretched unevenly, or turned while it carries a pattern, becomes a smoothly shaded
    mesh (its outline within 0.03 % of the radius), and so does a disc that becomes an ellipse.

    Parameters
    ----------
    shape
        The shape.
    matrix
        The map.
    is_patterned
        Whether texture coordinates matter, because a texture lies on the shape.
    """
    linear, offset = matrix[:3, :3], matrix[:3, 3]
    if isinstance(shape, Mesh):
        return shape.moved(matrix)
    if isinstance(shape, Instance):
        return Instance(shape.mesh, matrix @ shape.matrix)
    if isinstance(shape, Quad):
        return Quad(
            tuple(linear @ np.array(shape.corner_m) + offset),
            tuple(linear @ np.array(shape.edge_u_m)),
            tuple(linear @ np.array(shape.edge_v_m)),
        )
    if isinstance(shape, Disc):
        return _moved_disc(shape, matrix, is_patterned)
    scale = float(np.cbrt(np.linalg.det(linear)))
    is_uniform = np.allclose(
        linear @ linear.T, scale**2 * np.eye(3), rtol=0, atol=_TOLERANCE * scale**2
    )
    is_turned = not np.allclose(linear, scale * np.eye(3), rtol=0, atol=_TOLERANCE * scale)
    if not is_uniform or (is_patterned and is_turned):
        return sphere_mesh(shape).moved(matrix)
    return Sphere(tuple(linear @ np.array(shape.centre_m) + offset), scale * shape.radius_m)


def _moved_disc(disc: Disc, matrix: np.ndarray, is_patterned: bool) -> Shape:
    linear = matrix[:3, :3]
    box = disc.bounding_quad()
    u, v = linear @ np.array(box.edge_u_m), linear @ np.array(box.edge_v_m)
    size = float(np.linalg.norm(u))
    slack = _TOLERANCE * size
    if abs(float(np.linalg.norm(v)) - size) > slack or abs(float(u @ v)) > slack * size:
        return disc_mesh(disc).moved(matrix)
    centre = linear @ np.array(disc.centre_m) + matrix[:3, 3]
    normal = np.cross(u, v) / size**2
    moved = Disc(tuple(centre), size / 2.0, tuple(normal))
    if is_patterned and not np.allclose(moved.bounding_quad().edge_u_m, u, rtol=0, atol=slack):
        return disc_mesh(disc).moved(matrix)
    return moved


def sphere_mesh(sphere: Sphere) -> Mesh:
    """A sphere in triangles with smooth normals and the sphere's own texture coordinates."""
    u = np.linspace(0.0, 1.0, _AROUND + 1)
    v = np.linspace(0.0, 1.0, _UPWARD + 1)
    longitude, latitude = np.meshgrid(2.0 * np.pi * u, np.pi * (v - 0.5))
    normals = np.stack(
        [
            np.cos(latitude) * np.sin(longitude),
            np.sin(latitude),
            np.cos(latitude) * np.cos(longitude),
        ],
        axis=-1,
    ).reshape(-1, 3)
    i = (np.arange(_UPWARD)[:, None] * (_AROUND + 1) + np.arange(_AROUND)).ravel()
    above = i + _AROUND + 1
    # The triangles with two corners at a pole are left out.
    lower = np.column_stack([i, i + 1, above + 1])[_AROUND:]
    upper = np.column_stack([i, above + 1, above])[:-_AROUND]
    uv = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    vertices = np.array(sphere.centre_m) + sphere.radius_m * normals
    return Mesh(vertices, np.concatenate([lower, upper]), normals, uv)


def disc_mesh(disc: Disc) -> Mesh:
    """A disc in triangles with the disc's own texture coordinates."""
    turn = 2.0 * np.pi * np.arange(2 * _AROUND) / (2 * _AROUND)
    uv = np.concatenate([[[0.5, 0.5]], 0.5 + 0.5 * np.column_stack([np.cos(turn), np.sin(turn)])])
    box = disc.bounding_quad()
    edges = np.array([box.edge_u_m, box.edge_v_m])
    rim = 1 + np.arange(2 * _AROUND)
    faces = np.column_stack([np.zeros_like(rim), rim, np.roll(rim, -1)])
    return Mesh(np.array(box.corner_m) + uv @ edges, faces, uv=uv)


def moved_light(light: Light, matrix: np.ndarray) -> Light:
    """A light under a rigid motion."""
    turn = matrix[:3, :3]
    if isinstance(light, DistantLight):
        return dataclasses.replace(light, towards=tuple(turn @ np.array(light.towards)))
    position = tuple(turn @ np.array(light.position_m) + matrix[:3, 3])
    if isinstance(light, SpotLight):
        axis = tuple(turn @ np.array(light.direction))
        return dataclasses.replace(light, position_m=position, direction=axis)
    assert isinstance(light, PointLight)
    return dataclasses.replace(light, position_m=position)


def moved_background(
    background: Spectrum | Environment | None, matrix: np.ndarray
) -> Spectrum | Environment | None:
    """What surrounds a scene, after a rigid motion: only its rotation matters."""
    if not isinstance(background, Environment):
        return background
    before = np.eye(3) if background.rotation is None else background.rotation
    return dataclasses.replace(background, rotation=matrix[:3, :3] @ before)
