"""The elements of an eye as the kernels read them: records of constants, and a table of numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from isetcl.device.eye_features import EyeFeatures, ShapeKind, shape_kind
from isetcl.device.gradients import (
    is_smooth,
    kernel_steps,
    landing_rounds,
    landing_steps,
    profile_numbers,
)
from isetcl.device.layout import Member, Precision, Struct, c_enum, real_dtype
from isetcl.eye.prescription import Element, ElementKind
from isetcl.eye.rays import RayStatus
from isetcl.eye.sequential import Towards
from isetcl.eye.shapes.biconic import Biconic
from isetcl.eye.shapes.even_asphere import EvenAsphere
from isetcl.eye.shapes.height_map import HeightMap
from isetcl.eye.shapes.zernike_sag import ZernikeSag

ELEMENT = Struct(
    "element_t",
    (
        Member("kind", "int"),
        Member("is_bending", "int"),
        Member("shape", "int"),
        Member("steps", "int"),
        Member("table", "int"),
        Member("columns", "int"),
        Member("rows", "int"),
        Member("is_placed", "int"),
        Member("gradient_incident", "int"),
        Member("gradient_transmitted", "int"),
        Member("gradient_steps", "int"),
        Member("gradient_rounds", "int"),
        Member("gradient_landing", "int"),
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
        Member("inverse_aspect"),
        Member("curvature_x"),
        Member("axial"),
        Member("factor_x"),
        Member("factor_y"),
        Member("per_x"),
        Member("per_y"),
        Member("decentre_x"),
        Member("decentre_y"),
        Member("rotation", length=9),
    ),
)
"""Constants of an element for one direction of travel, prepared in float64.

`is_bending` says whether rays are bent there. `curvature` is that of the y section. `table` is
where the numbers of its shape begin in the table of the eye; `columns` and `rows` say how many
there are, `per_x` and `per_y` how many a mm. `gradient_incident` and `gradient_transmitted` are
where the profiles of the media begin there, -1 for homogeneous ones.
"""

SEARCH_STEPS = {
    "single": {
        ShapeKind.QUADRIC: 0,
        ShapeKind.BICONIC: 4,
        ShapeKind.TORIC: 4,
        ShapeKind.EVEN_ASPHERE: 5,
        ShapeKind.ZERNIKE_SAG: 4,
        ShapeKind.HEIGHT_MAP: 5,
    },
    "double": {
        ShapeKind.QUADRIC: 0,
        ShapeKind.BICONIC: 6,
        ShapeKind.TORIC: 6,
        ShapeKind.EVEN_ASPHERE: 7,
        ShapeKind.ZERNIKE_SAG: 6,
        ShapeKind.HEIGHT_MAP: 6,
    },
}
"""Steps of Newton's method from the quadric, by precision and shape.

Measured with rays of fields of 0 to 75 deg that meet 16 surfaces (corneas of 1 dpt to keratoconus,
lenses, saddles, k = -50/+5, cylinders, reliefs of 50 um) at up to 84 deg, both ways: the largest
error times the cosine of incidence, um, / rays lost of 1000, for the shapes that need most.

=========== ============ ============ ============ ============ ============
steps       2            3            4            5            6
=========== ============ ============ ============ ============ ============
biconic     1e-2 / 7     9e-3 / 0.2   5e-4 / 0     5e-4 / 0     5e-4 / 0
  double    5e-8 / 160   3e-8 / 7     3e-8 / 0.4   5e-11 / 0    2e-12 / 0
asphere     1e-2 / 28    6e-3 / 1.3   6e-3 / 0.3   6e-4 / 0     5e-4 / 0
  double    5e-8 / 680   5e-8 / 32    3e-9 / 1.6   9e-9 / 0.7   2e-9 / 0
height map  1e-2 / 18    4e-3 / 1     5e-4 / 1     6e-3 / 0     5e-4 / 0
  double    5e-8 / 320   5e-8 / 23    8e-9 / 2.6   1e-12 / 1    1e-11 / 0.3
=========== ============ ============ ============ ============ ============

