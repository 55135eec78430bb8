"""Complex refractive indices of metals against wavelength."""

from __future__ import annotations

import functools
import hashlib
from dataclasses import dataclass
from importlib import resources

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_choice, check_type
from isetcl.spectrum import check_wavelengths


@dataclass(frozen=True, eq=False)
class ComplexIndex:
    """Complex refractive index n + i k, sampled at ascending wavelengths, interpolated linearly.

    Parameters
    ----------
    wavelengths_nm
        Ascending wavelengths, nm, shape (m,).
    n, k
        Real part and extinction coefficient, shape (m,), finite; n > 0, k >= 0.
    name
        For messages and provenance.

    Raises
    ------
    InvalidInputError
        If shapes differ or a value breaks its rule.
    """

    wavelengths_nm: np.ndarray
    n: np.ndarray
    k: np.ndarray
    name: str = "metal"

    def __post_init__(self) -> None:
        check_type("index: name", self.name, str)
        grid = check_wavelengths(self.wavelengths_nm)
        object.__setattr__(self, "wavelengths_nm", grid)
        for part in ("n", "k"):
            values = np.atleast_1d(check_array(f"index {self.name!r}: {part}", getattr(self, part)))
            bad = ~np.isfinite(values) | (values < 0) | ((values == 0) & (part == "n"))
            if values.shape != grid.shape or bad.any():
                rule = "> 0" if part == "n" else ">= 0"
                raise InvalidInputError(
                    f"index {self.name!r}: {part} must be finite, {rule}, one entry a wavelength "
                    f"{grid.shape}, got {values[bad][0] if bad.any() else values.shape}"
                )
            object.__setattr__(self, part, values)

    @classmethod
    def named(cls, name: str) -> ComplexIndex:
        """A metal by name or chemical symbol, at room temperature, from 360 to 850 nm at least.

        "silver" (Ag), "gold" (Au), "copper" (Cu), "aluminium" (Al), "chromium" (Cr), "nickel"
        (Ni), "titanium" (Ti), "iron" (Fe) and "tungsten" (W); capitals do not matter.

        Source: measured tables of Johnson & Christy 1972, 1974 (Phys Rev B 6:4370, 9:5056), Rakic
        1995 (Appl Opt 34:4755, aluminium) and Weaver, Olson & Lynch 1975 (Phys Rev B 12:1293,
        tungsten).

        Raises
        ------
        InvalidInputError
            If the name is unknown; the message lists near matches.
        """
        known = _metals()
        folded = name.strip().lower() if isinstance(name, str) else name
        folded = _ALIASES.get(folded, folded) if isinstance(folded, str) else folded
        return known[check_choice("metal", folded, list(known))]

    def at(self, wavelengths_nm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """n and k at other wavelengths, linearly interpolated.

        Raises
        ------
        InvalidInputError
            If a wavelength lies outside the range of the samples: nothing is extrapolated.
        """
        grid = check_wavelengths(wavelengths_nm)
        low, high = self.wavelengths_nm[0], self.wavelengths_nm[-1]
        if grid[0] < low or grid[-1] > high:
            raise InvalidInputError(
                f"index {self.name!r} is known from {low:g} to {high:g} nm, asked for {grid[0]:g} "
                f"to {grid[-1]:g} nm; narrow the wavelength grid"
            )
        return (
            np.interp(grid, self.wavelengths_nm, self.n),
            np.interp(grid, self.wavelengths_nm, self.k),
        )

    def digest(self) -> str:
        """A hash of the samples, for provenance."""
        data = self.wavelengths_nm.tobytes() + self.n.tobytes() + self.k.tobytes()
        return hashlib.sha256(data).hexdigest()[:16]


_ALIASES = {
    "ag": "silver",
    "al": "aluminium",
    "aluminum": "aluminium",
    "au": "gold",
    "chrome": "chromium",
    "cr": "chromium",
    "cu": "copper",
    "fe": "iron",
    "ni": "nickel",
    "ti": "titanium",
    "w": "tungsten",
}


@functools.cache
def _metals() -> dict[str, ComplexIndex]:
    """The metals of the data file, by name."""
    rows: dict[str, list[tuple[float, float, float]]] = {}
    with resources.files("isetcl.data").joinpath("metals.csv").open() as lines:
        for line in lines:
            if not line.startswith("#"):
                metal, *numbers = line.split(",")
                wavelength, n, k = (float(number) for number in numbers)
                rows.setdefault(metal, []).append((wavelength, n, k))
    tables = {metal: np.array(values).T for metal, values in rows.items()}
    return {
        metal: ComplexIndex(table[0], table[1], table[2], metal) for metal, table in tables.items()
    }
