"""Linear least squares for many samples and few, well-conditioned functions."""

from __future__ import annotations

import numpy as np

from isetcl.errors import InvalidInputError

_REFINEMENTS = 2
_SINGULAR = 1e-13  # of the Gram matrix: functions that depend on each other to 3e-7


def least_squares(
    basis: np.ndarray, values: np.ndarray, weights: np.ndarray | None = None
) -> np.ndarray:
    """Coefficients c that minimise the weighted mean square of values - basis @ c.

    Normal equations in scaled functions, refined twice, which restores the digits they lose. QR and
    SVD of such tall matrices keep all cores of a machine waiting for each other.

    Parameters
    ----------
    basis
        Functions at the samples, (n, k).
    values
        Samples, (n,) or (n, columns).
    weights
        Weights of the samples, (n,); None counts all alike.

    Returns
    -------
    ndarray, (k,) or (k, columns)

    Raises
    ------
    InvalidInputError
        If the samples do not determine the coefficients.
    """
    scale = np.sqrt(np.mean(basis * basis, axis=0))
    scale = np.where(scale > 0, scale, 1.0)
    scaled = basis / scale
    weighted = scaled.T if weights is None else scaled.T * weights
    gram = weighted @ scaled
    eigenvalues, vectors = np.linalg.eigh(gram)
    if not eigenvalues[0] > _SINGULAR * eigenvalues[-1]:
        raise InvalidInputError(
            f"{len(values)} samples do not determine {basis.shape[1]} coefficients; use more "
            "samples or a lower order"
        )
    inverse = (vectors / eigenvalues) @ vectors.T
    found = inverse @ (weighted @ values)
    for _ in range(_REFINEMENTS):
        found = found + inverse @ (weighted @ (values - scaled @ found))
    return np.asarray((found.T / scale).T)
