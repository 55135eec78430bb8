"""The main job: one retinal image by ray tracing and by PSF methods, with error and cost of each.

Errors are taken against an independent, longer ray tracing of the same scene (another seed), whose
own noise is subtracted in quadrature.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from isetcl import psf_baseline
from isetcl.errors import FocusError, InvalidInputError, check_choice, check_count, check_type
from isetcl.eye.model import Eye
from isetcl.memory import check_memory
from isetcl.render.goal import MAX_SPP, error_of_samples
from isetcl.render.interrupt import check_complete
from isetcl.render.plan import Plan, plan
from isetcl.render.progress import Progress
from isetcl.render.render import render
from isetcl.retina.image import RetinalImage
from isetcl.scene.model import Scene
from isetcl.validation.occlusion.error import OcclusionError, occlusion_error

DEFAULT_SAMPLES = (4, 16, 64, 256)
REFERENCE_SEED_OFFSET = 1_000_003

_VERDICT_PIXELS = 64
_VERDICT_WAVELENGTHS = 5
_MAX_SEED = (1 << 63) - 1
_OPTIONS = ("centre_deg", "wavelengths_nm")

StepCallback = Callable[[str, float], None]


@dataclass(frozen=True)
class Trial:
    """One method at one cost: a point of the error-against-time plot.

    Attributes
    ----------
    method
        "ray tracing" or the name of a PSF method.
    spp
        Samples a pixel and band; None for methods without samples.
    seconds
        Time of the whole call, kernels built before.
    error, error_strip, error_outside
        Photopic root-mean-square error over all pixels, the strips along depth edges, and the
        rest, relative to the mean of the reference.
    reported_error
        The relative standard error the image states of itself; 0 for methods without noise.
    """

    method: str
    spp: int | None
    seconds: float
    error: float
    error_strip: float
    error_outside: float
    reported_error: float


@dataclass(frozen=True, eq=False)
class Comparison:
    """Images and errors of all methods on one scene.

    Attributes
    ----------
    reference : RetinalImage
        Ray-traced, the longest.
    images : dict of RetinalImage
        By PSF method.
    errors : dict of OcclusionError
        By PSF method, against the reference.
    trials : tuple of Trial
        Every method and sample count.
    focus_vergence_dpt : float or None
        Where the eye is focused, 1/m; None if that cannot be told.
    plan_text : str
        What the ray tracer compiled in for the reference, and why.
    build_s : float
        Time to the first, tiny image: kernels built, tables made.
    total_s : float
        Time of everything.
    verdicts : dict of str
        By PSF method, how much of the image it is predicted to show within 1 %, before any ray
        was traced.
    is_complete : bool
        False if Ctrl-C ended it early; it then holds what was finished.
    """

    reference: RetinalImage
    images: dict[str, RetinalImage]
    errors: dict[str, OcclusionError]
    trials: tuple[Trial, ...]
    focus_vergence_dpt: float | None
    plan_text: str
    build_s: float
    total_s: float
    is_complete: bool
    verdicts: dict[str, str] = field(default_factory=dict)


def compare(
    scene: Scene,
    eye: Eye,
    *,
    fov_deg: float = 2.0,
    resolution: int = 384,
    methods: Sequence[str] | Literal["all"] = ("layered_sum", "layered_over"),
    samples: Sequence[int] = DEFAULT_SAMPLES,
    reference_spp: int = 1024,
    seed: int = 0,
    device: str | None = None,
    on_step: StepCallback | None = None,
    **options: Any,
) -> Comparison:
    """The retinal image of a scene by ray tracing and by PSF methods.

    Parameters
    ----------
    scene, eye, fov_deg, resolution, device
        As in `render`.
    methods
        Names of PSF methods or their places in the survey, such as ``"M3"``; or ``"all"``.
    samples
        Samples a pixel of the ray-traced trials.
    reference_spp
        Samples a pixel of the reference.
    seed
        Of the trials; the reference takes another.
    on_step
        Called with what is being done and the fraction done.
    options
        More arguments for both renderers: `centre_deg`, `wavelengths_nm`.

    Raises
    ------
    InvalidInputError, DeviceError
        Before any work starts.
    KeyboardInterrupt
        If interrupted before there is a reference.
    """
    start = time.perf_counter()
    for name in options:
        check_choice("option of compare", name, _OPTIONS)
    names, samples = _checked_work(methods, samples, reference_spp)
    seed = check_count("seed", seed, 0, _MAX_SEED - REFERENCE_SEED_OFFSET)
    if on_step is not None and not callable(on_step):
        raise InvalidInputError(f"on_step must be a function or None, got {on_step!r}")
    where: dict[str, Any] = {"fov_deg": fov_deg, "resolution": resolution, **options}
    planned = plan(
        scene, eye, device=device, expected_error=error_of_samples(reference_spp), **where
    )
    if min(planned.grid.resolution) < 2:
        raise InvalidInputError(
            "resolution must be at least 2 pixels each way, so that there are edges to compare "
            f"at, got {planned.grid.resolution[0]} x {planned.grid.resolution[1]}"
        )
    _check_comparison_memory(planned, len(names))
    explained = planned.explain()
    steps = _Steps(on_step, [*samples, reference_spp], len(names))
    steps.say("preparing")
    render(scene, eye, spp=2, seed=seed, device=device, progress=False, **where)
    build_s = time.perf_counter() - start

    def trace(text: str, spp: int, seed: int) -> RetinalImage:
        with steps.sampling(text, spp) as show:
            return render(scene, eye, spp=spp, seed=seed, device=device, progress=show, **where)

    reference = trace("ray tracing, reference", reference_spp, seed + REFERENCE_SEED_OFFSET)
    trials: list[Trial] = []
    images: dict[str, RetinalImage] = {}
    errors: dict[str, OcclusionError] = {}
    verdicts: dict[str, str] = {}
    is_complete = True
    try:
        check_complete(reference)
        for spp in samples:
            image = trace(f"ray tracing, {spp} samples", spp, seed)
            check_complete(image)
            trials.append(_trial("ray tracing", spp, image, reference))
        for name in names:
            with steps.method(name) as advance:
                image = psf_baseline.render(scene, eye, method=name, progress=advance, **where)
            errors[name] = occlusion_error(image, reference)
            images[name] = image
            trials.append(_trial(name, None, image, reference))
        steps.say("predicting errors of PSF methods")
        verdicts = _verdicts(scene, eye, names, where, planned.grid.resolution)
    except KeyboardInterrupt:
        is_complete = False
    return Comparison(
        reference,
        images,
        errors,
        tuple(trials),
        _focus_vergence_dpt(eye),
        explained,
        build_s,
        time.perf_counter() - start,
        is_complete,
        verdicts,
    )


def _verdicts(
    scene: Scene, eye: Eye, names: list[str], where: dict[str, Any], resolution: tuple[int, int]
) -> dict[str, str]:
    """What `error_bounds` predicts of the methods, on few pixels and wavelengths."""
    shrink = min(1.0, _VERDICT_PIXELS / max(resolution))
    options = where | {"resolution": tuple(max(2, round(n * shrink)) for n in resolution)}
    if where.get("wavelengths_nm") is not None:
        known = np.atleast_1d(where["wavelengths_nm"])
        options["wavelengths_nm"] = known[:: -(-len(known) // _VERDICT_WAVELENGTHS)]
    found = psf_baseline.error_bounds(scene, eye, names, **options)
    return {name: bound.verdict().text for name, bound in found.items()}


def _focus_vergence_dpt(eye: Eye) -> float | None:
    try:
        return eye.focus_vergence_dpt()
    except FocusError:
        return None


def _checked_work(
    methods: Sequence[str] | Literal["all"], samples: Sequence[int], reference_spp: int
) -> tuple[list[str], list[int]]:
    """Names of methods and ascending numbers of samples, refused if there are none such."""
    check_type("samples", samples, (list, tuple))
    names = _method_names(methods)
    counts = sorted(check_count("samples", spp, 2, MAX_SPP) for spp in samples)
    largest = max(counts, default=1)
    if check_count("reference_spp", reference_spp, 2, MAX_SPP) < 2 * largest:
        raise InvalidInputError(
            f"reference_spp must be at least twice the largest sample count ({largest}), got "
            f"{reference_spp}"
        )
    return names, counts


def _method_names(methods: Sequence[str] | Literal["all"]) -> list[str]:
    """Names of methods, each once; ids of the survey are turned into names."""
    known = psf_baseline.methods()
    if isinstance(methods, str) and methods == "all":
        return list(known)
    check_type("methods", methods, (list, tuple))
    by_id = {method.id: name for name, method in known.items()}
    names = []
    for name in methods:
        is_id = isinstance(name, str) and name in by_id
        names.append(by_id[name] if is_id else check_choice("method", name, known))
    return list(dict.fromkeys(names))


def _check_comparison_memory(planned: Plan, n_methods: int) -> None:
    """Refuse a comparison whose images and differences do not fit into memory."""
    columns, rows = planned.grid.resolution
    images = 2 + n_methods
    per_pixel = 8 * len(planned.wavelengths_nm) * (images + 3 * n_methods)
    check_memory(
        f"comparing {n_methods} methods at {columns} x {rows} pixels and "
        f"{len(planned.wavelengths_nm)} wavelengths",
        columns * rows * per_pixel,
        lambda share: f"about {int(columns * share)} x {int(rows * share)} pixels would fit",
    )


def _trial(method: str, spp: int | None, image: RetinalImage, reference: RetinalImage) -> Trial:
    """Errors of an image against the independent reference."""
    found = occlusion_error(image, reference, noise_is_error=True).photopic
    return Trial(
        method,
        spp,
        float(image.provenance["elapsed_s"]),
        found["all"].rms,
        found["strip"].rms,
        found["outside"].rms,
        image.relative_error,
    )


class _Steps:
    """Turns the progress of the parts into one fraction."""

    def __init__(self, on_step: StepCallback | None, spps: Sequence[int], n_methods: int) -> None:
        self._on_step = on_step
        # A PSF method takes about as long as 256 samples.
        self._unit = 1.0 / (sum(spps) + 256.0 * n_methods + 64.0)
        self._done = 64.0 * self._unit
        self._text = ""

    def say(self, text: str, part: float = 0.0) -> None:
        """Report what is being done."""
        self._text = text
        if self._on_step is not None:
            self._on_step(text, min(1.0, self._done + part))

    def sampling(self, text: str, spp: int) -> _Part:
        """A part that takes so many samples."""
        return _Part(self, text, spp * self._unit)

    def method(self, name: str) -> _FractionPart:
        """A part that is one PSF method."""
        return _FractionPart(self, f"PSF method {name}", 256.0 * self._unit)

    def finish(self, share: float) -> None:
        """Count a part as done."""
        self._done += share


class _Part:
    """A context that passes a renderer's progress on."""

    def __init__(self, steps: _Steps, text: str, share: float) -> None:
        self._steps, self._text, self._share = steps, text, share

    def __enter__(self) -> Callable[[Progress], None]:
        self._steps.say(self._text)
        return self._show

    def __exit__(self, *details: Any) -> None:
        self._steps.finish(self._share)

    def _show(self, progress: Progress) -> None:
        known = progress.error == progress.error
        error = f" (error {100 * progress.error:.2g} %)" if known else ""
        self._steps.say(self._text + error, progress.fraction * self._share)


class _FractionPart(_Part):
    """A context that passes on a plain fraction."""

    def __enter__(self) -> Callable[[float], None]:  # type: ignore[override]
        self._steps.say(self._text)
        return lambda fraction: self._steps.say(self._text, fraction * self._share)
