"""Pictures of excitations, and `isetcl cones` as a user meets it."""

import struct
import sys

import numpy as np
import pytest
from matplotlib.colors import to_rgb

import isetcl as ic
from isetcl import cli
from isetcl.cones import ConeMosaic, movies
from isetcl.cones.excitation_pictures import line, plot_excitations
from isetcl.cones.pictures import COLOURS
from isetcl.cones.receptors import ReceptorType
from isetcl.errors import FileError, InvalidInputError, OutOfMemoryError

pytestmark = pytest.mark.filterwarnings("ignore:pixels are up to")

EYE = ic.eyes.navarro()


@pytest.fixture(scope="module")
def image():
    values = np.full((31, 24, 24), 2e-3, np.float32)
    values[:, :, 12:] *= 0.1
    grid = ic.RetinalGrid.of(EYE, 0.4, 24)
    return ic.RetinalImage.from_arrays(grid, np.arange(400.0, 701.0, 10.0), values)


@pytest.fixture(scope="module")
def seen(image):
    x, y = np.meshgrid(np.linspace(-0.15, 0.15, 11), np.linspace(-0.15, 0.15, 11))
    places = np.stack([x.ravel(), y.ravel()], axis=1)
    mosaic = ConeMosaic.from_positions(places, np.arange(121) % 3, spacing_um=5.0)
    gaze = np.array([[0.0, 0.0], [0.02, 0.0], [-0.02, 0.01]])
    return mosaic.excitations(image, gaze_deg=gaze, dark_rate_hz=250.0)


def test_the_map_shows_every_receptor_by_its_excitations(seen):
    (drawn,) = plot_excitations(seen, frame=1).collections
    np.testing.assert_allclose(drawn.get_array(), seen.mean.values[1])
    np.testing.assert_allclose(
        drawn.get_offsets(), np.stack([seen.dataset["x_deg"], seen.dataset["y_deg"]], axis=1)
    )


def test_in_colours_of_types_the_most_excited_of_each_has_its_full_colour(seen):
    drawn = seen.plot(colour="type", shown="counts").collections[0]
    colours = drawn.get_facecolor()[:, :3]
    for kind in range(3):
        own = np.flatnonzero(seen.types == kind)
        brightest = own[np.argmax(seen.counts.values[0, own])]
        np.testing.assert_allclose(colours[brightest], to_rgb(COLOURS[ReceptorType(kind)]))


def test_receptors_lie_in_one_layer_to_scale():
    # Types in layers of their own would hide each other where receptors are smaller than pixels.
    places = np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.0, 0.1]])
    mosaic = ConeMosaic.from_positions(places, [2, 0, 1, 3], spacing_um=[3.0, 4.0, 5.0, 2.0])
    axes = mosaic.plot()
    (discs,) = (c for c in axes.collections if len(c.get_offsets()))
    expected = [to_rgb(COLOURS[ReceptorType(kind)]) for kind in mosaic.types]
    np.testing.assert_allclose(discs.get_facecolor()[:, :3], expected)
    np.testing.assert_allclose(2.0 * discs._widths, mosaic.aperture_deg)
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels == ["L (1)", "M (1)", "S (1)", "rod (1)"]


def test_a_profile_has_the_receptors_of_one_line(seen):
    chosen = line(seen, 0.03, 0.01)
    np.testing.assert_allclose(seen.dataset["y_deg"].values[chosen], 0.03, atol=1e-12)
    assert chosen.sum() == 11
    axes = seen.plot_profile(y_deg=0.03, width_deg=0.01)
    shown = [drawn for drawn in axes.lines if drawn.get_label() in "LMS"]
    assert sum(len(drawn.get_xdata()) for drawn in shown) == 11
    with pytest.raises(InvalidInputError, match="no receptor lies within"):
        line(seen, 3.0)


def test_a_movie_has_a_frame_for_every_frame(seen, tmp_path):
    from PIL import Image

    path = seen.movie(tmp_path / "a.gif", width_px=200)
    with Image.open(path) as movie:
        assert movie.n_frames == 3
        assert movie.size[0] == 200
    assert [p.name for p in tmp_path.iterdir()] == ["a.gif"]


