"""How much work a figure may be: a draft of seconds, or the default of about a minute."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

from isetcl.errors import check_count, check_type

if TYPE_CHECKING:
    from isetcl.eye.model import Eye
    from isetcl.retina.image import RetinalImage
    from isetcl.scene.model import Scene

T = TypeVar("T")


@dataclass(frozen=True)
class Quality:
    """What all figures are told.

    Parameters
    ----------
    is_draft
        Few pixels and samples: under ten seconds a figure on two cores, kernels built before.
    device
        OpenCL device; see `find_device`.
    seed
        Of the samples.

    Raises
    ------
    InvalidInputError
        If `is_draft` is no bool, or the seed is negative.
    """

    is_draft: bool = False
    device: str | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        check_type("is_draft", self.is_draft, bool)
        object.__setattr__(self, "seed", check_count("seed", self.seed, 0))

    @property
    def name(self) -> str:
        """``"draft"`` or ``"default"``."""
        return "draft" if self.is_draft else "default"

    def pick(self, draft: T, default: T) -> T:
        """One of two values."""
        return draft if self.is_draft else default

    def render(self, scene: Scene, eye: Eye, **options: Any) -> RetinalImage:
        """`isetcl.render` on this device, with this seed; Ctrl-C ends the figure."""
        from isetcl.render.interrupt import check_complete
        from isetcl.render.render import render

        options = {"seed": self.seed, "device": self.device, "progress": False} | options
        image = render(scene, eye, **options)
        check_complete(image)
        return image
