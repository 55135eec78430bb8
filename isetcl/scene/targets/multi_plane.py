"""Multi-plane displays: transparent planes at several distances whose light adds up."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_between, check_type
from isetcl.scene.model import Scene, SceneObject
from isetcl.scene.targets.planes import facing_quad, picture
from isetcl.scene.texture import Image


def multi_plane_display(
    images: Sequence[Image],
    distances_m: Sequence[float] | None = None,
    width_deg: float = 10.0,
    *,
    vergences_dpt: Sequence[float] | None = None,
    luminance_cd_m2: float = 100.0,
) -> Scene:
    """A stack of pictures in front of the eye, each seen through the others; their light adds up.

    All planes subtend the same angle at the corneal vertex, so that equal pixels lie on one line of
    sight.

    Parameters
    ----------
    images
        One linear picture a plane, as `depth_blended_images` makes them; of the same shape.
    distances_m, vergences_dpt
        Where the planes are: distances from the corneal vertex, or their inverses.
    width_deg
        Angle that the width subtends.
    luminance_cd_m2
        Luminance of white (weights 1) of one plane.

    Raises
    ------
    InvalidInputError
        If there are not as many planes as images, two planes have the same place, or a number
        breaks its rule.
    """
    distances = plane_distances_m(distances_m, vergences_dpt)
    check_type("images", images, (tuple, list))
    for i, image in enumerate(images):
        check_type(f"images[{i}]", image, Image)
    if len(images) != len(distances):
        raise InvalidInputError(
            f"images must be one a plane, got {len(images)} for {len(distances)} planes"
        )
    if len({image.texels.shape for image in images}) > 1:
        raise InvalidInputError(
            f"images must have one shape, got {[image.texels.shape for image in images]}"
        )
    slope = 2.0 * math.tan(math.radians(check_between("width_deg", width_deg, 1e-3, 170.0)) / 2.0)
    rows, columns = images[0].shape
    planes = []
    for image, distance in zip(images, distances, strict=True):
        width = slope * float(distance)
        quad = facing_quad(float(distance), width, width * rows / columns)
        light = dataclasses.replace(picture(image, luminance_cd_m2), is_additive=True)
        planes.append(SceneObject(f"plane at {distance:g} m", quad, light))
    return Scene(tuple(planes), None, f"multi-plane display of {len(planes)} planes")


def depth_blend_weights(
    depth_m: np.ndarray,
    distances_m: Sequence[float] | None = None,
    *,
    vergences_dpt: Sequence[float] | None = None,
) -> np.ndarray:
    """Shares of the light that each plane of a multi-plane display shows, (planes, ...).

    Between two planes the light is divided linearly in dioptres; what is nearer than the nearest or
    farther than the farthest plane is shown on that one. The shares of a pixel sum to 1.

    Parameters
    ----------
    depth_m
        Distance of the scene at each pixel, metres, any shape; may be infinite.
    distances_m, vergences_dpt
        Where the planes are, in any order.

    Raises
    ------
    InvalidInputError
        If a depth is not positive, or two planes have the same place.

    Notes
    -----
    Source: Akeley, Watt, Girshick & Banks 2004 (ACM Trans. Graph. 23, 804).
    """
    depth = check_array("depth_m", depth_m)
    if not np.all(depth > 0):
        raise InvalidInputError("depth_m must be > 0 everywhere (infinity is far away)")
    planes = 1.0 / plane_distances_m(distances_m, vergences_dpt)
    order = np.argsort(planes)
    # Each plane's share is a hat function over dioptres.
    hats = np.eye(len(planes))
    shares = np.empty((len(planes), *depth.shape))
    for k, place in enumerate(order):
        shares[place] = np.interp(1.0 / depth, planes[order], hats[k])
    return shares


def depth_blended_images(
    image: Image,
    depth_m: np.ndarray,
    distances_m: Sequence[float] | None = None,
    *,
    vergences_dpt: Sequence[float] | None = None,
) -> tuple[Image, ...]:
    """A picture with depth, divided among the planes of a multi-plane display.

    Parameters
    ----------
    image
        The picture as seen from the corneal vertex.
    depth_m : array_like, (rows, columns)
        Distance of each of its pixels, metres.
    distances_m, vergences_dpt
        Where the planes are.

    Raises
    ------
    InvalidInputError
        If the depths do not fit the picture, or as for `depth_blend_weights`.
    """
    check_type("image", image, Image)
    shares = depth_blend_weights(depth_m, distances_m, vergences_dpt=vergences_dpt)
    if shares.shape[1:] != image.shape:
        raise InvalidInputError(
            f"depth_m must have one distance a pixel {image.shape}, got {shares.shape[1:]}"
        )
    texels = image.texels if image.channels == 1 else np.moveaxis(image.texels, 2, 0)
    parts = [share * texels for share in shares]
    return tuple(
        Image(part if image.channels == 1 else np.moveaxis(part, 0, 2), f"{image.name}, plane {k}")
        for k, part in enumerate(parts)
    )


def plane_distances_m(
    distances_m: Sequence[float] | None, vergences_dpt: Sequence[float] | None
) -> np.ndarray:
    """Distances of planes, metres, from distances or vergences.

    Raises
    ------
    InvalidInputError
        If not exactly one of both is given, one is not > 0, or two planes have the same place.
    """
    if (distances_m is None) == (vergences_dpt is None):
        raise InvalidInputError("pass either distances_m or vergences_dpt")
    name = "distances_m" if vergences_dpt is None else "vergences_dpt"
    values = check_array(name, distances_m if vergences_dpt is None else vergences_dpt)
    if values.ndim != 1 or len(values) == 0 or not np.all(np.isfinite(values) & (values > 0)):
        raise InvalidInputError(
            f"{name} must be a list of finite numbers > 0, got {values.tolist()}"
        )
    if len(np.unique(values)) != len(values):
        raise InvalidInputError(f"{name} must differ from plane to plane, got {values.tolist()}")
    return values if vergences_dpt is None else 1.0 / values
