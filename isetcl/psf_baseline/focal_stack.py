"""Focal stacks: photographs of one scene from one place, focused at several distances."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_array,
    check_between,
    check_choice,
    check_count,
    check_positive,
    check_type,
)
from isetcl.psf_baseline.camera import Projection
from isetcl.psf_baseline.depth_files import read_light
from isetcl.psf_baseline.depth_from_focus import FocusDepth, depth_from_focus
from isetcl.psf_baseline.depth_image import NEAREST_DPT, DepthImage, picture_shape
from isetcl.psf_baseline.picture_light import decoded
from isetcl.scene.display import Display
from isetcl.scene.texture import Image
from isetcl.units import MM_PER_M

_LARGEST_EXPOSURE_RATIO = 1.5
_LEAST_PICTURES = 3


@dataclass(frozen=True, eq=False)
class FocalStack:
    """Photographs of one scene from one place, focused at several distances.

    Depth is found where local contrast is largest among them: only where there is texture, and as
    finely as blur changes, see `resolution_dpt`. What it cannot know: even areas, and weak textures
    within the blur of strong ones (their confidence is 0 and they take the depth of the nearest
    pixel that has one); mirrors and glass; what lies beyond the ends of the stack, which is put at
    the end; and a rim about depth edges as wide as the window and the blur. The pictures must lie
    on one another: a lens whose picture grows as it focuses (focus breathing) must be corrected
    before.

    Parameters
    ----------
    pictures
        Linear light or codes, as the picture of a `DepthImage`; at least three, of one size and
        exposure.
    focus_dpt
        Vergence in focus of each, 1/m, >= 0; all rising or all falling. Steps of up to four times
        `resolution_dpt` tell depth to within one; wider ones to about a fifth of a step.
    aperture_mm
        Diameter of the camera's entrance pupil.
    fov_deg, centre_deg, projection, display, name
        As of a `DepthImage`.

    Raises
    ------
    InvalidInputError
        If pictures differ in size or exposure, or focus distances are equal or out of order.
    """

    pictures: Sequence[np.ndarray | Image]
    focus_dpt: Sequence[float] | np.ndarray
    aperture_mm: float
    fov_deg: float | tuple[float, float]
    centre_deg: tuple[float, float] = (0.0, 0.0)
    projection: Projection = "perspective"
    display: Display | None = None
    name: str = "focal stack"

    def __repr__(self) -> str:
        (rows, columns), count = self.shape, len(self.pictures)
        return f"<FocalStack {self.name!r}: {count} pictures of {columns} x {rows} pixels>"

    def __post_init__(self) -> None:
        check_type("focal stack: name", self.name, str)
        check_positive(f"{self._what}: aperture_mm", self.aperture_mm, "mm")
        check_type(f"{self._what}: pictures", self.pictures, (list, tuple, np.ndarray))
        object.__setattr__(self, "pictures", tuple(self.pictures))
        object.__setattr__(self, "focus_dpt", self._checked_focus())
        self._check_shapes()
        # The checks of the field and the display are those of any picture with depth.
        first = self._image(self.pictures[0], 1.0)
        object.__setattr__(self, "fov_deg", first.fov_deg)
        object.__setattr__(self, "centre_deg", first.centre_deg)
        self._check_exposure()

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return picture_shape(self._what, self.pictures[0])

    @property
    def resolution_dpt(self) -> float:
        """Change of vergence that widens the blur by one pixel in the middle, 1/m.

        The blur of an aperture A is A |dV| wide, radians; a pixel the angle that it has.
        """
        width, columns = self.fov_deg[0], self.shape[1]  # type: ignore[index]
        radians = math.radians(width) / columns
        if self.projection == "perspective":
            radians = 2.0 * math.tan(math.radians(width) / 2.0) / columns
        return radians / (self.aperture_mm / MM_PER_M)

    def depth(self, *, window: int = 9, least_confidence: float = 0.35) -> FocusDepth:
        """Depth, how sure it is, and the picture in focus everywhere.

        Parameters
        ----------
        window
            Pixels a side over which contrast is averaged: more for noisy pictures, fewer for fine
            depth edges.
        least_confidence
            Pixels below it count as unknown. White noise alone reaches 0.3 in a window of 9, 0.45
            in one of 5.

        Raises
        ------
        InvalidInputError
            If an argument breaks its rule, or no pixel's depth is known.
        """
        window = check_count("window", window, 1, min(self.shape))
        check_between("least_confidence", least_confidence, 0.0, 1.0)
        focus = np.asarray(self.focus_dpt)
        found = depth_from_focus(self._light, focus, self.resolution_dpt, window, least_confidence)
        if not found.is_known.any():
            raise InvalidInputError(
                f"{self._what}: focus changes the contrast of no pixel enough to tell its depth "
                f"(largest confidence {found.confidence.max():.2g}, least_confidence "
                f"{least_confidence:g}); it needs texture, and steps of focus of some "
                f"{self.resolution_dpt:.2g} dpt or more"
            )
        return found

    def depth_image(self, *, window: int = 9, least_confidence: float = 0.35) -> DepthImage:
        """The picture in focus everywhere with its depth, for `render`; as `depth`."""
        found = self.depth(window=window, least_confidence=least_confidence)
        return self._image(found.picture, found.vergence_dpt)

    def _light(self, k: int) -> np.ndarray:
        return decoded(self.pictures[k], self.display)

    @property
    def _what(self) -> str:
        return f"focal stack {self.name!r}"

    def _image(self, picture: np.ndarray | Image, vergence_dpt: np.ndarray | float) -> DepthImage:
        return DepthImage(
            picture,
            vergence_dpt,
            self.fov_deg,
            centre_deg=self.centre_deg,
            depth_unit="dpt",
            projection=self.projection,
            display=self.display,
            name=self.name,
        )

    def _checked_focus(self) -> np.ndarray:
        count = len(self.pictures)
        focus = check_array(f"{self._what}: focus_dpt", self.focus_dpt)
        if focus.shape != (count,) or count < _LEAST_PICTURES:
            raise InvalidInputError(
                f"{self._what}: there must be at least {_LEAST_PICTURES} pictures and a focus for "
                f"each, got {count} pictures and focus_dpt of shape {focus.shape}"
            )
        if not np.all((focus >= 0) & (focus < NEAREST_DPT)):
            raise InvalidInputError(
                f"{self._what}: focus_dpt must be >= 0 and < {NEAREST_DPT:g} 1/m, got "
                f"{focus.tolist()}; 0 is infinity"
            )
        steps = np.diff(focus)
        if not (np.all(steps > 0) or np.all(steps < 0)):
            raise InvalidInputError(
                f"{self._what}: focus_dpt must all rise or all fall, got {focus.tolist()}; sort "
                "the pictures by focus and leave out doubles"
            )
        return focus.astype(np.float64)

    def _check_shapes(self) -> None:
        for k, picture in enumerate(self.pictures):
            found = picture_shape(f"{self._what}: picture {k}", picture)
            if found != self.shape:
                raise InvalidInputError(
                    f"{self._what}: picture {k} must have {self.shape[0]} rows and "
                    f"{self.shape[1]} columns as picture 0 has, got {found[0]} and {found[1]}; "
                    "resample it"
                )

    def _check_exposure(self) -> None:
        lights = [self._light(k) for k in range(len(self.pictures))]
        if len({light.ndim for light in lights}) > 1:
            raise InvalidInputError(
                f"{self._what}: its pictures must be all grey or all coloured; got both"
            )
        means = np.array([light.mean() for light in lights])
        if not means.min() > 0:
            raise InvalidInputError(f"{self._what}: picture {means.argmin()} is black")
        if means.max() > _LARGEST_EXPOSURE_RATIO * means.min():
            raise InvalidInputError(
                f"{self._what}: the mean light of its pictures must not differ by more than a "
                f"factor of {_LARGEST_EXPOSURE_RATIO:g}, but that of picture {means.argmax()} is "
                f"{means.max() / means.min():.3g} times that of picture {means.argmin()}; scale "
                "them to one exposure"
            )


def load_focal_stack(
    paths: Sequence[str | Path],
    focus_dpt: Sequence[float] | np.ndarray,
    aperture_mm: float,
    fov_deg: float | tuple[float, float],
    *,
    display: Display | None = None,
    **options: Any,
) -> FocalStack:
    """A focal stack from files.

    Parameters
    ----------
    paths
        One file a picture, of the kinds that `load_depth_image` reads.
    focus_dpt, aperture_mm, fov_deg, display
        As of a `FocalStack`.
    options
        `centre_deg`, `projection`, `name` of a `FocalStack`.

    Raises
    ------
    FileError
        If a file cannot be read.
    InvalidInputError
        If they do not make a focal stack.
    """
    for name in options:
        check_choice("option", name, ("centre_deg", "projection", "name"))
    check_type("paths", paths, (list, tuple), "give one path for every picture")
    for path in paths:
        check_type("path", path, (str, Path))
    pictures = [read_light(Path(path), display) for path in paths]
    return FocalStack(pictures, focus_dpt, aperture_mm, fov_deg, display=display, **options)
