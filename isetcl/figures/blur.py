"""How large the blur of one object in a retinal image is: the disc that explains it best.

The image is compared with a sharp one of the same scene and grid (through a pupil of a tenth of a
millimetre), convolved with discs: the best diameter and gain in the least-squares sense, over the
pixels of the object and its surroundings.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.figures.result import Row, near
from isetcl.spectrum import luminous_efficiency
from isetcl.units import ARCMIN_PER_DEG

if TYPE_CHECKING:
    from isetcl.eye.model import Eye
    from isetcl.figures.quality import Quality
    from isetcl.retina.image import RetinalImage
    from isetcl.scene.model import Scene

SHARP_PUPIL_MM = 0.1
_STEPS = 48
SPOT_SOURCE = "spots on the axis, traced on the host (the paper prints no number)"
_TOLERANCE = 0.15  # of the blur: what is occluded, and depth within an object
_PIXEL_TOLERANCE = 0.6  # of a pixel: blur that is not much larger cannot be told
_SMALLEST_PIXELS = 0.3
_AROUND = (0.97, 1.0, 1.03)
_MOST_GROWTH = 8
_OTF_NODES = 200
_OTF_RINGS = 16
_WAVELENGTHS_NM = np.arange(450.0, 651.0, 50.0)


def brightness(image: RetinalImage) -> tuple[np.ndarray, np.ndarray]:
    """Illuminance of every pixel and its standard error, lux, each (rows, columns)."""
    return image.brightness()


@dataclass(frozen=True, eq=False)
class SharpView:
    """A scene through a tiny pupil: where its objects are, and how they look without blur.

    Attributes
    ----------
    signal
        What is compared with the image, (rows, columns).
    variance
        Of its noise, (rows, columns).
    masks
        By name of the object, the pixels that show it, (rows, columns).
    pitch_arcmin
        Side of a pixel.
    """

    signal: np.ndarray
    variance: np.ndarray
    masks: dict[str, np.ndarray]
    pitch_arcmin: float


def sharp_view(
    quality: Quality,
    scene: Scene,
    eye: Eye,
    signal: Callable[[RetinalImage], tuple[np.ndarray, np.ndarray]] = brightness,
    **options: Any,
) -> SharpView:
    """The scene on the grid of the options of `render`, without blur.

    `signal` makes one number a pixel of an image, and its standard error.
    """
    image = quality.render(scene, eye.with_pupil(SHARP_PUPIL_MM), layers=True, **options)
    numbers = image.dataset["object"].values
    masks = {item.name: numbers == i for i, item in enumerate(scene.objects)}
    value, error = signal(image)
    pitch = pitch_arcmin(image)
    return SharpView(value.astype(np.float64), error.astype(np.float64) ** 2, masks, pitch)


def pitch_arcmin(image: RetinalImage) -> float:
    """Side of a pixel, arcmin."""
    x = image.dataset["x"].values
    return float(abs(x[1] - x[0])) * ARCMIN_PER_DEG


def blur_arcmin(seen: np.ndarray, sharp: SharpView, name: str, most_arcmin: float) -> float:
    """Diameter of the disc that blurs an object of the sharp view as the image shows it, arcmin.

    Parameters
    ----------
    seen
        The image, (rows, columns), of the kind of the sharp view's signal.
    most_arcmin
        Largest diameter to look for.

    Raises
    ------
    InvalidInputError
        If no pixel shows the object.
    """
    place = _Place.of(sharp, name, most_arcmin)
    return place.best_disc(seen[place.window], sharp.variance[place.window]) * sharp.pitch_arcmin


def blur_error_arcmin(
    seen: np.ndarray,
    seen_variance: np.ndarray,
    sharp: SharpView,
    name: str,
    most_arcmin: float,
    found_arcmin: float,
) -> float:
    """Standard error of `blur_arcmin` by the noise of the image and of the sharp view, arcmin."""
    place = _Place.of(sharp, name, most_arcmin)
    window = place.window
    return (
        place.disc_error(
            seen[window],
            seen_variance[window],
            sharp.variance[window],
            found_arcmin / sharp.pitch_arcmin,
        )
        * sharp.pitch_arcmin
    )


def expected_blur_arcmin(
    eye: Eye,
    sharp: SharpView,
    name: str,
    distance_m: float,
    most_arcmin: float,
    wavelengths_nm: np.ndarray = _WAVELENGTHS_NM,
) -> float:
    """The same for the sharp view convolved with the ray-traced spots of one distance, arcmin.

    Spots of the axis in light of equal energy, traced in double precision on the host: a second
    algorithm, right where nothing stands behind or before the object.
    """
    place = _Place.of(sharp, name, most_arcmin)
    nodes = np.linspace(0.0, float(place.frequency.max()), _OTF_NODES)
    transfer = _spot_transfer(eye, nodes / sharp.pitch_arcmin, distance_m, wavelengths_nm)
    seen = place.filtered(np.interp(place.frequency, nodes, transfer))
    return place.best_disc(seen, np.zeros_like(seen)) * sharp.pitch_arcmin


def _spot_transfer(
    eye: Eye, per_arcmin: np.ndarray, distance_m: float, wavelengths_nm: np.ndarray
) -> np.ndarray:
    """Photopic transfer, averaged over directions, of the spots of a point on the axis."""
    from scipy.special import j0

    weights = luminous_efficiency(wavelengths_nm)
    total = np.zeros(len(per_arcmin))
    for nm, weight in zip(wavelengths_nm, weights / weights.sum(), strict=True):
        rays = eye.spot(0.0, float(nm), object_distance_m=distance_m, rings=_OTF_RINGS)
        radius = np.hypot(rays.x_arcmin, rays.y_arcmin)
        total += weight * (j0(2.0 * np.pi * np.outer(per_arcmin, radius)) @ rays.weights)
    return total


@dataclass(frozen=True, eq=False)
class _Place:
    """The surroundings of an object, ready to be blurred.

    Attributes
    ----------
    window
        Rows and columns of the image.
    judged
        Pixels that count, within the window.
    spectrum, frequency
        Fourier transform of the sharp window, and its frequencies in cycles/pixel.
    most_pixels
        Largest diameter to look for.
    """

    window: tuple[slice, slice]
    judged: np.ndarray
    spectrum: np.ndarray
    frequency: np.ndarray
    most_pixels: float

    @classmethod
    def of(cls, sharp: SharpView, name: str, most_arcmin: float) -> _Place:
        from scipy.ndimage import binary_dilation

        mask = sharp.masks[name]
        if not mask.any():
            raise InvalidInputError(f"no pixel shows {name!r}; raise the resolution")
        most = most_arcmin / sharp.pitch_arcmin
        reach = max(2, math.ceil(most / 2.0))
        # Twice the reach: the edge of the cut-out must not blur into the region that is judged.
        window = _window(mask, 2 * reach + 2)
        source = sharp.signal[window]
        grown = binary_dilation(mask[window], iterations=min(reach, _MOST_GROWTH))
        fy = np.fft.fftfreq(source.shape[0])[:, None]
        fx = np.fft.rfftfreq(source.shape[1])[None, :]
        return cls(window, grown, np.fft.rfft2(source), np.hypot(fx, fy), most)

    def filtered(self, transfer: np.ndarray) -> np.ndarray:
        """The sharp window after a transfer function."""
        return np.fft.irfft2(self.spectrum * transfer, s=self.judged.shape)

    def best_disc(self, seen: np.ndarray, variance: np.ndarray) -> float:
        """Diameter in pixels of the disc that makes the window what is seen.

        A disc also smooths the noise of the sharp view; what that takes from the misfit is put
        back, or else the disc would come out too large.
        """
        truth, noise = seen[self.judged], float(variance[self.judged].sum())

        def misfit(log_diameter: float) -> float:
            transfer = disc_transfer(self.frequency * math.exp(log_diameter))
            blurred = self.filtered(transfer)[self.judged]
            gain = float(blurred @ truth) / float(blurred @ blurred)
            kept = gain**2 * noise * float(np.mean(transfer**2))
            return float(np.sum((truth - gain * blurred) ** 2)) - kept

        return float(math.exp(_least(misfit, self.most_pixels)))

    def disc_error(
        self, seen: np.ndarray, seen_variance: np.ndarray, variance: np.ndarray, diameter: float
    ) -> float:
        """Standard error of the diameter in pixels, with that of the gain, to first order.

        The misfit is least where its slope J^T (truth - gain blurred) is 0.
        """
        near = [self.filtered(disc_transfer(self.frequency * diameter * e)) for e in _AROUND]
        judged = self.judged
        size = float(np.sum(near[1][judged] ** 2))
        gain = float(seen[judged] @ near[1][judged]) / size
        slope = (near[2] - near[0]) / math.log(_AROUND[2] / _AROUND[0])
        share = float(np.sum((slope * near[1])[judged])) / size
        jacobian = np.where(judged, gain * (slope - share * near[1]), 0.0)
        transfer = disc_transfer(self.frequency * diameter)
        spread = np.fft.irfft2(np.fft.rfft2(jacobian) * transfer, s=judged.shape)
        noise = float(np.sum(jacobian**2 * seen_variance + gain**2 * spread**2 * variance))
        return diameter * math.sqrt(noise) / float(np.sum(jacobian**2))


def _least(misfit: Callable[[float], float], most_pixels: float) -> float:
    """Logarithm of the diameter at which a misfit is least."""
    from scipy.optimize import minimize_scalar

    tries = np.linspace(math.log(_SMALLEST_PIXELS), math.log(most_pixels), _STEPS)
    best = int(np.argmin([misfit(t) for t in tries]))
    low, high = tries[max(best - 1, 0)], tries[min(best + 1, _STEPS - 1)]
    return float(minimize_scalar(misfit, bounds=(low, high), method="bounded").x)


def disc_transfer(cycles_per_diameter: np.ndarray) -> np.ndarray:
    """Transfer of an even disc: 2 J1(pi f b) / (pi f b), same shape as the input."""
    from scipy.special import j1

    z = np.pi * np.asarray(cycles_per_diameter, dtype=np.float64)
    safe = np.where(z > 0.0, z, 1.0)
    return np.asarray(np.where(z > 0.0, 2.0 * j1(safe) / safe, 1.0))


@dataclass(frozen=True)
class ObjectBlur:
    """Blur of an object in an image, and what spots on the axis give for it, arcmin.

    Attributes
    ----------
    name, distance_m
        The object and its distance from the corneal vertex along the axis.
    found_arcmin, expected_arcmin
        Diameter of the disc in the image, and for the spots.
    tolerance_arcmin
        By how much the two may differ.
    source
        Where the expected one is from.
    """

    name: str
    distance_m: float
    found_arcmin: float
    expected_arcmin: float
    tolerance_arcmin: float
    source: str = SPOT_SOURCE

    def row(self, what: str) -> Row:
        """The blur beside that of the spots."""
        return near(
            f"blur of {self.name}, {what}",
            self.found_arcmin,
            self.expected_arcmin,
            self.tolerance_arcmin,
            self.source,
            unit="arcmin",
        )


def object_blurs(
    seen: np.ndarray,
    sharp: SharpView,
    eye: Eye,
    distances_m: Mapping[str, float],
    most_arcmin: float,
    wavelengths_nm: np.ndarray = _WAVELENGTHS_NM,
) -> list[ObjectBlur]:
    """The blur of some objects, by name, with their distances along the axis.

    `seen` is the image, of the kind of the sharp view's signal; the wavelengths are those that
    make it up, weighted by V(lambda).
    """
    found = []
    for name, distance in distances_m.items():
        expected = expected_blur_arcmin(eye, sharp, name, distance, most_arcmin, wavelengths_nm)
        found.append(
            ObjectBlur(
                name,
                distance,
                blur_arcmin(seen, sharp, name, most_arcmin),
                expected,
                _TOLERANCE * expected + _PIXEL_TOLERANCE * sharp.pitch_arcmin,
            )
        )
    return found


def _window(mask: np.ndarray, margin: int) -> tuple[slice, slice]:
    """The rows and columns of a mask and a margin around it."""
    sides = []
    for axis in (1, 0):
        used = np.flatnonzero(mask.any(axis=axis))
        sides.append(slice(max(int(used[0]) - margin, 0), int(used[-1]) + margin + 1))
    return sides[0], sides[1]
