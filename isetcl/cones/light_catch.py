"""From irradiance to excitations: apertures in an image's pixels, efficiencies of receptors."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import numpy as np

from isetcl.cones.mosaic import ConeMosaic
from isetcl.cones.observer import Observer
from isetcl.cones.receptors import ReceptorType, outer_segment_um
from isetcl.cones.viewing import Viewing
from isetcl.errors import InvalidInputError
from isetcl.eye.people.macular_pigment import macular_fraction
from isetcl.memory import check_memory
from isetcl.retina.image import RetinalImage
from isetcl.retina.transmittance import MacularPigment
from isetcl.spectrum import bin_widths
from isetcl.units import NM_PER_M, PLANCK_J_S, SPEED_OF_LIGHT_M_S

if TYPE_CHECKING:
    from isetcl.device.layout import Precision

_GRID_TOLERANCE = 1e-2  # pixels
_MOST_EFFICIENCIES = 1 << 24


class ReceptorEfficiency:
    """Receptors of a mosaic before light of some wavelengths.

    Parameters
    ----------
    mosaic, viewing
        Who looks, with which pigments and behind what.
    wavelengths_nm
        Of the light.

    Raises
    ------
    InvalidInputError
        If wavelengths lie in unequal steps, and that is not allowed.
    """

    def __init__(self, mosaic: ConeMosaic, wavelengths_nm: np.ndarray, viewing: Viewing) -> None:
        self._mosaic, self._viewing = mosaic, viewing
        self._grid = viewing.check_wavelengths(wavelengths_nm)

    def efficiencies(self, receptors: slice) -> np.ndarray:
        """Excitations a second per W m^-2 nm^-1 at each wavelength, (receptors, wavelengths)."""
        grid = self._grid
        types = self._mosaic.types[receptors]
        eccentricity = self._mosaic.eccentricity_deg[receptors]
        efficiency = self._pigments(types, self._mosaic.outer_segment_um[receptors])
        if self._viewing.has_macular_pigment:
            density = self._viewing.observer.macular_density(grid)
            exponent = -np.log(10.0) * density  # exp costs a fraction of a power of ten
            efficiency *= np.exp(macular_fraction(eccentricity)[:, None] * exponent)
        area_m2 = np.pi * (0.5e-6 * self._mosaic.aperture_um[receptors]) ** 2
        photons = grid / (NM_PER_M * PLANCK_J_S * SPEED_OF_LIGHT_M_S) * bin_widths(grid)
        passed = self._viewing.transmittance(grid)
        return np.asarray(efficiency * area_m2[:, None] * (photons * passed))

    def _pigments(self, types: np.ndarray, segment_um: np.ndarray) -> np.ndarray:
        """Excitations per photon of every receptor, (receptors, wavelengths)."""
        observer, grid = self._viewing.observer, self._grid
        efficiency = np.empty((len(types), len(grid)))
        is_rod = types == ReceptorType.ROD
        if np.any(is_rod):
            efficiency[is_rod] = observer.rod_efficiency(grid)
        fraction = segment_um / float(outer_segment_um(np.zeros(1))[0])
        foveal = observer.quantal_efficiency(grid)
        if self._viewing.segments == "spectral":
            exponent = -np.log(10.0) * observer.absorbances(grid)
            for kind, density in enumerate(observer.optical_densities):
                chosen = types == kind
                depth = density * fraction[chosen, None]
                efficiency[chosen] = -np.expm1(depth * exponent[kind])
            efficiency[~is_rod] *= observer.photon_efficiency
            return efficiency
        factor = np.ones(len(types))
        if self._viewing.segments == "mean":
            factor = mean_segment_factor(observer, grid, fraction)
        cones = ~is_rod
        efficiency[cones] = foveal[types[cones]] * factor[cones, None]
        return efficiency


class LightCatch(ReceptorEfficiency):
    """Receptors of a mosaic before an image.

    Parameters
    ----------
    mosaic, image, viewing
        Who looks, at what, with which pigments and behind what.

    Raises
    ------
    InvalidInputError
        If the image has fewer than 2 x 2 pixels or 2 wavelengths, uneven pixels, values that are
        negative or not finite, or macular pigment that would be counted twice; or wavelengths lie
        in unequal steps, and that is not allowed.
    """

    def __init__(self, mosaic: ConeMosaic, image: RetinalImage, viewing: Viewing) -> None:
        super().__init__(mosaic, image.wavelengths_nm, viewing)
        self._image = image
        self._check_image()
        self.apertures = self._apertures()

    def _check_image(self) -> None:
        values = self._image.irradiance.values
        if min(values.shape[1:]) < 2 or values.shape[0] < 2:
            raise InvalidInputError(
                "excitations need an image of at least 2 x 2 pixels and 2 wavelengths, got "
                f"{values.shape[2]} x {values.shape[1]} pixels and {values.shape[0]} wavelengths"
            )
        # A minimum that is NaN fails too.
        if not (values.min() >= 0 and values.max() < np.inf):
            worst = values[~(np.isfinite(values) & (values >= 0))][0]
            raise InvalidInputError(
                f"irradiance must be finite and >= 0 W m^-2 nm^-1, got {worst:g}; clip or mend the "
                "image first"
            )
        for step in self._image.steps if self._viewing.has_macular_pigment else ():
            if isinstance(step.medium, MacularPigment):
                raise InvalidInputError(
                    f"the image has come through {step.label!r} already, and has_macular_pigment "
                    "must be False then; pass that, or take "
                    f"image.without({step.label!r}), which lets every receptor look through the "
                    "pigment of its own place"
                )

    @functools.cached_property
    def _axes(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """First pixel's middle and step of the columns and of the rows, degrees."""
        found = []
        for name in ("x", "y"):
            at = self._image.dataset[name].values.astype(np.float64)
            steps = np.diff(at)
            step = float(np.mean(steps))
            even = at[0] + step * np.arange(len(at))
            # Files may keep coordinates in single precision.
            slack = _GRID_TOLERANCE * abs(step) + 4e-7 * np.max(np.abs(at))
            if step == 0 or np.max(np.abs(at - even)) > slack:
                raise InvalidInputError(
                    f"pixels must lie in equal steps along {name}, got steps of {steps.min():g} to "
                    f"{steps.max():g} deg"
                )
            found.append((float(at[0]), step))
        return found[0], found[1]

    def _apertures(self) -> np.ndarray:
        """Column, row, semi-axes of every receptor, pixels from the image's corner, (n, 4)."""
        (x0, dx), (y0, dy) = self._axes
        places = self._mosaic.positions_deg
        column = (places[:, 0] - x0) / dx + 0.5
        row = (places[:, 1] - y0) / dy + 0.5
        scale = []
        shape = self._image.irradiance.shape[1:]
        at = tuple(
            np.clip(np.floor(v).astype(int), 0, n - 1)
            for v, n in zip((row, column), shape, strict=True)
        )
        mm = [self._image.dataset[name].values for name in ("x_mm", "y_mm")]
        for axis in (1, 0):
            after, before = list(at), list(at)
            after[axis] = np.minimum(at[axis] + 1, shape[axis] - 1)
            before[axis] = np.maximum(at[axis] - 1, 0)
            pixels = after[axis] - before[axis]
            across = (each[tuple(after)] - each[tuple(before)].astype(np.float64) for each in mm)
            scale.append(np.hypot(*across) / pixels)
        radius_mm = 0.5e-3 * self._mosaic.aperture_um
        return np.stack([column, row, radius_mm / scale[0], radius_mm / scale[1]], axis=1)

    @property
    def _reach(self) -> float:
        from isetcl.device.cone_apertures import GAUSSIAN_REACH

        return GAUSSIAN_REACH if self._mosaic.aperture_shape == "gaussian" else 1.0

    def shifts(self, gaze_deg: np.ndarray) -> np.ndarray:
        """Columns and rows by which gazes move the receptors over the image, (frames, 2)."""
        (_, dx), (_, dy) = self._axes
        return gaze_deg / np.array([dx, dy])

    def check_inside(self, gaze_deg: np.ndarray) -> None:
        """Raise InvalidInputError if an aperture reaches beyond the image in some frame."""
        moved = self.shifts(gaze_deg)
        low, high = moved.min(axis=0), moved.max(axis=0)
        shape = np.array(self._image.irradiance.shape[:0:-1])
        reach = self._reach * self.apertures[:, 2:]
        # Coordinates may come in single precision; the middle must lie inside in any case.
        slack = np.minimum(1e-6 * shape, 0.5 * reach)
        outside = (self.apertures[:, :2] - reach + low < -slack) | (
            self.apertures[:, :2] + reach + high > shape + slack
        )
        count = int(np.count_nonzero(outside.any(axis=1)))
        if count:
            left, right, bottom, top = self._image.extent_deg
            (x_low, y_low), (x_high, y_high) = self._mosaic.extent_deg
            moves = np.abs(gaze_deg).max()
            raise InvalidInputError(
                f"{count} of {len(self._mosaic)} receptors look beyond the image, which spans "
                f"x {left:.4g} to {right:.4g} and y {bottom:.4g} to {top:.4g} deg; the mosaic "
                f"spans x {x_low:.4g} to {x_high:.4g} and y {y_low:.4g} to {y_high:.4g} deg, and "
                f"the gaze moves by up to {moves:.3g} deg; render a larger fov_deg or use "
                "mosaic.within"
            )

    def check_memory(self, frames: int, precision: Precision) -> None:
        """Raise OutOfMemoryError if the means of so many frames do not fit."""
        size = 4 if precision == "single" else 8
        waves = self._image.irradiance.shape[0]
        means = 2.0 * size * frames * len(self._mosaic)
        efficiencies = 8.0 * 5.0 * min(_MOST_EFFICIENCIES, waves * len(self._mosaic))
        image = 2.0 * size * self._image.irradiance.size * (1.0 + 7.0 / waves)
        check_memory(
            f"means of {frames} frames and {len(self._mosaic)} receptors",
            means + efficiencies + image,
            lambda factor: (
                f"about {max(1, int(frames * factor**2))} frames at a time would fit"
                if frames > 1
                else "take a part of the mosaic at a time, by mosaic.within"
            ),
        )

    @property
    def is_coarse(self) -> bool:
        """Whether pixels are wider than the smallest aperture."""
        return bool(np.any(2.0 * self.apertures[:, 2:].min(axis=0) < 1.0))

    @property
    def coarse_message(self) -> str:
        """What to do about pixels that are too wide."""
        rows, columns = self._image.irradiance.shape[1:]
        wider = 0.5 / self.apertures[:, 2:].min(axis=0)
        enough = np.ceil(np.maximum(1.0, wider) * (columns, rows)).astype(int)
        return (
            f"pixels are up to {wider.max():.2g} times as wide as the smallest aperture "
            f"({self._mosaic.aperture_um.min():.3g} um), so the image is too coarse for these "
            f"receptors; render at least {enough[0]} x {enough[1]} pixels (three times as many "
            "for smooth edges), a smaller field around them, or at=mosaic"
        )

    def rates(self, gaze_deg: np.ndarray, precision: Precision, device: str | None) -> np.ndarray:
        """Mean excitations a second, (frames, receptors)."""
        from isetcl.device.choose import find_device
        from isetcl.device.cone_apertures import ApertureSums

        shifts = self.shifts(gaze_deg)
        rows, columns = self._window(shifts)
        sums = ApertureSums(
            find_device(device),
            self._image.irradiance.values[:, rows, columns],
            is_gaussian=self._mosaic.aperture_shape == "gaussian",
            precision=precision,
        )
        apertures = self.apertures - np.array([columns.start, rows.start, 0.0, 0.0])
        step = max(1, _MOST_EFFICIENCIES // len(self._image.wavelengths_nm))
        parts = [slice(first, first + step) for first in range(0, len(self._mosaic), step)]
        found = [sums.run(apertures[p], self.efficiencies(p), shifts) for p in parts]
        return found[0] if len(found) == 1 else np.concatenate(found, axis=1)

    def _window(self, shifts: np.ndarray) -> tuple[slice, slice]:
        """Rows and columns of the image that apertures reach, with one more on every side."""
        shape = np.array(self._image.irradiance.shape[:0:-1])
        middle, reach = self.apertures[:, :2], self._reach * self.apertures[:, 2:]
        low = np.floor((middle - reach).min(axis=0) + shifts.min(axis=0)) - 1
        high = np.ceil((middle + reach).max(axis=0) + shifts.max(axis=0)) + 1
        first = np.clip(low, 0, shape - 1).astype(int)
        end = np.clip(high, first + 1, shape).astype(int)
        return slice(first[1], end[1]), slice(first[0], end[0])


def mean_segment_factor(
    observer: Observer, wavelengths_nm: np.ndarray, fraction: np.ndarray
) -> np.ndarray:
    """ISETBio's factor of outer segments: L's absorptance over the fovea's, mean of wavelengths.

    A wavelength counts by the width it stands for, so that grids may be uneven.

    Parameters
    ----------
    fraction
        Lengths over that of the fovea, (n,).
    """
    density = observer.optical_densities[0] * observer.absorbances(wavelengths_nm)[0]
    exponent = -np.log(10.0) * density
    share = np.expm1(fraction[:, None] * exponent) / np.expm1(exponent)
    widths = bin_widths(wavelengths_nm)
    return np.asarray(share @ (widths / widths.sum()))
