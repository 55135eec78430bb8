"""Pictures with depth: a photograph and its depth map, or planes with alpha."""

from __future__ import annotations

import functools
import hashlib
import math
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
from isetcl.eye.field import direction_from_field
from isetcl.psf_baseline.camera import LARGEST_FOV_DEG, Camera, Projection
from isetcl.scene.cube import SpectralCube
from isetcl.scene.display import Display
from isetcl.scene.texture import Image

DepthUnit = Literal["m", "dpt"]
DepthKind = Literal["z", "range"]
Picture = np.ndarray | Image | SpectralCube

NEAREST_DPT = 125.0
"""Vergence of what stands right before the cornea, where eyes are no longer traced, 1/m."""

_EVEN_PX = 0.02  # pixels displaced by less are not worth the loss of sharpness of resampling
_LEAST_COSINE = 1e-3


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

    A pixel is a square patch of even radiance at one depth; row 0 is the top. A photograph is taken
    to be in perspective, as cameras and most renderers make them: pixels are equal steps of the
    tangent of the angle from the middle, which a retinal image, whose pixels are equal steps of
    polar field angle, samples by the area that each of its samples covers. The camera stands
    upright at the eye and points to `centre_deg`; its lens has no distortion. Where no pixel lies
    farther than a fiftieth of its width from that of even angles the two are taken as the same. At
    10 degrees from the middle they differ by 1 % in place and 3 % in scale along the radius.

    Parameters
    ----------
    picture, depth, alpha
        As of a `DepthSheet`: what is nearest in every pixel.
    fov_deg
        Angle between the middles of its left and right borders, degrees, for square pixels; or
        width and height.
    centre_deg
        Field angles (x, y) of its middle.
    depth_unit
        ``"m"``: metres along the axis from the corneal vertex, > 0; infinity is legal. ``"dpt"``:
        1/m, >= 0 and finite; 0 is infinity.
    depth_kind
        ``"z"``: depth along the axis, that of the camera of a picture in perspective, of the eye
        otherwise. A wall across the axis has one such depth. ``"range"``: distance along the line
        of sight, as scanners measure it. Both from the corneal vertex.
    projection
        ``"perspective"``, or ``"angular"``: pixels are equal steps of polar field angle.
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
    depth_kind: DepthKind = "z"
    projection: Projection = "perspective"
    hidden: tuple[DepthSheet, ...] = ()
    display: Display | None = None
    name: str = "picture"

    def __post_init__(self) -> None:
        check_type("depth image: name", self.name, str)
        check_choice("depth unit", self.depth_unit, ("m", "dpt"))
        check_choice("depth kind", self.depth_kind, ("z", "range"))
        check_choice("projection", self.projection, ("perspective", "angular"))
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
            found = picture_shape(self._which(k), sheet.picture)
            if found != shape:
                raise InvalidInputError(
                    f"{self._which(k)} must have {shape[0]} rows and {shape[1]} columns as the "
                    f"front picture has, got {found[0]} and {found[1]}; resample it"
                )
        object.__setattr__(self, "fov_deg", self._checked_fov())
        object.__setattr__(self, "_nearer", self._depth_factor())
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
        return picture_shape(self._which(0), self.picture)

    @functools.cached_property
    def camera(self) -> Camera | None:
        """What took a picture in perspective; None where its pixels are even field angles."""
        if self.projection == "angular":
            return None
        found = self._any_camera
        return found if found.farthest_from_even() > _EVEN_PX else None

    @property
    def even_fov_deg(self) -> tuple[float, float]:
        """Size of the largest image of even field angles about the middle that it fills."""
        width, height = self.fov_deg  # type: ignore[misc]
        if self.camera is not None:
            return self.camera.inner_fov_deg()
        if self.projection == "angular":
            return width, height
        wide, high = self._any_camera.half_tangents
        return width, width * high / wide

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
        projection: Projection = "perspective",
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
            projection=projection,
            hidden=tuple(DepthSheet(*plane) for plane in planes[1:]),
            display=display,
            name=name,
        )

    def digest(self) -> str:
        """A hash of pictures and maps, for provenance."""
        settings = self.fov_deg, self.centre_deg, self.projection
        found = hashlib.sha256(repr(settings).encode())
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
            if self.projection == "angular":
                return width, width * rows / columns
            tangent = math.tan(math.radians(min(width, LARGEST_FOV_DEG) / 2.0)) * rows / columns
            return width, math.degrees(2.0 * math.atan(tangent))
        width, height = check_pair(f"{self._what}: fov_deg", self.fov_deg, "deg")  # type: ignore[arg-type]
        check_positive(f"{self._what}: fov_deg (width)", width, "deg")
        check_positive(f"{self._what}: fov_deg (height)", height, "deg")
        return width, height

    @property
    def _any_camera(self) -> Camera:
        return Camera(self.fov_deg, self.centre_deg, self.shape)  # type: ignore[arg-type]

    def _directions(self) -> np.ndarray:
        """Unit vectors of the pixels' middles, (rows, columns, 3)."""
        if self.projection == "perspective":
            return self._any_camera.directions()
        rows, columns = self.shape
        width, height = self.fov_deg  # type: ignore[misc]
        x = self.centre_deg[0] + ((np.arange(columns) + 0.5) / columns - 0.5) * width
        y = self.centre_deg[1] + (0.5 - (np.arange(rows) + 0.5) / rows) * height
        return direction_from_field(x[None, :], y[:, None])

    def _depth_factor(self) -> np.ndarray | float:
        """Vergence along the axis of the eye over what is given, by pixel."""
        is_perspective = self.projection == "perspective"
        along = self._any_camera.axes[2] if is_perspective else np.array([0.0, 0.0, -1.0])
        if self.depth_kind == "z" and along[2] == -1.0:
            return 1.0
        seen = self._directions()
        cosine = -seen[..., 2]
        if np.any(cosine < _LEAST_COSINE):
            raise InvalidInputError(
                f"{self._what}: all of it must lie less than 90 deg from the axis of the eye; "
                "reduce fov_deg or centre_deg"
            )
        return (seen @ along if self.depth_kind == "z" else 1.0) / cosine

    def _maps(self, k: int, sheet: DepthSheet) -> tuple[np.ndarray, np.ndarray]:
        """Vergence and alpha of a sheet, (rows, columns)."""
        alpha = self._map(k, "alpha", 1.0 if sheet.alpha is None else sheet.alpha)
        if not np.all((alpha >= 0) & (alpha <= 1)):
            raise InvalidInputError(f"{self._which(k)}: alpha must lie between 0 and 1")
        depth = self._map(k, "depth", sheet.depth)
        with np.errstate(divide="ignore"):
            vergence = depth if self.depth_unit == "dpt" else 1.0 / np.where(depth > 0, depth, 1.0)
            good = depth >= 0 if self.depth_unit == "dpt" else depth > 0
        vergence = vergence * self.__dict__["_nearer"]
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


def picture_shape(what: str, picture: Picture) -> tuple[int, int]:
    """Rows and columns of a picture.

    Raises
    ------
    InvalidInputError
        If it is no picture.
    """
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
