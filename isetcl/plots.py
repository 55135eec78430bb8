"""Figures, drawn with matplotlib and returned as figures; nothing here computes a result."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from isetcl.psf_baseline import methods
from isetcl.retina.image import RetinalImage
from isetcl.validation.comparison import Comparison, Trial
from isetcl.validation.occlusion.error import OcclusionError

RAY_COLOUR = "#1f4e79"
_METHOD_STYLES = {
    # Colours apart from their neighbours', markers apart from those of like colours.
    "single": ("#7f7f7f", "s"),
    "gather": ("#117a8b", "D"),
    "splat": ("#d68910", "^"),
    "splat_normalized": ("#6d4c41", "v"),
    "layered_sum": ("#c0392b", "s"),
    "layered_normalized": ("#e377c2", "P"),
    "layered_over_visible": ("#8e44ad", "X"),
    "layered_over_normalized": ("#3f51b5", "h"),
    "ikoma": ("#bcbd22", "*"),
    "layered_over": ("#2e8b57", "D"),
    "pupil_clipped": ("#000000", "P"),
    "aperture_samples": ("#ff5722", "o"),
}
_OTHER_STYLE = ("#444444", "p")
_IMAGES_ACROSS = 4
_MOST_LINES = 4  # methods whose profiles can be told apart in one panel
_ACROSS_EDGE = "distance from the depth edge (arcmin); near plane at the left"
_STRIP_COLOUR = "#f2c14e"
_OBJECT_COLOURS = colormaps["tab20"]
_NOTHING = 0.75  # grey
MOST_NAMES = 20
"""Names in the legend of a map of objects."""


def method_label(name: str) -> str:
    """How a method is called in figures and tables."""
    known = methods().get(name)
    return name if known is None else f"{name.replace('_', ' ')} ({known.id})"


def method_style(name: str) -> tuple[str, str]:
    """Colour and marker of a method, the same in all figures."""
    return _METHOD_STYLES.get(name, _OTHER_STYLE)


def retinal_images(comparison: Comparison, white_point: str = "E") -> Figure:
    """All images side by side in the same exposure."""
    images = [("ray tracing", comparison.reference), *comparison.images.items()]
    white = float(np.percentile(comparison.reference.illuminance_lux, 99.5))
    across = min(len(images), _IMAGES_ACROSS)
    down = -(-len(images) // across)
    figure = Figure(figsize=(4.6 * across, 4.7 * down), layout="constrained")
    axes = figure.subplots(down, across, sharex=True, sharey=True, squeeze=False).ravel()
    for i, (ax, (name, image)) in enumerate(zip(axes, images, strict=False)):
        image.plot(ax, white_lux=white, white_point=white_point)
        ax.set_title(method_label(name))
        ax.set_ylabel("visual angle (deg)" if i % across == 0 else "")
        is_lowest = i + across >= len(images)
        ax.tick_params(labelbottom=is_lowest)
        ax.set_xlabel("visual angle (deg)" if is_lowest else "")
    for ax in axes[len(images) :]:
        ax.set_visible(False)
    return figure


def depth_map(image: RetinalImage) -> Figure:
    """Vergence of what each pixel's chief ray meets, 1/m; where there is nothing, grey."""
    depth = image.vergence_dpt
    assert depth is not None
    values = np.ma.masked_equal(depth.values, 0.0)
    figure, ax = _map_axes(image, "depth")
    drawn = _draw_map(ax, image, values, cmap="viridis")
    low, high = drawn.get_clim()
    if high - low < 1e-3 * high:
        # Rounding of an even depth is no depth.
        drawn.set_clim(0.95 * low, 1.05 * high)
    figure.colorbar(drawn, ax=ax, label="vergence of the surface (1/m)", shrink=0.85)
    return figure


