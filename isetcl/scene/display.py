"""Displays: spectra of their primaries, and how codes become light."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_array,
    check_between,
    check_choice,
    check_count,
    check_finite,
    check_positive,
    check_type,
)
from isetcl.scene.material import Emission
from isetcl.scene.model import Quad, SceneObject
from isetcl.scene.texture import Image, decode_srgb
from isetcl.spectrum import Spectrum


@functools.lru_cache(maxsize=16)
def display_primaries(luminance_cd_m2: float = 100.0) -> tuple[Spectrum, Spectrum, Spectrum]:
    """Spectral radiances of red, green and blue of an sRGB display, W m^-2 sr^-1 nm^-1.

    Linear sRGB values times these spectra have exactly the colour those values stand for, and
    (1, 1, 1) is D65 of the given luminance.

    Source: smooth sRGB basis of Mallett & Yuksel 2019 (EGSR), times CIE D65, as tabulated by
    colour-science from 380 to 780 nm.
    """
    import colour

    basis = colour.recovery.MSDS_BASIS_FUNCTIONS_sRGB_MALLETT2019
    grid = np.asarray(basis.domain, dtype=np.float64)
    white = Spectrum.illuminant("D65", luminance_cd_m2).at(grid)
    values = np.maximum(np.asarray(basis.values, dtype=np.float64), 0.0)
    # The published basis sums to 1 within 1e-6; make that exact, so that white is D65.
    values = values / values.sum(axis=1, keepdims=True)
    red, green, blue = (
        Spectrum(grid, values[:, i] * white, f"sRGB {name}")
        for i, name in enumerate(("red", "green", "blue"))
    )
    return red, green, blue


@dataclass(frozen=True, eq=False)
class Display:
    """A flat calibrated display.

    Parameters
    ----------
    resolution
        Pixels across and down (columns, rows).
    width_m, height_m, pixel_pitch_m
        Its size in metres: one of the three for square pixels, or width and height.
    primaries
        Spectral radiances of red, green and blue at full drive, W m^-2 sr^-1 nm^-1; None is an sRGB
        display (`display_primaries`).
    gamma
        How a code between 0 and 1 becomes light between 0 and 1: ``"srgb"``, an exponent, or a
        table of light at evenly spaced codes, shape (n,) or (n, 3), never falling, interpolated
        linearly and scaled so that the last entry is 1.
    luminance_cd_m2
        Luminance of white; the primaries are scaled to it together. None leaves them as they are
        (100 cd/m^2 without any).
    black_level_cd_m2
        Luminance at code 0, of the colour of white; that of white includes it.

    Raises
    ------
    InvalidInputError
        If a number breaks its rule, the size is stated twice or not at all, or black is not darker
        than white.
    """

    resolution: tuple[int, int]
    width_m: float | None = None
    height_m: float | None = None
    pixel_pitch_m: float | None = None
    primaries: tuple[Spectrum, Spectrum, Spectrum] | None = None
    gamma: str | float | np.ndarray = "srgb"
    luminance_cd_m2: float | None = None
    black_level_cd_m2: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "resolution", _resolution(self.resolution))
        given = [
            n for n in ("width_m", "height_m", "pixel_pitch_m") if getattr(self, n) is not None
        ]
        for name in given:
            check_positive(f"display: {name}", getattr(self, name), "m")
        if len(given) != 1 and given != ["width_m", "height_m"]:
            raise InvalidInputError(
                "display: pass one of width_m, height_m and pixel_pitch_m, or width and height, "
                f"got {' and '.join(given) or 'none'}"
            )
        if self.luminance_cd_m2 is not None:
            check_positive("display: luminance_cd_m2", self.luminance_cd_m2, "cd/m^2")
        object.__setattr__(self, "primaries", self._scaled_primaries())
        white = self.white.luminance_cd_m2()
        object.__setattr__(self, "luminance_cd_m2", white)
        check_finite("display: black_level_cd_m2", self.black_level_cd_m2, "cd/m^2")
        if not 0.0 <= self.black_level_cd_m2 < white:
            raise InvalidInputError(
                f"display: black_level_cd_m2 must be >= 0 and below white ({white:g} cd/m^2), got "
                f"{self.black_level_cd_m2:g}"
            )
        object.__setattr__(self, "gamma", _checked_gamma(self.gamma))

    def _scaled_primaries(self) -> tuple[Spectrum, ...]:
        if self.primaries is None:
            return display_primaries(
                100.0 if self.luminance_cd_m2 is None else self.luminance_cd_m2
            )
        check_type("display: primaries", self.primaries, (tuple, list))
        for spectrum in self.primaries:
            check_type("display: primaries", spectrum, Spectrum)
        if len(self.primaries) != 3:
            raise InvalidInputError(
                f"display: primaries must be three spectra, got {len(self.primaries)}"
            )
        if self.luminance_cd_m2 is None:
            return tuple(self.primaries)
        present = sum(spectrum.luminance_cd_m2() for spectrum in self.primaries)
        if not present > 0:
            raise InvalidInputError("display: primaries must have visible energy")
        factor = self.luminance_cd_m2 / present
        return tuple(spectrum.scaled(factor) for spectrum in self.primaries)

    @property
    def size_m(self) -> tuple[float, float]:
        """Width and height, metres."""
        columns, rows = self.resolution
        if self.width_m is not None:
            other = self.width_m * rows / columns
            return self.width_m, other if self.height_m is None else self.height_m
        if self.height_m is not None:
            return self.height_m * columns / rows, self.height_m
        assert self.pixel_pitch_m is not None
        return columns * self.pixel_pitch_m, rows * self.pixel_pitch_m

    @property
    def white(self) -> Spectrum:
        """Spectral radiance of white: the sum of the primaries, W m^-2 sr^-1 nm^-1."""
        assert self.primaries is not None
        grid = np.unique(np.concatenate([s.wavelengths_nm for s in self.primaries]))
        low = max(s.wavelengths_nm[0] for s in self.primaries)
        high = min(s.wavelengths_nm[-1] for s in self.primaries)
        grid = grid[(grid >= low) & (grid <= high)]
        if len(grid) == 0:
            raise InvalidInputError("display: primaries must share some wavelengths")
        return Spectrum(grid, np.sum([s.at(grid) for s in self.primaries], axis=0), "display white")

    def decoded(self, codes: np.ndarray) -> np.ndarray:
        """Light between 0 and 1 for codes, without the black level.

        Parameters
        ----------
        codes : array_like, (..., 3) or any shape
            Numbers from 0 to 1, or whole numbers of an unsigned type, from 0 to its largest.

        Raises
        ------
        InvalidInputError
            If a code is out of range.
        """
        raw = np.asarray(codes)
        values = check_array("codes", codes)
        if raw.dtype.kind == "u":
            values = values / np.iinfo(raw.dtype).max
        if not np.all((values >= 0) & (values <= 1)):
            raise InvalidInputError(
                "codes must lie between 0 and 1, or be of an unsigned integer type; got "
                f"{values.min():g} to {values.max():g} of type {raw.dtype}"
            )
        if isinstance(self.gamma, str):
            return decode_srgb(values)
        if isinstance(self.gamma, float):
            return values**self.gamma
        tables = self.gamma.reshape(len(self.gamma), -1)
        at = np.linspace(0.0, 1.0, len(tables))
        if tables.shape[1] == 1:
            return np.interp(values, at, tables[:, 0])
        if values.shape[-1:] != (3,):
            raise InvalidInputError(
                f"codes must be coloured (..., 3) for a table of three columns, got {values.shape}"
            )
        return np.stack([np.interp(values[..., k], at, tables[:, k]) for k in range(3)], axis=-1)

    def emission(self, picture: Image | np.ndarray, *, is_additive: bool = False) -> Emission:
        """What the display sends out when it shows a picture.

        Parameters
        ----------
        picture
            An array of codes (rows, columns) or (rows, columns, 3), of the display's resolution; or
            an `Image`, which is linear light already.
        is_additive
            Whether one looks through the display, as at one plane of several.

        Raises
        ------
        InvalidInputError
            If the picture does not fit the display, or asks for more light than white.
        """
        if isinstance(picture, Image):
            light, name = picture.texels.astype(np.float64), picture.name
            if picture.largest > 1.0:
                raise InvalidInputError(
                    f"picture {name!r} must not exceed 1, the display's white, got "
                    f"{picture.largest:g}; scale it"
                )
        else:
            light, name = self.decoded(picture), "display"
        columns, rows = self.resolution
        if light.shape not in ((rows, columns), (rows, columns, 3)):
            raise InvalidInputError(
                f"picture must have {rows} rows, {columns} columns and 1 or 3 channels, as the "
                f"display has, got {light.shape}; resample it"
            )
        assert self.luminance_cd_m2 is not None
        assert self.primaries is not None
        black = self.black_level_cd_m2 / self.luminance_cd_m2
        texture = Image(black + (1.0 - black) * light, name)
        spectra = self.white if light.ndim == 2 else self.primaries
        return Emission(spectra, texture, is_additive=is_additive)

    def plane(
        self,
        picture: Image | np.ndarray,
        distance_m: float,
        *,
        name: str = "display",
        is_additive: bool = False,
    ) -> SceneObject:
        """The display facing the eye, its middle on the axis, showing a picture.

        Parameters
        ----------
        picture, is_additive
            As for `emission`.
        distance_m
            From the corneal vertex.
        name
            Of the object.

        Raises
        ------
        InvalidInputError
            If the picture does not fit the display, or the distance is not positive.
        """
        distance = check_positive("distance_m", distance_m, "m")
        width, height = self.size_m
        quad = Quad((-width / 2.0, -height / 2.0, -distance), (width, 0.0, 0.0), (0.0, height, 0.0))
        return SceneObject(name, quad, self.emission(picture, is_additive=is_additive))


def _resolution(resolution: tuple[int, int]) -> tuple[int, int]:
    try:
        columns, rows = resolution
    except (TypeError, ValueError):
        raise InvalidInputError(
            f"display: resolution must be two whole numbers, columns and rows, got {resolution!r}"
        ) from None
    return (
        check_count("display: resolution (columns)", columns, 1, 65536),
        check_count("display: resolution (rows)", rows, 1, 65536),
    )


def _checked_gamma(gamma: str | float | np.ndarray) -> str | float | np.ndarray:
    """The name, exponent or table of a display's nonlinearity."""
    if isinstance(gamma, str):
        return check_choice("display: gamma", gamma, ("srgb",))
    if np.ndim(gamma) == 0:
        return check_between("display: gamma", gamma, 0.1, 10.0)  # type: ignore[arg-type]
    table = check_array("display: gamma", gamma)
    if table.ndim > 2 or len(table) < 2 or table.shape[1:] not in ((), (1,), (3,)):
        raise InvalidInputError(
            f"display: gamma must be a table of shape (n >= 2,) or (n, 3), got {table.shape}"
        )
    if not np.isfinite(table).all() or np.any(table < 0) or np.any(np.diff(table, axis=0) < 0):
        raise InvalidInputError("display: gamma must be a table >= 0 that never falls")
    if not np.all(table[-1] > 0):
        raise InvalidInputError("display: gamma must be a table that ends above 0")
    return table / table[-1]
