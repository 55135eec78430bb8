"""The modulation transfer of an image from a slanted edge in it, after ISO 12233."""

from __future__ import annotations

import math

import numpy as np

from isetcl.errors import InvalidInputError, check_choice
from isetcl.eye.model import Eye
from isetcl.eye.waves.otf import check_frequencies
from isetcl.retina.image import RetinalImage
from isetcl.validation.transfer.edge_line import find_edge, turned
from isetcl.validation.transfer.result import Edge, PixelChoice, SlantedEdgeMtf
from isetcl.validation.transfer.source import (
    EdgeSource,
    check_not_clipped,
    check_not_cut,
    source_of,
)
from isetcl.validation.transfer.spread import EdgeFit, fit_edge
from isetcl.validation.transfer.tail import Beyond

__all__ = ["Edge", "SlantedEdgeMtf", "slanted_edge_mtf"]

NYQUIST = 0.5
"""Highest frequency of the pixels, cycles per pixel."""

_FREQUENCIES = 65
_LARGEST_ERROR = 0.1
_HALF = 0.5
_OUTER = 0.5
_NOISY = 1e-4


def slanted_edge_mtf(
    image: RetinalImage | np.ndarray,
    *,
    pitch_deg: float | None = None,
    pitch_mm: float | None = None,
    wavelengths_nm: np.ndarray | None = None,
    standard_error: np.ndarray | None = None,
    frequency_cpd: np.ndarray | list[float] | None = None,
    weights: np.ndarray | list[float] | None = None,
    region: tuple[int, int, int, int] | None = None,
    is_curved: bool = True,
    pixel: PixelChoice = "remove",
    eye: Eye | None = None,
) -> SlantedEdgeMtf:
    """The modulation transfer across a slanted edge, by wavelength and photopic.

    The edge is found, its line fitted to a part of a pixel, the pixels beside it ordered by their
    distance from it, and a smooth function of the distance fitted to them: the edge spread
    function. Its derivative under a window is the line spread function, whose Fourier transform,
    1 at frequency 0, is the transfer. Noise does not raise it: what it adds to the modulus is
    subtracted.

    Parameters
    ----------
    image
        A retinal image, or an array (rows, columns) or (wavelengths, rows, columns).
    pitch_deg, pitch_mm
        Side of a pixel of an array, in degrees and in mm on the retina; at least one of them.
    wavelengths_nm
        Wavelengths of an array, nm.
    standard_error
        Standard error of the pixels of an array, of its shape or one number; None estimates it from
        how the pixels scatter about the edge spread function.
    frequency_cpd
        Frequencies, cycles/degree (per mm, where only `pitch_mm` is known), up to half a cycle per
        pixel; None is 65 of them, from 0 to there.
    weights
        Weight of every wavelength in the photopic image; None is V(lambda) times the step.
    region
        Part of the image: first row, row after the last, first column, column after the last. None
        finds the edge in the whole image.
    is_curved
        Fit a parabola to the edge, since a retina shows straight lines slightly curved; False fits
        a straight line.
    pixel
        ``"remove"`` divides by the transfer of square pixels, sinc(f cos a) sinc(f sin a), and
        gives that of the eye alone; ``"keep"`` leaves it in, as cameras are measured.
    eye
        The eye of the image, for cycles/mm; None takes it from the image.

    Raises
    ------
    InvalidInputError
        If there is no edge, or it is too vertical, too short, too noisy or saturated; if pixels are
        NaN or not square; the message says which.

    Notes
    -----
    Where the transfer is smaller than about twice its standard error, noise still raises it.
    Brightness that changes evenly along the edge, on each side by itself, is allowed for. An image
    of floating-point numbers that was clipped on both sides, and without noise, cannot be told from
    a sharper edge.

    Light that the edge spreads beyond the region is not seen; left out, a share s of it raises the
    transfer by up to 1.8 s. Diffraction by a round pupil with cut-off f_c (cycles/degree) spreads
    0.13 / (f_c w) of the light beyond w degrees from the edge. The share is found from how the edge
    spread function approaches its levels in the outer part of the region, and put back; `beyond`
    tells it. This takes it that out there the blur is that of a pupil's rim, whose line spread
    falls as 1 / x^2, or nil, and that both sides are evenly lit. Where the share is larger than
    0.035, or the outer part surely shows another fall, a warning names the width that is needed.

    Source: ISO 12233:2017, annex D; the fit of a spline in place of means over bins is our own, see
    `isetcl.validation.transfer.spread`.
    """
    check_choice("pixel", pixel, ("remove", "keep"))
    source = source_of(
        image,
        pitch_deg=pitch_deg,
        pitch_mm=pitch_mm,
        wavelengths_nm=wavelengths_nm,
        standard_error=standard_error,
        weights=weights,
        eye=eye,
        region=region,
    )
    line = find_edge(source.brightness, source.name)
    image_turned = turned(source.brightness, line.is_turned)
    found = fit_edge(image_turned, line, is_curved)
    _check_clipped(found, image_turned, source.name, isinstance(image, RetinalImage))
    return _measure(source, found, frequency_cpd, pixel)


