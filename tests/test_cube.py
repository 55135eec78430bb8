"""Hyperspectral pictures: reading them, and channels that are near enough."""

import h5py
import numpy as np
import pytest
import scipy.io

from isetcl.errors import FileError, InvalidInputError, IsetclError, OutOfMemoryError
from isetcl.scene.cube import SpectralCube, load_cube
from isetcl.scene.material import Diffuse, Emission

GRID = np.arange(400.0, 701.0, 10.0)


def smooth(rows=6, columns=5, seed=0):
    """Reflectances like those of natural surfaces: a few broad bumps, between 0.05 and 0.95."""
    rng = np.random.default_rng(seed)
    centres = np.linspace(400, 700, 5)
    bumps = np.exp(-0.5 * ((GRID[None] - centres[:, None]) / 60.0) ** 2)
    mixed = rng.dirichlet(np.ones(5), size=(rows, columns)) @ bumps
    return 0.05 + 0.9 * mixed / mixed.max()


def rebuilt(made):
    """The cube that an image and its spectra stand for, at the cube's wavelengths."""
    spectra = np.stack([spectrum.at(GRID) for spectrum in made.spectra])
    texels = made.image.texels.reshape(*made.image.shape, -1).astype(np.float64)
    return texels @ spectra


@pytest.mark.parametrize("max_error", [0.1, 0.03, 0.01, 1e-3])
def test_channels_are_as_near_as_asked_and_state_their_error(max_error):
    values = smooth()
    made = SpectralCube(values, GRID).channels(max_error)
    difference = rebuilt(made) - values
    scale = np.sqrt(np.mean(values**2))
    rms = np.sqrt(np.mean(difference**2)) / scale
    assert rms <= max_error
    assert made.rms_error == pytest.approx(rms, abs=1e-6)
    assert made.largest_error == pytest.approx(np.max(np.abs(difference)) / scale, abs=1e-6)
    assert made.image.channels < len(GRID)


def test_spectra_of_channels_sum_to_one_so_that_no_light_is_made():
    made = SpectralCube(smooth(), GRID).channels(0.02)
    np.testing.assert_allclose(sum(s.at(GRID) for s in made.spectra), 1.0, atol=1e-12)


def test_fewest_channels_are_those_of_an_exhaustive_search():
    from itertools import combinations

    values = smooth(seed=3)[..., ::3]
    grid = GRID[::3]
    cube = SpectralCube(values, grid)

    def error(knots):
        lines = np.apply_along_axis(lambda y: np.interp(grid, grid[knots], y[knots]), 2, values)
        return np.sqrt(np.mean((lines - values) ** 2) / np.mean(values**2))

    for count in (3, 4, 5):
        inner = combinations(range(1, len(grid) - 1), count - 2)
        best = min(error([0, *middle, len(grid) - 1]) for middle in inner)
        made = cube.channels(0.0, max_channels=count)
        assert made.image.channels == count
        assert made.rms_error == pytest.approx(best, rel=1e-4)


def test_straight_spectra_need_two_channels_and_noise_needs_all():
    line = np.linspace(0.2, 0.8, len(GRID)) * np.linspace(0.1, 1.0, 12).reshape(4, 3, 1)
    made = SpectralCube(line, GRID).channels(1e-6)
    assert made.image.channels == 2
    noise = np.random.default_rng(1).uniform(size=(8, 8, len(GRID)))
    made = SpectralCube(noise, GRID).channels(0.0)
    assert made.image.channels == len(GRID)
    assert made.rms_error < 1e-7


def test_one_wavelength_and_black_cubes_have_channels_too():
    made = SpectralCube(np.full((2, 2, 1), 0.3), [550.0]).channels()
    assert made.image.channels == 1
    assert made.spectra[0].at([550.0]) == 1.0
    made = SpectralCube(np.zeros((2, 2, 5)), GRID[:5]).channels()
    assert (made.rms_error, made.largest_error) == (0.0, 0.0)


def test_cubes_become_materials():
    cube = SpectralCube(smooth(), GRID)
    matt, lamp = cube.diffuse(0.02), cube.scaled(50.0).emission(0.02)
    assert isinstance(matt, Diffuse)
    assert isinstance(lamp, Emission)
    assert matt.texture.channels == len(matt.spectra()) > 1
    with pytest.raises(InvalidInputError, match=r"must be <= 1.*clipped"):
        cube.scaled(2.0).diffuse()
    assert isinstance(cube.scaled(2.0).clipped().diffuse(), Diffuse)


