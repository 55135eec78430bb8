"""Patterns on shapes: checkerboards and images, as weights between 0 and 1 (or any scale).

Texture coordinates (u, v) run from 0 to 1 over a shape, u to its right and v upwards; row 0 of an
image is its top.
"""

from __future__ import annotations

import dataclasses
import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from isetcl.errors import (
    FileError,
    InvalidInputError,
    check_array,
    check_between,
    check_choice,
    check_finite,
    check_pair,
    check_positive,
    check_type,
)


@dataclass(frozen=True)
class Checkerboard:
    """Alternating fields, `periods_u` by `periods_v` dark-bright pairs over the shape.

    Parameters
    ----------
    periods_u, periods_v
        Number of pairs along u and v; need not be whole.
    bright, dark
        Weights of the two fields, >= 0. The field at u = v = 0 is bright.
    """

    periods_u: float
    periods_v: float
    bright: float = 1.0
    dark: float = 0.0

    channels = 1

    def __post_init__(self) -> None:
        check_positive("checkerboard: periods_u", self.periods_u)
        check_positive("checkerboard: periods_v", self.periods_v)
        for name in ("bright", "dark"):
            if check_finite(f"checkerboard: {name}", getattr(self, name)) < 0:
                raise InvalidInputError(
                    f"checkerboard: {name} must be >= 0, got {getattr(self, name):g}"
                )

    @property
    def largest(self) -> float:
        """The largest weight."""
        return max(self.bright, self.dark)

    @property
    def mean(self) -> float:
        """The mean weight, for estimates."""
        return (self.bright + self.dark) / 2.0

    def weights(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Weights at texture coordinates, shape (..., 1)."""
        parity = np.floor(2.0 * u * self.periods_u) + np.floor(2.0 * v * self.periods_v)
        return np.where(parity % 2 == 0, self.bright, self.dark)[..., np.newaxis]

    def digest(self) -> str:
        """A hash of the pattern, for provenance."""
        return hashlib.sha256(repr(self).encode()).hexdigest()[:16]


@dataclass(frozen=True)
class Grid:
    """Thin lines on a ground, at whole multiples of a period, so that half a line lies at u = 0.

    Parameters
    ----------
    periods_u, periods_v
        Periods along u and v; need not be whole.
    width
        Width of a line in periods, 0 to 1.
    line, ground
        Weights of lines and ground, >= 0.
    """

    periods_u: float
    periods_v: float
    width: float = 0.1
    line: float = 1.0
    ground: float = 0.0

    channels = 1

    def __post_init__(self) -> None:
        check_positive("grid: periods_u", self.periods_u)
        check_positive("grid: periods_v", self.periods_v)
        check_between("grid: width", self.width, 0.0, 1.0)
        for name in ("line", "ground"):
            if check_finite(f"grid: {name}", getattr(self, name)) < 0:
                raise InvalidInputError(f"grid: {name} must be >= 0, got {getattr(self, name):g}")

    @property
    def largest(self) -> float:
        """The largest weight."""
        return max(self.line, self.ground)

    @property
    def mean(self) -> float:
        """The mean weight, for estimates."""
        share = 1.0 - (1.0 - self.width) ** 2
        return share * self.line + (1.0 - share) * self.ground

    def weights(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Weights at texture coordinates, shape (..., 1)."""
        half = self.width / 2.0
        a, b = np.asarray(u) * self.periods_u + half, np.asarray(v) * self.periods_v + half
        on_line = (a - np.floor(a) < self.width) | (b - np.floor(b) < self.width)
        return np.where(on_line, self.line, self.ground)[..., np.newaxis]

    def digest(self) -> str:
        """A hash of the pattern, for provenance."""
        return hashlib.sha256(repr(self).encode()).hexdigest()[:16]


Wrap = Literal["clamp", "repeat"]


@dataclass(frozen=True, eq=False)
class Image:
    """A picture in linear light, interpolated bilinearly between the centres of its texels.

    Parameters
    ----------
    texels
        Weights >= 0, shape (rows, columns) or (rows, columns, channels), row 0 at the top. Linear:
        a photograph must be decoded from sRGB first, as `load_image` does.
    name
        For messages and provenance.
    wrap
        What lies beyond 0 to 1: the border (``"clamp"``) or the picture again (``"repeat"``).
    repeats, offset
        The picture is looked up at `repeats` times (u, v) plus `offset`.
    """

    texels: np.ndarray
    name: str = "image"
    wrap: Wrap = "clamp"
    repeats: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        texels = check_array(f"image {self.name!r}", self.texels).astype(np.float32)
        if texels.ndim == 3 and texels.shape[2] == 1:
            texels = texels[..., 0]
        if texels.ndim not in (2, 3) or texels.size == 0:
            raise InvalidInputError(
                f"image {self.name!r} must have shape (rows, columns) or (rows, columns, "
                f"channels), got {texels.shape}"
            )
        if not np.all(np.isfinite(texels)) or np.any(texels < 0):
            raise InvalidInputError(
                f"image {self.name!r} must be finite and >= 0 (linear light); "
                "clip or repair it first"
            )
        object.__setattr__(self, "texels", texels)
        check_choice(f"image {self.name!r}: wrap", self.wrap, ("clamp", "repeat"))
        for name in ("repeats", "offset"):
            pair = check_pair(f"image {self.name!r}: {name}", getattr(self, name))
            object.__setattr__(self, name, pair)

    @property
    def channels(self) -> int:
        """1 for a grey image, 3 for a coloured one, more for a spectral one."""
        return 1 if self.texels.ndim == 2 else int(self.texels.shape[2])

    @property
    def is_plain(self) -> bool:
        """Whether the picture fills the shape once and ends at its borders."""
        return (self.wrap, self.repeats, self.offset) == ("clamp", (1.0, 1.0), (0.0, 0.0))

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return int(self.texels.shape[0]), int(self.texels.shape[1])

    @property
    def largest(self) -> float:
        """The largest weight."""
        return float(self.texels.max())

    @property
    def mean(self) -> float:
        """The mean weight, for estimates."""
        return float(self.texels.mean())

    def weights(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Weights at texture coordinates, shape (..., channels)."""
        rows, columns = self.shape
        x = (np.asarray(u) * self.repeats[0] + self.offset[0]) * columns - 0.5
        y = (1.0 - (np.asarray(v) * self.repeats[1] + self.offset[1])) * rows - 0.5
        if self.wrap == "clamp":
            x, y = np.clip(x, 0, columns - 1), np.clip(y, 0, rows - 1)
        left, top = np.floor(x).astype(int), np.floor(y).astype(int)
        right, low = left + 1, top + 1
        fx, fy = (x - left)[..., None], (y - top)[..., None]
        if self.wrap == "clamp":
            right, low = np.minimum(right, columns - 1), np.minimum(low, rows - 1)
        else:
            left, right, top, low = left % columns, right % columns, top % rows, low % rows
        t = self.texels.reshape(rows, columns, self.channels)
        upper = t[top, left] * (1 - fx) + t[top, right] * fx
        lower = t[low, left] * (1 - fx) + t[low, right] * fx
        return upper * (1 - fy) + lower * fy

    def halved(self, times: int) -> Image:
        """The image averaged over blocks of 2^times by 2^times texels.

        Rows or columns that do not fill a block are resampled by area, so that the picture keeps
        its place on the shape.
        """
        if times <= 0:
            return self
        from skimage.transform import downscale_local_mean, resize

        rows, columns = (max(1, n >> times) for n in self.shape)
        block = 1 << times
        if self.shape == (rows * block, columns * block):
            factors = (block, block) + (1,) * (self.texels.ndim - 2)
            small = downscale_local_mean(self.texels, factors)
        else:
            # Averages of whole blocks after stretching to a multiple of the block size.
            stretched = resize(
                self.texels,
                (rows * block, columns * block),
                order=1,
                mode="edge",
                anti_aliasing=False,
            )
            factors = (block, block) + (1,) * (self.texels.ndim - 2)
            small = downscale_local_mean(stretched, factors)
        return dataclasses.replace(self, texels=np.maximum(small, 0.0))

    def cropped(self, width_over_height: float) -> Image:
        """The middle of the image with a proportion, cut by whole texels.

        Raises
        ------
        InvalidInputError
            If the proportion is not positive.
        """
        proportion = check_positive("width_over_height", width_over_height)
        rows, columns = self.shape
        width = max(1, min(columns, round(rows * proportion)))
        height = max(1, min(rows, round(columns / proportion)))
        left, top = (columns - width) // 2, (rows - height) // 2
        return Image(self.texels[top : top + height, left : left + width], self.name)

    def digest(self) -> str:
        """A hash of the texels, for provenance."""
        data = np.ascontiguousarray(self.texels).tobytes()
        place = f"{self.texels.shape} {self.wrap} {self.repeats} {self.offset}"
        return hashlib.sha256(data + place.encode()).hexdigest()[:16]


Texture = Checkerboard | Grid | Image
TEXTURES = (Checkerboard, Grid, Image)
"""The kinds of texture."""


def load_image(path: str | Path) -> Image:
    """A picture from a file, upright and in linear light: sRGB decoded unless it holds floats.

    Reads PNG, JPEG, TIFF, WebP and what else imageio's Pillow plugin and scikit-image read. The
    orientation a camera noted is applied, palettes and CMYK become RGB, the first frame of an
    animation is taken, an alpha channel is composited on black.

    Raises
    ------
    FileError
        If the file does not exist or is not an image.
    """
    check_type("path", path, (str, Path))
    file = Path(path)
    if not file.is_file():
        raise FileError(f"image file {str(file)!r} does not exist")
    try:
        raw = _read_pixels(file)
    except Exception as error:
        # Readers raise what they like; whatever it is, the file is no image.
        raise FileError(
            f"image file {str(file)!r} cannot be read as an image ({error}); use PNG, JPEG or TIFF"
        ) from error
    if raw.ndim not in (2, 3) or (raw.ndim == 3 and raw.shape[2] not in (1, 2, 3, 4)):
        raise FileError(
            f"image file {str(file)!r} must hold one grey or RGB picture, got shape {raw.shape}; "
            "save one picture as PNG"
        )
    return Image(_linear_light(raw), file.name)


def _read_pixels(file: Path) -> np.ndarray:
    """Stored pixels of an image file, upright, (rows, columns) or (rows, columns, channels)."""
    from PIL import Image as Pillow
    from PIL import ImageOps, UnidentifiedImageError

    try:
        with Pillow.open(file) as picture:
            if picture.mode in ("P", "PA", "CMYK", "YCbCr", "LAB", "HSV"):
                has_alpha = picture.mode == "PA" or "transparency" in picture.info
                upright = ImageOps.exif_transpose(picture).convert("RGBA" if has_alpha else "RGB")
                return np.asarray(upright)
            if picture.mode in ("1", "L", "LA", "RGB", "RGBA", "I;16"):
                return np.asarray(ImageOps.exif_transpose(picture))
    except UnidentifiedImageError:
        pass
    # Sixteen bits a channel, floats and scientific formats.
    from skimage.io import imread

    return np.asarray(imread(file))


def _linear_light(raw: np.ndarray) -> np.ndarray:
    """Linear weights from stored pixels: integers are sRGB codes, floats are linear already."""
    if raw.dtype == bool:
        raw = raw.astype(np.uint8) * np.uint8(255)
    integer = np.issubdtype(raw.dtype, np.integer)
    scaled = raw.astype(np.float64) / (np.iinfo(raw.dtype).max if integer else 1.0)
    has_alpha = scaled.ndim == 3 and scaled.shape[2] in (2, 4)
    colour = scaled[..., :-1] if has_alpha else scaled
    if integer:
        colour = decode_srgb(colour)
    return colour * scaled[..., -1:] if has_alpha else colour


def decode_srgb(code: np.ndarray) -> np.ndarray:
    """Linear light from sRGB values between 0 and 1 (IEC 61966-2-1)."""
    code = np.asarray(code, dtype=np.float64)
    return np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
