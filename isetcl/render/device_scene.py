"""A scene on a device: its records, textures and hierarchies, as the kernels of paths read them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from isetcl.device.layout import real_dtype
from isetcl.render.kernel_config import PathConfig
from isetcl.render.pack_paths import pack_paths
from isetcl.render.plan import Plan
from isetcl.render.trees import SceneTrees

if TYPE_CHECKING:
    pass


class DeviceScene:
    """Everything of a plan's scene on its device; owns the buffers.

    Attributes
    ----------
    stack_size
        Entries the stack of a ray may need.
    """

    def __init__(self, plan: Plan) -> None:
        assert isinstance(plan.config, PathConfig)
        assert isinstance(plan.images, dict)
        self._device = plan.device
        real = real_dtype(plan.config.precision)
        packed = pack_paths(
            plan.scene,
            plan.images,
            plan.wavelengths_nm,
            plan.band_choice.bands,
            plan.config.precision,
        )
        trees = SceneTrees(plan.device, packed, plan.config.precision)
        self.stack_size = trees.stack_size
        self._nodes, self._blocks = trees.nodes, trees.blocks
        self._instances = self._device.upload(trees.instances)
        self._records = {name: self._device.upload(array) for name, array in trees.records.items()}
        none = np.zeros(16, dtype=real)
        corners = packed.triangles.reshape(-1, 9).astype(real)
        self._corners = self._device.upload(corners if len(corners) else none)
        self._normals = self._device.upload(
            _table(packed.normals, len(corners), 9 * plan.config.has_normals, real)
        )
        self._uvs = self._device.upload(
            _table(packed.uvs, len(corners), 6 * plan.config.has_uv, real)
        )
        self._owner = self._device.upload(packed.triangle_object)
        self._texels = self._device.upload(packed.texels)
        self._spectra = self._device.upload(packed.spectra)
        self._n_columns = np.int32(packed.spectra.shape[1])

    def surfaces(self) -> tuple[Any, ...]:
        """What rays are asked about: analytic shapes, hierarchies, instances."""
        shapes = (self._records[name] for name in ("world", "flats", "balls"))
        return (*shapes, self._nodes, self._blocks, self._owner, self._instances)

    def openings(self) -> tuple[Any, ...]:
        """What says where surfaces let light pass."""
        records = (self._records[name] for name in ("objects", "textures"))
        return (*records, self._texels, self._corners, self._uvs)

    def looks(self) -> tuple[Any, ...]:
        """What says how surfaces and lights look."""
        names = ("objects", "substances", "textures", "lights")
        return (
            *(self._records[name] for name in names),
            self._texels,
            self._corners,
            self._normals,
            self._uvs,
            self._spectra,
            self._n_columns,
        )

    def shading(self) -> tuple[Any, ...]:
        """What the stage that shades reads: shapes without hierarchies, and looks."""
        shapes = (self._records[name] for name in ("world", "flats", "balls"))
        return (*shapes, self._instances, *self.looks())


def _table(values: np.ndarray | None, triangles: int, width: int, real: np.dtype) -> np.ndarray:
    """Numbers of all triangles; zeros where there are none but a kernel may read them."""
    return np.zeros(max(16, triangles * width), dtype=real) if values is None else values