def _measure(
    source: EdgeSource,
    found: EdgeFit,
    frequency_cpd: np.ndarray | list[float] | None,
    pixel: PixelChoice,
) -> SlantedEdgeMtf:
    normal, place = _normal(found), _place(source, found)
    per_deg, per_mm = source.scale.cycles(normal, place)
    unit = per_deg if per_deg is not None else per_mm
    assert unit is not None
    if frequency_cpd is None:
        frequency = np.linspace(0.0, NYQUIST, _FREQUENCIES)
    else:
        frequency = check_frequencies(frequency_cpd) / unit
        if len(frequency) == 0:
            raise InvalidInputError("frequency_cpd must hold a frequency, got an empty list")
        if np.any(frequency > NYQUIST * (1.0 + 1e-9)):
            raise InvalidInputError(
                f"frequency_cpd must be at most {NYQUIST * unit:.4g}, half a cycle per pixel, got "
                f"{np.max(frequency) * unit:.4g}; render smaller pixels"
            )
    passed = np.sinc(frequency * normal[0]) * np.sinc(frequency * normal[1])
    if pixel == "keep":
        passed = np.ones_like(passed)
    # Frequency 0 comes first, for the normalisation.
    onto = found.transfer_map(np.concatenate([[0.0], frequency]))
    images = [(turned(source.brightness, found.line.is_turned), source.brightness_error)]
    if len(source.values) > 1 or source.brightness is not source.values[0]:
        errors = [None] * len(source.values) if source.errors is None else list(source.errors)
        images += [
            (turned(values, found.line.is_turned), error)
            for values, error in zip(source.values, errors, strict=True)
        ]
    results = []
    for values, error in images:
        used = found.levelled(values[found.pixels])
        variance = _variance(found, used, error)
        results.append(_transfer(found, onto, used, variance, passed))
    whole = results[0]
    beyond = _beyond(found, images[0][0], source.brightness_error)
    beyond.warn(found.reach, source.name, stacklevel=4)
    _check_noise(found, frequency, *whole)
    spectral = results[1:] if len(results) > 1 else results
    frequency_in_unit = frequency * unit
    mtf50, mtf50_error = _half(frequency_in_unit, *whole)
    distance, spread = _profile(found, images[0][0])
    return SlantedEdgeMtf(
        frequency_cpd=None if per_deg is None else frequency * per_deg,
        frequency_cpmm=None if per_mm is None else frequency * per_mm,
        frequency_cpp=frequency,
        wavelengths_nm=source.wavelengths_nm,
        mtf=np.stack([each[0] for each in spectral]),
        standard_error=np.stack([each[1] for each in spectral]),
        photopic_mtf=whole[0],
        photopic_standard_error=whole[1],
        mtf50_cpd=mtf50 if per_deg is not None else math.nan,
        mtf50_standard_error_cpd=mtf50_error if per_deg is not None else math.nan,
        edge=_edge(found, images[0][0], place),
        beyond=beyond.share,
        beyond_standard_error=beyond.standard_error,
        distance_deg=distance / unit,
        edge_spread=spread,
        pixel=pixel,
    )


def _check_clipped(found: EdgeFit, image: np.ndarray, name: str, is_traced: bool) -> None:
    values = image[found.pixels]
    spread = found.spline(values)
    low, high = found.sides(spread)
    away = found.distance * np.sign(high - low) / found.reach
    # The median overlooks a corner of something else.
    left = np.abs(values - spread(found.distance))
    scatter = max(float(np.median(left[side * away > _OUTER])) for side in (-1.0, 1.0))
    check_not_clipped(values[away > _OUTER], name, scatter > _NOISY * abs(high - low))
    # Rays may find no light in a pixel, and little in the next.
    if not is_traced:
        check_not_cut(values[away < -_OUTER], name)


def _normal(found: EdgeFit) -> np.ndarray:
    """Unit vector across the edge, right and up, in pixels, (2,)."""
    slope, cosine = found.line.coefficients[1], found.line.cosine
    across = np.array([cosine, -slope * cosine])
    return across[::-1] if found.line.is_turned else across


def _place(source: EdgeSource, found: EdgeFit) -> tuple[float, float]:
    """Where the middle of the edge lies, in the frame of the image."""
    t, s = found.line.middle, float(found.line.at(found.line.middle))
    rows = source.brightness.shape[0]
    row, column = (rows - 1 - s, t) if found.line.is_turned else (rows - 1 - t, s)
    return source.scale.place(row, column)