def test_layers_are_chosen_by_wavelength():
    cube = SpectralCube(smooth(), GRID).between(450, 500)
    np.testing.assert_array_equal(cube.wavelengths_nm, np.arange(450.0, 501.0, 10.0))
    np.testing.assert_allclose(cube.values, smooth()[..., 5:11], atol=1e-7)
    with pytest.raises(InvalidInputError, match="no layer between 800 and 900"):
        cube.between(800, 900)


@pytest.mark.parametrize(
    ("values", "grid"),
    [
        (np.zeros((2, 2)), [400, 500]),
        (np.zeros((2, 2, 3)), [400, 500]),
        (np.zeros((0, 2, 2)), [400, 500]),
        (np.full((2, 2, 2), -0.1), [400, 500]),
        (np.full((2, 2, 2), np.nan), [400, 500]),
        (np.full((2, 2, 2), np.inf), [400, 500]),
        (np.zeros((2, 2, 2)), [500, 400]),
        (np.zeros((2, 2, 2), complex), [400, 500]),
        ("abc", [400, 500]),
        (None, None),
    ],
)
def test_impossible_cubes_are_refused(values, grid):
    with pytest.raises(InvalidInputError):
        SpectralCube(values, grid)


@pytest.mark.parametrize("options", [{"max_error": -1}, {"max_error": "a"}, {"max_channels": 1}])
def test_impossible_reductions_are_refused(options):
    with pytest.raises(InvalidInputError):
        SpectralCube(smooth(), GRID).channels(**options)


# -- files ----------------------------------------------------------------------------------------


def write(folder, kind, values, grid=GRID):
    """A cube in a file of a kind, written by another program's library."""
    file = folder / f"cube.{kind}"
    if kind == "npz":
        np.savez(file, reflectance=values, wave=grid)
    elif kind == "mat":
        scipy.io.savemat(file, {"reflectances": values, "wavelength": grid, "note": "text"})
    elif kind == "73.mat":
        with h5py.File(file, "w", userblock_size=512) as opened:
            opened["reflectances"], opened["wavelength"] = values.T, grid[:, None]
        with file.open("r+b") as raw:
            raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    return file


@pytest.mark.parametrize("kind", ["npz", "mat", "73.mat"])
def test_cubes_of_numpy_and_matlab_are_read(tmp_path, kind):
    cube = load_cube(write(tmp_path, kind, smooth()))
    np.testing.assert_allclose(cube.values, smooth(), atol=1e-7)
    np.testing.assert_array_equal(cube.wavelengths_nm, GRID)


def test_a_bare_array_needs_wavelengths(tmp_path):
    file = tmp_path / "cube.npy"
    np.save(file, smooth())
    np.testing.assert_allclose(load_cube(file, wavelengths_nm=GRID).values, smooth(), atol=1e-7)
    with pytest.raises(FileError, match="pass wavelengths_nm="):
        load_cube(file)
    with pytest.raises(FileError, match="31 layers, but 2 wavelengths"):
        load_cube(file, wavelengths_nm=[400, 500])


def envi(folder, interleave="bsq", dtype="<f4", code=4, values=None, **fields):
    values = smooth(4, 3) if values is None else values
    axes = {"bil": (0, 2, 1), "bip": (0, 1, 2)}.get(interleave, (2, 0, 1))
    (folder / "cube.img").write_bytes(values.transpose(axes).astype(dtype).tobytes())
    entries = {
        "samples": values.shape[1],
        "lines": values.shape[0],
        "bands": values.shape[2],
        "data type": code,
        "interleave": interleave,
        "byte order": int(dtype.startswith(">")),
        "wavelength": "{" + ",\n ".join(f"{w:g}" for w in GRID) + "}",
        "description": "{a = b,\n c}",
        **{key.replace("_", " "): value for key, value in fields.items()},
    }
    text = "ENVI\n" + "".join(f"{k} = {v}\n" for k, v in entries.items() if v is not None)
    (folder / "cube.hdr").write_text(text)
    return folder / "cube.hdr"


@pytest.mark.parametrize("interleave", ["bsq", "bil", "bip"])
@pytest.mark.parametrize(("dtype", "code"), [("<f4", 4), (">f8", 5)])
def test_envi_files_are_read_in_every_order(tmp_path, interleave, dtype, code):
    cube = load_cube(envi(tmp_path, interleave, dtype, code))
    np.testing.assert_allclose(cube.values, smooth(4, 3), atol=1e-7)
    np.testing.assert_array_equal(cube.wavelengths_nm, GRID)
    np.testing.assert_array_equal(load_cube(tmp_path / "cube.img").values, cube.values)


