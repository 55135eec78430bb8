"""Excitations: what the receptors of a mosaic catch of a retinal image, with and without noise."""

from __future__ import annotations

import dataclasses
import json
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from isetcl.cones.at_places import rates_at_places
from isetcl.cones.light_catch import LightCatch
from isetcl.cones.mosaic import ConeMosaic
from isetcl.cones.observer import Observer
from isetcl.cones.receptors import ReceptorType
from isetcl.cones.viewing import MediaChoice, Segments, Viewing, media_to_pass
from isetcl.errors import (
    InvalidInputError,
    check_choice,
    check_count,
    check_number,
    check_positive,
    check_type,
    check_vectors,
)
from isetcl.netcdf import load_dataset, save_dataset
from isetcl.retina.image import RetinalImage
from isetcl.retina.places import IrradianceAtPlaces
from isetcl.spectrum import Uneven

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

    from isetcl.device.layout import Precision

_MOST_BYTES = 2 << 30
_MOST_EXCITATIONS = 4e9  # 32 bits hold 4.29e9; Poisson spread is 6e4 there


class Excitations:
    """Excitations of receptors in each frame.

    Attributes
    ----------
    dataset : xarray.Dataset
        ``mean`` (frame, receptor): mean excitations in one integration time; ``standard_error``
        likewise, where the scene was rendered at the receptors. Coordinates by receptor:
        ``x_deg``, ``y_deg``, ``eccentricity_deg``, ``aperture_deg`` (diameter) and ``type`` (0 L,
        1 M, 2 S, 3 rod); by frame: ``time_s`` and where the fovea looks, ``gaze_x_deg`` and
        ``gaze_y_deg``. Attributes: ``integration_time_s``, ``seed``, ``provenance`` (JSON).
    """

    def __init__(self, dataset: xarray.Dataset) -> None:
        import xarray

        check_type("dataset", dataset, xarray.Dataset)
        if "mean" not in dataset or dataset["mean"].dims != ("frame", "receptor"):
            raise InvalidInputError(
                "excitations need a variable 'mean' with dimensions (frame, receptor); this "
                "dataset has none"
            )
        missing = {"integration_time_s", "seed"} - set(dataset.attrs)
        if "type" not in dataset.coords or missing:
            raise InvalidInputError(
                "excitations need a coordinate 'type' and the attributes 'integration_time_s' and "
                "'seed', which this dataset lacks; use those that a mosaic made"
            )
        self.dataset = dataset

    def __repr__(self) -> str:
        frames, receptors = self.mean.shape
        means = []
        for kind in ReceptorType:
            own = self.of(kind.name).values
            if own.size:
                means.append(f"{own.mean(dtype=np.float64):.3g} {kind.name}")
        return (
            f"<Excitations of {receptors} receptors in {frames} frame{'s' * (frames > 1)} of "
            f"{1e3 * self.integration_time_s:g} ms, mean {', '.join(means)}>"
        )

    @property
    def mean(self) -> xarray.DataArray:
        """Mean excitations in one integration time, (frame, receptor)."""
        return self.dataset["mean"]

    @property
    def standard_error(self) -> xarray.DataArray | None:
        """Standard error of the means, (frame, receptor), of light rendered at the receptors."""
        return self.dataset.get("standard_error")

    @property
    def types(self) -> np.ndarray:
        """Type of each receptor, (receptor,)."""
        return np.asarray(self.dataset["type"].values)

    @property
    def integration_time_s(self) -> float:
        """Time over which excitations are counted, s."""
        return float(self.dataset.attrs["integration_time_s"])

    @property
    def counts(self) -> xarray.DataArray:
        """One noisy instance, of the seed the excitations were made with, (frame, receptor)."""
        return self.instances(1, int(self.dataset.attrs["seed"])).isel(instance=0, drop=True)

    @property
    def provenance(self) -> dict[str, Any]:
        """How the excitations were made."""
        return dict(json.loads(self.dataset.attrs.get("provenance", "{}")))

    def of(self, kind: str | int) -> xarray.DataArray:
        """Means of the receptors of one type, ``"L"``, ``"M"``, ``"S"`` or ``"ROD"``, or 0 to 3.

        Dimensions (frame, receptor); a mosaic without such receptors gives none.
        """
        if isinstance(kind, str):
            number = ReceptorType[check_choice("receptor type", kind, ReceptorType.__members__)]
        else:
            number = ReceptorType(check_count("receptor type", kind, 0, len(ReceptorType) - 1))
        return self.mean.isel(receptor=np.flatnonzero(self.types == number))

    def instances(self, count: int = 1, seed: int = 0) -> xarray.DataArray:
        """Noisy instances: Poisson variables of the means, (instance, frame, receptor), uint32.

        Numbers of an instance depend on the seed and its place only: instance 7 is the same among
        10 as among 1000. They come from a counter-based generator (Philox; Salmon et al. 2011) with
        the key (seed, number of the instance).

        Raises
        ------
        InvalidInputError
            If they need more than 2 GiB; ask for fewer, or one seed at a time. If a mean is over
            4e9, beyond what a count holds.
        """
        import xarray

        count = check_count("count", count, 1, 1 << 31)
        seed = check_count("seed", seed, 0, (1 << 63) - 1)
        mean = self.mean.values
        size = 4 * count * mean.size
        if size > _MOST_BYTES:
            raise InvalidInputError(
                f"{count} instances of {mean.shape[0]} frames and {mean.shape[1]} receptors need "
                f"{size / 2**30:.3g} GiB, and at most 2 are made at once; ask for fewer"
            )
        brightest = float(mean.max())
        if not brightest <= _MOST_EXCITATIONS:
            raise InvalidInputError(
                f"mean excitations must be at most {_MOST_EXCITATIONS:g} to be counted, got "
                f"{brightest:g}; shorten integration_time_s"
            )
        counts = np.empty((count, *mean.shape), dtype=np.uint32)
        for i in range(count):
            generator = np.random.Generator(np.random.Philox(key=[seed, i]))
            counts[i] = generator.poisson(mean)
        return xarray.DataArray(
            counts,
            dims=("instance", "frame", "receptor"),
            coords=dict(self.mean.coords),
            attrs={"long_name": "excitations", "units": "1", "seed": seed},
        )

    def plot(self, ax: Axes | None = None, **options: Any) -> Axes:
        """Draw the mosaic coloured by excitations; see `excitation_pictures.plot_excitations`."""
        from isetcl.cones.excitation_pictures import plot_excitations

        return plot_excitations(self, ax, **options)

    def plot_profile(self, ax: Axes | None = None, **options: Any) -> Axes:
        """Draw excitations along a line; see `excitation_pictures.plot_profile`."""
        from isetcl.cones.excitation_pictures import plot_profile

        return plot_profile(self, ax, **options)

    def movie(self, path: str | Path, **options: Any) -> Path:
        """Write the frames as a GIF or MP4; see `movies.write_movie`."""
        from isetcl.cones.movies import write_movie

        return write_movie(self, path, **options)

    def save(self, path: str | Path) -> Path:
        """Write the means as NetCDF-4; returns the path.

        Raises
        ------
        FileError
            If the file cannot be written.
        """
        return save_dataset(self.dataset, path)

    @classmethod
    def load(cls, path: str | Path) -> Excitations:
        """Read excitations that `save` wrote.

        Raises
        ------
        FileError
            If the file cannot be read or is something else.
        """
        return load_dataset(path, "excitations", cls)


