"""isetcl's own ways to render a scene, with the parts of their errors."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from isetcl import psf_baseline
from isetcl.device.choose import find_device
from isetcl.errors import InvalidInputError, check_choice, check_type
from isetcl.eye.model import Eye
from isetcl.psf_baseline.pupil import MAX_SAMPLES
from isetcl.psf_baseline.view import MAX_LAYERS
from isetcl.render.goal import MAX_SPP
from isetcl.render.interrupt import check_complete
from isetcl.render.plan import plan
from isetcl.render.render import render
from isetcl.retina.image import RetinalImage
from isetcl.scene.model import Scene
from isetcl.validation.work_precision.method import (
    ImageLike,
    Part,
    Run,
    WorkMethod,
    checked_knobs,
)

RAY_TRACING = "ray_tracing"

_TRACED_KNOBS = {"spp": (4, 16, 64, 256), "bands": (1, 2, 4, 8)}
_PSF_KNOBS = {
    "oversampling": (1, 2, 4),
    "layers": (2, 4, 8, 16),
    "pupil_samples": (16, 64, 256),
}
_FINEST = {"oversampling": 8, "layers": MAX_LAYERS, "pupil_samples": MAX_SAMPLES}
_DEFAULT_SPP = 256
_Any = TypeVar("_Any")


@dataclass(frozen=True)
class SceneMethod:
    """A renderer of isetcl, to be measured on whatever scene is given.

    Attributes
    ----------
    method
        ``"ray_tracing"`` or one of `isetcl.psf_baseline.methods()`.
    knob
        ``"spp"`` or ``"bands"`` for ray tracing, ``"oversampling"``, ``"layers"`` or
        ``"pupil_samples"`` for PSF methods. None is the first of these.
    knobs
        Its values; none for a few.
    options
        Further arguments of `isetcl.render` or `isetcl.psf_baseline.render`, such as
        ``precision="double"`` or ``psf="wave"``.
    label
        Name of the curve; None is made of the method and its options.
    """

    method: str = RAY_TRACING
    knob: str | None = None
    knobs: tuple[float, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
    label: str | None = None

    def __post_init__(self) -> None:
        check_choice("method", self.method, [RAY_TRACING, *psf_baseline.methods()])
        known = _TRACED_KNOBS if self.is_traced else _PSF_KNOBS
        knob = next(iter(known)) if self.knob is None else check_choice("knob", self.knob, known)
        object.__setattr__(self, "knob", knob)
        values = self.knobs if len(self.knobs) else known[knob]
        object.__setattr__(self, "knobs", checked_knobs(self.name, values))
        for value in self.knobs:
            if value != int(value):
                raise InvalidInputError(f"{knob} must be a whole number, got {value:g}")
        most = MAX_SPP if self.is_traced else _FINEST[knob]
        if max(self.knobs) > most:
            raise InvalidInputError(f"{knob} must be at most {most}, got {max(self.knobs):g}")
        if knob in self.options:
            raise InvalidInputError(
                f"{knob!r} is the knob of method {self.name!r} and cannot be an option as well"
            )

    @property
    def is_traced(self) -> bool:
        """Whether it is ray tracing."""
        return self.method == RAY_TRACING

    @property
    def name(self) -> str:
        """Name of the curve."""
        if self.label is not None:
            return self.label
        options = ", ".join(f"{key} {value}" for key, value in self.options.items())
        return f"{self.method} ({options})" if options else self.method

    def on(
        self, scene: Scene, eye: Eye, where: Mapping[str, Any], device: str | None
    ) -> WorkMethod:
        """The method on a scene; `where` are arguments that all renderers take."""
        check_type("scene", scene, Scene)
        check_type("eye", eye, Eye)
        if self.is_traced:
            return self._traced(scene, eye, where, device)
        return self._by_psf(scene, eye, where)

    def _largest(self, knob: str) -> dict[str, Any]:
        return {knob: int(max(self.knobs))} if self.knob == knob else {}

    def _traced(
        self, scene: Scene, eye: Eye, where: Mapping[str, Any], device: str | None
    ) -> WorkMethod:
        assert self.knob is not None
        knob, base = self.knob, {**where, **self.options, "device": device}

        def run(scene: Scene, eye: Eye, **changed: Any) -> Run:
            def render_at(value: float, seed: int) -> RetinalImage:
                options = {"spp": _DEFAULT_SPP, **base, knob: int(value), **changed}
                image = render(scene, eye, seed=seed, progress=False, **options)
                check_complete(image)
                return image

            return render_at

        fixed = {k: v for k, v in base.items() if k != "spp"}
        # The largest value of the knob is refused now if there are not so many wavelengths.
        planned = plan(scene, eye, **fixed, **self._largest("bands"))
        parts: list[Part] = []
        if planned.config.precision == "single" and find_device(device).has_double:
            near_scene, near_eye = rounded_inputs(scene), rounded_inputs(eye)
            rounded = run(near_scene, near_eye, precision="double")
            single = run(near_scene, near_eye, precision="single")
            exact = run(scene, eye, precision="double")
            parts = [Part("representation", rounded, exact), Part("rounding", single, rounded)]
        wavelengths = len(planned.wavelengths_nm)
        if wavelengths > 1:
            few, every = run(scene, eye), run(scene, eye, bands=wavelengths)
            if knob == "spp":
                # Samples do not change what bands do: it is measured where the noise is least.
                few, every = (_once(side, int(max(self.knobs))) for side in (few, every))
            parts.append(Part("discretisation", few, every, is_paired=False))
        return WorkMethod(
            self.name, run(scene, eye), self.knobs, knob, True, tuple(parts), dict(self.options)
        )

    def _by_psf(self, scene: Scene, eye: Eye, where: Mapping[str, Any]) -> WorkMethod:
        assert self.knob is not None
        knob = self.knob
        # What is read from a disk cache has not been computed.
        options = {"psf_cache": False, **where, **self.options}

        def run(value: float, seed: int) -> RetinalImage:
            return psf_baseline.render(
                scene, eye, method=self.method, **(options | {knob: int(value)})
            )

        finest = min(_FINEST[knob], int(2 * max(self.knobs)))
        parts: tuple[Part, ...] = ()
        if finest > max(self.knobs):
            kept: list[RetinalImage] = []

            def fine(value: float, seed: int) -> RetinalImage:
                if not kept:
                    kept.append(run(finest, seed))
                return kept[0]

            parts = (Part("discretisation", run, fine),)
        return WorkMethod(self.name, run, self.knobs, knob, False, parts, dict(self.options))


def _once(run: Run, value: float) -> Run:
    """The same image of a seed for all values of a knob, made once, of one value."""
    kept: dict[int, ImageLike] = {}

    def keep(_: float, seed: int) -> ImageLike:
        if seed not in kept:
            kept[seed] = run(value, seed)
        return kept[seed]

    return keep


def rounded_inputs(value: _Any) -> _Any:
    """A scene or an eye with all its real numbers rounded to float32, still kept as float64."""
    return _rounded(value)


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return float(np.float32(value))
    if isinstance(value, np.ndarray):
        if value.dtype != np.float64:
            return value
        return value.astype(np.float32).astype(np.float64)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        changed = {
            f.name: _rounded(getattr(value, f.name)) for f in dataclasses.fields(value) if f.init
        }
        return dataclasses.replace(value, **changed)
    if isinstance(value, tuple) and not hasattr(value, "_fields"):
        return tuple(_rounded(item) for item in value)
    if isinstance(value, list):
        return [_rounded(item) for item in value]
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    return value
