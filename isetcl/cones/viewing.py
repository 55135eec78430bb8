"""How receptors look at light: whose pigments they hold, and behind what they stand."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from isetcl.cones.observer import Observer
from isetcl.errors import InvalidInputError, check_choice, check_type
from isetcl.eye.people.ocular_media import OcularMedia, transmittance_or_one
from isetcl.retina.image import RetinalImage
from isetcl.retina.places import IrradianceAtPlaces
from isetcl.retina.transmittance import MacularPigment, Transmittance
from isetcl.spectrum import Uneven, check_even_or_bins

Segments = Literal["spectral", "mean", "none"]
MediaChoice = OcularMedia | Transmittance | Literal["as_is"] | None

_NO_LENS = (
    "this light was rendered without the eye's lens, and S cones catch several times as much as "
    "behind one: render with media=OcularMedia(age), or pass isetcl.retina.transmittance(age) to "
    "image.through or here as media; media='as_is' takes the light as it is, without this warning"
)


@dataclass(frozen=True)
class Viewing:
    """Whose pigments receptors hold, and behind what they stand.

    Parameters
    ----------
    observer
        Pigments.
    segments, has_macular_pigment, uneven_wavelengths
        As in `isetcl.cones.excitations`.
    media
        Ocular media that the light has yet to pass; None for none.
    """

    observer: Observer = field(default_factory=Observer)
    segments: Segments = "spectral"
    has_macular_pigment: bool = True
    media: OcularMedia | None = None
    uneven_wavelengths: Uneven = "refuse"

    def __post_init__(self) -> None:
        check_type("observer", self.observer, Observer)
        check_choice("segments", self.segments, ("spectral", "mean", "none"))
        check_type("has_macular_pigment", self.has_macular_pigment, bool)
        check_choice("uneven_wavelengths", self.uneven_wavelengths, ("refuse", "bins"))
        if self.media is not None:
            check_type("media", self.media, OcularMedia)

    def check_wavelengths(self, wavelengths_nm: np.ndarray) -> np.ndarray:
        """A grid that may be summed over, even or by leave; raises InvalidInputError."""
        return check_even_or_bins("the light", wavelengths_nm, self.uneven_wavelengths)

    def transmittance(self, wavelengths_nm: np.ndarray) -> np.ndarray:
        """Share of the light that comes through the media, (wavelengths,)."""
        return transmittance_or_one(self.media, wavelengths_nm)

    def describe(self) -> dict[str, Any]:
        """Everything as plain values, for provenance."""
        return {
            "observer": self.observer.describe(),
            "segments": self.segments,
            "has_macular_pigment": self.has_macular_pigment,
            "media": None if self.media is None else self.media.describe(),
            "uneven_wavelengths": self.uneven_wavelengths,
        }


def media_to_pass(
    light: RetinalImage | IrradianceAtPlaces, media: MediaChoice, stacklevel: int
) -> OcularMedia | None:
    """The ocular media that light has yet to pass on its way to the receptors.

    Warns where isetcl rendered the light without media and none are given. Light from elsewhere,
    such as arrays or ISETBio's files, which come through a lens there, is taken as it is.

    Raises
    ------
    InvalidInputError
        If the light would pass media twice, or `media` is something else.
    """
    in_front = _media_of(light)
    if isinstance(media, str):
        check_choice("media", media, ("as_is",))
        return None
    if media is None:
        if in_front is None and light.provenance.get("method", "file") != "file":
            warnings.warn(_NO_LENS, stacklevel=stacklevel + 1)
        return None
    own = media.medium if isinstance(media, Transmittance) else media
    if not isinstance(own, OcularMedia):
        raise InvalidInputError(
            "media must be OcularMedia, isetcl.retina.transmittance(...) or 'as_is', got "
            + ("macular pigment" if isinstance(own, MacularPigment) else type(own).__name__)
        )
    if in_front is not None:
        raise InvalidInputError(
            f"the light has come through ocular media already, {in_front.describe()}, and media "
            "would be counted twice; leave media out, or take them from the image first by "
            "image.without('media')"
        )
    return own


def _media_of(light: RetinalImage | IrradianceAtPlaces) -> OcularMedia | None:
    """The ocular media that light has come through; None where none are known."""
    if isinstance(light, RetinalImage):
        passed = [s.medium for s in light.steps if isinstance(s.medium, OcularMedia)]
        return passed[0] if passed else None
    record = light.provenance.get("media")
    return None if record is None else OcularMedia(**record)
