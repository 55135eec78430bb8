"""Excitations while the eye turns in its socket before a scene with depth."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from isetcl.cones.excitations import Excitations, excitations
from isetcl.cones.mosaic import ConeMosaic
from isetcl.errors import InvalidInputError, check_count, check_positive, check_type, check_vectors
from isetcl.eye.model import Eye
from isetcl.scene.model import Scene


def excitations_of_turning_eye(
    mosaic: ConeMosaic,
    scene: Scene,
    eye: Eye,
    gaze_deg: np.ndarray | Sequence[Sequence[float]],
    integration_time_s: float = 0.005,
    *,
    frame_time_s: float | None = None,
    rotation_centre_mm: float | None = None,
    seed: int = 0,
    cone_options: dict[str, Any] | None = None,
    **render_options: Any,
) -> Excitations:
    """Excitations in all frames, each rendered with the eye turned about its centre of rotation.

    The pupil lies some 10 mm before the centre of rotation and moves sideways as the eye turns, so
    near things shift against far ones and hide other parts of them. `ConeMosaic.excitations` with
    `gaze_deg` moves the receptors over one still image instead, which leaves out this parallax: a
    turn of 10 minutes of arc moves the pupil by 0.03 mm, and things 25 cm away by 0.4 minutes of
    arc against those far away.

    It costs as much as rendering one image for every different gaze, a hundred frames a hundred
    times as much as a still image; take `target_error="cone_noise:0.3"`, few pixels more than the
    cones need, and frames no shorter than the integration time. One image is held at a time.

    Parameters
    ----------
    mosaic
        The receptors, in the frame of the eye.
    scene, eye
        The scene before the eye looks aside, and the eye; as in `render`.
    gaze_deg
        Where the eye's axis points in each frame relative to straight ahead: to the right and up,
        (frames, 2), degrees; `EyeMovements.path`.
    integration_time_s
        Time over which excitations are counted, s.
    frame_time_s
        Time from frame to frame; None is the integration time.
    rotation_centre_mm
        Distance of the centre of rotation behind the cornea; see `Scene.turned`.
    seed
        Seed of the noise of the renders, which are independent, and of `Excitations.counts`.
    cone_options
        More arguments of `ConeMosaic.excitations`, such as ``observer``.
    render_options
        More arguments of `render`, such as ``fov_deg``, ``resolution`` and ``target_error``.

    Raises
    ------
    InvalidInputError
        As `render` and `ConeMosaic.excitations` do; most of it before the first image.
    """
    import xarray

    from isetcl.render.interrupt import check_complete
    from isetcl.render.render import render

    check_type("mosaic", mosaic, ConeMosaic)
    check_type("scene", scene, Scene)
    check_type("eye", eye, Eye)
    gaze = check_vectors("gaze_deg", gaze_deg, width=2)
    if len(gaze) == 0 or not np.all(np.isfinite(gaze)):
        raise InvalidInputError("gaze_deg must have at least one frame and be finite")
    step = integration_time_s if frame_time_s is None else frame_time_s
    step = check_positive("frame_time_s", step, "s")
    check_positive("integration_time_s", integration_time_s, "s")
    seed = check_count("seed", seed, 0, (1 << 62) - 1)
    options = {} if cone_options is None else cone_options
    check_type("cone_options", options, dict)
    for name in {"gaze_deg", "seed", "frame_time_s"} & options.keys():
        raise InvalidInputError(f"cone_options must not have {name!r}; it is an argument itself")
    different, which = np.unique(gaze, axis=0, return_inverse=True)
    found = []
    for i, direction in enumerate(different):
        x, y = (float(angle) for angle in direction)
        turned = scene.turned((x, y), rotation_centre_mm=rotation_centre_mm)
        image = render(turned, eye, seed=seed + i, **render_options)
        check_complete(image)
        found.append(excitations(mosaic, image, integration_time_s, seed=seed, **options))
    frames = [found[k].dataset for k in which.ravel()]
    dataset = xarray.concat(
        frames, "frame", data_vars="minimal", coords="minimal", combine_attrs="override"
    )
    details = found[0].provenance | {"turning_eye": True, "rotation_centre_mm": rotation_centre_mm}
    dataset = dataset.assign_coords(
        time_s=("frame", step * np.arange(len(gaze)), {"units": "s"}),
        gaze_x_deg=("frame", gaze[:, 0], {"units": "deg"}),
        gaze_y_deg=("frame", gaze[:, 1], {"units": "deg"}),
    ).assign_attrs(found[0].dataset.attrs | {"provenance": json.dumps(details)})
    return Excitations(dataset)
