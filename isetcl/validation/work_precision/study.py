"""Error against run time of any set of methods: `isetcl.validation.work_precision`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_choice,
    check_count,
    check_finite,
    check_positive,
    check_type,
)
from isetcl.eye.model import Eye
from isetcl.memory import check_memory
from isetcl.retina.cone_noise import ConeNoise
from isetcl.retina.image import RetinalImage
from isetcl.scene.model import Scene
from isetcl.validation.work_precision import assemble
from isetcl.validation.work_precision.cone_units import cone_squares
from isetcl.validation.work_precision.estimators import Squares, errors_of
from isetcl.validation.work_precision.kinds import kinds_of_error
from isetcl.validation.work_precision.method import ImageLike, Point, WorkMethod
from isetcl.validation.work_precision.notes import (
    ENOUGH_REPLICATES,
    LEAST_MEASUREMENTS,
    cone_record,
    load,
    notes_of,
    record_of,
    surroundings,
)
from isetcl.validation.work_precision.pixels import (
    QUANTITIES,
    Pixels,
    Quantity,
    check_same_grid,
    pixels_of,
)
from isetcl.validation.work_precision.reference import (
    LEAST_FACTOR,
    SEED_OFFSET,
    Reference,
    check_independent,
    reference_samples,
    traced_reference,
)
from isetcl.validation.work_precision.result import WorkPrecision
from isetcl.validation.work_precision.scene_method import SceneMethod
from isetcl.validation.work_precision.timing import (
    CLOCKS,
    LEAST_S,
    Clock,
    ClockName,
    NoisyTimingError,
    Times,
    check_quiet,
    timed,
)

StepCallback = Callable[[str, float], None]


_CONE_NOISE = ConeNoise(0.1)
_WHERE = ("fov_deg", "resolution", "centre_deg", "wavelengths_nm")


def work_precision(
    methods: Sequence[str | SceneMethod | WorkMethod],
    *,
    scene: Scene | None = None,
    eye: Eye | None = None,
    reference: Reference | ImageLike | None = None,
    replicates: int = ENOUGH_REPLICATES,
    quantity: Quantity = "photopic",
    targets: Sequence[float] = (0.01, 0.001),
    reference_factor: int = LEAST_FACTOR,
    cone_noise: ConeNoise = _CONE_NOISE,
    illuminance_lux: float | None = 10.0,
    parts: bool = True,
    time: ClockName = "wall",
    least_s: float = LEAST_S,
    allow_noise: bool = False,
    seed: int = 0,
    device: str | None = None,
    clock: Clock | None = None,
    on_step: StepCallback | None = None,
    **where: Any,
) -> WorkPrecision:
    """Error against run time: each method at each value of its knob, against one reference.

    Every measurement is one call at one seed; the methods take turns, and the same seeds serve all
    of them. Errors are relative to the mean of the reference.

    Parameters
    ----------
    methods
        Names (``"ray_tracing"`` or a PSF method), `SceneMethod` with a knob and options, or
        `WorkMethod` around a function of your own.
    scene, eye
        What isetcl's methods render; not needed for functions of your own.
    reference
        None traces one: float64, random samples instead of Sobol' points, another seed, and
        `reference_factor` times the samples of the largest method. Or a `Reference`, an image or
        an array, whose error is taken as known.
    replicates
        Images of different seeds of each random method, and measurements of time of all; 16 or
        more give intervals that hold, fewer are said.
    quantity
        ``"photopic"`` judges brightness, ``"spectral"`` the irradiance at every wavelength.
    targets
        Relative root-mean-square errors whose times are wanted.
    reference_factor
        Least samples of the reference over those of any method.
    cone_noise
        The cone in whose Poisson noise errors are told as well, and the part of it to which times
        are wanted (`ratio`): below a tenth, more samples cannot be seen.
    illuminance_lux
        Mean of the reference on the retina in whose light that cone is, lux; None leaves it as it
        is. Images without a spectrum have no error in these units.
    parts
        Whether to measure representation, rounding and discretisation by themselves, which takes
        a few more images.
    time
        ``"wall"`` or ``"cpu"``: what errors are set against, and what must be steady.
    least_s
        Calls are repeated until a measurement lasts so long.
    allow_noise
        Report although times differed by more than 20 % ((median - least) / least), marked so.
    seed
        The first one of the replicates.
    device
        See `find_device`.
    clock
        For tests; None is the machine's.
    on_step
        Called with what is being done and the fraction done.
    where
        Arguments that all renderers take: `fov_deg`, `resolution`, `centre_deg`, `wavelengths_nm`.

    Raises
    ------
    InvalidInputError
        If an argument breaks its rule, grids differ (both are named), an image has NaN, or a call
        takes no time.
    NoisyTimingError
        If the machine was too noisy and `allow_noise` is False; its `result` has all but times.
    """
    for name in where:
        check_choice("argument of work_precision", name, _WHERE)
    named = _methods(methods, scene, eye, where, device)
    count = check_count("replicates", replicates, 2, 10_000)
    check_choice("quantity", quantity, QUANTITIES)
    check_choice("time", time, CLOCKS)
    check_type("allow_noise", allow_noise, bool)
    wanted = tuple(check_positive("target", target) for target in targets)
    if check_finite("least_s", least_s) < 0:
        raise InvalidInputError(f"least_s must be >= 0 s, got {least_s:g}")
    first_seed = check_count("seed", seed, 0, 1 << 62)
    factor = check_count("reference_factor", reference_factor, 1)
    points = [Point(method, value) for method in named for value in method.knobs]
    rounds = [_rounds(point, count) for point in points]
    say = _Steps(on_step, sum(rounds) + (2 if parts else 1) * len(points))
    check_type("cone_noise", cone_noise, ConeNoise)
    if illuminance_lux is not None:
        check_positive("illuminance_lux", illuminance_lux, "lux")
    load_before = load()
    seeds = list(range(first_seed, first_seed + count))
    most = _most_samples(methods)
    found = _reference(reference, scene, eye, where, most, factor, first_seed, device, say)
    check_independent(found, seeds, most, factor)
    truth = found.pixels(quantity)
    if not np.mean(truth.values) != 0:
        raise InvalidInputError("the reference must have a mean that is not 0: it is black")
    excitations = found.excitations(cone_noise, illuminance_lux)
    check_memory(
        f"{len(points)} x {count} images of {truth.values.size} values",
        8.0 * len(points) * count * truth.values.size,
        lambda share: "take fewer replicates, knobs or pixels",
    )
    images, seen, times = _measure(
        points, seeds, truth, quantity, Clock() if clock is None else clock, least_s, time, say
    )
    flat, variance = truth.values.ravel(), truth.variance.ravel()
    errors = [errors_of(np.array(own), flat, variance) for own in images]
    cones = _cone_errors(seen, truth, excitations)
    columns = []
    for point in points:
        if parts:
            say(f"kinds of error of {point.what}", 1)
        columns.append(kinds_of_error(point, seeds, truth, quantity) if parts else {})
    notes = notes_of(points, errors, count, found, images)
    spreads = {p.what: t.spread(time) for p, t in zip(points, times, strict=True)}
    trouble = check_quiet(spreads)
    details = {
        **({} if scene is None else surroundings(scene, eye, device)),
        **record_of(named, found, where, quantity),
        **cone_record(cone_noise, illuminance_lux, excitations),
        **{"load_before": load_before, "load": load()},
    }
    pieces = assemble.Pieces(
        tuple(named), errors, times, columns, cones, cone_noise.ratio, wanted, time,
        first_seed, count, details,
    )  # fmt: skip
    if trouble is None or allow_noise:
        said = notes if trouble is None else [*notes, trouble]
        return assemble.result(pieces, said, has_times=True)
    other = ", take time='cpu'" if time == "wall" else ""
    withheld = assemble.result(pieces, [*notes, trouble], has_times=False)
    raise NoisyTimingError(
        f"{trouble}; wait until nothing else runs, raise least_s{other}, or pass allow_noise=True "
        "to have it marked",
        withheld,
    )


def _methods(
    methods: Sequence[str | SceneMethod | WorkMethod],
    scene: Scene | None,
    eye: Eye | None,
    where: Mapping[str, Any],
    device: str | None,
) -> list[WorkMethod]:
    """All methods as functions of knob and seed, each name once."""
    check_type("methods", methods, (list, tuple))
    if not methods:
        raise InvalidInputError("methods must hold one or more, got none")
    found = []
    for method in methods:
        check_type("method", method, (str, SceneMethod, WorkMethod))
        if isinstance(method, WorkMethod):
            found.append(method)
            continue
        chosen = SceneMethod(method) if isinstance(method, str) else method
        if scene is None or eye is None:
            raise InvalidInputError(f"method {chosen.name!r} renders a scene: pass scene= and eye=")
        found.append(chosen.on(scene, eye, where, device))
    names = [method.name for method in found]
    if len(set(names)) < len(names):
        raise InvalidInputError(
            f"methods must have different names, got {', '.join(names)}; give them a label"
        )
    return found


def _most_samples(methods: Sequence[str | SceneMethod | WorkMethod]) -> int:
    """Largest samples a pixel of any ray tracing; 1 if there is none."""
    most = 1
    for method in methods:
        chosen = SceneMethod(method) if isinstance(method, str) else method
        if isinstance(chosen, SceneMethod) and chosen.is_traced:
            fixed = int(chosen.options.get("spp", 256))
            most = max(most, int(max(chosen.knobs)) if chosen.knob == "spp" else fixed)
    return most


def _reference(
    reference: Reference | ImageLike | None,
    scene: Scene | None,
    eye: Eye | None,
    where: Mapping[str, Any],
    most: int,
    factor: int,
    seed: int,
    device: str | None,
    say: _Steps,
) -> Reference:
    if isinstance(reference, Reference):
        return reference
    if reference is not None:
        check_type("reference", reference, (Reference, RetinalImage, np.ndarray))
        return Reference(reference)
    if scene is None or eye is None:
        raise InvalidInputError(
            "a reference is needed: pass reference=, or scene= and eye= to have one traced"
        )
    samples = reference_samples(most, factor)
    say(f"ray tracing the reference, {samples} samples", 0)
    return traced_reference(scene, eye, where, spp=samples, seed=seed + SEED_OFFSET, device=device)


def _measure(
    points: list[Point],
    seeds: list[int],
    truth: Pixels,
    quantity: Quantity,
    clock: Clock,
    least_s: float,
    time: ClockName,
    say: _Steps,
) -> tuple[list[list[np.ndarray]], list[list[np.ndarray]], list[Times]]:
    """Images, their brightness and times of all points, in turns; the first round warms up."""
    images: list[list[np.ndarray]] = [[] for _ in points]
    seen: list[list[np.ndarray]] = [[] for _ in points]
    times = [Times() for _ in points]

    def call(i: int, seed: int, least: float) -> tuple[float, float]:
        point = points[i]
        image, wall, cpu = timed(
            lambda: point.method.run(point.value, seed), point.what, clock, least
        )
        if time == "cpu" and not cpu > 0:
            raise InvalidInputError(
                f"the processor time of {point.what} must be > 0 s, got {cpu:g} s; raise least_s, "
                "or take time='wall'"
            )
        pixels = pixels_of(image, f"the image of {point.what}", quantity)  # type: ignore[arg-type]
        check_same_grid(pixels, f"the image of {point.what}", truth)
        if isinstance(image, RetinalImage) and "transfer_s" in image.provenance:
            times[i].transfer_s.append(float(image.provenance["transfer_s"]))
        if len(images[i]) == 0 or point.method.is_random:
            images[i].append(pixels.values.ravel())
            seen[i].append(pixels.brightness.ravel())
        return wall, cpu

    for i, point in enumerate(points):
        say(f"first image of {point.what}", 1)
        times[i].first_s = call(i, seeds[0], 0.0)[0]
        images[i].clear()
        seen[i].clear()
    for r, seed in enumerate(seeds):
        for i, point in enumerate(points):
            if r >= _rounds(point, len(seeds)):
                continue
            say(f"replicate {r + 1} of {len(seeds)}, {point.what}", 1)
            wall, cpu = call(i, seed, least_s)
            times[i].wall_s.append(wall)
            times[i].cpu_s.append(cpu)
    return images, seen, times


def _cone_errors(
    seen: list[list[np.ndarray]], truth: Pixels, excitations: float | None
) -> list[Squares | None]:
    """Errors of all points in units of cone noise; None where no excitations are known."""
    if excitations is None:
        return [None] * len(seen)
    flat, variance = truth.brightness.ravel(), truth.brightness_variance.ravel()
    return [cone_squares(np.array(own), flat, variance, excitations) for own in seen]


def _rounds(point: Point, replicates: int) -> int:
    """Measurements of a point: images without noise need no more than times do."""
    return replicates if point.method.is_random else min(replicates, LEAST_MEASUREMENTS)


class _Steps:
    """Turns calls into one fraction."""

    def __init__(self, on_step: StepCallback | None, total: int) -> None:
        if on_step is not None and not callable(on_step):
            raise InvalidInputError(f"on_step must be a function or None, got {on_step!r}")
        self._on_step, self._total, self._done = on_step, total, 0

    def __call__(self, text: str, calls: int) -> None:
        if self._on_step is not None:
            self._on_step(text, min(1.0, self._done / self._total))
        self._done += calls
