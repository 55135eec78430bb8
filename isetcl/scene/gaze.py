"""Placing the eyes: the whole scene brought into the frame of an eye that looks along -z.

Two eyes stand side by side on the x axis and turn about centres behind their corneas. By Listing's
law they do so without twist: the turn from straight ahead to any direction is the shortest one.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from isetcl.errors import InvalidInputError, check_between
from isetcl.eye.field import direction_from_field
from isetcl.eye.model import Eye
from isetcl.eye.turning import AHEAD, ROTATION_CENTRE_MM, gaze_direction, shortest_rotation
from isetcl.scene.affine import (
    direction,
    moved_background,
    moved_light,
    vector,
)
from isetcl.scene.edit import moved_object
from isetcl.scene.model import Scene, Vector

__all__ = ["ROTATION_CENTRE_MM", "binocular", "fixating", "seen_from", "turned"]


def seen_from(
    scene: Scene,
    eye_at_m: Vector = (0.0, 0.0, 0.0),
    look_at_m: Vector | None = None,
    *,
    gaze_deg: tuple[float, float] | None = None,
    up: Vector = (0.0, 1.0, 0.0),
) -> Scene:
    """The scene as it lies before an eye in another place: at the origin, looking along -z.

    Objects, lights and surroundings move together; an upright eye stays upright.

    Parameters
    ----------
    scene
        The scene.
    eye_at_m
        The corneal vertex, metres.
    look_at_m
        The point on the eye's axis that it looks at, metres.
    gaze_deg
        Instead of the point: the direction, first to the right about +y (longitude), then up
        (latitude). Without either the eye looks along -z.
    up
        The direction that is up in the eye's view.

    Raises
    ------
    InvalidInputError
        If both a point and a direction are given, the eye stands in the point, or looks along `up`.
    """
    eye = vector("eye_at_m", eye_at_m)
    if look_at_m is not None and gaze_deg is not None:
        raise InvalidInputError("pass look_at_m or gaze_deg, not both")
    if look_at_m is not None:
        forward = vector("look_at_m", look_at_m) - eye
        if not np.linalg.norm(forward) > 0:
            raise InvalidInputError(f"look_at_m must differ from eye_at_m, got both {look_at_m!r}")
    else:
        forward = AHEAD if gaze_deg is None else gaze_direction(gaze_deg)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, direction("up", up))
    if not np.linalg.norm(right) > 1e-9:
        raise InvalidInputError(f"the eye must not look along up, got up = {up!r}; pass another")
    right = right / np.linalg.norm(right)
    return _in_eye_frame(scene, np.array([right, np.cross(right, forward), -forward]), eye)


def turned(
    scene: Scene, gaze_deg: tuple[float, float], *, rotation_centre_mm: float | None = None
) -> Scene:
    """The scene as it lies before an eye that has turned in its socket, without twist.

    Parameters
    ----------
    scene
        The scene before the eye looks aside: with the corneal vertex at the origin, along -z.
    gaze_deg
        Where its axis points then: to the right (longitude) and up (latitude).
    rotation_centre_mm
        Distance of the centre of rotation behind the corneal vertex; None is
        `ROTATION_CENTRE_MM`.
    """
    return _turned(scene, shortest_rotation(AHEAD, gaze_direction(gaze_deg)), rotation_centre_mm)


def fixating(
    scene: Scene, eye: Eye, point_m: Vector, *, rotation_centre_mm: float | None = None
) -> Scene:
    """The scene as it lies before an eye that has turned until its fovea sees a point.

    The line from the entrance pupil to the point then has the field angles `eye.fovea_deg`. The
    turn is the shortest one from the direction that the fovea saw before.

    Raises
    ------
    InvalidInputError
        If the point lies nearer than the cornea, or not in front of the eye.
    """
    point = vector("point_m", point_m)
    if not point[2] < -1e-3:
        raise InvalidInputError(
            f"point_m must lie more than 1 mm in front of the cornea (z < -0.001 m), got {point}"
        )
    centre = np.array([0.0, 0.0, _behind_mm(rotation_centre_mm) * 1e-3])
    pupil = np.array([0.0, 0.0, eye.entrance_pupil().z_mm * 1e-3])
    seen = direction_from_field(*(np.array(angle) for angle in eye.fovea_deg))
    turn = np.eye(3)
    for _ in range(_FIXATION_STEPS):
        # The pupil moves with the eye, and the direction from it to the point a little with it.
        towards = point - (centre + turn @ (pupil - centre))
        turn = shortest_rotation(seen, towards / np.linalg.norm(towards))
    return _turned(scene, turn, rotation_centre_mm)


_FIXATION_STEPS = 20


def _turned(scene: Scene, turn: np.ndarray, rotation_centre_mm: float | None) -> Scene:
    centre = np.array([0.0, 0.0, _behind_mm(rotation_centre_mm) * 1e-3])
    return _in_eye_frame(scene, turn.T, centre - turn @ centre)


def _behind_mm(rotation_centre_mm: float | None) -> float:
    depth = ROTATION_CENTRE_MM if rotation_centre_mm is None else rotation_centre_mm
    return check_between("rotation_centre_mm", depth, 0.0, 30.0, "mm")


def binocular(
    scene: Scene,
    interpupillary_distance_mm: float = 63.0,
    verge_on_m: Vector | None = None,
    *,
    rotation_centre_mm: float | None = None,
) -> tuple[Scene, Scene]:
    """The scene as it lies before the left and the right eye of a viewer.

    Looking straight ahead the corneal vertices lie at x = -ipd/2 and +ipd/2, and the axes of both
    eyes are parallel to -z. Then each eye turns about its own centre, which lies on its axis behind
    the cornea, until its axis meets the point. (The axis is that of the model eye; the fovea of a
    real eye lies some degrees beside it.)

    Parameters
    ----------
    scene
        The scene, in the frame of the viewer.
    interpupillary_distance_mm
        Distance between the eyes' centres of rotation: of the pupils when they look far away.
    verge_on_m
        The point both eyes look at, metres; None leaves them parallel.
    rotation_centre_mm
        Distance of the centre of rotation behind the corneal vertex; None is
        `ROTATION_CENTRE_MM`.

    Returns
    -------
    tuple of Scene
        For the left eye and for the right eye.

    Raises
    ------
    InvalidInputError
        If a distance breaks its rule, or the point does not lie in front of the eyes.
    """
    half = check_between("interpupillary_distance_mm", interpupillary_distance_mm, 1, 1000, "mm")
    behind = _behind_mm(rotation_centre_mm) * 1e-3
    point = None if verge_on_m is None else vector("verge_on_m", verge_on_m)
    views = []
    for side, name in ((-0.5, "left eye"), (0.5, "right eye")):
        centre = np.array([side * half * 1e-3, 0.0, behind])
        gaze = AHEAD
        if point is not None:
            gaze = point - centre
            if not (point[2] < 0 and np.linalg.norm(gaze) > behind):
                raise InvalidInputError(
                    f"verge_on_m must lie in front of the eyes (z < 0), got {tuple(point.tolist())}"
                )
            gaze = gaze / np.linalg.norm(gaze)
        turn = shortest_rotation(AHEAD, gaze)
        view = _in_eye_frame(scene, turn.T, centre + behind * gaze)
        views.append(dataclasses.replace(view, name=f"{scene.name}, {name}"))
    return views[0], views[1]


def _in_eye_frame(scene: Scene, axes: np.ndarray, eye_m: np.ndarray) -> Scene:
    """A scene in the frame with these axes (rows) and this origin."""
    matrix = np.eye(4)
    matrix[:3, :3] = axes
    matrix[:3, 3] = -axes @ eye_m
    return dataclasses.replace(
        scene,
        objects=tuple(moved_object(item, matrix) for item in scene.objects),
        background=moved_background(scene.background, matrix),
        lights=tuple(moved_light(light, matrix) for light in scene.lights),
    )