def excitations(
    mosaic: ConeMosaic,
    image: RetinalImage | IrradianceAtPlaces,
    integration_time_s: float = 0.005,
    *,
    observer: Observer | None = None,
    gaze_deg: np.ndarray | Sequence[Sequence[float]] | None = None,
    frame_time_s: float | None = None,
    dark_rate_hz: float = 0.0,
    has_macular_pigment: bool = True,
    segments: Segments = "spectral",
    media: MediaChoice = None,
    uneven_wavelengths: Uneven = "refuse",
    seed: int = 0,
    precision: Precision = "single",
    device: str | None = None,
) -> Excitations:
    """Mean excitations of every receptor of a mosaic.

    The spectral irradiance is averaged over each receptor's own aperture, exactly in area, and
    weighted by its pigment behind the macular pigment of its own eccentricity. The lens and other
    media in front of the retina are the image's, by ``render(..., media=...)`` or
    `RetinalImage.through`, or `media` here; without them S cones catch several times as much.

    The spectrum is the sum over wavelengths times their step, which should be fine enough for it,
    10 nm for smooth ones.

    Parameters
    ----------
    mosaic
        The receptors. `ConeMosaic.moved` places them in an image whose fovea is off the axis.
    image
        The retinal image, W m^-2 nm^-1; or what ``isetcl.render(..., at=mosaic)`` found at the
        receptors themselves, for an eye at rest, which gives the means a standard error.
    integration_time_s
        Time over which excitations are counted, s.
    observer
        Pigments; None is the standard observer, `Observer()`.
    gaze_deg
        Where the fovea looks from frame to frame, relative to the mosaic's place, (frames, 2),
        degrees: the path of an eye that moves before a still image. None is one frame at rest.
    frame_time_s
        Time from frame to frame; None is the integration time.
    dark_rate_hz
        Excitations a second that occur without light: about 100 to 300 in the literature (Koenig &
        Hofer 2011), 250 in Lian et al. 2019.
    has_macular_pigment
        False where the image has it already; see `isetcl.retina.transmittance`.
    segments
        Outer segments shorten with eccentricity, and pigments with them: ``"spectral"``, by each
        wavelength; ``"mean"``, by the mean over wavelengths for L cones, as ISETBio does;
        ``"none"``, not at all.
    media
        Ocular media that the light has yet to pass: `isetcl.OcularMedia` or
        ``isetcl.retina.transmittance(age)``. None takes what the light has come through, with a
        warning where that is no lens although isetcl rendered it; ``"as_is"`` is silent. Light of
        arrays and files is taken to have come through its lens.
    uneven_wavelengths
        ``"refuse"`` wants wavelengths in equal steps. ``"bins"`` takes others: each wavelength
        stands for the bin that reaches half-way to its neighbours, as in the image's illuminance.
    seed
        Seed of `Excitations.counts`.
    precision, device
        As in `render`.

    Raises
    ------
    InvalidInputError
        If receptors look beyond the image, wavelengths lie in unequal steps, media or macular
        pigment would count twice, or an argument is out of range.
    OutOfMemoryError
        If the means do not fit; their size is said.

    Warns
    -----
    UserWarning
        If pixels are wider than the smallest aperture; the resolution needed is said. If light that
        isetcl rendered has come through no lens; see `media`.
    """
    check_type("mosaic", mosaic, ConeMosaic)
    check_type("image", image, (RetinalImage, IrradianceAtPlaces))
    check_positive("integration_time_s", integration_time_s, "s")
    step = (
        integration_time_s
        if frame_time_s is None
        else check_positive("frame_time_s", frame_time_s, "s")
    )
    check_count("seed", seed, 0, (1 << 63) - 1)
    if not (np.isfinite(check_number("dark_rate_hz", dark_rate_hz)) and dark_rate_hz >= 0):
        raise InvalidInputError(f"dark_rate_hz must be finite and >= 0 Hz, got {dark_rate_hz}")
    gaze = np.zeros((1, 2)) if gaze_deg is None else check_vectors("gaze_deg", gaze_deg, width=2)
    if len(gaze) == 0:
        raise InvalidInputError("gaze_deg must have at least one frame, got none")
    viewing = Viewing(
        Observer() if observer is None else observer,
        segments,
        has_macular_pigment,
        media_to_pass(image, media, stacklevel=3),
        uneven_wavelengths,
    )
    error = None
    if isinstance(image, IrradianceAtPlaces):
        if gaze_deg is not None:
            raise InvalidInputError(
                "gaze_deg needs an image: light rendered at the receptors is that of an eye at "
                "rest; render a RetinalImage, or render at mosaic.moved(gaze) frame by frame"
            )
        rate, rate_error = rates_at_places(mosaic, image, viewing)
        error = (rate_error * integration_time_s)[None]
        mean = (rate * integration_time_s)[None].astype(mean_type(0.0, precision).dtype)
    else:
        catch = LightCatch(mosaic, image, viewing)
        catch.check_inside(gaze)
        catch.check_memory(len(gaze), precision)
        if catch.is_coarse:
            warnings.warn(catch.coarse_message, stacklevel=3)
        mean = catch.rates(gaze, precision, device)
        mean *= mean_type(integration_time_s, precision)
    mean += mean_type(dark_rate_hz * integration_time_s, precision)
    details = {
        "integration_time_s": integration_time_s,
        "dark_rate_hz": dark_rate_hz,
        **viewing.describe(),
        "mosaic": mosaic.provenance,
        "image": image.provenance,
    }
    found = _labelled(mosaic, mean, gaze, step, integration_time_s, seed, details)
    if error is not None:
        found.dataset["standard_error"] = found.mean.copy(data=error.astype(mean.dtype))
        found.dataset["standard_error"].attrs["long_name"] = "standard error of the mean"
    return found


