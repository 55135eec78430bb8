"""What stands before the receptors: named steps on a retinal image, which can be undone."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

from isetcl.errors import check_between, check_choice, check_pair, check_type
from isetcl.eye.people.macular_pigment import (
    MACULAR_PEAK_DENSITY,
    PIGMENT_MODELS,
    PigmentModel,
    macular_density,
    macular_fraction,
)
from isetcl.eye.people.ocular_media import MediaModel, OcularMedia


@dataclass(frozen=True)
class MacularPigment:
    """Macular pigment over a retina, densest in the fovea.

    Parameters
    ----------
    peak_density
        Density in the fovea at 458 nm.
    fovea_deg
        Field angles (x, y) that the fovea sees, degrees.
    model
        ``"cie_170"`` or ``"stockman_rider_2023"``; see `macular_density`.
    """

    peak_density: float = MACULAR_PEAK_DENSITY
    fovea_deg: tuple[float, float] = (0.0, 0.0)
    model: PigmentModel = "cie_170"

    def __post_init__(self) -> None:
        check_between("macular pigment: peak_density", self.peak_density, 0.0, 5.0)
        check_pair("macular pigment: fovea_deg", self.fovea_deg, "deg")
        check_choice("pigment model", self.model, PIGMENT_MODELS)


@dataclass(frozen=True)
class Transmittance:
    """A step on a retinal image: the share of the light that comes through.

    Parameters
    ----------
    label
        Its name in the image, by which it is undone.
    medium
        What stands there.
    """

    label: str
    medium: OcularMedia | MacularPigment

    def __post_init__(self) -> None:
        check_type("step: label", self.label, str)
        check_type("step: medium", self.medium, (OcularMedia, MacularPigment))

    def at(self, wavelengths_nm: np.ndarray, x_deg: np.ndarray, y_deg: np.ndarray) -> np.ndarray:
        """Share of the light for pixels at field angles x and y, degrees.

        Shape (wavelengths, 1, 1) if it is the same everywhere, else (wavelengths, y, x).

        Raises
        ------
        InvalidInputError
            If a wavelength lies outside the model.
        """
        if isinstance(self.medium, OcularMedia):
            return self.medium.transmittance(wavelengths_nm)[:, None, None]
        pigment = self.medium
        density = macular_density(wavelengths_nm, pigment.peak_density, pigment.model)
        x, y = np.meshgrid(x_deg - pigment.fovea_deg[0], y_deg - pigment.fovea_deg[1])
        return np.asarray(10.0 ** (-density[:, None, None] * macular_fraction(np.hypot(x, y))))

    def describe(self) -> dict[str, Any]:
        """Everything as plain values, for provenance."""
        kind = "ocular_media" if isinstance(self.medium, OcularMedia) else "macular_pigment"
        return {"label": self.label, "kind": kind, **dataclasses.asdict(self.medium)}

    @classmethod
    def from_dict(cls, record: dict[str, Any]) -> Transmittance:
        """The step that `describe` described."""
        values = {k: v for k, v in record.items() if k not in ("label", "kind")}
        if record["kind"] == "ocular_media":
            return cls(record["label"], OcularMedia(**values))
        return cls(
            record["label"],
            MacularPigment(**values | {"fovea_deg": tuple(values["fovea_deg"])}),
        )


def transmittance(age: float = 32.0, model: MediaModel = "cie_170") -> Transmittance:
    """The lens or all ocular media of a person, as a step ``"media"`` on a retinal image.

    ``image.through(transmittance(age=60))`` is the image behind them; ``image.without("media")`` is
    the one before. An image that `render` made with ``media=`` has the step already.

    Parameters
    ----------
    age
        Age, years.
    model
        See `isetcl.eye.people.ocular_media.ocular_density`.

    Raises
    ------
    InvalidInputError
        If the model is unknown or the age lies outside its range.
    """
    return Transmittance("media", OcularMedia(age, model))


def macular_pigment(
    peak_density: float = MACULAR_PEAK_DENSITY,
    fovea_deg: tuple[float, float] = (0.0, 0.0),
    model: PigmentModel = "cie_170",
) -> Transmittance:
    """Macular pigment as a step ``"macular pigment"`` on a retinal image; see `MacularPigment`.

    Excitations of a mosaic put macular pigment before each receptor themselves: with this step, ask
    them for ``has_macular_pigment=False``.
    """
    return Transmittance("macular pigment", MacularPigment(peak_density, fovea_deg, model))