def boxes(data):
    """Boxes of an ISO 14496-12 file by their names, and the order of the outermost."""
    found, order = {}, []
    while data:
        size, name = struct.unpack(">I4s", data[:8])
        found[name], data = data[8:size], data[size:]
        order.append(name)
    return found, order


def movie_header(path):
    """Movie's sample description and times, read by ISO 14496-12 and 14496-15 alone."""
    outer, order = boxes(path.read_bytes())
    media = boxes(boxes(boxes(outer[b"moov"])[0][b"trak"])[0][b"mdia"])[0]
    table = boxes(boxes(media[b"minf"])[0][b"stbl"])[0]
    scale, duration = struct.unpack(">II", media[b"mdhd"][12:20])
    entry = boxes(table[b"stsd"][8:])[0][b"avc1"]
    return {
        "frames": struct.unpack(">I", table[b"stsz"][8:12])[0],
        "seconds": duration / scale,
        "size": struct.unpack(">HH", entry[24:28]),
        "profile": boxes(entry[78:])[0][b"avcC"][1],
        "order": [name for name in order if name in (b"moov", b"mdat")],
    }


@pytest.mark.slow
def test_an_mp4_is_what_browsers_play(seen, tmp_path):
    pytest.importorskip("imageio_ffmpeg")
    path = seen.movie(tmp_path / "a.mp4", width_px=321, frames_per_s=10)
    assert [p.name for p in tmp_path.iterdir()] == ["a.mp4"]
    header = movie_header(path)
    # Baseline, Main and High are 8 bit of 4:2:0 (H.264, annex A.2); sizes must be even for that.
    assert header.pop("profile") in (66, 77, 100)
    assert header.pop("seconds") == pytest.approx(0.3)
    assert header == {"frames": 3, "size": (320, 266), "order": [b"moov", b"mdat"]}


def test_movies_that_cannot_be_written_are_refused(seen, tmp_path, monkeypatch):
    monkeypatch.setattr(movies, "ffmpeg", lambda: None)
    with pytest.raises(InvalidInputError, match=r'"isetcl\[movies\]", or write .a\.gif. instead'):
        movies.write_movie(seen, tmp_path / "a.mp4")
    with pytest.raises(InvalidInputError, match=r"must end in \.gif or \.mp4"):
        movies.write_movie(seen, tmp_path / "a.avi")
    with pytest.raises(InvalidInputError, match="frame must be between 0 and 2"):
        seen.plot(frame=3)
    monkeypatch.setattr("isetcl.memory.available_bytes", lambda: 10_000_000)
    with pytest.raises(OutOfMemoryError, match=r"3 frames of 4000 pixels .*width_px = 912, fewer"):
        seen.movie(tmp_path / "a.gif", width_px=4000)
    assert not list(tmp_path.iterdir())


