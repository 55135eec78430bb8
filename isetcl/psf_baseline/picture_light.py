"""Linear light of pictures."""

from __future__ import annotations

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.scene.display import Display
from isetcl.scene.texture import Image


def srgb() -> Display:
    """An sRGB display of 100 cd/m^2; its size means nothing."""
    return Display((1, 1), width_m=1.0)


def decoded(picture: np.ndarray | Image, display: Display | None) -> np.ndarray:
    """Linear light, (rows, columns) or (rows, columns, 3), 1 being white.

    Raises
    ------
    InvalidInputError
        If a value is no light.
    """
    if isinstance(picture, Image):
        light = picture.texels.astype(np.float64)
    else:
        raw = np.asarray(picture)
        light = raw.astype(np.float64)
        if raw.dtype.kind == "u":
            light = (srgb() if display is None else display).decoded(raw)
    light = light[..., 0] if light.shape[2:] == (1,) else light
    if not np.all(np.isfinite(light)) or np.any(light < 0):
        raise InvalidInputError("a picture must be finite and >= 0 (linear light); repair it first")
    return light


def shown(picture: np.ndarray | Image, display: Display | None) -> np.ndarray:
    """`decoded`, with the black level of a display added."""
    light = decoded(picture, display)
    if display is None:
        return light
    assert display.luminance_cd_m2 is not None
    black = display.black_level_cd_m2 / display.luminance_cd_m2
    return black + (1.0 - black) * light
