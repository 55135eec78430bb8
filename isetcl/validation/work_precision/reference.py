"""What methods are judged by: an image of known error that shares nothing with them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from isetcl.device.choose import find_device
from isetcl.errors import InvalidInputError, check_array, check_positive, check_type
from isetcl.eye.model import Eye
from isetcl.render.goal import MAX_SPP
from isetcl.render.interrupt import check_complete
from isetcl.render.render import render
from isetcl.retina.cone_noise import ConeNoise
from isetcl.retina.image import RetinalImage
from isetcl.scene.model import Scene
from isetcl.validation.work_precision.cone_units import mean_excitations
from isetcl.validation.work_precision.method import ImageLike
from isetcl.validation.work_precision.pixels import Pixels, Quantity, pixels_of

LEAST_FACTOR = 64
"""Samples of the reference over the most of any method: its error is then small beside theirs."""

SEED_OFFSET = 1_000_003
_FEWEST_SAMPLES = 4096


@dataclass(frozen=True, eq=False)
class Reference:
    """An image with its standard error.

    Attributes
    ----------
    image : RetinalImage or ndarray
    standard_error : ndarray or float or None
        Of a plain array, of its shape; None is that of a `RetinalImage`, or none.
    text
        What it is, for the record.
    mean_excitations
        Of a plain array: excitations, within its integration time, of a cone where the array has
        its mean; for errors in units of cone noise. A `RetinalImage` tells them itself.
    """

    image: ImageLike
    standard_error: np.ndarray | float | None = None
    text: str = "given"
    mean_excitations: float | None = None

    def __post_init__(self) -> None:
        check_type("image of the reference", self.image, (RetinalImage, np.ndarray))
        check_type("text", self.text, str)
        if self.mean_excitations is not None:
            check_positive("mean_excitations", self.mean_excitations)
            if isinstance(self.image, RetinalImage):
                raise InvalidInputError(
                    "mean_excitations are those of a plain array; this reference is a RetinalImage "
                    "and has a spectrum: pass illuminance_lux and cone_noise to work_precision"
                )
        if self.standard_error is not None:
            error = check_array("standard_error", self.standard_error)
            if not np.all(np.isfinite(error)) or np.any(error < 0):
                raise InvalidInputError(
                    "standard_error of the reference must be finite and >= 0 in every pixel"
                )

    def pixels(self, quantity: Quantity) -> Pixels:
        """Its values and variances."""
        found = pixels_of(self.image, "the reference", quantity)
        if self.standard_error is None:
            return found
        error = np.asarray(self.standard_error, dtype=np.float64)
        if error.ndim and error.shape != found.values.shape:
            raise InvalidInputError(
                f"standard_error of the reference must have its shape {found.values.shape}, got "
                f"{error.shape}"
            )
        variance = np.broadcast_to(error * error, found.values.shape)
        if found.values.shape == found.brightness.shape:
            return dataclasses.replace(found, variance=variance, brightness_variance=variance)
        return dataclasses.replace(found, variance=variance)

    def excitations(self, cone: ConeNoise, illuminance_lux: float | None) -> float | None:
        """Of a cone in the mean light of the image; None if they are not known."""
        if isinstance(self.image, RetinalImage):
            return mean_excitations(self.image, cone, illuminance_lux)
        return self.mean_excitations


def traced_reference(
    scene: Scene,
    eye: Eye,
    where: Mapping[str, Any],
    *,
    spp: int,
    seed: int,
    device: str | None = None,
) -> Reference:
    """A long ray tracing with independent random samples, in float64 where the device has it."""
    precision = "double" if find_device(device).has_double else "single"
    options = dict(where) | {"spp": spp, "seed": seed, "precision": precision, "bands": _all(where)}
    image = render(scene, eye, sampler="random", device=device, progress=False, **options)
    check_complete(image)
    return Reference(
        image,
        text=f"ray tracing, {spp} random samples a pixel, {precision} precision, seed {seed}, "
        f"{len(image.provenance['bands_nm'])} bands",
    )


def reference_samples(most: int, factor: int) -> int:
    """Samples of a reference for methods that take so many at most."""
    wanted = max(_FEWEST_SAMPLES, factor * most)
    if wanted > MAX_SPP:
        raise InvalidInputError(
            f"a reference of {factor} x {most} samples a pixel would take more than {MAX_SPP}; "
            "lower the largest spp"
        )
    return wanted


def check_independent(reference: Reference, seeds: Sequence[int], most: int, factor: int) -> None:
    """Refuse an image of ours as reference that shares samples with what it judges, or is short."""
    if not isinstance(reference.image, RetinalImage):
        return
    known = reference.image.provenance
    if known.get("method") != "ray tracing":
        return
    if known.get("sampler", "sobol") == "sobol" and known.get("seed") in seeds:
        raise InvalidInputError(
            f"the reference must be independent of the images, but seed {known['seed']} and the "
            "sampler are theirs; render it with another seed and sampler='random'"
        )
    spp = int(known.get("samples_per_pixel", 0))
    if spp < factor * most:
        raise InvalidInputError(
            f"the reference must have at least {factor} x {most} samples a pixel, got {spp}; "
            "render a longer one, or lower reference_factor"
        )


def _all(where: Mapping[str, Any]) -> int:
    """One band for every wavelength: the reference has no error from bands."""
    from isetcl.spectrum import default_wavelengths_nm

    known = where.get("wavelengths_nm")
    return len(default_wavelengths_nm() if known is None else np.atleast_1d(known))
