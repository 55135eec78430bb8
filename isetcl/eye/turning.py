"""How an eye turns in its socket: the place of its centre, and Listing's turns to a gaze."""

from __future__ import annotations

import math

import numpy as np

from isetcl.errors import check_between, check_pair

ROTATION_CENTRE_MM = 13.5
"""Distance of an eye's centre of rotation behind the corneal vertex, mm: one number between those
of Fry & Hill for turns to the side (14.7 mm: 1962, Am. J. Optom. 39, 581) and up or down (12.0 mm:
1963, Am. J. Optom. 40, 707); the value customary in the design of spectacles."""

AHEAD = np.array([0.0, 0.0, -1.0])
"""The direction of the optical axis out of the eye."""


def gaze_direction(gaze_deg: tuple[float, float]) -> np.ndarray:
    """Unit vector of a longitude to the right and a latitude upwards, degrees, both from -z."""
    longitude, latitude = (math.radians(angle) for angle in check_pair("gaze_deg", gaze_deg, "deg"))
    check_between("gaze_deg (second)", math.degrees(latitude), -89.999, 89.999, "deg")
    return np.array(
        [
            math.cos(latitude) * math.sin(longitude),
            math.sin(latitude),
            -math.cos(latitude) * math.cos(longitude),
        ]
    )


def shortest_rotation(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Matrix (3, 3) of the smallest turn from one unit vector to another, less than half a turn."""
    k = cross_matrix(np.cross(start, end))
    return np.eye(3) + k + (k @ k) / (1.0 + float(start @ end))


def cross_matrix(v: np.ndarray) -> np.ndarray:
    """The matrix (3, 3) that takes the vector product of v with what it is applied to."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
