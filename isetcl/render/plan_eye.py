"""What the kernels need of an eye: shapes and places of its surfaces."""

from __future__ import annotations

from isetcl.device.elements import travel_order
from isetcl.device.eye_features import EyeFeatures
from isetcl.device.gradients import WANTED_MM, kernel_steps
from isetcl.device.layout import Precision
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
    "has_polynomial_gradients": ("polynomial gradients", "no index is a polynomial of place"),
    "has_shell_gradients": ("shell gradients", "no medium has shells of equal index"),
    "has_real_powers": ("real powers", "no shells, or all their powers are whole numbers"),
    "has_placed_gradients": ("placed gradients", "none off the axis of the eye"),
}
"""Of every field of `EyeFeatures`: what it is called, and why it is left out."""

_GROUPS = {
    ("surface shapes", "every surface is a plane, a sphere or a conic of revolution"): (
        "has_quadrics",
        "has_biconics",
        "has_torics",
        "has_even_aspheres",
        "has_zernike_sags",
        "has_height_maps",
    ),
    ("gradient index", "every medium is the same everywhere"): (
        "has_polynomial_gradients",
        "has_shell_gradients",
        "has_real_powers",
        "has_placed_gradients",
    ),
}
"""Fields that are told in one line where an eye has none of them."""


def decide_eye_features(
    eye: Eye, wavelength_nm: float, precision: Precision, notes: list[Decision]
) -> dict[str, int]:
    """The fields of `EyeFeatures` for rays from the retina out of an eye, with their reasons."""
    sequence = travel_order(elements(eye, wavelength_nm), "scene")
    alone = {element.name: EyeFeatures.of([(element,)]) for element in reversed(sequence)}
    decided: dict[str, int] = {}
    owners = {
        field: [owner for owner, features in alone.items() if getattr(features, field)]
        for field in _NAMES
    }
    together: set[str] = set()
    for (name, why_not), fields in _GROUPS.items():
        if not any(owners[field] for field in fields):
            decided |= dict.fromkeys(fields, False)
            left_out(notes, name, False, "", why_not)
            together.update(fields)
    for field, (name, why_not) in _NAMES.items():
        if field not in together:
            there = owners[field]
            decided[field] = left_out(notes, name, bool(there), ", ".join(there), why_not)
    lenses = [e for e in reversed(sequence) if e.gradient_before is not None]
    if lenses:
        steps = [kernel_steps(e.gradient_before, precision) for e in lenses if e.gradient_before]
        notes.append(
            Decision(
                "steps through gradients",
                ", ".join(map(str, steps)),
                f"the fewest that are right to {WANTED_MM[precision]:g} mm on the retina, in front "
                f"of {', '.join(e.name for e in lenses)}",
            )
        )
    return decided | {"gradient_degree": EyeFeatures.of([sequence]).gradient_degree}
