"""Scenes from files, whatever their format."""

from __future__ import annotations

from pathlib import Path

from isetcl.errors import FileError, check_type
from isetcl.scene.model import Scene

_MESH_SUFFIXES = (
    ".glb", ".gltf", ".obj", ".ply", ".stl", ".off", ".3mf", ".dae", ".zae", ".xyz", ".ctm",
)  # fmt: skip


def load_scene(path: str | Path, *, allow_outside: bool = False) -> Scene:
    """The scene of a file: PBRT (version 3 or 4), glTF/GLB, OBJ, PLY, STL, OFF, ISETBio (.mat).

    Of a PBRT scene, the eye stands where the camera stands and looks where it looks. What the
    scene asks for and isetcl has not is listed in warnings, one a kind. A scene of ISETBio is a
    flat spectral picture at its distance; see `isetcl.scene.isetbio`.

    Parameters
    ----------
    path
        The file. Lengths are metres (millimetres where a PBRT camera says mmUnits).
    allow_outside
        Whether a scene may read files outside of its own folder.

    Raises
    ------
    FileError
        If a file is missing, unreadable or breaks its format; the message says where.
    InvalidInputError
        If what it describes cannot be.
    OutOfMemoryError
        If it would not fit into memory.
    """
    check_type("path", path, (str, Path))
    check_type("allow_outside", allow_outside, bool)
    file = Path(path)
    try:
        exists, is_folder = file.is_file(), file.is_dir()
    except (OSError, ValueError) as error:
        raise FileError(f"scene file {str(path)!r} cannot be looked up ({error})") from error
    if is_folder:
        raise FileError(f"scene file {str(file)!r} is a folder; name the file in it")
    if not exists:
        raise FileError(f"scene file {str(file)!r} does not exist")
    suffix = file.suffix.lower()
    if suffix == ".pbrt" or file.name.lower().endswith(".pbrt.gz"):
        from isetcl.scene.pbrt.reader import read_scene

        return read_scene(file, allow_outside=allow_outside)
    if suffix in _MESH_SUFFIXES:
        from isetcl.scene.mesh_files import load_mesh_scene

        return load_mesh_scene(file, allow_outside=allow_outside)
    if suffix == ".mat":
        from isetcl.scene.isetbio import read_isetbio_scene

        return read_isetbio_scene(file)
    known = ", ".join((".pbrt", ".mat", *_MESH_SUFFIXES))
    raise FileError(f"scene file {str(file)!r} has no known suffix (known: {known}); rename it")
