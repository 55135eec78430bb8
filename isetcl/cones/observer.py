"""An observer's receptors: what share of the light that reaches them excites them."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from isetcl.cones.nomogram import govardovskii_absorbance
from isetcl.errors import InvalidInputError, check_between, check_choice, check_finite
from isetcl.eye.people.macular_pigment import (
    MACULAR_PEAK_DENSITY,
    PIGMENT_MODELS,
    PigmentModel,
    check_pigment_range,
    macular_density,
    standard_lens_density,
)
from isetcl.eye.people.ocular_media import ocular_density
from isetcl.eye.people.pigments import (
    CONE_PEAK_NM,
    FOVEAL_DENSITIES,
    PHOTON_EFFICIENCY,
    absorbance,
    absorptance,
    field_size_densities,
)
from isetcl.eye.people.stockman_rider import template_lens_density
from isetcl.spectrum import check_wavelengths

ROD_DENSITY = 0.4
"""Optical density of rods. Lucas et al. 2014, Trends Neurosci 37:1, toolbox."""

MELANOPSIN_PEAK_NM = 480.0
"""Peak of melanopsin's absorbance. Lucas et al. 2014, Trends Neurosci 37:1; CIE S 026:2018."""

MELANOPSIN_DENSITY = 0.015
"""Optical density of melanopsin cells, as Psychtoolbox's LivingHumanMelanopsin has it."""

_STANDARD_AGE = 32.0
_ROD_RANGE_NM = (400.0, 780.0)
_MELANOPIC_RANGE_NM = (400.0, 780.0)

Dichromacy = Literal["protan", "deutan"]


