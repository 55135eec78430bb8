"""What the kernels need of an eye: shapes and places of its surfaces."""

from __future__ import annotations

from isetcl.device.elements import travel_order
from isetcl.device.eye_features import EyeFeatures
from isetcl.eye.model import Eye
from isetcl.eye.prescription import elements
from isetcl.render.decision import Decision, left_out

_NAMES = {
    "has_conics": ("conic surfaces", "every refracting surface is a sphere or a plane"),
    "has_placements": ("placed surfaces", "no surface is decentred, tilted or turned"),
    "has_placed_stop": ("placed stop", "the stop is a circle about the axis"),
    "has_quadrics": ("quadrics", "no surface is an ellipsoid of three axes or the like"),
    "has_biconics": ("biconics", "none in the eye"),
    "has_torics": ("torics", "none in the eye"),
    "has_even_aspheres": ("even aspheres", "none in the eye"),
    "has_zernike_sags": ("Zernike surfaces", "none in the eye"),
    "has_height_maps": ("height maps", "none in the eye"),
}
"""Of every field of `EyeFeatures`: what it is called, and why it is left out."""


def decide_eye_features(eye: Eye, wavelength_nm: float, notes: list[Decision]) -> dict[str, bool]:
    """The fields of `EyeFeatures` for rays from the retina out of an eye, with their reasons."""
    sequence = travel_order(elements(eye, wavelength_nm), "scene")
    alone = {element.name: EyeFeatures.of([(element,)]) for element in reversed(sequence)}
    decided = {}
    for field, (name, why_not) in _NAMES.items():
        owners = [owner for owner, features in alone.items() if getattr(features, field)]
        decided[field] = left_out(notes, name, bool(owners), ", ".join(owners), why_not)
    return decided
