"""Wavefronts and what follows from them: Zernike terms, point spread, transfer."""
