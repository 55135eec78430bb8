"""Movies of excitations, as GIF or MP4."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from isetcl.cones.excitation_pictures import GROUND, Shown, add_receptors, label_of, values_of
from isetcl.cones.excitations import Excitations
from isetcl.errors import FileError, InvalidInputError, check_count, check_type
from isetcl.memory import check_memory
from isetcl.output import replace_file

if TYPE_CHECKING:
    from matplotlib.collections import Collection
    from matplotlib.figure import Figure
    from matplotlib.text import Text

_MOST_FRAMES = 2000
_LEAST_WITH_AXES_PX = 320  # in narrower movies the numbers of axes cannot be read
_LETTERS_PX = 12
_BYTES_PER_PIXEL = 4  # of a GIF, whose frames are all kept until it is written
_FORMATS = (".gif", ".mp4")

# H.264 with half the colour resolution is what browsers and players open; with its index in front
# of the frames a movie starts before all of it has arrived.
_CODEC = "h264"
_OPTIONS = ["-pix_fmt", "yuv420p", "-crf", "18", "-movflags", "+faststart"]


def write_movie(
    excitations: Excitations,
    path: str | Path,
    *,
    shown: Shown = "mean",
    frames_per_s: int = 20,
    width_px: int = 480,
) -> Path:
    """Write the frames as a movie, GIF or MP4 by the suffix; returns the path.

    Parameters
    ----------
    path
        ``.gif``, or ``.mp4`` (H.264), which needs the extra ``isetcl[movies]`` or the program
        ffmpeg.
    shown
        ``"mean"``, or ``"counts"`` for noisy instances.
    frames_per_s
        Speed of the movie; the time of the excitations is written above.
    width_px
        Width of the movie, pixels; MP4 rounds it down to an even number. Below 320 pixels axes and
        scale are left out.

    Raises
    ------
    InvalidInputError
        If there are more than 2000 frames, or the suffix is another, or MP4 without ffmpeg.
    FileError
        If the file cannot be written.
    OutOfMemoryError
        If a GIF would not fit into memory.
    """
    check_type("path", path, (str, Path))
    target = Path(path)
    check_movie(target)
    values = values_of(excitations, shown)
    if len(values) > _MOST_FRAMES:
        raise InvalidInputError(
            f"a movie has at most {_MOST_FRAMES} frames, got {len(values)}; take every n-th"
        )
    speed = check_count("frames_per_s", frames_per_s, 1, 50)
    width = check_count("width_px", width_px, 100, 4000)
    if target.suffix.lower() == ".gif":
        check_memory(
            f"a GIF of {len(values)} frames of {width} pixels",
            _BYTES_PER_PIXEL * len(values) * width**2,
            lambda side: f"take width_px = {int(width * side)}, fewer frames, or write an MP4",
        )
    return replace_file(target, lambda file: _write_frames(excitations, values, file, speed, width))


def check_movie(path: Path) -> None:
    """Raise InvalidInputError unless movies of this suffix can be written here."""
    suffix = path.suffix.lower()
    if suffix not in _FORMATS:
        raise InvalidInputError(f"a movie must end in .gif or .mp4, got {path.name!r}")
    if suffix == ".mp4" and ffmpeg() is None:
        raise InvalidInputError(
            f"movie {path.name!r}: MP4 needs the program ffmpeg, which is not installed; get it "
            f'with pip install "isetcl[movies]", or write {path.stem + ".gif"!r} instead'
        )


def ffmpeg() -> str | None:
    """The program ffmpeg: that of the extra ``movies``, else an installed one; None without."""
    import matplotlib as mpl

    names = [mpl.rcParams["animation.ffmpeg_path"]]
    try:
        import imageio_ffmpeg

        names.insert(0, imageio_ffmpeg.get_ffmpeg_exe())
    except (ImportError, RuntimeError):  # not installed; installed, but without its program
        pass
    return next(filter(None, map(shutil.which, names)), None)


def _write_frames(
    excitations: Excitations, values: np.ndarray, path: Path, speed: int, width_px: int
) -> None:
    import matplotlib as mpl
    from matplotlib.animation import FFMpegWriter, PillowWriter

    figure, drawn, time = _drawing(excitations, float(values.max()), width_px)
    times_ms = 1e3 * excitations.dataset["time_s"].values
    with mpl.rc_context():
        writer: Any = PillowWriter(fps=speed)
        if path.suffix.lower() == ".mp4":
            mpl.rcParams["animation.ffmpeg_path"] = ffmpeg()
            writer = FFMpegWriter(speed, codec=_CODEC, extra_args=_OPTIONS)
        try:
            with writer.saving(figure, str(path), figure.dpi):
                for time_ms, frame in zip(times_ms.tolist(), values, strict=True):
                    drawn.set_array(frame)
                    time.set_text(f"{time_ms:.4g} ms")
                    writer.grab_frame()
        except (subprocess.CalledProcessError, BrokenPipeError) as error:
            said = getattr(error, "stderr", None) or ""
            lines = (said if isinstance(said, str) else said.decode(errors="replace")).splitlines()
            raise FileError(
                f"ffmpeg ({ffmpeg()}) could not write the movie: "
                f"{lines[-1][:200] if lines else error}; free room on the disk, get another ffmpeg "
                'with pip install "isetcl[movies]", or write a GIF'
            ) from error


def _drawing(
    excitations: Excitations, most: float, width_px: int
) -> tuple[Figure, Collection, Text]:
    """A figure, its receptors without colours, and its line for the time."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    is_small = width_px < _LEAST_WITH_AXES_PX
    inches = 2.0 if is_small else 6.0
    figure = Figure(figsize=(inches, inches * (1.0 if is_small else 5.0 / 6.0)))
    figure.set_dpi(width_px / inches)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1) if is_small else (0.13, 0.12, 0.7, 0.78))
    drawn = add_receptors(axes, excitations)
    drawn.set_cmap("gray")
    drawn.set_clim(0.0, most or 1.0)
    if is_small:
        ground = {"facecolor": GROUND, "edgecolor": "none", "pad": 1.0}
        points = 72.0 * _LETTERS_PX / figure.dpi
        place: dict[str, Any] = {"transform": axes.transAxes, "fontsize": points, "bbox": ground}
        return figure, drawn, axes.text(0.02, 0.03, "", color="w", **place)
    scale = figure.add_axes((0.86, 0.12, 0.03, 0.78))
    figure.colorbar(drawn, cax=scale, label=label_of(excitations))
    return figure, drawn, axes.set_title("", fontsize="medium")