def test_what_ffmpeg_complains_of_is_told(seen, tmp_path, monkeypatch):
    program = tmp_path / "ffmpeg"
    program.write_text("#!/bin/sh\necho 'Unknown encoder h264' >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setattr(movies, "ffmpeg", lambda: str(program))
    with pytest.raises(FileError, match=r"could not write the movie: Unknown encoder h264; "):
        movies.write_movie(seen, tmp_path / "a.mp4")
    assert [p.name for p in tmp_path.iterdir()] == ["ffmpeg"]


@pytest.fixture
def isetcl(tmp_path, monkeypatch, capsys):
    """Run `isetcl cones` in an empty folder: exit status, standard output, standard error."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["isetcl", "cones", *arguments])
        try:
            cli.main()
            status = 0
        except SystemExit as stopped:
            status = stopped.code
        printed = capsys.readouterr()
        return status, printed.out, printed.err

    return run


def test_a_saved_image_becomes_excitations_and_pictures(isetcl, image, tmp_path):
    image.save(tmp_path / "a.nc")
    status, out, _ = isetcl("a.nc", "--fov", "0.12", "--dark", "250", "--mat", "-o", "o")
    assert status == 0
    assert {p.name for p in (tmp_path / "o").iterdir()} == {
        *("excitations.nc", "mosaic.nc", "retina.nc", "mosaic.mat", "opticalimage.mat"),
        *("excitations.png", "mosaic.png", "profile.png"),
    }
    found = ic.cones.Excitations.load(tmp_path / "o" / "excitations.nc")
    assert found.dataset.attrs["command"].startswith("isetcl cones a.nc --fov 0.12")
    assert f"{float(found.of('L').mean()):.4g}" in out
    # Behind the lens, of which the image had none: 32 years by default.
    assert [step.label for step in ic.RetinalImage.load(tmp_path / "o" / "retina.nc").steps] == [
        "media"
    ]


def test_an_image_that_isetbio_cannot_have_is_refused_before_any_work(isetcl, tmp_path):
    grid = ic.RetinalGrid.of(EYE, (0.4, 0.3), (8, 8))
    values = np.ones((3, 8, 8), np.float32)
    ic.RetinalImage.from_arrays(grid, np.array([500.0, 550.0, 600.0]), values).save(
        tmp_path / "a.nc"
    )
    status, _, err = isetcl("a.nc", "--fov", "0.1", "--mat", "-o", "o")
    assert status == 2
    assert "must have square pixels" in err
    assert [p.name for p in tmp_path.iterdir()] == ["a.nc"]


@pytest.mark.slow
def test_a_scene_becomes_excitations_and_a_movie(isetcl, tmp_path):
    pytest.importorskip("isetcl.cones.eye_movements")
    status, _, err = isetcl(
        *("slanted-edge", "--fov", "0.1", "--lux", "5", "--spp", "4", "--size", "40"),
        *("--movie", "20", "-o", "o"),
    )
    assert status == 0, err
    assert (tmp_path / "o" / "fixation.gif").is_file()


@pytest.mark.slow
def test_a_scene_may_be_looked_at_without_an_image(isetcl, tmp_path):
    status, out, err = isetcl("slanted-edge", "--fov", "0.1", "--spp", "8", "--no-image", "-o", "o")
    assert status == 0, err
    assert "error of the means" in out
    assert {p.name for p in (tmp_path / "o").iterdir()} == {
        *("excitations.nc", "mosaic.nc", "light.nc"),
        *("excitations.png", "mosaic.png", "profile.png"),
    }
    light = ic.IrradianceAtPlaces.load(tmp_path / "o" / "light.nc")
    mosaic = ConeMosaic.load(tmp_path / "o" / "mosaic.nc")
    found = ic.cones.Excitations.load(tmp_path / "o" / "excitations.nc")
    assert found.standard_error.shape == found.mean.shape
    np.testing.assert_array_equal(mosaic.excitations(light).mean.values, found.mean.values)


def test_a_scene_that_is_missing_is_refused_before_there_is_a_folder(isetcl, tmp_path):
    status, _, err = isetcl("nothing.glb", "-o", "o")
    assert status == 2
    assert "nothing.glb" in err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--no-image"], "--no-image needs a scene"),
        (["--fov", "0"], "--fov must be > 0"),
        (["--fov", "1"], "reaches beyond the image"),
        (["--centre", "1"], "--centre must be two numbers"),
        (["--time", "-5"], "--time must be > 0"),
        (["--dark", "-1"], "--dark must be >= 0"),
        (["--lux", "0"], "--lux must be > 0"),
        (["--age", "5"], "age"),
        (["--density", "curcio"], "did you mean curcio1990"),
        (["--movie", "0"], "--movie must be > 0"),
        (["--mp4"], "ask for one with --movie"),
        (["--fov", "0.4", "--movie", "60"], "as the gaze moves by up to 0.0"),
        (["--movie", "1e9"], "at most 2 are made at once"),
        (["--size", "40", "--spp", "8"], "--size, --spp: a saved image is not rendered again"),
        (["--eye", "arizona"], "--eye: a saved image is not rendered again"),
        (["--pupil", "4", "--accommodation", "centre"], "--pupil, --accommodation: a saved image"),
    ],
)
def test_bad_options_are_refused_before_any_work(isetcl, image, tmp_path, arguments, message):
    image.save(tmp_path / "a.nc")
    status, _, err = isetcl("a.nc", *arguments)
    assert status == 2
    assert message in err
    assert [p.name for p in tmp_path.iterdir()] == ["a.nc"]