Torics are like biconics, Zernike surfaces need a step less. A lost ray is one that the steps leave
too far off the surface (lib/form.cl). More steps make single precision no worse.
"""


def declarations() -> str:
    """The C declarations the ray kernels share with the host."""
    return (
        c_enum(ElementKind, "ELEMENT")
        + c_enum(ShapeKind, "SHAPE")
        + c_enum(RayStatus, "RAY")
        + ELEMENT.c_declaration()
    )


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
    sequences: Sequence[tuple[Element, ...]],
    towards: Towards,
    precision: Precision,
    *,
    gradient_degree: int | None = None,
) -> PackedEye:
    """Elements in the order rays meet them, for one or several wavelengths.

    `gradient_degree` is that of the kernel, which sets how polynomials lie in the table; None for
    one that is built for these elements.
    """
    table = _Table()
    degree = EyeFeatures.of(sequences).gradient_degree
    if gradient_degree is not None:
        degree = gradient_degree
    records = [_records(sequence, towards, precision, table) for sequence in sequences]
    for sequence, of_sequence in zip(sequences, records, strict=True):
        for record, e in zip(of_sequence, sequence, strict=True):
            _fill_gradients(record, e, towards, precision, degree, table)
    return PackedEye(np.concatenate(records), table.packed(precision))


class _Table:
    """The numbers of shapes, those that several elements share only once."""

    def __init__(self) -> None:
        self._parts = [np.zeros(1)]
        self._used = 1
        self._places: dict[int, tuple[object, int]] = {}

    def place(self, owner: object, numbers: np.ndarray) -> int:
        """Where the numbers of a shape begin."""
        if id(owner) not in self._places:
            # The owner is kept, as its number may be given to another when it is gone.
            self._places[id(owner)] = owner, self._used
            self._parts.append(numbers.ravel())
            self._used += numbers.size
        return self._places[id(owner)][1]

    def packed(self, precision: Precision) -> np.ndarray:
        """All numbers."""
        return np.concatenate(self._parts).astype(real_dtype(precision))


def _records(
    sequence: tuple[Element, ...], towards: Towards, precision: Precision, table: _Table
) -> np.ndarray:
    records = np.zeros(len(sequence), dtype=ELEMENT.dtype(precision))
    for record, e in zip(records, sequence, strict=True):
        n, n_next = (e.n_before, e.n_after) if towards == "retina" else (e.n_after, e.n_before)
        record["kind"] = e.kind
        record["is_bending"] = e.is_bending and not is_smooth(e, precision)
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
        record["inverse_aspect"] = 1.0 / e.aspect
        _fill_place(record, e)
        _fill_shape(record, e, precision, table)
    return records


def _fill_place(record: np.void, element: Element) -> None:
    record["rotation"] = np.eye(3).ravel()
    if element.placement is not None:
        record["decentre_x"], record["decentre_y"] = element.placement.decentre_mm
        record["rotation"] = element.placement.rotation.ravel()
        record["is_placed"] = not np.array_equal(element.placement.rotation, np.eye(3))


def _fill_gradients(
    record: np.void,
    element: Element,
    towards: Towards,
    precision: Precision,
    degree: int,
    table: _Table,
) -> None:
    inside, beyond = element.gradient_before, element.gradient_after
    if towards == "scene":
        inside, beyond = beyond, inside
    for side, placed in (("incident", inside), ("transmitted", beyond)):
        record[f"gradient_{side}"] = -1
        if placed is not None:
            numbers = profile_numbers(placed, element, degree)
            record[f"gradient_{side}"] = table.place(numbers, numbers)
    if inside is not None:
        record["gradient_steps"] = kernel_steps(inside, precision)
        record["gradient_rounds"] = landing_rounds(inside, precision)
        record["gradient_landing"] = landing_steps(int(record["gradient_steps"]))


def _fill_shape(record: np.void, element: Element, precision: Precision, table: _Table) -> None:
    kind, shape, quadric = shape_kind(element), element.shape, element.quadric
    record["shape"] = kind
    record["steps"] = SEARCH_STEPS[precision][kind]
    record["curvature_x"] = quadric.curvature_x
    record["axial"] = quadric.axial
    record["factor_y"] = (1.0 + element.conic) * element.curvature**2
    if isinstance(shape, Biconic):
        record["factor_x"] = (1.0 + shape.conic_x) * shape.curvature_x**2
    elif isinstance(shape, EvenAsphere):
        record["columns"] = len(shape.coefficients)
        record["table"] = table.place(shape, np.array(shape.coefficients))
    elif isinstance(shape, ZernikeSag):
        record["columns"] = shape.order
        record["per_x"] = 1.0 / shape.radius_mm
        powers = [shape.powers[i, shape.order - i :: -1] for i in range(shape.order, -1, -1)]
        record["table"] = table.place(shape, np.concatenate(powers))
    elif isinstance(shape, HeightMap):
        record["rows"], record["columns"] = shape.heights_mm.shape
        record["per_x"] = (record["columns"] - 1) / shape.width_mm
        record["per_y"] = (record["rows"] - 1) / shape.height_mm
        record["table"] = table.place(shape, shape.spline)
