"""The wavefront of an eye: what reaches the retina from one object point, with its phase.

Rays fill the stop and are followed to the reference sphere: centred on a point of the retina, and
as large as the distance of the exit pupil. W = OPL(chief ray) - OPL(ray), from the object to that
sphere, is the wavefront error. **W > 0 where the wave is ahead of the reference sphere**, which is
the OSA/ANSI sense: a myopic eye has a positive defocus coefficient, and so has positive spherical
aberration (its edge rays meet in front of the retina) a positive Z(4, 0) (Thibos et al. 2002, J
Refract Surg 18:S652).

Pupil coordinates. Samples lie on a square grid in spatial frequency, q = (n'/lambda) M d in
cycles/degree: d is the unit direction in which the light of a sample travels to the retinal point,
and M turns it along the retina, in mm per degree of visual angle. In these coordinates the
amplitude in the image is the Fourier transform of the pupil function, whatever the field angle or
the aberrations of the pupil, and the transfer function is its autocorrelation. Each sample also
knows where its ray crossed the entrance pupil, in mm; Zernike fits and refractions use those.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from isetcl.errors import InvalidInputError, check_finite, check_positive
from isetcl.eye.least_squares import least_squares
from isetcl.eye.waves import zernike

if TYPE_CHECKING:
    from isetcl.eye.aberrations.refraction_error import Refraction, RefractionDefinition
    from isetcl.eye.waves.diffraction_psf import DiffractionPsf
    from isetcl.eye.waves.otf import OpticalTransfer

Reference = Literal["chief", "best_focus"]

STILES_CRAWFORD_RHO_PER_MM2 = 0.05
"""Typical rho of the Stiles-Crawford effect, 1/mm^2: intensity 10^(-rho r^2) (Applegate &
Lakshminarayanan 1993, J Opt Soc Am A 10:1611)."""

_AUTO_STEP_WAVES = 0.35


@dataclass(frozen=True, eq=False)
class Wavefront:
    """A sampled wavefront; n samples across the longer side of the pupil. Row 0 is the upper side.

    Attributes
    ----------
    opd_um : ndarray, (n, n)
        Wavefront error W, um; NaN outside the pupil. Positive where the wave is ahead.
    amplitude : ndarray, (n, n)
        Amplitude of a sample, averaged over its cell, in units that make the flux of the whole
        pupil 1; 0 outside.
    flux : ndarray, (n, n)
        Share of the flux in the cell of a sample; sums to 1. It is the squared amplitude but on the
        rim, where part of the cell is dark.
    x_cpd, y_cpd : ndarray, (n,)
        Pupil coordinates q, cycles/degree; y descends.
    entrance_mm : ndarray, (n, n, 2)
        Where the ray of a sample crosses the entrance pupil, mm from the chief ray, in the plane at
        right angles to it; NaN outside. A cell on the rim is sampled a little farther in.
    area_mm2 : ndarray, (n, n)
        The part of the entrance pupil that a sample stands for, mm^2.
    entrance_radius_mm
        Largest distance of the pupil's rim from the chief ray in the entrance pupil, mm.
    wavelength_nm, field_deg, vergence_dpt
        Of the object: vergence 1/m from the corneal vertex.
    centre_mm : ndarray, (3,)
        Centre of the reference sphere, mm, eye frame.
    radius_mm
        Radius of the reference sphere, mm.
    mm_per_deg : ndarray, (2, 3)
        M: the steps along the retina, mm, eye frame, of a degree of visual angle to the right and
        up (the image is inverted).
    vitreous_index
        n' at the wavelength.
    vignetted
        Fraction of the stop's light that is lost at the rims of surfaces.
    """

    opd_um: np.ndarray
    amplitude: np.ndarray
    flux: np.ndarray
    x_cpd: np.ndarray
    y_cpd: np.ndarray
    entrance_mm: np.ndarray
    area_mm2: np.ndarray
    entrance_radius_mm: float
    wavelength_nm: float
    field_deg: tuple[float, float]
    vergence_dpt: float
    centre_mm: np.ndarray
    radius_mm: float
    mm_per_deg: np.ndarray
    vitreous_index: float
    vignetted: float = 0.0

    @property
    def samples(self) -> int:
        """Samples across the pupil."""
        return len(self.x_cpd)

    @property
    def step_cpd(self) -> float:
        """Distance of neighbouring samples, cycles/degree."""
        return float(self.x_cpd[1] - self.x_cpd[0])

    @property
    def inside(self) -> np.ndarray:
        """True for samples that carry light, (n, n)."""
        return self.amplitude > 0

    @property
    def opd_waves(self) -> np.ndarray:
        """W in wavelengths (in vacuum), (n, n); NaN outside the pupil."""
        return self.opd_um * 1000.0 / self.wavelength_nm

    @property
    def rms_um(self) -> float:
        """Root mean square of W, weighted by flux, without piston and tilt, um.

        The tilt is the plane in q: it only moves the image. A Zernike fit has another, in mm of the
        entrance pupil, which differs where the eye does not meet the sine condition.
        """
        values = _untilted(self)[self.inside]
        return float(np.sqrt(np.sum(self.flux[self.inside] * values**2)))

    @property
    def rms_waves(self) -> float:
        """`rms_um` in wavelengths."""
        return self.rms_um * 1000.0 / self.wavelength_nm

    @property
    def strehl_marechal(self) -> float:
        """Strehl ratio from the RMS alone, exp(-(2 pi sigma)^2) (Mahajan 1983); good above 0.3."""
        return math.exp(-((2.0 * math.pi * self.rms_waves) ** 2))

    def strehl(self) -> float:
        """Strehl ratio: peak of the PSF over its peak without aberrations, wherever it lies."""
        from isetcl.eye.waves import diffraction_psf

        return diffraction_psf.strehl(self)

    def pupil_function(self) -> np.ndarray:
        """Complex amplitude on the reference sphere, amplitude exp(-2 pi i W / lambda), (n, n).

        Time runs as exp(-i omega t).
        """
        phase = -2.0 * math.pi * np.where(self.inside, self.opd_waves, 0.0)
        return np.asarray(self.amplitude * np.exp(1j * phase))

    def zernike(self, order: int = 8, radius_mm: float | None = None) -> zernike.ZernikeFit:
        """The least-squares Zernike fit over the entrance pupil, every mm^2 counted alike.

        Parameters
        ----------
        order
            Largest radial order.
        radius_mm
            Radius of the unit circle; None takes the circle about the whole pupil. A smaller circle
            leaves out the samples beyond it.

        Raises
        ------
        InvalidInputError
            If part of the pupil is vignetted, so that the fit would be extrapolated, or the samples
            are too few.
        """
        self._need_whole_pupil("a Zernike fit")
        radius = self.entrance_radius_mm
        if radius_mm is not None:
            radius = check_positive("radius_mm", radius_mm, "mm")
            if radius > self.entrance_radius_mm * (1.0 + 1e-9):
                raise InvalidInputError(
                    f"radius_mm must be at most {self.entrance_radius_mm:.6g} mm, where this pupil "
                    f"ends, got {radius:g} mm"
                )
        used = self.inside & (np.linalg.norm(self.entrance_mm, axis=-1) <= radius * (1 + 1e-9))
        if radius_mm is None:
            used = self.inside
        x, y = self.entrance_mm[used].T
        return zernike.fit(
            self.opd_um[used],
            x,
            y,
            radius_mm=radius,
            order=order,
            wavelength_nm=self.wavelength_nm,
            weights=self.area_mm2[used],
        )

    def refraction(self, definition: RefractionDefinition = "minimum_rms") -> Refraction:
        """The spherical and cylindrical lens that corrects this wavefront; see `Refraction`."""
        from isetcl.eye.aberrations import refraction_error

        return refraction_error.refraction(self, definition)

    def psf(
        self,
        fov_arcmin: float = 20.0,
        resolution: int = 256,
        method: Literal["fraunhofer", "huygens"] = "fraunhofer",
    ) -> DiffractionPsf:
        """The point spread function with diffraction.

        Parameters
        ----------
        fov_arcmin
            Width of the square on the retina, arcmin of visual angle.
        resolution
            Samples across it.
        method
            ``"fraunhofer"`` (Fourier transform of the pupil function) or ``"huygens"`` (the sum of
            the spherical waves of all samples, with their exact distances; slow).

        Raises
        ------
        InvalidInputError
            If the samples are too few for the aberrations or for this width.
        """
        from isetcl.eye.waves import diffraction_psf

        return diffraction_psf.psf(self, fov_arcmin, resolution, method)

    def otf(self) -> OpticalTransfer:
        """The optical transfer function, from the autocorrelation of the pupil function.

        Raises
        ------
        InvalidInputError
            If the samples are too few for the aberrations.
        """
        from isetcl.eye.waves import otf

        return otf.transfer(self)

    def defocused(self, vergence_dpt: float) -> Wavefront:
        """The wavefront of an object that is nearer by `vergence_dpt`.

        A thin lens of power -vergence_dpt in the entrance pupil: W - vergence p^2 / 2. Pupil
        aberrations are taken as unchanged; `Eye.wavefront` traces the nearer object anew.
        """
        return self.with_lens(-check_finite("vergence_dpt", vergence_dpt, "dpt"))

    def with_lens(self, m_dpt: float, j0_dpt: float = 0.0, j45_dpt: float = 0.0) -> Wavefront:
        """The wavefront behind a thin lens in the entrance pupil, in dioptres of power.

        The lens adds (M (x^2 + y^2) + J0 (x^2 - y^2) + 2 J45 x y) / 2 to W, x and y in mm of the
        entrance pupil: M, J0 and J45 are its power vector.
        """
        x, y = self.entrance_mm[..., 0], self.entrance_mm[..., 1]
        change = m_dpt * (x * x + y * y) + j0_dpt * (x * x - y * y) + 2.0 * j45_dpt * x * y
        # mm^2 / m = um.
        return dataclasses.replace(self, opd_um=self.opd_um + change / 2.0)

    def with_stiles_crawford(
        self,
        rho_per_mm2: float = STILES_CRAWFORD_RHO_PER_MM2,
        peak_mm: tuple[float, float] = (0.0, 0.0),
    ) -> Wavefront:
        """The wavefront apodised by the Stiles-Crawford effect.

        The *intensity* falls as 10^(-rho r^2) with the distance r in the entrance pupil, so the
        amplitude as 10^(-rho r^2 / 2). The flux is made 1 again.

        Parameters
        ----------
        rho_per_mm2
            rho, 1/mm^2, >= 0.
        peak_mm
            Where in the entrance pupil the effect peaks, mm.
        """
        rho = check_finite("rho_per_mm2", rho_per_mm2, "1/mm^2")
        if rho < 0:
            raise InvalidInputError(f"rho_per_mm2 must be >= 0 1/mm^2, got {rho:g}")
        squared = np.sum((self.entrance_mm - np.array(peak_mm)) ** 2, axis=-1)
        weight = 10.0 ** (-rho * np.where(self.inside, squared, 0.0) / 2.0)
        total = float(np.sum(self.flux * weight**2))
        return dataclasses.replace(
            self,
            amplitude=self.amplitude * weight / math.sqrt(total),
            flux=self.flux * weight**2 / total,
        )

    def _listed(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """W, x and y (entrance pupil, mm) and flux of the samples inside the pupil, (k,) each."""
        used = self.inside
        x, y = self.entrance_mm[used].T
        return self.opd_um[used], x, y, self.flux[used]

    def _need_whole_pupil(self, what: str) -> None:
        if self.vignetted > 1e-3:
            raise InvalidInputError(
                f"{what} needs the whole pupil, but {100 * self.vignetted:.2g} % of the stop's "
                f"light from field {self.field_deg} deg is lost at the rims of surfaces; use a "
                "smaller stop, a smaller field angle or larger semi-diameters"
            )

    def _largest_step_waves(self) -> float:
        """Largest change of W, without its plane, between neighbouring samples, waves."""
        values = _untilted(self) * 1000.0 / self.wavelength_nm
        steps = [np.abs(np.diff(values, axis=axis)) for axis in (0, 1)]
        return max(float(np.nanmax(step, initial=0.0)) for step in steps)

    def samples_needed(self) -> int:
        """Samples across the pupil at which W changes by 0.35 waves at most between neighbours."""
        return 8 * math.ceil(self.samples * self._largest_step_waves() / _AUTO_STEP_WAVES / 8)

    @property
    def is_sampled(self) -> bool:
        """True if W changes by less than half a wave between neighbouring samples."""
        return self._largest_step_waves() < 0.5

    def check_sampling(self) -> None:
        """Raise InvalidInputError where W changes by half a wave or more between samples."""
        largest = self._largest_step_waves()
        if not self.is_sampled:
            wanted = self.samples_needed()
            raise InvalidInputError(
                f"the wavefront changes by {largest:.2g} waves between neighbouring samples, so "
                f"{self.samples} samples across the pupil are too few for diffraction; use "
                f"samples={wanted} or a smaller defocus"
            )


def without_plane(
    values: np.ndarray, x: np.ndarray, y: np.ndarray, weights: np.ndarray
) -> np.ndarray:
    """Values less their weighted least-squares plane."""
    basis = np.stack([np.ones_like(x), x, y], axis=1)
    return np.asarray(values - basis @ least_squares(basis, values, weights))


def _untilted(front: Wavefront) -> np.ndarray:
    """W less its flux-weighted plane in q, (n, n): a tilt only moves the image."""
    used = front.inside
    x, y = np.meshgrid(front.x_cpd, front.y_cpd)
    result = np.full(used.shape, np.nan)
    result[used] = without_plane(front.opd_um[used], x[used], y[used], front.flux[used])
    return result
