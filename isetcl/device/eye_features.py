"""What the kernels that trace rays through an eye have to know: one #define for every field."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from enum import IntEnum

from isetcl.eye.gradient import PolynomialGradient, ShellGradient
from isetcl.eye.prescription import Element, ElementKind
from isetcl.eye.shapes.biconic import Biconic
from isetcl.eye.shapes.even_asphere import EvenAsphere
from isetcl.eye.shapes.height_map import HeightMap
from isetcl.eye.shapes.toric import Toric
from isetcl.eye.shapes.zernike_sag import ZernikeSag


class ShapeKind(IntEnum):
    """How a surface is met. The same numbers are compiled into the kernels."""

    QUADRIC = 0
    BICONIC = 1
    TORIC = 2
    EVEN_ASPHERE = 3
    ZERNIKE_SAG = 4
    HEIGHT_MAP = 5


_KINDS = {
    Biconic: ShapeKind.BICONIC,
    Toric: ShapeKind.TORIC,
    EvenAsphere: ShapeKind.EVEN_ASPHERE,
    ZernikeSag: ShapeKind.ZERNIKE_SAG,
    HeightMap: ShapeKind.HEIGHT_MAP,
}


def shape_kind(element: Element) -> ShapeKind:
    """How an element is met: directly if it is a quadric, otherwise by its own search."""
    shape = element.shape
    if shape is None or shape.is_quadric(element.curvature, element.conic):
        return ShapeKind.QUADRIC
    return _KINDS[type(shape)]


@dataclass(frozen=True, kw_only=True)
class EyeFeatures:
    """Compile-time features of the elements of an eye.

    Attributes
    ----------
    has_conics
        Some surface of revolution is curved and not a sphere.
    has_placements
        Some surface is decentred, tilted or turned.
    has_placed_stop
        The stop is decentred or elliptical.
    has_quadrics
        Some surface is a quadric but not one of revolution.
    has_biconics, has_torics, has_even_aspheres, has_zernike_sags, has_height_maps
        Some surface has this shape.
    has_polynomial_gradients, has_shell_gradients
        Some medium has a gradient of this kind.
    has_real_powers
        Some shells have a power that is no whole number.
    has_placed_gradients
        Some gradient lies off the axis of the eye.
    gradient_degree
        Largest i + 2 j of the polynomials' z^i r^2j, at least 2.
    """

    has_conics: bool = True
    has_placements: bool = False
    has_placed_stop: bool = False
    has_quadrics: bool = False
    has_biconics: bool = False
    has_torics: bool = False
    has_even_aspheres: bool = False
    has_zernike_sags: bool = False
    has_height_maps: bool = False
    has_polynomial_gradients: bool = False
    has_shell_gradients: bool = False
    has_real_powers: bool = False
    has_placed_gradients: bool = False
    gradient_degree: int = 2

    @classmethod
    def of(cls, sequences: Iterable[tuple[Element, ...]]) -> EyeFeatures:
        """What elements need."""
        elements = [e for sequence in sequences for e in sequence]
        surfaces = [e for e in elements if e.kind is not ElementKind.STOP]
        shaped = {shape_kind(e) for e in surfaces if e.shape is not None}
        gradients = [g for e in elements for g in (e.gradient_before, e.gradient_after) if g]
        polynomials = [g.profile for g in gradients if isinstance(g.profile, PolynomialGradient)]
        shells = [g.profile for g in gradients if isinstance(g.profile, ShellGradient)]
        return cls(
            has_conics=any(e.conic != 0.0 and e.curvature != 0.0 for e in surfaces),
            has_placements=any(e.placement is not None for e in surfaces),
            has_placed_stop=any(
                e.kind is ElementKind.STOP and e.placement is not None for e in elements
            ),
            has_quadrics=ShapeKind.QUADRIC in shaped,
            has_biconics=ShapeKind.BICONIC in shaped,
            has_torics=ShapeKind.TORIC in shaped,
            has_even_aspheres=ShapeKind.EVEN_ASPHERE in shaped,
            has_zernike_sags=ShapeKind.ZERNIKE_SAG in shaped,
            has_height_maps=ShapeKind.HEIGHT_MAP in shaped,
            has_polynomial_gradients=bool(polynomials),
            has_shell_gradients=bool(shells),
            has_real_powers=any(not profile.power.is_integer() for profile in shells),
            has_placed_gradients=any(not g.is_centred for g in gradients),
            gradient_degree=max([2, *(profile.degree for profile in polynomials)]),
        )

    def missing(self, sequences: Iterable[tuple[Element, ...]]) -> list[str]:
        """Names of the fields that elements need and that are not here."""
        needed = EyeFeatures.of(sequences)
        return [
            f.name for f in fields(EyeFeatures) if getattr(needed, f.name) > getattr(self, f.name)
        ]

    def eye_feature_defines(self) -> dict[str, int]:
        """The #defines, one for every field."""
        return {f.name.upper(): int(getattr(self, f.name)) for f in fields(EyeFeatures)}
