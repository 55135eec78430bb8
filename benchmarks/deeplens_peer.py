"""DeepLens' layered rendering of the layers that a file holds: run by `psf_baseline.py`.

By an interpreter that has DeepLens (the package deeplens-core, Apache licence 2.0, for Python 3.12
only) and torch, which isetcl's need not have. Nothing of isetcl is imported here.
"""

from __future__ import annotations

import json
import sys
import time
from importlib.metadata import version

import numpy as np
import torch
from deeplens.imgsim.psf import conv_psf_occlusion


def main(path: str) -> None:
    with np.load(path) as data:
        picture, layer, kernels = (torch.from_numpy(data[k]) for k in ("picture", "layer", "psfs"))
    # It wants depths, far to near and negative: the numbers of the layers will do.
    depths = torch.arange(len(kernels), dtype=torch.float32) - len(kernels)
    start = time.perf_counter()
    with torch.no_grad():
        image = conv_psf_occlusion(
            picture[None, None], depths[layer][None, None], kernels[:, None], depths
        )
    seconds = time.perf_counter() - start
    np.save(f"{path}.npy", image[0, 0].numpy())
    versions = {name: version(name) for name in ("deeplens-core", "torch")}
    print(json.dumps({"seconds": seconds, "versions": versions, "python": sys.version.split()[0]}))


if __name__ == "__main__":
    main(sys.argv[1])
