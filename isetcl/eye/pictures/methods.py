"""The pictures of an eye, as methods of `Eye`: what is computed here is drawn elsewhere."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from isetcl.eye.aberrations.analysis import EyeAnalysis

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from isetcl.eye.aberrations.refraction_error import FocusMetric
    from isetcl.eye.pictures.picture_parts import AnyFigure
    from isetcl.eye.waves.wavefront import Wavefront

_REFERENCE_NM = 550.0
_COLOURS_NM = (486.1, 550.0, 656.3)
_SPOT_RINGS = 9
_THROUGH_FOCUS_STEPS = 101
_SHOWN_SHARE = 0.98
_LARGEST_PSF_ARCMIN = 240.0


class EyePictures(EyeAnalysis):
    """Methods of `Eye` that draw. `ax` or `figure` None makes a new matplotlib figure."""

    def plot_overview(
        self,
        fields_deg: Sequence[float] = (0.0, 5.0, 10.0),
        wavelength_nm: float = _REFERENCE_NM,
        figure: AnyFigure | None = None,
        *,
        object_distance_m: float = math.inf,
    ) -> AnyFigure:
        """All pictures of the eye on one page; returns the figure. See `overview.Overview`."""
        from isetcl.eye.pictures.overview import Overview

        eye, fields = self._as_eye(), tuple(fields_deg)
        return Overview(eye, fields, wavelength_nm, object_distance_m).page(figure)

    def plot_spots(
        self,
        fields_deg: Sequence[float] = (0.0, 5.0, 10.0),
        wavelengths_nm: Sequence[float] = _COLOURS_NM,
        figure: AnyFigure | None = None,
        *,
        reference_nm: float | None = None,
        object_distance_m: float = math.inf,
    ) -> AnyFigure:
        """Spot diagrams of field angles, upwards, in several wavelengths; returns the figure.

        All wavelengths of a panel are drawn about the chief ray of `reference_nm` (None: the middle
        one). The black ring is the Airy ring of the middle one.
        """
        from isetcl.eye.pictures import ray_pictures

        spots = [
            self.spots(
                float(field),
                wavelengths_nm,
                reference_nm=reference_nm,
                object_distance_m=object_distance_m,
                rings=_SPOT_RINGS,
            )
            for field in fields_deg
        ]
        return ray_pictures.draw_spots(spots, fields_deg, figure)

    def plot_fan(
        self,
        fields_deg: Sequence[float] | float = (0.0, 10.0),
        wavelengths_nm: Sequence[float] = _COLOURS_NM,
        figure: AnyFigure | None = None,
        *,
        reference_nm: float | None = None,
        object_distance_m: float = math.inf,
    ) -> AnyFigure:
        """Ray fans of field angles, upwards, in several wavelengths; returns the figure.

        Errors are measured from the chief ray of `reference_nm` (None: the middle wavelength).
        """
        from isetcl.eye.pictures import ray_pictures

        middle = float(wavelengths_nm[len(wavelengths_nm) // 2])
        origin = middle if reference_nm is None else reference_nm
        fans = [
            [
                self.ray_fan(
                    float(field),
                    float(wavelength),
                    reference_nm=origin,
                    object_distance_m=object_distance_m,
                )
                for wavelength in wavelengths_nm
            ]
            for field in np.atleast_1d(fields_deg)
        ]
        return ray_pictures.draw_fans(fans, figure)

    def plot_opd(
        self,
        field_deg: tuple[float, float] | float = (0.0, 0.0),
        wavelength_nm: float = _REFERENCE_NM,
        figure: AnyFigure | None = None,
        *,
        zernike_order: int | None = 4,
        object_distance_m: float = math.inf,
    ) -> AnyFigure:
        """The wavefront error, with bars of the Zernike terms up to an order; returns the figure.

        `zernike_order` None leaves the bars out.
        """
        from isetcl.eye.pictures import wave_pictures

        front = self._as_eye().wavefront(
            field_deg, wavelength_nm, object_distance_m=object_distance_m
        )
        fit = None if zernike_order is None else front.zernike(zernike_order)
        return wave_pictures.draw_wavefront(front, figure, fit=fit)

    def plot_psf(
        self,
        field_deg: tuple[float, float] | float = (0.0, 0.0),
        wavelength_nm: float = _REFERENCE_NM,
        ax: Axes | None = None,
        *,
        fov_arcmin: float | None = None,
        decades: float | None = None,
        object_distance_m: float = math.inf,
    ) -> Axes:
        """The point spread function with diffraction; returns the axes.

        Parameters
        ----------
        fov_arcmin
            Width of the picture; None is what the light needs.
        decades
            None is linear; a number is logarithmic, down to so many decades below the peak.
        """
        from isetcl.eye.pictures import wave_pictures

        front = self._as_eye().wavefront(
            field_deg, wavelength_nm, object_distance_m=object_distance_m
        )
        share = _SHOWN_SHARE if fov_arcmin is None and decades is None else None
        if fov_arcmin is None:
            fov_arcmin = psf_width_arcmin(front)
        return wave_pictures.draw_psf(front.psf(fov_arcmin, 512), ax, decades=decades, share=share)

    def plot_mtf(
        self,
        fields_deg: Sequence[tuple[float, float] | float] = (0.0, 5.0, 10.0),
        wavelength_nm: float = _REFERENCE_NM,
        ax: Axes | None = None,
        *,
        largest_cpd: float = 60.0,
        object_distance_m: float = math.inf,
    ) -> Axes:
        """Tangential and sagittal MTF of field angles with the diffraction limit; returns the axes.

        For light of one wavelength.
        """
        from isetcl.eye.pictures import curve_pictures

        transfers = [
            self._as_eye()
            .wavefront(field, wavelength_nm, object_distance_m=object_distance_m)
            .otf()
            for field in fields_deg
        ]
        return curve_pictures.draw_mtf(transfers, fields_deg, ax, largest_cpd=largest_cpd)

    def plot_through_focus(
        self,
        vergences_dpt: np.ndarray | Sequence[float] | None = None,
        metric: FocusMetric = "strehl",
        ax: Axes | None = None,
        *,
        field_deg: tuple[float, float] | float = (0.0, 0.0),
        wavelength_nm: float = _REFERENCE_NM,
        frequency_cpd: float = 10.0,
    ) -> Axes:
        """Image quality against the vergence of the object, best focus marked; returns the axes.

        `vergences_dpt` None is 1 dpt to either side of the best focus.
        """
        from isetcl.eye.pictures import curve_pictures

        best = self.best_focus_dpt(metric, field_deg, wavelength_nm, frequency_cpd=frequency_cpd)
        if vergences_dpt is None:
            vergences_dpt = best + np.linspace(-1.0, 1.0, _THROUGH_FOCUS_STEPS)
        grid = np.asarray(vergences_dpt, dtype=np.float64)
        values = self.through_focus(
            grid, metric, field_deg, wavelength_nm, frequency_cpd=frequency_cpd
        )
        label = curve_pictures.METRIC_LABELS[metric]
        if metric == "mtf":
            label += f" at {frequency_cpd:g} cycles/degree"
        return curve_pictures.draw_through_focus(grid, values, ax, label=label, best_dpt=best)

    def plot_lca(
        self,
        wavelengths_nm: np.ndarray | Sequence[float] | None = None,
        ax: Axes | None = None,
        *,
        reference_nm: float = 589.3,
    ) -> Axes:
        """Longitudinal chromatic aberration against wavelength; returns the axes.

        `wavelengths_nm` None is 400 to 700 nm, as far as the media are defined.
        """
        from isetcl.eye.pictures import curve_pictures

        low, high = self._as_eye().wavelength_range_nm()
        if wavelengths_nm is None:
            wavelengths_nm = np.linspace(max(400.0, low), min(700.0, high), 31)
        grid = np.asarray(wavelengths_nm, dtype=np.float64)
        return curve_pictures.draw_lca(grid, self.lca_dpt(grid, reference_nm), ax)

    def plot_oblique_foci(
        self,
        field_deg: np.ndarray | Sequence[float] | None = None,
        ax: Axes | None = None,
        *,
        wavelength_nm: float = _REFERENCE_NM,
    ) -> Axes:
        """Field curvature and astigmatism against the field angle; returns the axes.

        `field_deg` None is 0 to 40 degrees, or as far as chief rays reach.
        """
        from isetcl.eye.pictures import curve_pictures

        if field_deg is None:
            reach = self._as_eye().field_map(wavelength_nm).max_field_deg
            field_deg = np.linspace(0.0, min(40.0, 0.95 * reach), 21)
        foci = self.oblique_foci(field_deg, wavelength_nm)
        return curve_pictures.draw_oblique_foci(foci, ax)


def psf_width_arcmin(front: Wavefront) -> float:
    """A width that shows the rays of a point and ten dark rings about them, arcmin."""
    from isetcl.eye.aberrations import geometric
    from isetcl.units import ARCMIN_PER_DEG

    rays = geometric.spot_of_wavefront(front)
    reach = math.hypot(*rays.centroid_arcmin) + 2.0 * rays.rms_arcmin
    ring = ARCMIN_PER_DEG / (front.step_cpd * front.samples)
    most = 0.999 * ARCMIN_PER_DEG / front.step_cpd
    return min(2.0 * (reach + 10.0 * ring), most, _LARGEST_PSF_ARCMIN)