@dataclass(frozen=True)
class Observer:
    """Pigments of the receptors of one person.

    Parameters
    ----------
    optical_densities
        Peak densities of the pigments in L, M and S cones at the fovea, whose outer segments are
        the longest; elsewhere they fall with the length.
    shifts_nm
        How far the peaks of the pigments in L, M and S cones lie from the standard, nm.
    pigments
        Which pigment L, M and S cones hold; ``("M", "M", "S")`` is a protanope.
    macular_peak_density
        Density of macular pigment in the fovea at its peak, 458 nm.
    model
        Where absorbances come from; see `isetcl.eye.people.pigments.absorbance`.
    photon_efficiency
        Excitations per absorbed photon.
    rod_density
        Peak density of the rods.
    melanopsin_density
        Peak density of the melanopsin in retinal ganglion cells.

    Raises
    ------
    InvalidInputError
        If a density is not positive (macular: negative), a shift is over 60 nm, or a name is
        unknown.
    """

    optical_densities: tuple[float, float, float] = FOVEAL_DENSITIES
    shifts_nm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    pigments: tuple[str, str, str] = ("L", "M", "S")
    macular_peak_density: float = MACULAR_PEAK_DENSITY
    model: PigmentModel = "cie_170"
    photon_efficiency: float = PHOTON_EFFICIENCY
    rod_density: float = ROD_DENSITY
    melanopsin_density: float = MELANOPSIN_DENSITY

    def __post_init__(self) -> None:
        check_choice("pigment model", self.model, PIGMENT_MODELS)
        for name in ("optical_densities", "shifts_nm", "pigments"):
            if np.ndim(getattr(self, name)) == 0 or len(getattr(self, name)) != 3:
                raise InvalidInputError(
                    f"observer: {name} must name L, M and S, got {getattr(self, name)}"
                )
            object.__setattr__(self, name, tuple(getattr(self, name)))
        for cone, density, shift, pigment in zip(
            "LMS", self.optical_densities, self.shifts_nm, self.pigments, strict=True
        ):
            check_between(f"observer: optical density of {cone}", density, 1e-6, 5.0)
            check_between(f"observer: shift of {cone}", shift, -60.0, 60.0, "nm")
            check_choice(f"observer: pigment of {cone}", pigment, ("L", "M", "S"))
        check_between("observer: macular_peak_density", self.macular_peak_density, 0.0, 5.0)
        check_between("observer: photon_efficiency", self.photon_efficiency, 1e-6, 1.0)
        check_between("observer: rod_density", self.rod_density, 1e-6, 5.0)
        check_between("observer: melanopsin_density", self.melanopsin_density, 1e-6, 5.0)

    @classmethod
    def of_field(cls, field_deg: float, **options: Any) -> Observer:
        """The standard observer of a field of 1 to 10 degrees, CIE 170-1:2006."""
        densities, macular = field_size_densities(field_deg)
        return cls(optical_densities=densities, macular_peak_density=macular, **options)

    @classmethod
    def dichromat(cls, kind: Dichromacy, **options: Any) -> Observer:
        """One whose L cones hold the M pigment (``"protan"``), or the reverse (``"deutan"``).

        A tritanope has no S cones: make the mosaic without them.
        """
        check_choice("kind of dichromat", kind, ("protan", "deutan"))
        held = ("M", "M", "S") if kind == "protan" else ("L", "L", "S")
        return cls(pigments=held, **options)

    @classmethod
    def anomalous(cls, kind: Dichromacy, separation_nm: float, **options: Any) -> Observer:
        """One whose two longer pigments lie only `separation_nm` apart, nm.

        A protanomalous observer's L cones hold an M pigment moved to longer wavelengths, a
        deuteranomalous one's M cones an L pigment moved to shorter ones.
        """
        check_between("separation_nm", separation_nm, 0.0, 30.0, "nm")
        observer = cls.dichromat(kind, **options)
        moved = (separation_nm, 0.0, 0.0) if kind == "protan" else (0.0, -separation_nm, 0.0)
        return dataclasses.replace(observer, shifts_nm=moved)

    def absorbances(self, wavelengths_nm: np.ndarray) -> np.ndarray:
        """Low-density absorbance of the pigments in L, M and S cones, peak 1, (3, wavelengths)."""
        grid = check_pigment_range(self.model, wavelengths_nm)
        return np.stack(
            [
                absorbance(pigment, grid, self.model, shift)
                for pigment, shift in zip(self.pigments, self.shifts_nm, strict=True)
            ]
        )

    def quantal_efficiency(
        self, wavelengths_nm: np.ndarray, segment_fraction: float = 1.0
    ) -> np.ndarray:
        """Excitations of L, M and S cones per photon that enters the aperture, (3, wavelengths).

        Macular pigment is left out. `segment_fraction` is the length of the outer segment over that
        of the fovea.
        """
        fraction = check_finite("segment_fraction", segment_fraction)
        if not fraction > 0:
            raise InvalidInputError(f"segment_fraction must be > 0, got {fraction:g}")
        density = fraction * np.array(self.optical_densities)
        absorbed = absorptance(density[:, None], self.absorbances(wavelengths_nm))
        return np.asarray(self.photon_efficiency * absorbed)

    def rod_efficiency(self, wavelengths_nm: np.ndarray) -> np.ndarray:
        """Excitations of rods per photon that enters the aperture, (wavelengths,), 400 to 780 nm.

        The CIE 1951 scotopic observer per photon, without the lens that stood before his rods
        (CIE 170-1 at 32 years), so that such a lens gives the observer back. At its peak a rod
        absorbs 1 - 10^-density.
        """
        import colour

        grid = check_wavelengths(wavelengths_nm)
        if grid[0] < _ROD_RANGE_NM[0] or grid[-1] > _ROD_RANGE_NM[1]:
            raise InvalidInputError(
                f"rods are known from {_ROD_RANGE_NM[0]:g} to {_ROD_RANGE_NM[1]:g} nm, got "
                f"{grid[0]:g} to {grid[-1]:g} nm; narrow the wavelength grid or leave the rods out"
            )
        scotopic = colour.SDS_LEFS["CIE 1951 Scotopic Standard Observer"]

        def at_the_rods(nm: np.ndarray) -> np.ndarray:
            luminous = np.interp(nm, scotopic.wavelengths, scotopic.values)
            return np.asarray(luminous / nm * 10.0 ** _lens(nm, _STANDARD_AGE))

        peak = float(at_the_rods(np.arange(400.0, 781.0)).max())
        most = self.photon_efficiency * (1.0 - 10.0**-self.rod_density)
        return np.asarray(most / peak * at_the_rods(grid))

    def melanopsin_absorptance(self, wavelengths_nm: np.ndarray) -> np.ndarray:
        """Share of photons that a melanopsin cell absorbs, (wavelengths,), 300 to 800 nm.

        The pigment alone, before which stands no macular pigment: the cells lie in front of it.
        Source: the template of Govardovskii et al. 2000 at 480 nm.
        """
        grid = check_wavelengths(wavelengths_nm)
        if grid[0] < 300.0 or grid[-1] > 800.0:
            raise InvalidInputError(
                f"melanopsin is known from 300 to 800 nm, got {grid[0]:g} to {grid[-1]:g} nm; "
                "narrow the wavelength grid"
            )
        shape = govardovskii_absorbance(MELANOPSIN_PEAK_NM, grid)
        return absorptance(self.melanopsin_density, shape)

    def melanopic_sensitivity(
        self, wavelengths_nm: np.ndarray, age_years: float = _STANDARD_AGE
    ) -> np.ndarray:
        """Sensitivity of melanopsin cells at the cornea, in energy, peak 1, (wavelengths,).

        Light at the cornea weighted by it is melanopic irradiance. The lens is that of Pokorny,
        Smith & Lutze 1987 at an age of 20 to 80 years, 400 to 780 nm. At 32 years it lies within
        0.03 of the melanopic action spectrum of CIE S 026:2018, which has another lens, and gives
        1.334 mW of melanopic irradiance a lumen of daylight D65, where the standard has 1.326.
        """
        grid = check_wavelengths(wavelengths_nm)
        low, high = _MELANOPIC_RANGE_NM
        if grid[0] < low or grid[-1] > high:
            raise InvalidInputError(
                f"melanopic sensitivity is known from {low:g} to {high:g} nm, got {grid[0]:g} to "
                f"{grid[-1]:g} nm; narrow the wavelength grid"
            )

        def at_the_cornea(nm: np.ndarray) -> np.ndarray:
            lens = ocular_density(age_years, nm, "pokorny_1987")
            return np.asarray(self.melanopsin_absorptance(nm) * nm * 10.0**-lens)

        return np.asarray(at_the_cornea(grid) / at_the_cornea(np.arange(low, high + 1.0)).max())

    def macular_density(self, wavelengths_nm: np.ndarray) -> np.ndarray:
        """Density of the macular pigment in the fovea, (wavelengths,)."""
        return macular_density(wavelengths_nm, self.macular_peak_density, self.model)

    def fundamentals(self, wavelengths_nm: np.ndarray, age_years: float = 32.0) -> np.ndarray:
        """Cone fundamentals at the cornea, in energy, each with a peak of 1 on the grid, (3, n).

        The lens is that of CIE 170-1 at an age of 20 to 80 years (from 390 nm; below it the
        template of Stockman & Rider 2023 scaled to it). Compare: CIE 170-1:2006; colour-science's
        Stockman & Sharpe fundamentals.
        """
        grid = check_pigment_range(self.model, wavelengths_nm)
        density = self.macular_density(grid) + _lens(grid, age_years)
        energy = self.quantal_efficiency(grid)[:3] * 10.0**-density * grid
        return np.asarray(energy / energy.max(axis=1, keepdims=True))

    @property
    def peaks_nm(self) -> tuple[float, ...]:
        """Peaks of the absorbance of the pigments in L, M and S cones, nm."""
        return tuple(
            CONE_PEAK_NM[pigment] + shift
            for pigment, shift in zip(self.pigments, self.shifts_nm, strict=True)
        )

    def describe(self) -> dict[str, Any]:
        """Everything as plain values, for provenance."""
        return dataclasses.asdict(self)


def _lens(grid: np.ndarray, age_years: float) -> np.ndarray:
    """Density of the lens of CIE 170-1 by age: its table from 390 nm, below it the template."""
    standard = standard_lens_density(grid)
    if grid[0] < 390.0:
        ends = np.array([390.0])
        shape = template_lens_density(np.minimum(grid, 390.0)) / template_lens_density(ends)
        standard = standard * shape
    # What age adds is tabulated from 400 nm; at shorter waves the lens grows as it does there.
    nodes = np.unique(np.maximum(grid, 400.0))
    aged, base = (ocular_density(age, nodes, "cie_170") for age in (age_years, _STANDARD_AGE))
    added = np.interp(grid, nodes, aged - base)
    from_400 = added[0] / base[0] if nodes[0] == 400.0 else 0.0
    return np.asarray(np.where(grid < 400.0, standard * (1.0 + from_400), standard + added))
