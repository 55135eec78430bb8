"""Pictures with depth: a photograph and its depth map, or planes with alpha."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Literal

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_array,
    check_choice,
    check_pair,
    check_positive,
    check_type,
)
from isetcl.scene.cube import SpectralCube
from isetcl.scene.display import Display
from isetcl.scene.texture import Image

DepthUnit = Literal["m", "dpt"]
Picture = np.ndarray | Image | SpectralCube

NEAREST_DPT = 125.0
"""Vergence of what stands right before the cornea, where eyes are no longer traced, 1/m."""


@dataclass(frozen=True, eq=False)
class DepthSheet:
    """A picture with a depth and an opacity in every pixel.

    Parameters
    ----------
    picture
        Linear light (rows, columns) or (rows, columns, 3), 1 being the display's white, more
        allowed; whole numbers of an unsigned type are codes that the display decodes; an `Image`
        is linear light; a `SpectralCube` holds radiances, W m^-2 sr^-1 nm^-1.
    depth
        Of every pixel, (rows, columns), or one number for all; see `DepthImage.depth_unit`. Of
        pixels with alpha 0 it means nothing.
    alpha
        Share of each pixel that is covered, 0 to 1; None is 1. The picture is not multiplied by it.
    """

    picture: Picture
    depth: np.ndarray | float
    alpha: np.ndarray | float | None = None


@dataclass(frozen=True, eq=False)
class DepthImage:
    """A view from the middle of the entrance pupil: a picture, its depth, and what it hides.

    A pixel is a square patch of even radiance at one depth. Pixels are equal steps of polar field
    angle, as those of a retinal image are; row 0 is the top. Of a small field that is what any
    camera gives: at 10 degrees from the middle a picture in perspective differs by 1 % in scale.

    Parameters
    ----------
    picture, depth, alpha
        As of a `DepthSheet`: what is nearest in every pixel.
    fov_deg
        Width of the picture in degrees of field angle, for square pixels; or width and height.
    centre_deg
        Field angles (x, y) of its middle.
    depth_unit
        ``"m"``: metres along the axis from the corneal vertex, > 0; infinity is legal. ``"dpt"``:
        1/m, >= 0 and finite; 0 is infinity.
    hidden
        Complete layers behind it, near to far: what would be seen if all before were taken away.
        In every pixel each must lie at or behind the one before.
    display
        Spectra, nonlinearity and black level of linear or coded light; its resolution and size are
        not used. None is an sRGB display of 100 cd/m^2.
    name
        For messages and provenance.

    Raises
    ------
    InvalidInputError
        If sizes differ, a depth is not a depth, or layers are out of order.
    """

    picture: Picture
    depth: np.ndarray | float
    fov_deg: float | tuple[float, float]
    alpha: np.ndarray | float | None = None
    centre_deg: tuple[float, float] = (0.0, 0.0)
    depth_unit: DepthUnit = "m"
    hidden: tuple[DepthSheet, ...] = ()
    display: Display | None = None
    name: str = "picture"

    def __post_init__(self) -> None:
        check_type("depth image: name", self.name, str)
        check_choice("depth unit", self.depth_unit, ("m", "dpt"))
        if self.display is not None:
            check_type(f"{self._what}: display", self.display, Display)
        check_type(f"{self._what}: hidden", self.hidden, (tuple, list))
        for sheet in self.hidden:
            check_type(f"{self._what}: hidden", sheet, DepthSheet)
        object.__setattr__(self, "hidden", tuple(self.hidden))
        object.__setattr__(self, "centre_deg", check_pair("centre_deg", self.centre_deg, "deg"))
        kinds = {isinstance(sheet.picture, SpectralCube) for sheet in self.sheets}
        if len(kinds) > 1:
            raise InvalidInputError(
                f"{self._what}: all its pictures must be spectral cubes, or none; got both"
            )
        shape = self.shape
        for k, sheet in enumerate(self.sheets):
            found = _picture_shape(self._which(k), sheet.picture)
            if found != shape:
                raise InvalidInputError(
                    f"{self._which(k)} must have {shape[0]} rows and {shape[1]} columns as the "
                    f"front picture has, got {found[0]} and {found[1]}; resample it"
                )
        object.__setattr__(self, "fov_deg", self._checked_fov())
        maps = [self._maps(k, sheet) for k, sheet in enumerate(self.sheets)]
        self._check_order(maps)
        object.__setattr__(self, "_sheet_maps", tuple(maps))

    @property
    def sheets(self) -> tuple[DepthSheet, ...]:
        """The front and all hidden layers, near to far."""
        return DepthSheet(self.picture, self.depth, self.alpha), *self.hidden

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return _picture_shape(self._which(0), self.picture)

    @property
    def maps(self) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
        """Vergence (1/m) and alpha of every sheet, each (rows, columns)."""
        return self.__dict__["_sheet_maps"]

    @property
    def vergence_dpt(self) -> np.ndarray:
        """Vergence of the front, 1/m, (rows, columns)."""
        return self.maps[0][0]

    @classmethod
    def of_planes(
        cls,
        pictures: list[Picture],
        vergences_dpt: list[float],
        alphas: list[np.ndarray | float],
        fov_deg: float | tuple[float, float],
        *,
        centre_deg: tuple[float, float] = (0.0, 0.0),
        display: Display | None = None,
        name: str = "planes",
    ) -> DepthImage:
        """A multi-plane image: complete pictures with alpha at single depths.

        Parameters
        ----------
        pictures, alphas
            Near to far.
        vergences_dpt
            Of each plane, 1/m, strictly descending: near to far.

        Raises
        ------
        InvalidInputError
            If the lists differ in length or the planes are out of order.
        """
        count = len(pictures)
        if count == 0 or len(vergences_dpt) != count or len(alphas) != count:
            raise InvalidInputError(
                f"{name}: pictures, vergences_dpt and alphas must be as many, at least one, got "
                f"{count}, {len(vergences_dpt)} and {len(alphas)}"
            )
        verges = check_array(f"{name}: vergences_dpt", vergences_dpt)
        if np.any(np.diff(verges) >= 0):
            raise InvalidInputError(
                f"{name}: vergences_dpt must fall from plane to plane, near to far, got "
                f"{verges.tolist()}; sort the planes"
            )
        planes = list(zip(pictures, map(float, verges), alphas, strict=True))
        return cls(
            planes[0][0],
            planes[0][1],
            fov_deg,
            alpha=planes[0][2],
            centre_deg=centre_deg,
            depth_unit="dpt",
            hidden=tuple(DepthSheet(*plane) for plane in planes[1:]),
            display=display,
            name=name,
        )

    def digest(self) -> str:
        """A hash of pictures and maps, for provenance."""
        found = hashlib.sha256(repr((self.fov_deg, self.centre_deg)).encode())
        for sheet, maps in zip(self.sheets, self.maps, strict=True):
            values = sheet.picture
            if isinstance(values, Image):
                values = values.texels
            if isinstance(values, SpectralCube):
                values = values.values
            for array in (values, *maps):
                found.update(np.ascontiguousarray(array).tobytes())
        return found.hexdigest()[:16]

    @property
    def _what(self) -> str:
        return f"depth image {self.name!r}"

    def _which(self, k: int) -> str:
        return f"{self._what}: " + ("picture" if k == 0 else f"hidden layer {k}")

    def _checked_fov(self) -> tuple[float, float]:
        rows, columns = self.shape
        if np.ndim(self.fov_deg) == 0:
            width = check_positive(f"{self._what}: fov_deg", self.fov_deg, "deg")  # type: ignore[arg-type]
            return width, width * rows / columns
        width, height = check_pair(f"{self._what}: fov_deg", self.fov_deg, "deg")  # type: ignore[arg-type]
        check_positive(f"{self._what}: fov_deg (width)", width, "deg")
        check_positive(f"{self._what}: fov_deg (height)", height, "deg")
        return width, height

    def _maps(self, k: int, sheet: DepthSheet) -> tuple[np.ndarray, np.ndarray]:
        """Vergence and alpha of a sheet, (rows, columns)."""
        alpha = self._map(k, "alpha", 1.0 if sheet.alpha is None else sheet.alpha)
        if not np.all((alpha >= 0) & (alpha <= 1)):
            raise InvalidInputError(f"{self._which(k)}: alpha must lie between 0 and 1")
        depth = self._map(k, "depth", sheet.depth)
        with np.errstate(divide="ignore"):
            vergence = depth if self.depth_unit == "dpt" else 1.0 / np.where(depth > 0, depth, 1.0)
            good = depth >= 0 if self.depth_unit == "dpt" else depth > 0
        good &= vergence < NEAREST_DPT
        bad = ~good & (alpha > 0)
        if bad.any():
            rule = (
                f"a number of metres > {1.0 / NEAREST_DPT:g} (infinity is legal)"
                if self.depth_unit == "m"
                else f"a number of dioptres >= 0 and < {NEAREST_DPT:g}"
            )
            row, column = np.argwhere(bad)[0]
            raise InvalidInputError(
                f"{self._which(k)}: depth must be {rule} in every pixel, got "
                f"{depth[row, column]:g} at row {row}, column {column} and {int(bad.sum())} such "
                "value(s) in all; repair the map or set alpha to 0 there"
            )
        return np.where(alpha > 0, vergence, 0.0), alpha

    def _map(self, k: int, what: str, values: np.ndarray | float) -> np.ndarray:
        array = check_array(f"{self._which(k)}: {what}", values)
        if array.ndim != 0 and array.shape != self.shape:
            raise InvalidInputError(
                f"{self._which(k)}: {what} must have shape {self.shape} as the picture has, or be "
                f"one number, got {array.shape}; resample one of them"
            )
        return np.broadcast_to(array, self.shape).astype(np.float64)

    def _check_order(self, maps: list[tuple[np.ndarray, np.ndarray]]) -> None:
        nearest_allowed = np.full(self.shape, np.inf)
        for k, (vergence, alpha) in enumerate(maps):
            wrong = (alpha > 0) & (vergence > nearest_allowed * (1.0 + 1e-6))
            if wrong.any():
                raise InvalidInputError(
                    f"{self._which(k)} must lie at or behind the layers before it, but is nearer "
                    f"in {int(wrong.sum())} pixel(s); list layers near to far"
                )
            nearest_allowed = np.where(
                alpha > 0, np.minimum(vergence, nearest_allowed), nearest_allowed
            )


def _picture_shape(what: str, picture: Picture) -> tuple[int, int]:
    if isinstance(picture, SpectralCube):
        return picture.shape[:2]
    if isinstance(picture, Image):
        if picture.channels in (1, 3):
            return picture.shape
        shape: tuple[int, ...] = picture.texels.shape
    else:
        shape = check_array(what, picture).shape
    if len(shape) not in (2, 3) or 0 in shape or shape[2:] not in ((), (1,), (3,)):
        raise InvalidInputError(
            f"{what} must have shape (rows, columns) or (rows, columns, 3), got {shape}; "
            "use a SpectralCube for spectra"
        )
    return shape[0], shape[1]
