"""The elements of an eye as the kernels read them: records of constants, and a table of numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from isetcl.device.gradients import *
from isetcl.device.gradients import is_placed
from isetcl.device.layout import Member, Precision, Struct, c_enum, real_dtype
from isetcl.eye.gradient import PolynomialGradient, ShellGradient
from isetcl.eye.prescription import Element, ElementKind
from isetcl.eye.rays import RayStatus
from isetcl.eye.sequential import Towards

ELEMENT = Struct(
    "element_t",
    (
        Member("kind", "int"),
        Member("vertex_z"),
        Member("curvature"),
        Member("kappa"),
        Member("curvature_times_kappa"),
        Member("curvature_times_conic"),
        Member("curvature_times_n2"),
        Member("index_incident"),
        Member("n2_incident"),
        Member("inverse_n2"),
        Member("n2_transmitted"),
        Member("index_step"),
        Member("renormalise"),
        Member("aperture2"),
        Member("bend", "int"),
        Member("gradient_incident", "int"),
        Member("gradient_transmitted", "int"),
        Member("gradient_steps", "int"),
        Member("gradient_landing", "int"),
    ),
)
"""Constants of an element for one direction of travel, prepared in float64."""


def declarations() -> str:
    """The C declarations the ray kernels share with the host."""
    return c_enum(ElementKind, "ELEMENT") + c_enum(RayStatus, "RAY") + ELEMENT.c_declaration()


def travel_order(sequence: tuple[Element, ...], towards: Towards) -> tuple[Element, ...]:
    """The elements in the order rays meet them; towards the scene they start behind the lens."""
    if towards == "retina":
        return sequence
    return tuple(e for e in reversed(sequence) if e.kind is not ElementKind.RETINA)


@dataclass(frozen=True, eq=False)
class PackedEye:
    """An eye in the kernels' layout.

    Attributes
    ----------
    elements : ndarray
        Records of `ELEMENT`, sequence after sequence.
    table : ndarray
        Reals that the elements point into; never empty.
    """

    elements: np.ndarray
    table: np.ndarray


def pack_eye(
    sequences: Sequence[tuple[Element, ...]], towards: Towards, precision: Precision
) -> PackedEye:
    """Elements in the order rays meet them, for one or several wavelengths."""
    records = [_records(sequence, towards, precision) for sequence in sequences]
    table = [np.zeros(1)]
    most = max(
        [
            2,
            *(
                degree(g.profile)
                for s in sequences
                for g in gradients_of(s)
                if isinstance(g.profile, PolynomialGradient)
            ),
        ]
    )
    for sequence, record in zip(sequences, records, strict=False):
        for r, e in zip(record, sequence, strict=False):
            sides = (e.gradient_before, e.gradient_after)
            if towards == "scene":
                sides = sides[::-1]
            for name, placed in zip(
                ("gradient_incident", "gradient_transmitted"), sides, strict=False
            ):
                r[name] = -1
                if placed is not None:
                    r[name] = sum(len(t) for t in table)
                    table.append(profile_numbers(placed, e, most))
            if sides[0] is not None:
                r["gradient_steps"] = kernel_steps(sides[0], precision)
                r["gradient_landing"] = landing_steps(int(r["gradient_steps"]), precision)
    return PackedEye(np.concatenate(records), np.concatenate(table).astype(real_dtype(precision)))


def gradients_of(s):
    return [e.gradient_before for e in s if e.gradient_before is not None]


def _records(sequence: tuple[Element, ...], towards: Towards, precision: Precision) -> np.ndarray:
    records = np.zeros(len(sequence), dtype=ELEMENT.dtype(precision))
    for record, e in zip(records, sequence, strict=True):
        n, n_next = (e.n_before, e.n_after) if towards == "retina" else (e.n_after, e.n_before)
        record["kind"] = e.kind
        record["vertex_z"] = e.vertex_z_mm
        record["curvature"] = e.curvature
        record["kappa"] = 1.0 + e.conic
        record["curvature_times_kappa"] = e.curvature * (1.0 + e.conic)
        record["curvature_times_conic"] = e.curvature * e.conic
        record["curvature_times_n2"] = e.curvature * n * n
        record["index_incident"] = n
        record["n2_incident"] = n * n
        record["inverse_n2"] = 1.0 / (n * n)
        record["n2_transmitted"] = n_next * n_next
        record["index_step"] = n_next * n_next - n * n
        record["renormalise"] = -0.5 / (n_next * n_next)
        record["aperture2"] = e.semi_diameter_mm**2
    return records


def has_conics(sequence: tuple[Element, ...]) -> bool:
    """Whether any element is curved and not a sphere."""
    return any(e.conic != 0.0 and e.curvature != 0.0 for e in sequence)


def gradient_defines(sequences):
    g = [x for s in sequences for x in gradients_of(s)]
    return {
        "HAS_GRADIENTS": int(bool(g)),
        "HAS_POLYNOMIALS": int(any(isinstance(x.profile, PolynomialGradient) for x in g)),
        "HAS_SHELLS": int(any(isinstance(x.profile, ShellGradient) for x in g)),
        "HAS_REAL_POWERS": int(
            any(isinstance(x.profile, ShellGradient) and x.profile.power % 1 for x in g)
        ),
        "HAS_PLACED_GRADIENTS": int(any(map(is_placed, g))),
        "GRADIENT_DEGREE": max(
            [2, *(degree(x.profile) for x in g if isinstance(x.profile, PolynomialGradient))]
        ),
    }