def _variance(found: EdgeFit, used: np.ndarray, error: np.ndarray | None) -> np.ndarray:
    """Variance of the pixels used, (n,): as told, or as they scatter on each side of the edge."""
    if error is not None:
        return np.square(turned(error, found.line.is_turned)[found.pixels], dtype=np.float64)
    left = used - found.spline(used)(found.distance)
    freedom = max(1.0 - found.basis.shape[1] / len(used), 0.1)
    right = found.distance > 0
    return np.where(right, np.mean(left[right] ** 2), np.mean(left[~right] ** 2)) / freedom


def _beyond(found: EdgeFit, values: np.ndarray, error: np.ndarray | None) -> Beyond:
    """Light beyond the region, of a turned image."""
    used = found.levelled(values[found.pixels])
    return found.beyond(used, _variance(found, used, error))


def _transfer(
    found: EdgeFit, onto: np.ndarray, values: np.ndarray, variance: np.ndarray, passed: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Transfer and its standard error, (f,) both.

    The modulus of a noisy number z is too large by the variance of its part at right angles to z;
    this is taken from its square.
    """
    from scipy.sparse import diags_array

    transform = onto @ (found.basis.T @ values)
    step, transform = transform[0].real, transform[1:]
    size = np.abs(transform)
    turn = np.where(size > 0, transform / np.where(size > 0, size, 1.0), 1.0)
    along = (np.conj(turn)[:, None] * onto[1:]) / step
    covariance = found.basis.T @ diags_array(variance) @ found.basis
    across = along.imag
    aside = np.sum((covariance @ across.T).T * across, axis=1)
    raw = size / abs(step)
    mtf = np.sqrt(np.maximum(raw**2 - aside, 0.0))
    relative = along.real - raw[:, None] * np.sign(step) * onto[0].real / abs(step)
    error = np.sqrt(np.sum((covariance @ relative.T).T * relative, axis=1))
    return mtf / passed, error / passed


def _check_noise(found: EdgeFit, frequency: np.ndarray, mtf: np.ndarray, error: np.ndarray) -> None:
    low = frequency <= NYQUIST / 2.0
    worst = float(np.sqrt(np.mean(np.square(error[low])))) if np.any(low) else float(np.max(error))
    if not worst <= _LARGEST_ERROR:
        raise InvalidInputError(
            f"the edge is too noisy: its transfer would have a standard error of {worst:.2g}, more "
            f"than {_LARGEST_ERROR:g}; take more samples, or a longer edge than "
            f"{found.line.rows[1] - found.line.rows[0]} pixels"
        )


def _half(frequency: np.ndarray, mtf: np.ndarray, error: np.ndarray) -> tuple[float, float]:
    """Where the transfer first falls to a half, with its standard error; NaN if it does not."""
    below = mtf <= _HALF
    surely = np.flatnonzero(mtf <= _HALF - 2.0 * error)
    end = int(surely[0]) if len(surely) else len(mtf) - 1
    # Noise may cross the line several times; the middle crossing is no earlier than it should be.
    crossings = 1 + np.flatnonzero(below[1 : end + 1] != below[:end])
    if below[0] or len(crossings) == 0:
        return math.nan, math.nan
    i = int(crossings[(len(crossings) - 1) // 2])
    fall = (mtf[i] - mtf[i - 1]) / (frequency[i] - frequency[i - 1])
    at = float(frequency[i - 1] + (_HALF - mtf[i - 1]) / fall)
    first, last = i - 1, i
    # A slope over a stretch that noise cannot turn round.
    while mtf[first] - mtf[last] < 4.0 * error[i] and (first > 0 or last < len(mtf) - 1):
        first, last = max(first - 1, 0), min(last + 1, len(mtf) - 1)
    steep = abs((mtf[last] - mtf[first]) / (frequency[last] - frequency[first]))
    return at, float(np.interp(at, frequency, error) / steep)


def _profile(found: EdgeFit, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The edge spread function at its knots, from 0 to 1, and their distances in pixels."""
    spread = found.spline(found.levelled(values[found.pixels]))
    distance = np.linspace(-found.reach, found.reach, round(8 * found.reach) + 1)[1:-1]
    low, high = found.levels(spread)
    height = (spread(distance) - low) / (high - low)
    return distance, np.asarray(height)


def _edge(found: EdgeFit, image: np.ndarray, place: tuple[float, float]) -> Edge:
    line = found.line
    values = found.levelled(image[found.pixels])
    spread = found.spline(values)
    low, high = sorted(found.levels(spread))
    along = math.degrees(math.atan(line.coefficients[1]))
    angle = -along if not line.is_turned else (along - 90.0 if along > 0 else along + 90.0)
    length = line.rows[1] - line.rows[0]
    left = values - spread(found.distance)
    return Edge(
        angle_deg=angle,
        position=place,
        bend_px=line.coefficients[2] * line.cosine * (length / 2.0) ** 2,
        rows=length,
        half_width_px=line.half_width,
        contrast=(high - low) / (high + low) if high + low > 0 else math.nan,
        knots_per_pixel=found.knots_per_pixel,
        noise=float(np.std(left)) / (high - low),
    )