def test_envi_scale_units_and_ignored_values_are_applied(tmp_path):
    counts = np.round(10000 * smooth(4, 3))
    counts[0, 0] = -9999
    micrometres = "{" + ",".join(f"{w / 1000:.3f}" for w in GRID) + "}"
    file = envi(
        tmp_path, "bil", "<i2", 2, counts, wavelength=micrometres,
        wavelength_units="Micrometers", reflectance_scale_factor=10000, data_ignore_value=-9999,
    )  # fmt: skip
    cube = load_cube(file)
    np.testing.assert_allclose(cube.wavelengths_nm, GRID, rtol=1e-12)
    np.testing.assert_allclose(cube.values[1:], counts[1:] / 10000, atol=1e-7)
    assert np.all(cube.values[0, 0] == 0.0)


def test_unsorted_bands_are_put_in_order(tmp_path):
    order = np.random.default_rng(5).permutation(len(GRID))
    cube = load_cube(write(tmp_path, "npz", smooth()[..., order], GRID[order]))
    np.testing.assert_array_equal(cube.wavelengths_nm, GRID)
    np.testing.assert_allclose(cube.values, smooth(), atol=1e-7)


def test_negative_noise_is_refused_unless_clipped(tmp_path):
    file = write(tmp_path, "npz", smooth() - 0.2)
    with pytest.raises(InvalidInputError, match="finite and >= 0"):
        load_cube(file)
    cube = load_cube(file, clip=(0.0, 0.5))
    assert (cube.values.min(), cube.values.max()) == (0.0, 0.5)
    for clip in ((1.0, 0.0), (-1.0, 1.0), 3, ("a", "b"), (0, np.nan)):
        with pytest.raises(InvalidInputError):
            load_cube(file, clip=clip)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"samples": None}, "samples"),
        ({"samples": 3.5}, "whole number"),
        ({"lines": 0}, "whole number"),
        ({"lines": 5}, "truncated"),
        ({"data_type": 6}, "data type"),
        ({"interleave": "xyz"}, "interleave"),
        ({"wavelength": None}, "states no wavelengths"),
        ({"wavelength": "{a, b}"}, "must be numbers"),
        ({"wavelength": "{400, 500}"}, "31 layers, but 2"),
        ({"wavelength": "{" + ", ".join(["400"] * 31) + "}"}, "strictly ascending"),
        ({"wavelength_units": "Index"}, "'index'"),
        ({"reflectance_scale_factor": "x"}, "must state a number"),
        ({"bands": "nan"}, "cube"),
        ({"header_offset": -5}, "whole number"),
    ],
)
def test_wrong_envi_headers_are_refused_by_entry(tmp_path, fields, message):
    with pytest.raises(FileError, match=message):
        load_cube(envi(tmp_path, **fields))


def test_a_header_without_data_or_word_is_refused(tmp_path):
    file = envi(tmp_path)
    (tmp_path / "cube.img").unlink()
    with pytest.raises(FileError, match="no data file beside it"):
        load_cube(file)
    file.write_text("hello")
    with pytest.raises(FileError):
        load_cube(file)


@pytest.mark.parametrize("kind", ["npy", "npz", "mat", "73.mat", "hdr"])
def test_sizes_that_do_not_fit_are_said(tmp_path, monkeypatch, kind):
    if kind == "hdr":
        file = envi(tmp_path)
    elif kind == "npy":
        file = tmp_path / "cube.npy"
        np.save(file, smooth())
    else:
        file = write(tmp_path, kind, smooth())
    monkeypatch.setattr("isetcl.memory.available_bytes", lambda: 2000)
    with pytest.raises(OutOfMemoryError, match=r"cube file .* GiB are free; crop each side"):
        load_cube(file, wavelengths_nm=GRID)


@pytest.mark.parametrize("kind", ["npy", "npz", "mat", "hdr", "img", "tif", ""])
@pytest.mark.parametrize(
    "content", [b"", b"\0" * 200, bytes(range(256)) * 4, b"ENVI\n", b"MATLAB 5"]
)
def test_junk_is_refused(tmp_path, kind, content):
    file = tmp_path / f"junk.{kind}"
    file.write_bytes(content)
    with pytest.raises(IsetclError):
        load_cube(file)


def test_archives_without_one_cube_are_refused(tmp_path):
    file = tmp_path / "two.npz"
    np.savez(file, a=smooth(), b=smooth())
    with pytest.raises(FileError, match="one array"):
        load_cube(file)
    np.savez(file, a=np.zeros(3))
    with pytest.raises(FileError, match="one array"):
        load_cube(file)
    np.savez(file, a=np.array([{}], dtype=object))
    with pytest.raises(FileError):
        load_cube(file)
    for path in (tmp_path / "none.npz", tmp_path):
        with pytest.raises(FileError):
            load_cube(path)
    with pytest.raises(InvalidInputError):
        load_cube(None)
