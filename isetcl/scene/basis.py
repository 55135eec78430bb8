"""The few spectra that a scene is made of.

Every radiance in a scene is a combination of a small set of spectra: one for a black and white
scene whatever its illuminant, three for pictures on a display. Rendering their coefficients and
multiplying afterwards is exact, and costs as many channels as the scene has, not as many as there
are wavelengths.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isetcl.scene.light import Environment
from isetcl.scene.model import Scene

_RELATIVE_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class SpectralBasis:
    """Spectra that span a scene on a wavelength grid.

    Attributes
    ----------
    spectra : ndarray, (basis, wavelengths)
        Spectral radiances, W m^-2 sr^-1 nm^-1.
    background : ndarray, (basis,)
        Coefficients of the background.
    objects : tuple of ndarray, (channels, basis)
        Coefficients of every channel of every object's material.
    """

    spectra: np.ndarray
    background: np.ndarray
    objects: tuple[np.ndarray, ...]


def spectral_basis(scene: Scene, wavelengths_nm: np.ndarray) -> SpectralBasis:
    """The smallest set of a scene's own spectra that spans all of them.

    Raises
    ------
    InvalidInputError
        If a spectrum is not known at one of the wavelengths.
    """
    chosen: list[np.ndarray] = []
    known: dict[str, np.ndarray] = {}
    rows: list[list[np.ndarray]] = []
    assert not isinstance(scene.background, Environment), "a basis spans even backgrounds only"
    sources = [[scene.background] if scene.background else []]
    sources += [list(item.material.spectra()) for item in scene.objects]
    for spectra in sources:
        rows.append([])
        for spectrum in spectra:
            key = spectrum.digest()
            if key not in known:
                known[key] = _coefficients(spectrum.at(wavelengths_nm), chosen)
            rows[-1].append(known[key])
    count = max(1, len(chosen))
    basis = np.array(chosen) if chosen else np.zeros((1, len(wavelengths_nm)))

    def padded(coefficients: list[np.ndarray]) -> np.ndarray:
        return np.array([np.pad(c, (0, count - len(c))) for c in coefficients]).reshape(-1, count)

    background = padded(rows[0])[0] if rows[0] else np.zeros(count)
    return SpectralBasis(basis, background, tuple(padded(row) for row in rows[1:]))


def _coefficients(values: np.ndarray, chosen: list[np.ndarray]) -> np.ndarray:
    """Coefficients of a spectrum in the chosen ones; it joins them if they do not reach it."""
    scale = float(np.max(values))
    if scale == 0.0:
        return np.zeros(len(chosen))
    if chosen:
        matrix = np.array(chosen).T
        norms = np.linalg.norm(matrix, axis=0)
        solution = np.linalg.lstsq(matrix / norms, values, rcond=None)[0] / norms
        if np.max(np.abs(matrix @ solution - values)) <= _RELATIVE_TOLERANCE * scale:
            part = np.abs(solution) * norms
            return np.where(part < 1e-12 * np.max(part), 0.0, solution)
    chosen.append(values)
    return np.concatenate([np.zeros(len(chosen) - 1), [1.0]])