def mean_type(value: float, precision: Precision) -> np.floating:
    """A number of the type the means have, so that products keep it."""
    return np.float32(value) if precision == "single" else np.float64(value)


def _labelled(
    mosaic: ConeMosaic,
    mean: np.ndarray,
    gaze: np.ndarray,
    step_s: float,
    integration_time_s: float,
    seed: int,
    details: dict[str, Any],
) -> Excitations:
    import xarray

    places = mosaic.positions_deg
    dataset = xarray.Dataset(
        {
            "mean": (
                ("frame", "receptor"),
                mean,
                {"units": "1", "long_name": "mean excitations in one integration time"},
            )
        },
        coords={
            "x_deg": ("receptor", places[:, 0], {"units": "deg"}),
            "y_deg": ("receptor", places[:, 1], {"units": "deg"}),
            "eccentricity_deg": ("receptor", mosaic.eccentricity_deg, {"units": "deg"}),
            "type": ("receptor", mosaic.types),
            "aperture_deg": ("receptor", mosaic.aperture_deg, {"units": "deg"}),
            "time_s": ("frame", step_s * np.arange(len(gaze)), {"units": "s"}),
            "gaze_x_deg": ("frame", gaze[:, 0], {"units": "deg"}),
            "gaze_y_deg": ("frame", gaze[:, 1], {"units": "deg"}),
        },
        attrs={
            "integration_time_s": float(integration_time_s),
            "seed": int(seed),
            "provenance": json.dumps(details, default=_plain),
        },
    )
    return Excitations(dataset)


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return dataclasses.asdict(value)
    return np.asarray(value).tolist()