def object_map(image: RetinalImage, names: Sequence[str]) -> Figure:
    """Which object each pixel's chief ray meets, with a legend of the largest ones."""
    numbers = image.dataset["object"].values
    found, counts = np.unique(numbers[numbers >= 0], return_counts=True)
    shades = np.array([_OBJECT_COLOURS(i % _OBJECT_COLOURS.N)[:3] for i in range(len(found))])
    pixels = np.full((*numbers.shape, 3), _NOTHING)
    for shade, number in zip(shades, found, strict=True):
        pixels[numbers == number] = shade
    figure, ax = _map_axes(image, "objects")
    _draw_map(ax, image, pixels)
    for i in np.argsort(-counts, kind="stable")[:MOST_NAMES]:
        ax.plot([], [], "s", color=shades[i], label=names[found[i]][:40])
    if len(found):
        title = None if len(found) <= MOST_NAMES else f"{MOST_NAMES} of {len(found)} objects"
        ax.legend(title=title, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    return figure


def normal_map(image: RetinalImage) -> Figure:
    """Normals as colours: x, y, z from -1 to 1 are red, green, blue from 0 to 1."""
    normals = np.moveaxis(image.dataset["normal"].values, 0, -1)
    pixels = np.where(image.dataset["object"].values[..., None] >= 0, 0.5 + 0.5 * normals, _NOTHING)
    figure, ax = _map_axes(image, "normals: right is red, up is green, towards the eye is blue")
    _draw_map(ax, image, np.clip(pixels, 0.0, 1.0))
    return figure


def _map_axes(image: RetinalImage, title: str) -> tuple[Figure, Axes]:
    left, right, bottom, top = image.extent_deg
    figure = Figure(figsize=(6.4, max(2.0, 5.2 * (top - bottom) / (right - left))))
    ax = figure.subplots()
    ax.set_title(title)
    ax.set_xlabel("visual angle (deg)")
    ax.set_ylabel("visual angle (deg)")
    ax.set_facecolor((_NOTHING,) * 3)
    return figure, ax


def _draw_map(ax: Axes, image: RetinalImage, values: np.ndarray, **options: str) -> AxesImage:
    return ax.imshow(values, extent=image.extent_deg, interpolation="nearest", **options)  # type: ignore[arg-type]


def difference_maps(name: str, error: OcclusionError, reference: RetinalImage) -> Figure:
    """Signed and absolute photopic difference of a method, with the depth edge marked."""
    level = float(reference.illuminance_lux.mean())
    signed = 100.0 * error.photopic_difference.values / level
    limit = max(float(np.percentile(np.abs(signed), 99.8)), 0.5)
    extent = reference.extent_deg
    figure = Figure(figsize=(10.6, 4.9), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    panels = (
        (signed, "RdBu_r", -limit, "signed: method minus ray tracing"),
        (np.abs(signed), "magma", 0.0, "absolute"),
    )
    for ax, (values, colours, low, title) in zip(axes, panels, strict=True):
        drawn = ax.imshow(
            values, cmap=colours, vmin=low, vmax=limit, extent=extent, interpolation="nearest"
        )
        _mark_edges(ax, reference, error, "black" if low < 0 else "white")
        ax.set_title(title)
        ax.set_xlabel("visual angle (deg)")
        figure.colorbar(drawn, ax=ax, label="% of the mean illuminance", shrink=0.85)
    axes[0].set_ylabel("visual angle (deg)")
    figure.suptitle(f"{method_label(name)}: difference from ray tracing")
    return figure


def _mark_edges(ax: Axes, reference: RetinalImage, error: OcclusionError, colour: str) -> None:
    """Draw the depth edge and the borders of the occlusion strip."""
    x, y = reference.dataset["x"].values, reference.dataset["y"].values
    depth = reference.vergence_dpt
    if depth is None or not error.strip.any() or min(error.strip.shape) < 2:
        return
    strip = error.strip.astype(float)
    if strip.min() < strip.max():
        ax.contour(x, y, strip, levels=[0.5], colors=colour, linewidths=0.7, linestyles="dotted")
    levels = np.unique(np.round(depth.values, 6))
    if 2 <= len(levels) <= 12:
        middles = (levels[1:] + levels[:-1]) / 2
        ax.contour(x, y, depth.values, levels=middles, colors=colour, linewidths=1.1)


def edge_profiles(comparison: Comparison, edge_angle_deg: float) -> Figure:
    """Profiles of all methods across the depth edge, where the first PSF method errs most.

    Photopic and at three wavelengths; of more than four methods photopic only, a panel for each.
    """
    error = next(iter(comparison.errors.values()))
    x, y = (comparison.reference.dataset[axis].values for axis in ("x", "y"))
    position, line = _line_across(x, y, edge_angle_deg, _worst_place(error, edge_angle_deg))
    inside = _sample(error.strip.astype(float), line) > 0.5
    if len(comparison.images) > _MOST_LINES:
        figure = _profiles_by_method(comparison, position, line, inside)
    else:
        figure = _profiles_by_wavelength(comparison, position, line, inside)
    figure.suptitle(
        "Across the depth edge, where the first PSF method errs most (shaded: within a |D1 - D2|)"
    )
    return figure


def _profiles_by_wavelength(
    comparison: Comparison,
    position: np.ndarray,
    line: tuple[np.ndarray, np.ndarray],
    inside: np.ndarray,
) -> Figure:
    """All methods in one panel, a panel for each of some wavelengths."""
    images = [("ray tracing", comparison.reference), *comparison.images.items()]
    wavelengths = comparison.reference.wavelengths_nm
    shown: list[int | None] = [None]
    if len(wavelengths) > 1:
        shown += [int(np.argmin(np.abs(wavelengths - w))) for w in (450.0, 550.0, 650.0)]
    figure = Figure(figsize=(10.6, 7.2), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True)
    styles = ("-", (0, (4, 1.5)), (0, (1.5, 1.5)), (0, (6, 1.5, 1.5, 1.5)), (0, (3, 3)))
    for ax, index in zip(axes.ravel(), shown, strict=False):
        for i, (name, image) in enumerate(images):
            ax.plot(
                60.0 * position,
                _sample(_quantity(image, index), line),
                color=RAY_COLOUR if i == 0 else method_style(name)[0],
                lw=2.2 if i == 0 else 1.5,
                ls=styles[i],
                label=method_label(name),
                zorder=2 if i == 0 else 3,
            )
        _shade(ax, 60.0 * position, inside)
        ax.set_ylim(bottom=0)
        ax.set_title("photopic" if index is None else f"{wavelengths[index]:g} nm")
        unit = "illuminance (lux)" if index is None else "irradiance (W m$^{-2}$ nm$^{-1}$)"
        ax.set_ylabel(unit)
    for ax in axes[-1]:
        ax.set_xlabel(_ACROSS_EDGE)
    for ax in axes.ravel()[len(shown) :]:
        ax.set_visible(False)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
    return figure


def _profiles_by_method(
    comparison: Comparison,
    position: np.ndarray,
    line: tuple[np.ndarray, np.ndarray],
    inside: np.ndarray,
) -> Figure:
    """Photopic profiles, each method over the reference in a panel of its own."""
    count = len(comparison.images)
    down = -(-count // 3)
    figure = Figure(figsize=(10.6, 2.4 * down + 0.8), layout="constrained")
    axes = figure.subplots(down, 3, sharex=True, sharey=True, squeeze=False)
    truth = _sample(_quantity(comparison.reference, None), line)
    for ax, (name, image) in zip(axes.ravel(), comparison.images.items(), strict=False):
        ax.plot(60.0 * position, truth, color=RAY_COLOUR, lw=2.2)
        found = _sample(_quantity(image, None), line)
        ax.plot(60.0 * position, found, color="#c0392b", lw=1.4, ls=(0, (4, 1.5)))
        _shade(ax, 60.0 * position, inside)
        ax.set_title(method_label(name), fontsize=10)
    # All panels share their axes: only now is the highest curve known.
    axes[0, 0].set_ylim(bottom=0)
    for ax in axes.ravel()[count:]:
        ax.set_visible(False)
    figure.supxlabel(_ACROSS_EDGE)
    figure.supylabel("illuminance (lux); solid: ray tracing, dashed: the method")
    return figure


def _shade(ax: Axes, position: np.ndarray, inside: np.ndarray) -> None:
    """Shade the occlusion strip and mark the edge."""
    ax.fill_between(
        position,
        0,
        1,
        where=list(inside),
        transform=ax.get_xaxis_transform(),
        color=_STRIP_COLOUR,
        alpha=0.25,
        lw=0,
    )
    ax.axvline(0.0, color="0.4", lw=0.8)


def _worst_place(error: OcclusionError, edge_angle_deg: float) -> float:
    """Distance along the edge from the middle of the image where the error is largest, degrees."""
    data = error.photopic_difference
    x, y = data["x"].values, data["y"].values
    reach = 0.25 * min(abs(float(x[-1] - x[0])), abs(float(y[0] - y[-1])))
    places = np.linspace(-reach, reach, 41)
    sizes = []
    for place in places:
        _, line = _line_across(x, y, edge_angle_deg, place)
        sizes.append(float(np.mean(np.square(_sample(data.values, line)))))
    return float(places[int(np.argmax(sizes))])


def _quantity(image: RetinalImage, index: int | None) -> np.ndarray:
    if index is not None:
        return np.asarray(image.irradiance.values[index])
    return np.asarray(image.illuminance_lux.values)


def _line_across(
    x: np.ndarray, y: np.ndarray, edge_angle_deg: float, along_deg: float
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """Distances in degrees along a line across the edge, and its (rows, columns) in the image.

    The edge passes the middle of the image and leans by `edge_angle_deg` anticlockwise from the
    vertical; the line crosses it at right angles, `along_deg` upwards from the middle.
    """
    pitch = abs(float(x[1] - x[0]))
    turn = np.radians(edge_angle_deg)
    reach = 0.25 * min(len(x), len(y)) * pitch
    position = np.arange(-reach, reach, pitch / 2)
    columns = np.cos(turn) * position - np.sin(turn) * along_deg - float(x[0]) + float(x.mean())
    rows = float(y[0]) - float(y.mean()) - np.sin(turn) * position - np.cos(turn) * along_deg
    return position, (rows / pitch, columns / pitch)


def _sample(values: np.ndarray, line: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    from scipy.ndimage import map_coordinates

    return np.asarray(map_coordinates(values.astype(float), line, order=1, mode="nearest"))


def error_against_time(trials: Sequence[Trial]) -> Figure:
    """Every method and sample count: error against run time, over the image and in the strip."""
    names = [t.method for t in trials if t.spp is None]
    figure = Figure(figsize=(10.6, 5.0 + 0.2 * (len(names) // 4)), layout="constrained")
    axes = figure.subplots(1, 2, sharex=True, sharey=True)
    regions = (("error", "whole image"), ("error_strip", "within a |D1 - D2| of the depth edge"))
    for ax, (field, title) in zip(axes, regions, strict=True):
        _draw_trials(ax, trials, field)
        ax.set_title(title)
        ax.set_xlabel("run time (s)")
    axes[0].set_ylabel("root-mean-square error (% of the mean illuminance)")
    handles, labels = axes[0].get_legend_handles_labels()
    columns = len(labels) if len(labels) <= _MOST_LINES + 1 else _IMAGES_ACROSS
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, frameon=False)
    figure.suptitle(
        "Error against run time (independent ray-traced reference, its noise subtracted)"
    )
    return figure


def _draw_trials(ax: Axes, trials: Sequence[Trial], field: str) -> None:
    """Draw one panel of `error_against_time`."""

    def percent(trial: Trial) -> float:
        return 100.0 * max(float(getattr(trial, field)), 1e-6)

    traced = sorted((t for t in trials if t.spp is not None), key=lambda t: t.seconds)
    ax.loglog(
        [t.seconds for t in traced],
        [percent(t) for t in traced],
        "o-",
        color=RAY_COLOUR,
        label="ray tracing (samples a pixel)",
    )
    for t in traced:
        ax.annotate(
            str(t.spp),
            (t.seconds, percent(t)),
            textcoords="offset points",
            xytext=(6, 5),
            fontsize=9,
            color=RAY_COLOUR,
        )
    for t in trials:
        if t.spp is None:
            colour, marker = method_style(t.method)
            ax.loglog(
                t.seconds,
                percent(t),
                marker,
                ms=14 if marker == "*" else 10,
                color=colour,
                label=method_label(t.method),
                ls="",
                mec="white",
                mew=0.5,
            )
    ax.margins(0.15)
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(LogLocator(base=10, subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
    ax.grid(True, which="major", lw=0.4, alpha=0.7)
