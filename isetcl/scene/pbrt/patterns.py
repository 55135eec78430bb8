"""What PBRT's textures amount to: sums of spectra times products of simple patterns.

PBRT nests textures (scale, mix, checkerboards of images); isetcl has one texture a surface. A
pattern keeps the sum that a nest of textures stands for, from which the simplest material that
shows it is made.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.scene.material import Mix, Scattering
from isetcl.scene.pbrt.places import Notes, Place
from isetcl.scene.pbrt.spectra import common_grid
from isetcl.scene.texture import Checkerboard, Image, Texture
from isetcl.spectrum import Spectrum

Factor = Checkerboard | Image
Make = Callable[["Spectrum | tuple[Spectrum, ...]", "Texture | None"], Scattering]
MAX_TERMS = 64
IMAGES = "textures of images that do not match, replaced by their mean"


@dataclass(frozen=True, eq=False)
class Term:
    """A spectrum, or a number in a grey pattern, times grey factors."""

    value: Spectrum | float
    factors: tuple[Factor, ...] = ()


@dataclass(frozen=True, eq=False)
class Pattern:
    """A sum of terms; no terms are black."""

    terms: tuple[Term, ...]
    place: Place

    def __post_init__(self) -> None:
        if len(self.terms) > MAX_TERMS:
            raise InvalidInputError(
                f"textures must combine at most {MAX_TERMS} others, got {len(self.terms)}"
            )

    @property
    def is_constant(self) -> bool:
        """Whether it is the same everywhere."""
        return all(not term.factors for term in self.terms)

    def value(self) -> float:
        """The value of a constant grey pattern."""
        return float(sum(_number(term.value) for term in self.terms))

    def times(self, other: Pattern) -> Pattern:
        """The product of two patterns."""
        return Pattern(
            tuple(
                Term(_product(a.value, b.value), a.factors + b.factors)
                for a in self.terms
                for b in other.terms
            ),
            self.place,
        )

    def plus(self, other: Pattern) -> Pattern:
        """The sum of two patterns."""
        return Pattern(self.terms + other.terms, self.place)

    def complement(self) -> Pattern | None:
        """1 minus a grey pattern; None where that is no simple pattern."""
        if self.is_constant:
            return constant(max(0.0, 1.0 - self.value()), self.place)
        if len(self.terms) != 1 or len(self.terms[0].factors) != 1:
            return None
        amount, factor = _number(self.terms[0].value), self.terms[0].factors[0]
        if isinstance(factor, Checkerboard):
            values = [max(0.0, 1.0 - amount * v) for v in (factor.bright, factor.dark)]
            factor = dataclasses.replace(factor, bright=values[0], dark=values[1])
        else:
            texels = np.maximum(1.0 - np.float32(amount) * factor.texels, 0.0)
            factor = dataclasses.replace(factor, texels=texels)
        return Pattern((Term(1.0, (factor,)),), self.place)

    def mean(self) -> float:
        """About the mean of a grey pattern."""
        total = 0.0
        for term in self.terms:
            total += _number(term.value) * float(np.prod([f.mean for f in term.factors]))
        return total


def constant(value: Spectrum | float, place: Place) -> Pattern:
    """The same everywhere."""
    return Pattern((Term(value),), place)


def level(pattern: Pattern, notes: Notes, place: Place) -> float | Texture:
    """A grey pattern as a number or a grey texture."""
    if pattern.is_constant:
        return pattern.value()
    checkers = _checker_grids(pattern.terms)
    images = [f for term in pattern.terms for f in term.factors if isinstance(f, Image)]
    if len(checkers) == 1 and not images:
        (periods,) = checkers
        bright, dark = (
            sum(_number(term.value) for term in _resolved(pattern.terms, periods, side))
            for side in (True, False)
        )
        return Checkerboard(*periods, float(bright), float(dark))
    if not checkers:
        channels = _channels(pattern.terms, notes, place)
        first = channels[0][1]
        texels = sum(np.float32(_number(value)) * image.texels for value, image in channels)
        return dataclasses.replace(first, texels=np.asarray(texels))
    notes.add("grey textures of checkerboards and images, replaced by their mean", "mean", place)
    return pattern.mean()


def surface(pattern: Pattern, make: Make, notes: Notes, *, textured: bool = True) -> Scattering:
    """The material that a pattern of a reflectance makes.

    Parameters
    ----------
    pattern
        Spectra and factors.
    make
        Makes the material from spectra and a texture.
    notes
        Takes what could not be kept.
    textured
        Whether `make` takes textures; where not, images are replaced by their mean.
    """
    terms = pattern.terms
    checkers = _checker_grids(terms)
    if checkers:
        return _checked(pattern, checkers[0], make, notes, textured)
    if pattern.is_constant:
        return make(_limited((_sum(terms),), 1.0, notes, pattern.place)[0], None)
    channels = _channels(terms, notes, pattern.place)
    if not textured:
        notes.add("images on mirrors, replaced by their mean", "mean", pattern.place)
        means = tuple(Term(_product(value, image.mean)) for value, image in channels)
        return make(_limited((_sum(means),), 1.0, notes, pattern.place)[0], None)
    spectra = tuple(_spectral(value) for value, _ in channels)
    first = channels[0][1]
    if len(channels) == 1:
        return make(_limited(spectra, first.largest, notes, pattern.place)[0], first)
    texels = np.stack([image.texels for _, image in channels], axis=-1)
    if _peak(spectra, float(texels.max())) > 1.0:
        # Materials bound a reflectance by the largest weight of any channel: make all alike.
        most = [max(float(image.texels.max()), 1e-30) for _, image in channels]
        texels = texels / np.array(most, dtype=np.float32)
        spectra = tuple(s.scaled(m) for s, m in zip(spectra, most, strict=True))
    spectra = _limited(spectra, float(texels.max()), notes, pattern.place)
    return make(spectra, dataclasses.replace(first, texels=texels))


def _limited(
    spectra: tuple[Spectrum, ...], largest: float, notes: Notes, place: Place
) -> tuple[Spectrum, ...]:
    """Reflectances scaled down where, times the largest weight, they exceed 1."""
    peak = _peak(spectra, largest)
    if peak <= 1.0 + 1e-5:
        return spectra
    notes.add("reflectances above 1, scaled down", f"by {peak:.3g}", place)
    return tuple(s.scaled(1.0 / peak) for s in spectra)


def _peak(spectra: tuple[Spectrum, ...], largest: float) -> float:
    """The largest sum of spectra times a weight."""
    grid = common_grid(spectra)
    return largest * float(np.max(np.asarray(sum(s.at(grid) for s in spectra))))


def _checked(
    pattern: Pattern, periods: tuple[float, float], make: Make, notes: Notes, textured: bool
) -> Scattering:
    """A checkerboard: as a texture where one spectrum is enough, else two materials in turn."""
    terms = pattern.terms
    if textured and len(terms) == 1 and len(terms[0].factors) == 1:
        only = _spectral(terms[0].value)
        return make(
            _limited((only,), terms[0].factors[0].largest, notes, pattern.place)[0],
            terms[0].factors[0],
        )
    bright, dark = (
        Pattern(_resolved(terms, periods, side), pattern.place) for side in (True, False)
    )
    if textured and bright.is_constant and dark.is_constant:
        one = _proportional(_sum(bright.terms), _sum(dark.terms))
        if one is not None:
            limited = _limited((one[0],), 1.0, notes, pattern.place)[0]
            return make(limited, Checkerboard(*periods, one[1], one[2]))
    return Mix(
        surface(dark, make, notes, textured=textured),
        surface(bright, make, notes, textured=textured),
        Checkerboard(*periods),
    )


def _checker_grids(terms: tuple[Term, ...]) -> list[tuple[float, float]]:
    """The different checkerboards that occur, without their values."""
    grids = [
        (factor.periods_u, factor.periods_v)
        for term in terms
        for factor in term.factors
        if isinstance(factor, Checkerboard)
    ]
    return list(dict.fromkeys(grids))


def _resolved(
    terms: tuple[Term, ...], periods: tuple[float, float], is_bright: bool
) -> tuple[Term, ...]:
    """The terms on one kind of field of a checkerboard; those that vanish are left out."""
    result = []
    for term in terms:
        value, rest = term.value, []
        for factor in term.factors:
            same = isinstance(factor, Checkerboard) and (
                (factor.periods_u, factor.periods_v) == periods
            )
            if isinstance(factor, Checkerboard) and same:
                value = _product(value, factor.bright if is_bright else factor.dark)
            else:
                rest.append(factor)
        if not _is_zero(value):
            result.append(Term(value, tuple(rest)))
    return tuple(result)


def _channels(
    terms: tuple[Term, ...], notes: Notes, place: Place
) -> list[tuple[Spectrum | float, Image]]:
    """Terms without checkerboards as values times images that all cover the surface alike."""
    images = [f for term in terms for f in term.factors if isinstance(f, Image)]
    first = max(images, key=lambda image: image.texels.size)
    result: list[tuple[Spectrum | float, Image]] = []
    for term in terms:
        value = term.value
        texels = np.ones(first.shape, dtype=np.float32)
        for factor in term.factors:
            assert isinstance(factor, Image)
            if _lies_like(factor, first):
                texels = texels * _resized(factor.texels, first.shape)
            else:
                notes.add(IMAGES, factor.name, place)
                value = _product(value, factor.mean)
        result.append((value, dataclasses.replace(first, texels=texels)))
    return result


def _lies_like(image: Image, other: Image) -> bool:
    a = (image.wrap, image.repeats, image.offset)
    return a == (other.wrap, other.repeats, other.offset)


def _resized(texels: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    if texels.shape == shape:
        return texels
    from skimage.transform import resize

    return np.asarray(resize(texels, shape, order=1, mode="edge", anti_aliasing=False))


def _number(value: Spectrum | float) -> float:
    assert not isinstance(value, Spectrum)
    return float(value)


def _spectral(value: Spectrum | float) -> Spectrum:
    return value if isinstance(value, Spectrum) else Spectrum.constant(value)


def _is_zero(value: Spectrum | float) -> bool:
    return not np.any(value.values) if isinstance(value, Spectrum) else value == 0.0


def _product(a: Spectrum | float, b: Spectrum | float) -> Spectrum | float:
    if isinstance(a, Spectrum) and isinstance(b, Spectrum):
        grid = common_grid((a, b))
        return Spectrum(grid, a.at(grid) * b.at(grid), f"{a.name} times {b.name}")
    if isinstance(a, Spectrum):
        return a if b == 1.0 else a.scaled(float(b))  # type: ignore[arg-type]
    if isinstance(b, Spectrum):
        return b if a == 1.0 else b.scaled(float(a))
    return float(a) * float(b)


def _sum(terms: tuple[Term, ...]) -> Spectrum:
    """The sum of terms without factors."""
    spectra = tuple(_spectral(term.value) for term in terms)
    if not spectra:
        return Spectrum.constant(0.0, "black")
    if len(spectra) == 1:
        return spectra[0]
    grid = common_grid(spectra)
    values = sum(s.at(grid) for s in spectra)
    return Spectrum(grid, np.asarray(values), spectra[0].name)


def _proportional(bright: Spectrum, dark: Spectrum) -> tuple[Spectrum, float, float] | None:
    """One spectrum with the weights that make two of it, if they are proportional."""
    grid = common_grid((bright, dark))
    a, b = bright.at(grid), dark.at(grid)
    if not a.any():
        return dark, 0.0, 1.0
    peak = int(np.argmax(a))
    ratio = float(b[peak] / a[peak])
    if not np.allclose(b, ratio * a, rtol=1e-9, atol=0):
        return None
    return (bright, 1.0, ratio) if ratio <= 1.0 else (dark, 1.0 / ratio, 1.0)
