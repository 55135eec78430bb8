"""Random bytes and mutated scenes through the PBRT reader: only isetcl's own errors may come out.

Needs atheris, which is not a dependency. Run it, for as long as you like, with

    pip install atheris
    python tests/fuzz/fuzz_pbrt.py -max_total_time=300 CORPUS tests/scenes

where CORPUS is an empty folder that keeps what the fuzzer finds.
"""

import contextlib
import os
import sys
import tempfile
import warnings
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["isetcl.scene.pbrt"]):
    from isetcl.errors import IsetclError
    from isetcl.scene.pbrt.reader import read_scene

SCENES = Path(__file__).resolve().parent.parent / "scenes"
FOLDER = Path(tempfile.mkdtemp())
for name in ("textures", "meshes", "spds"):
    os.symlink(SCENES / name, FOLDER / name)


def one(data):
    path = FOLDER / "fuzz.pbrt"
    path.write_bytes(data)
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        warnings.simplefilter("ignore", UserWarning)
        with contextlib.suppress(IsetclError):
            read_scene(path, allow_outside=True)


if __name__ == "__main__":
    atheris.Setup(sys.argv, one)
    atheris.Fuzz()
