"""Everything an eye can be made of, by the names that stand in files.

A new shape, medium, gradient or family of eyes becomes writable and readable by its line here; it
has to be a frozen dataclass whose constructor checks its fields.
"""

from __future__ import annotations

from typing import Any

from isetcl.eye.changes import (
    AlteredModel,
    CorneaChange,
    FoveaChange,
    LensShift,
    VitreousChange,
)
from isetcl.eye.gradient import PolynomialGradient, PolynomialMedium, ShellMedium
from isetcl.eye.media import (
    AbbeDispersion,
    ConstantIndex,
    CornuDispersion,
    Medium,
    NavarroDispersion,
    PowerDispersion,
    SellmeierDispersion,
    TabulatedDispersion,
)
from isetcl.eye.model import Eye
from isetcl.eye.models.ageing import AgeingModel
from isetcl.eye.models.arizona import ArizonaModel
from isetcl.eye.models.bennett_rabbetts import BennettRabbettsModel
from isetcl.eye.models.navarro import NavarroModel
from isetcl.eye.models.parts import PupilSpec
from isetcl.eye.placement import Placement
from isetcl.eye.retina import Retina
from isetcl.eye.shapes.biconic import Biconic
from isetcl.eye.shapes.even_asphere import EvenAsphere
from isetcl.eye.shapes.height_map import HeightMap
from isetcl.eye.shapes.toric import Toric
from isetcl.eye.shapes.zernike_sag import ZernikeSag
from isetcl.eye.stop import Stop
from isetcl.eye.surface import Surface
from isetcl.eye.worn.artificial_pupil import ArtificialPupil
from isetcl.eye.worn.contact_lens import ContactLens
from isetcl.eye.worn.intraocular_lens import IntraocularLens
from isetcl.eye.worn.spectacles import SpectacleLens

_PARTS: tuple[type[Any], ...] = (Eye, Surface, Stop, Retina, Placement, PupilSpec)
_SHAPES: tuple[type[Any], ...] = (Biconic, Toric, EvenAsphere, ZernikeSag, HeightMap)
_MEDIA: tuple[type[Any], ...] = (
    Medium,
    ConstantIndex,
    NavarroDispersion,
    PowerDispersion,
    CornuDispersion,
    AbbeDispersion,
    SellmeierDispersion,
    TabulatedDispersion,
    PolynomialMedium,
    PolynomialGradient,
    ShellMedium,
)
_FAMILIES: tuple[type[Any], ...] = (
    NavarroModel,
    ArizonaModel,
    BennettRabbettsModel,
    AgeingModel,
    AlteredModel,
)
_CHANGES: tuple[type[Any], ...] = (
    VitreousChange,
    LensShift,
    CorneaChange,
    FoveaChange,
    SpectacleLens,
    ContactLens,
    IntraocularLens,
    ArtificialPupil,
)

KINDS: dict[str, type[Any]] = {
    kind.__name__: kind for kind in (*_PARTS, *_SHAPES, *_MEDIA, *_FAMILIES, *_CHANGES)
}
"""Class by name."""
