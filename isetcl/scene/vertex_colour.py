"""Colours at the corners of triangles, as a texture."""

from __future__ import annotations

import numpy as np

from isetcl.scene.mesh import Mesh


def baked(mesh: Mesh, colours: np.ndarray) -> tuple[Mesh, np.ndarray]:
    """A mesh with own texture coordinates, and the texture that holds its vertex colours.

    Every triangle has two by two texels of its own; its corners lie at the centres of three of
    them. The fourth is b + c - a, for which the bilinear interpolation of the texture is the linear
    one of the triangle. Where that is no colour, it is clipped, and colours inside the triangle are
    a little off; the corner opposite is chosen for the least of that.

    Parameters
    ----------
    mesh
        The mesh.
    colours : ndarray, (vertices, 3) or (faces, 3, 3)
        Linear colours between 0 and 1, of the vertices or of the corners of each triangle.

    Returns
    -------
    mesh : Mesh
        The same triangles, with three vertices each.
    texels : ndarray of float32, (rows, columns, 3)
    """
    corner = np.clip(colours if colours.ndim == 3 else colours[mesh.faces], 0.0, 1.0)
    count = len(mesh.faces)
    # The fourth texel for each choice of the corner opposite to it.
    total = corner.sum(axis=1, keepdims=True)
    fourth = total - 2.0 * corner
    excess = np.maximum(np.maximum(fourth - 1.0, -fourth), 0.0).sum(axis=2)
    first = np.argmin(excess, axis=1)
    order = (first[:, None] + np.arange(3)) % 3
    a, b, c = (corner[np.arange(count), order[:, i]] for i in range(3))
    across = int(np.ceil(np.sqrt(count)))
    down = -(-count // across)
    row, column = np.divmod(np.arange(count), across)
    texels = np.zeros((2 * down, 2 * across, 3), dtype=np.float32)
    texels[2 * row, 2 * column] = a
    texels[2 * row, 2 * column + 1] = b
    texels[2 * row + 1, 2 * column] = c
    texels[2 * row + 1, 2 * column + 1] = np.clip(b + c - a, 0.0, 1.0)
    left, top = (2 * column + 0.5) / (2 * across), 1.0 - (2 * row + 0.5) / (2 * down)
    right, low = (2 * column + 1.5) / (2 * across), 1.0 - (2 * row + 1.5) / (2 * down)
    uv = np.zeros((count, 3, 2))
    triangle = np.arange(count)
    uv[triangle, order[:, 0]] = np.stack([left, top], axis=1)
    uv[triangle, order[:, 1]] = np.stack([right, top], axis=1)
    uv[triangle, order[:, 2]] = np.stack([left, low], axis=1)
    used = mesh.faces.reshape(-1)
    normals = None if mesh.normals is None else mesh.normals[used]
    faces = np.arange(3 * count).reshape(-1, 3)
    return Mesh(mesh.vertices_m[used], faces, normals, uv.reshape(-1, 2)), texels
