"""The retinal image: spectral irradiance with labels, units, its own standard error, provenance."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from isetcl.errors import InvalidInputError, check_choice, check_positive, check_type
from isetcl.netcdf import load_dataset, save_dataset
from isetcl.retina.grid import RetinalGrid
from isetcl.retina.transmittance import Transmittance
from isetcl.spectrum import photopic_weights

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

    from isetcl.eye.model import Eye

FORMAT_VERSION = 1
_LEAST_SHARE = 1e-25  # of the light: what single precision still holds of dim images


class RetinalImage:
    """Spectral irradiance on a retina.

    The data are an `xarray.Dataset` with dimensions wavelength (nm), y and x (polar field angles
    in degrees; y falls from row to row, so that row 0 is the top of the visual field).

    Attributes
    ----------
    dataset
        Variables ``irradiance`` and ``standard_error`` (wavelength, y, x), W m^-2 nm^-1;
        ``illuminance_standard_error`` (y, x), lux; ``vergence_dpt`` (y, x), 1/m, of the nearest
        object in each direction. Coordinates ``x_mm`` and ``y_mm`` (y, x): arc length on the
        retina from its vertex. Attribute ``provenance``: JSON.
    """

    def __init__(self, dataset: xarray.Dataset) -> None:
        import xarray

        check_type("dataset", dataset, xarray.Dataset)
        for name in ("irradiance", "standard_error"):
            if name not in dataset or dataset[name].dims != ("wavelength", "y", "x"):
                raise InvalidInputError(
                    f"a retinal image needs a variable {name!r} with dimensions "
                    "(wavelength, y, x); this dataset has none"
                )
        self.dataset = dataset

    @classmethod
    def from_arrays(
        cls,
        grid: RetinalGrid,
        wavelengths_nm: np.ndarray,
        irradiance: np.ndarray,
        *,
        standard_error: np.ndarray | None = None,
        illuminance_standard_error: np.ndarray | None = None,
        vergence_dpt: np.ndarray | None = None,
        surfaces: dict[str, Any] | None = None,
        provenance: dict[str, Any] | None = None,
    ) -> RetinalImage:
        """An image from arrays on a grid; see the attributes for shapes and units.

        `surfaces` are more variables on the grid, as `xarray.Dataset.assign` takes them.
        An image computed without noise has a standard error of zero.
        """
        import xarray

        shape = (len(wavelengths_nm), *grid.shape)
        if irradiance.shape != shape:
            raise InvalidInputError(f"irradiance must have shape {shape}, got {irradiance.shape}")
        if standard_error is None:
            standard_error = np.zeros_like(irradiance)
        if illuminance_standard_error is None:
            illuminance_standard_error = np.zeros(grid.shape)
        x_mm, y_mm = grid.positions_mm()
        dataset = xarray.Dataset(
            {
                "irradiance": (
                    ("wavelength", "y", "x"),
                    irradiance,
                    {"units": "W m-2 nm-1", "long_name": "spectral irradiance on the retina"},
                ),
                "standard_error": (
                    ("wavelength", "y", "x"),
                    standard_error,
                    {"units": "W m-2 nm-1", "long_name": "standard error of the irradiance"},
                ),
                "illuminance_standard_error": (
                    ("y", "x"),
                    illuminance_standard_error.astype(irradiance.dtype),
                    {"units": "lux", "long_name": "standard error of the illuminance"},
                ),
            },
            coords={
                "wavelength": ("wavelength", wavelengths_nm, {"units": "nm"}),
                "y": ("y", grid.y_deg, {"units": "deg", "long_name": "field angle, up"}),
                "x": ("x", grid.x_deg, {"units": "deg", "long_name": "field angle, right"}),
                "x_mm": (("y", "x"), x_mm.astype(np.float32), {"units": "mm"}),
                "y_mm": (("y", "x"), y_mm.astype(np.float32), {"units": "mm"}),
            },
        )
        if vergence_dpt is not None:
            dataset["vergence_dpt"] = (
                ("y", "x"),
                vergence_dpt.astype(np.float32),
                {"units": "m-1", "long_name": "vergence of the nearest object"},
            )
        if surfaces:
            dataset = dataset.assign(surfaces)
            if "position_m" in surfaces:
                dataset = dataset.assign_coords(axis=["x", "y", "z"])
        pupil = grid.eye.entrance_pupil(grid.wavelength_nm)
        details = {
            "format_version": FORMAT_VERSION,
            "entrance_pupil_diameter_mm": pupil.diameter_mm,
            "eye": grid.eye.describe(),
            "grid": {
                "fov_deg": list(grid.fov_deg),
                "resolution": list(grid.resolution),
                "centre_deg": list(grid.centre_deg),
                "wavelength_nm": grid.wavelength_nm,
            },
        }
        dataset.attrs["provenance"] = json.dumps(details | (provenance or {}))
        return cls(dataset)

    @property
    def irradiance(self) -> xarray.DataArray:
        """Spectral irradiance, W m^-2 nm^-1, (wavelength, y, x)."""
        return self.dataset["irradiance"]

    @property
    def standard_error(self) -> xarray.DataArray:
        """Standard error of the irradiance, W m^-2 nm^-1, (wavelength, y, x)."""
        return self.dataset["standard_error"]

    @property
    def wavelengths_nm(self) -> np.ndarray:
        """Wavelengths, nm, (wavelengths,)."""
        return np.asarray(self.dataset["wavelength"].values)

    @property
    def vergence_dpt(self) -> xarray.DataArray | None:
        """Vergence of the nearest object in each direction, 1/m, (y, x); None if not known."""
        return self.dataset.get("vergence_dpt")

    @property
    def provenance(self) -> dict[str, Any]:
        """How the image was made: eye, scene, options, device, versions."""
        return dict(json.loads(self.dataset.attrs.get("provenance", "{}")))

    @property
    def entrance_pupil_diameter_mm(self) -> float:
        """Diameter of the eye's entrance pupil, mm.

        Raises
        ------
        InvalidInputError
            If the provenance does not tell.
        """
        try:
            return float(self.provenance["entrance_pupil_diameter_mm"])
        except KeyError:
            raise InvalidInputError(
                "this image does not tell its entrance pupil: its attribute 'provenance' must hold "
                "'entrance_pupil_diameter_mm'; use an image that isetcl rendered"
            ) from None

    @property
    def illuminance_lux(self) -> xarray.DataArray:
        """Photopic illuminance, lux, (y, x); needs at least two wavelengths."""
        weights = photopic_weights(self.wavelengths_nm)
        if not np.any(weights > 0):
            raise InvalidInputError(
                "illuminance needs at least two wavelengths in the visible range, got "
                f"{self.wavelengths_nm.tolist()} nm; render more wavelengths"
            )
        values = np.tensordot(weights, self.irradiance.values, axes=1)
        return (
            self.irradiance.isel(wavelength=0, drop=True)
            .copy(data=values)
            .assign_attrs(units="lux", long_name="illuminance on the retina")
        )

    @property
    def relative_error(self) -> float:
        """Standard error of the image as one number: photopic, root mean square over lit pixels,
        relative to their mean. Zero for an image without noise."""
        return relative_error(*self.brightness())

    def brightness(self) -> tuple[np.ndarray, np.ndarray]:
        """What the eye sees as one number a pixel, with its standard error, each (y, x).

        The illuminance in lux; for a single wavelength, or where none is visible, the sum of the
        irradiances.
        """
        if np.any(photopic_weights(self.wavelengths_nm) > 0):
            return self.illuminance_lux.values, self.dataset["illuminance_standard_error"].values
        total = self.irradiance.values.sum(axis=0, dtype=np.float64)
        if len(self.wavelengths_nm) == 1:
            return total, self.standard_error.values[0]
        # For invisible wavelengths the renderer keeps the error of this sum in its place.
        return total, self.dataset["illuminance_standard_error"].values

    def scale_to_mean_illuminance(self, lux: float) -> RetinalImage:
        """The image scaled to a mean illuminance in lux.

        The paper's convention: its renderer returns relative units and sets the mean to 1 lux
        times the pupil area in mm^2. isetcl's images are absolute and need no such step.

        Raises
        ------
        InvalidInputError
            If the illuminance is not positive, or the image is black or has no visible wavelengths.
        """
        wanted, mean = check_positive("lux", lux, "lux"), float(self.illuminance_lux.mean())
        if not mean > 0:
            raise InvalidInputError(
                f"a black image cannot be scaled to {wanted:g} lux; its mean must be > 0"
            )
        factor = wanted / mean
        scaled = self.dataset.copy()
        for name in ("irradiance", "standard_error", "illuminance_standard_error"):
            scaled[name] = scaled[name] * factor
            scaled[name].attrs = self.dataset[name].attrs
        details = self.provenance | {"scaled_to_mean_illuminance_lux": float(lux)}
        scaled.attrs["provenance"] = json.dumps(details)
        return RetinalImage(scaled)

    @property
    def steps(self) -> tuple[Transmittance, ...]:
        """What the light came through before the receptors, in the order it was put there."""
        details = self.provenance
        records = details.get("steps", [])
        if details.get("media") is not None:
            records = [{"label": "media", "kind": "ocular_media", **details["media"]}, *records]
        return tuple(Transmittance.from_dict(record) for record in records)

    def through(self, step: Transmittance) -> RetinalImage:
        """The image behind a medium, such as `isetcl.retina.transmittance` or `macular_pigment`.

        The step is written into the provenance, and `without` undoes it. Standard errors follow
        the light; that of the illuminance as the illuminance does.

        Raises
        ------
        InvalidInputError
            If the image has a step of that label or such a medium already, or a wavelength lies
            outside the model.
        """
        if not isinstance(step, Transmittance):
            raise InvalidInputError(
                "step must be one of isetcl.retina.transmittance(...) or macular_pigment(...), got "
                f"an object of type {type(step).__name__}"
            )
        for each in self.steps:
            if each.label == step.label or isinstance(each.medium, type(step.medium)):
                raise InvalidInputError(
                    f"the image has come through {each.label!r} already; take "
                    f"image.without({each.label!r}) first"
                )
        steps = [*self.provenance.get("steps", []), step.describe()]
        return self._dimmed(self._share(step), {"steps": steps})

    def without(self, label: str) -> RetinalImage:
        """The image before the step of a label; ``"media"`` are those of `render` as well.

        Raises
        ------
        InvalidInputError
            If the image has no such step, or too little light came through to undo it.
        """
        names = [each.label for each in self.steps]
        if label not in names:
            raise InvalidInputError(f"the image has no step {label!r}; it has {names or 'none'}")
        details = self.provenance
        left = [each for each in details.get("steps", []) if each["label"] != label]
        changes: dict[str, Any] = {"steps": left}
        if len(left) == len(details.get("steps", [])):
            changes["media"] = None
        share = self._share(self.steps[names.index(label)])
        if share.min() < _LEAST_SHARE:
            dark = self.wavelengths_nm[int(np.argmin(share.min(axis=(1, 2))))]
            raise InvalidInputError(
                f"{label!r} lets {share.min():.2g} of the light through at {dark:g} nm; undoing it "
                f"needs {_LEAST_SHARE:g}; keep the image from before, or narrow the wavelengths"
            )
        return self._dimmed(1.0 / share, changes)

    def _share(self, step: Transmittance) -> np.ndarray:
        return step.at(self.wavelengths_nm, self.dataset["x"].values, self.dataset["y"].values)

    def _dimmed(self, share: np.ndarray, changes: dict[str, Any]) -> RetinalImage:
        """The image with its irradiance multiplied, and other words in its provenance."""
        changed = self.dataset.copy()
        before = self.brightness()[0]
        for name in ("irradiance", "standard_error"):
            values = (self.dataset[name].values * share).astype(self.dataset[name].dtype)
            changed[name] = self.dataset[name].copy(data=values)
        after = RetinalImage(changed).brightness()[0]
        ratio = np.divide(after, before, out=np.ones_like(before), where=before > 0)
        error = self.dataset["illuminance_standard_error"]
        changed["illuminance_standard_error"] = error.copy(
            data=(error.values * ratio).astype(error.dtype)
        )
        changed.attrs["provenance"] = json.dumps(self.provenance | changes)
        return RetinalImage(changed)

    def to_srgb(self, white_lux: float | None = None, white_point: str = "D65") -> np.ndarray:
        """The image as sRGB for display, (rows, columns, 3), uint8.

        CIE 1931 colour matching by colour-science; out-of-gamut colours are clipped.

        Parameters
        ----------
        white_lux
            Illuminance shown as white; None is the 99.5th percentile of the image.
        white_point
            The illuminant that looks neutral: ``"D65"`` (none is adapted) or another name of
            colour-science, such as ``"E"`` for equal-energy scenes.

        Raises
        ------
        InvalidInputError
            If the illuminant is unknown, or `white_lux` is not positive.
        """
        import colour

        observer = "CIE 1931 2 Degree Standard Observer"
        matching = colour.MSDS_CMFS[observer]
        wavelengths = self.wavelengths_nm
        bars = np.stack(
            [np.interp(wavelengths, matching.wavelengths, matching.values[:, i]) for i in range(3)]
        )
        widths = np.gradient(wavelengths) if len(wavelengths) > 1 else np.ones(1)
        xyz = np.tensordot(bars * widths, self.irradiance.values.astype(np.float64), axes=1)
        xyz = np.moveaxis(xyz, 0, -1)
        white = _white_y(xyz[..., 1], white_lux, wavelengths)
        whites = colour.CCS_ILLUMINANTS[observer]
        name = check_choice("white point", white_point, list(whites.keys()))
        linear = colour.XYZ_to_RGB(
            xyz / white,
            "sRGB",
            illuminant=whites[name],
            chromatic_adaptation_transform="Bradford",
            apply_cctf_encoding=False,
        )
        encoded = colour.models.RGB_COLOURSPACES["sRGB"].cctf_encoding(np.clip(linear, 0.0, 1.0))
        return np.asarray(np.rint(255.0 * encoded), dtype=np.uint8)

    def plot(self, ax: Axes | None = None, **options: Any) -> Axes:
        """Draw the image in colour against degrees of visual angle; returns the axes.

        Parameters
        ----------
        ax
            Matplotlib axes; None makes a new figure.
        options
            `white_lux` and `white_point` of `to_srgb`.
        """
        import matplotlib.pyplot as plt

        for name in options:
            check_choice("option of plot", name, ("white_lux", "white_point"))
        if ax is not None and not hasattr(ax, "imshow"):
            raise InvalidInputError(f"ax must be matplotlib axes, got {type(ax).__name__}")
        axes = plt.subplots()[1] if ax is None else ax
        axes.imshow(self.to_srgb(**options), extent=self.extent_deg, interpolation="nearest")
        axes.set_xlabel("visual angle (deg)")
        axes.set_ylabel("visual angle (deg)")
        return axes

    @property
    def extent_deg(self) -> tuple[float, float, float, float]:
        """Borders left, right, bottom, top in degrees, as matplotlib's `imshow` takes them."""
        x, y = self.dataset["x"].values, self.dataset["y"].values
        half_x = abs(x[1] - x[0]) / 2 if len(x) > 1 else 0.5
        half_y = abs(y[1] - y[0]) / 2 if len(y) > 1 else 0.5
        return (x[0] - half_x, x[-1] + half_x, y[-1] - half_y, y[0] + half_y)

    def save(self, path: str | Path) -> Path:
        """Write the image as NetCDF-4; returns the path. A crash leaves no half-written file.

        Raises
        ------
        FileError
            If the file cannot be written.
        """
        return save_dataset(self.dataset, path)

    @classmethod
    def load(cls, path: str | Path) -> RetinalImage:
        """Read an image that `save` wrote.

        Raises
        ------
        FileError
            If the file does not exist or holds no retinal image.
        """
        return load_dataset(path, "retinal image", cls)

    def to_isetbio(self, path: str | Path) -> Path:
        """Write the image as an optical image that ISETBio and ISETCam open; returns the path.

        See `isetcl.retina.isetbio.to_isetbio`.
        """
        from isetcl.retina.isetbio import to_isetbio

        return to_isetbio(self, path)

    @staticmethod
    def from_isetbio(path: str | Path, eye: Eye, **options: Any) -> RetinalImage:
        """The optical image of a file of ISETBio or ISETCam, on the retina of an eye.

        See `isetcl.retina.isetbio.from_isetbio`.
        """
        from isetcl.retina.isetbio import from_isetbio

        return from_isetbio(path, eye, **options)

    def __repr__(self) -> str:
        n, rows, columns = self.irradiance.shape
        return (
            f"<RetinalImage {columns} x {rows} pixels, {n} wavelengths, "
            f"relative error {self.relative_error:.2g}>"
        )


def relative_error(value: np.ndarray, error: np.ndarray) -> float:
    """Root mean square of `error` over pixels with `value` > 0, relative to their mean value."""
    lit = value > 0
    if not np.any(lit):
        return 0.0
    mean_square = float(np.mean(np.square(error[lit], dtype=np.float64)))
    return float(np.sqrt(mean_square) / np.mean(value[lit], dtype=np.float64))


def _white_y(y: np.ndarray, white_lux: float | None, wavelengths_nm: np.ndarray) -> float:
    """The luminous sum (in the units of `y`) that is shown as white."""
    if white_lux is not None:
        from isetcl.units import LUMINOUS_EFFICACY_LM_PER_W

        return check_positive("white_lux", white_lux, "lux") / LUMINOUS_EFFICACY_LM_PER_W
    brightest = float(np.percentile(y, 99.5))
    return brightest if brightest > 0 else max(float(y.max()), 1e-30)
