"""What a reader must know of the numbers, and where they come from."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from isetcl.device.choose import find_device
from isetcl.eye.model import Eye
from isetcl.retina.cone_noise import ConeNoise
from isetcl.retina.image import RetinalImage
from isetcl.scene.model import Scene
from isetcl.validation.work_precision.estimators import Errors
from isetcl.validation.work_precision.method import Point, WorkMethod
from isetcl.validation.work_precision.reference import Reference

ENOUGH_REPLICATES = 16
LEAST_MEASUREMENTS = 9
_FEWEST = 5.0


def notes_of(
    points: list[Point],
    errors: list[Errors],
    replicates: int,
    reference: Reference,
    images: list[list[np.ndarray]],
) -> list[str]:
    """What a reader must know of the numbers."""
    notes = []
    if replicates < ENOUGH_REPLICATES:
        notes.append(
            f"only {replicates} replicates: intervals of fewer than {ENOUGH_REPLICATES} are rough"
        )
    if replicates < LEAST_MEASUREMENTS:
        notes.append(
            f"only {replicates} measurements of each time: medians want {LEAST_MEASUREMENTS}"
        )
    noisy = [p.what for p, e in zip(points, errors, strict=True) if is_limited(e)]
    if noisy:
        more = f" and {len(noisy) - 3} more" if len(noisy) > 3 else ""
        level = math.sqrt(errors[0].reference_variance)
        notes.append(
            f"the reference (standard error {100 * level:.2g} %) is noisier than the image of "
            f"{', '.join(noisy[:3])}{more}: those errors are what is left after subtracting it"
        )
    swaying = [p.what for p, e in zip(points, errors, strict=True) if _freedoms(e) < _FEWEST]
    if swaying:
        more = f" and {len(swaying) - 3} more" if len(swaying) > 3 else ""
        notes.append(
            f"the error of {', '.join(swaying[:3])}{more} changes as a whole from seed to seed: "
            "intervals of 95 % hold only about nine times in ten"
        )
    if errors and errors[0].reference_variance == 0:
        notes.append(f"the reference ({reference.text}) is taken as exact")
    notes += _dependence(reference)
    for point, own in zip(points, images, strict=True):
        same = len(own) > 1 and all(np.array_equal(own[0], other) for other in own[1:])
        if same:
            notes.append(f"{point.what} gave the same image for every seed: it is not random")
    return notes


def _dependence(reference: Reference) -> list[str]:
    """What a traced reference shares with the images it judges."""
    image = reference.image
    known = image.provenance if isinstance(image, RetinalImage) else {}
    if known.get("method") != "ray tracing":
        return []
    shared = []
    if known.get("precision") == "single":
        shared.append("was traced in single precision: errors of rounding may cancel")
    if known.get("sampler", "sobol") == "sobol":
        shared.append("has Sobol' points of another seed: render it with sampler='random'")
    return [f"the reference {text}" for text in shared]


def _freedoms(errors: Errors) -> float:
    """Independent parts that an image's square error seems to have: of n, it varies by 2 / n."""
    squares = np.diag(errors.gram)
    spread = float(np.var(squares, ddof=1)) if len(squares) > 1 else 0.0
    if not spread > 0:
        return math.inf
    return 2.0 * float(np.mean(squares)) ** 2 / spread


def is_limited(errors: Errors) -> bool:
    """Whether the reference is noisier than the image is wrong."""
    return errors.reference_variance > 0 and errors.mse < errors.reference_variance


def load() -> float:
    """Processes that wait for a processor, mean of the last minute; NaN where it is not known."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else math.nan


def surroundings(scene: Scene, eye: Eye | None, device: str | None) -> dict[str, Any]:
    """What was rendered, and on which device."""
    chosen = find_device(device)
    widths = {"vector_width_single": chosen.vector_width("single")}
    if chosen.has_double:
        widths["vector_width_double"] = chosen.vector_width("double")
    return {
        "scene": scene.name,
        "eye": None if eye is None else eye.name,
        "device": chosen.describe() | widths,
    }


def record_of(
    methods: Sequence[WorkMethod],
    reference: Reference,
    where: Mapping[str, Any],
    quantity: str,
) -> dict[str, Any]:
    """What was asked for, as plain values."""
    return {
        "reference": reference.text,
        "quantity": quantity,
        "arguments": {name: _plain(value) for name, value in where.items()},
        "methods": {
            m.name: {"knob": m.knob, "options": {k: _plain(v) for k, v in m.options.items()}}
            for m in methods
        },
    }


def cone_record(
    cone: ConeNoise, illuminance_lux: float | None, excitations: float | None
) -> dict[str, Any]:
    """The cone in whose noise errors are told; nothing if its excitations are not known."""
    if excitations is None:
        return {}
    light = {"illuminance_lux": illuminance_lux, "mean_excitations": excitations}
    return {"cone_noise": cone.describe() | light}


def _plain(value: Any) -> Any:
    if isinstance(value, (str, int, float, bool)) or value is None:
        return value
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_plain(item) for item in np.asarray(value).tolist()]
    return repr(value)
