"""PSFs over depth and field, kept on disk; images in patches and tiles."""

import importlib
import multiprocessing
import os

import numpy as np
import pytest
from oracles import reduced_eye
from scipy.signal import fftconvolve
from slow_cases import slow_after

import isetcl as ic
from isetcl.psf_baseline import Psf, PsfBank, PsfCache
from isetcl.psf_baseline.bank import kernel_distance
from isetcl.psf_baseline.convolve import LayerSpectra, SpectralBlur, transfer_of
from isetcl.psf_baseline.patches import field_patches, tiles
from isetcl.psf_baseline.psf_cache import default_cache
from isetcl.psf_baseline.psfs.cells import disc_cells
from isetcl.psf_baseline.view import Layer

render_module = importlib.import_module("isetcl.psf_baseline.render")
EYE = ic.eyes.navarro(4.0, 1.25)
PITCH = 0.02


def bank(tmp_path=None, kind="geometric", eye=EYE, **options):
    cache = None if tmp_path is None else PsfCache(tmp_path)
    return PsfBank(eye, kind, PITCH, cache=cache, **options)


def test_a_psf_is_made_once_and_then_comes_from_disk(tmp_path):
    first = bank(tmp_path)
    one = first.psf(550.0, 1.0, (3.0, 0.0))
    assert first.psf(550.0, 1.0, (3.0, 0.0)) is one
    again = bank(tmp_path)
    other = again.psf(550.0, 1.0, (3.0, 0.0))
    assert (first.made, first.loaded, again.made, again.loaded) == (1, 0, 0, 1)
    assert np.array_equal(one.kernel, other.kernel)
    assert (one.pitch_deg, one.energy_outside) == (other.pitch_deg, other.energy_outside)


@pytest.mark.parametrize(
    "change",
    [
        {"eye": ic.eyes.navarro(4.0, 1.5)},
        {"kind": "hurb"},
        {"reach_deg": 1.0},
        {"wavelength": 560.0},
        {"vergence": 1.1},
        {"field": (3.0, 0.5)},
    ],
)
def test_another_eye_kind_grid_or_place_is_another_psf(tmp_path, change):
    bank(tmp_path).psf(550.0, 1.0, (3.0, 0.0))
    at = (change.pop("wavelength", 550.0), change.pop("vergence", 1.0))
    where = change.pop("field", (3.0, 0.0))
    other = bank(tmp_path, **change)
    other.psf(*at, where)
    assert (other.made, other.loaded) == (1, 0)


def test_files_that_are_broken_are_made_anew(tmp_path):
    good = bank(tmp_path).psf(550.0, 1.0).kernel
    (file,) = tmp_path.glob("*/*.npz")
    whole = file.read_bytes()
    flipped = bytearray(whole)
    flipped[len(whole) // 2] ^= 0xFF
    for broken in (b"", b"nonsense", whole[: len(whole) // 2], bytes(flipped)):
        file.write_bytes(broken)
        again = bank(tmp_path)
        assert np.array_equal(again.psf(550.0, 1.0).kernel, good)
        assert again.made == 1
        assert file.read_bytes() == whole


def _write(folder):
    cache = PsfCache(folder)
    psf = Psf(np.full((101, 101), 1.0 / 101**2), 0.01, 0.0)
    for i in range(30):
        cache.store("ab" + "0" * 10, psf)
        found = cache.load("ab" + "0" * 10)
        if i > 0 and (found is None or not np.array_equal(found.kernel, psf.kernel)):
            os._exit(1)


def test_writers_and_readers_at_once_see_whole_files(tmp_path):
    context = multiprocessing.get_context("fork")
    workers = [context.Process(target=_write, args=(tmp_path,)) for _ in range(3)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert [worker.exitcode for worker in workers] == [0, 0, 0]
    assert not list(tmp_path.rglob("*.tmp"))


def test_the_least_recently_used_go_first(tmp_path):
    cache = PsfCache(tmp_path, limit_mb=0.06)
    psf = Psf(np.full((31, 31), 1.0 / 31**2), 0.01, 0.0)
    for i in range(8):
        cache.store(f"{i}" * 8, psf)
        os.utime(tmp_path / (f"{i}" * 2) / (f"{i}" * 8 + ".npz"), (i, i))
    assert cache.load("0" * 8) is not None
    cache.prune()
    size = sum(f.stat().st_size for f in tmp_path.rglob("*.npz"))
    assert 0.03e6 < size <= 0.06e6
    assert cache.load("0" * 8) is not None
    assert cache.load("1" * 8) is None
    assert cache.load("7" * 8) is not None


def test_the_environment_and_an_argument_switch_the_cache_off(tmp_path, monkeypatch):
    for off in ("off", "0", "NO"):
        monkeypatch.setenv("ISETCL_PSF_CACHE", off)
        assert default_cache() is None
    monkeypatch.setenv("ISETCL_PSF_CACHE", str(tmp_path))
    monkeypatch.setenv("ISETCL_PSF_CACHE_MB", "3")
    assert default_cache() == PsfCache(tmp_path, 3.0)
    PsfBank(EYE, "disc", PITCH, cache=False).psf(550.0, 0.0)
    assert not list(tmp_path.iterdir())
    PsfBank(EYE, "disc", PITCH).psf(550.0, 0.0)
    assert len(list(tmp_path.iterdir())) == 1
    monkeypatch.setenv("ISETCL_PSF_CACHE_MB", "much")
    with pytest.raises(ic.InvalidInputError, match="ISETCL_PSF_CACHE_MB"):
        default_cache()


def test_a_folder_that_cannot_be_written_does_no_harm(tmp_path):
    place = tmp_path / "file"
    place.write_text("not a folder")
    psf = PsfBank(EYE, "disc", PITCH, cache=PsfCache(place)).psf(550.0, 0.0)
    assert psf.kernel.sum() == pytest.approx(1.0)


@pytest.mark.slow
def test_depths_are_interpolated_only_within_the_bound():
    verges = np.linspace(1.0, 1.15, 17)
    exact = [bank(kind="wave").psf(550.0, v) for v in verges[::4]]
    for bound in (0.04, 0.01):
        some = bank(kind="wave")
        found = some.over_depth(550.0, list(verges), bound=bound)
        errors = [kernel_distance(a, b) for a, b in zip(found[::4], exact, strict=True)]
        assert max(errors) <= bound
        assert 2 < some.made < 17
        assert 0.0 < some.describe()["depth_error"] <= bound
    none = bank(kind="wave")
    none.over_depth(550.0, list(verges), bound=0.0)
    assert none.made == 17


def test_what_a_kind_does_not_know_is_made_once():
    some = bank(kind="watson")
    psfs = [some.psf(w, v, f) for w in (450.0, 600.0) for v in (0.0, 2.0) for f in ((0, 0), (9, 0))]
    assert all(p is psfs[0] for p in psfs)
    assert some.made == 1


def test_a_psf_of_the_user_s_serves_all():
    mine = Psf(np.ones((3, 3)) / 9.0, PITCH, 0.0)
    assert bank(kind=mine).psf(400.0, 2.0, (5.0, 0.0)) is mine
    with pytest.raises(ic.InvalidInputError, match="a pixel over oversampling"):
        PsfBank(EYE, mine, 0.03)
    options = {"fov_deg": 1.28, "resolution": 32, "wavelengths_nm": [550.0]}
    scene = ic.scenes.two_planes(edge_angle_deg=0.0)
    image = ic.psf_baseline.render(scene, EYE, psf=mine, **options)
    assert image.provenance["psf"] == "user"


@pytest.mark.parametrize(
    ("rows", "columns", "count"), [(40, 30, 3), (5, 7, 6), (1, 1, 4), (9, 1, 2)]
)
def test_weights_of_patches_sum_to_one(rows, columns, count):
    grid = ic.RetinalGrid.of(EYE, (columns * 0.1, rows * 0.1), (columns, rows), (4.0, -2.0))
    for parts in (field_patches(grid, count), tiles(grid, count)):
        total = np.zeros(grid.shape)
        for part in parts:
            total[part.rows, part.columns] += part.weight
            own = part.grid(grid)
            np.testing.assert_allclose(own.x_deg, grid.x_deg[part.columns], atol=1e-12)
            np.testing.assert_allclose(own.y_deg, grid.y_deg[part.rows], atol=1e-12)
        np.testing.assert_allclose(total, 1.0, atol=1e-12)


def test_blended_weights_interpolate_field_positions():
    """What a pixel gets is the PSF of its own place: the mean of the nodes' places."""
    grid = ic.RetinalGrid.of(EYE, 3.0, 30, (4.0, -2.0))
    x, y = np.zeros(grid.shape), np.zeros(grid.shape)
    for part in field_patches(grid, 4):
        x[part.rows, part.columns] += part.weight * part.field_deg[0]
        y[part.rows, part.columns] += part.weight * part.field_deg[1]
    np.testing.assert_allclose(x, np.broadcast_to(grid.x_deg, grid.shape), atol=1e-9)
    np.testing.assert_allclose(y, np.broadcast_to(grid.y_deg[:, None], grid.shape), atol=1e-9)


def textured(width_deg=40.0):
    y, x = np.mgrid[0:256, 0:256] / 256.0
    picture = ic.Image(0.5 + 0.4 * np.sin(150 * x) * np.sin(140 * y))
    return ic.scenes.image_plane(picture, 0.8, width_deg)


@pytest.fixture(scope="module")
def traced_off_axis():
    """A picture at one depth around 10 degrees, where it is, and it ray-traced."""
    where = {"fov_deg": 6.0, "resolution": 64, "centre_deg": (10.0, 0.0)}
    where["wavelengths_nm"] = [450.0, 550.0]
    return where, ic.render(textured(), EYE, spp=1024, bands=2, **where)


def off_axis_error(traced_off_axis, method, field):
    where, traced = traced_off_axis
    level = traced.irradiance.values.mean()
    image = ic.psf_baseline.render(textured(), EYE, method=method, field=field, **where)
    return (image.irradiance.values - traced.irradiance.values) / level


@pytest.mark.slow
@pytest.mark.parametrize("method", sorted(ic.psf_baseline.methods()))
def test_ten_degrees_off_axis_patches_agree_with_ray_tracing_to_one_percent(
    traced_off_axis, method
):
    error = off_axis_error(traced_off_axis, method, 3)
    # Ikoma's epsilon leaves a thousandth out.
    assert abs(error.mean()) < (1.5e-3 if method == "ikoma" else 5e-4)
    assert np.abs(error).max() < 0.01
    _, traced = traced_off_axis
    noise = np.sqrt(np.mean(traced.standard_error.values**2))
    assert noise < 1e-3 * traced.irradiance.values.mean()


@pytest.mark.slow
def test_ten_degrees_off_axis_one_psf_is_twice_as_wrong_as_patches(traced_off_axis):
    centre, patches = (
        np.abs(off_axis_error(traced_off_axis, "layered_sum", field)).max()
        for field in ("centre", 3)
    )
    assert centre > 2.0 * patches


@pytest.mark.slow
def test_the_number_of_patches_follows_from_the_bound():
    where = ((10.0, 0.0), (4.0, 4.0))
    few, many = (bank().patches_needed(550.0, [0.6], *where, bound=b) for b in (0.2, 0.06))
    assert 1 <= few < many
    some = bank()
    n = some.patches_needed(550.0, [0.6], *where, bound=0.06)
    assert n == many
    assert some.field_error <= 0.06
    # Between two neighbouring nodes, off the diagonal on which it was measured.
    x = 10.0 - 2.0 + 4.0 * np.array([0.0, 0.5, 1.0]) / (n - 1)
    a, m, b = (some.psf(550.0, 0.6, (float(t), 0.0)) for t in x)
    half = max(p.radius for p in (a, b))
    grown = [np.pad(p.kernel, half - p.radius) for p in (a, b)]
    middle = Psf((grown[0] + grown[1]) / 2.0, PITCH, 0.0)
    assert kernel_distance(middle, m) < 0.06
    assert bank(kind="disc").patches_needed(550.0, [0.6], *where, bound=0.01) == 1


@pytest.mark.parametrize(
    "method", slow_after(2, ["layered_over", "gather", "layered_sum", "single"])
)
def test_tiles_change_nothing(method, monkeypatch):
    """On even objects; where textures are refined depends on the range of a tile's colours."""
    scene = ic.scenes.two_planes(edge_angle_deg=20.0, texture="uniform")
    eye = ic.eyes.navarro(3.0, 2.0)
    options = {"fov_deg": 1.6, "resolution": 80, "wavelengths_nm": [500.0, 600.0]}
    whole = ic.psf_baseline.render(scene, eye, method=method, **options)
    monkeypatch.setattr(render_module, "_TILE_BYTES", 3e6)
    monkeypatch.setattr(render_module, "_LEAST_TILE", 30)
    parts = ic.psf_baseline.render(scene, eye, method=method, **options)
    assert whole.provenance["patches"] == 1
    assert parts.provenance["patches"] > 3
    level = whole.irradiance.values.mean()
    assert np.abs(whole.irradiance.values - parts.irradiance.values).max() < 5e-6 * level


@pytest.mark.parametrize("psf", ["wave", "watson", "ijspeert", "vos_van_den_berg", "hurb"])
def test_a_uniform_scene_stays_uniform_whatever_a_kernel_leaves_out(psf):
    options = {"fov_deg": 2.0, "resolution": 24, "wavelengths_nm": [550.0]}
    images = [
        ic.psf_baseline.render(ic.scenes.uniform(), EYE, psf=kind, **options)
        for kind in (psf, "geometric")
    ]
    np.testing.assert_allclose(images[0].irradiance, images[1].irradiance, rtol=3e-6)


def random_layers(shape, basis=2):
    rng = np.random.default_rng(0)
    whole = np.ones(shape, dtype=np.float32)
    part = np.zeros(shape, dtype=np.float32)
    part[60:90, 70:120] = 1.0
    return [
        Layer(v, (rng.random((basis, *shape)) * cover).astype(np.float32), cover)
        for v, cover in ((0.0, whole), (1.0, part))
    ]


@pytest.mark.parametrize("is_symmetric", [True, False])
@pytest.mark.parametrize("outside", [0.0, 0.1])
def test_blur_is_convolution(is_symmetric, outside):
    kernel = disc_cells(7, 6.3)
    if not is_symmetric:
        kernel = kernel * np.linspace(0.5, 1.5, 15) * np.linspace(0.2, 1.0, 15)[:, None]
    psf = Psf(kernel / kernel.sum() * (1.0 - outside), PITCH, outside)
    layers = random_layers((260, 280))
    mix = np.array([2.0, 3.0])
    plain = SpectralBlur(LayerSpectra(layers), [psf, psf])
    mixed = SpectralBlur(LayerSpectra(layers), [psf, psf], mix=mix)
    inner = (slice(7, -7), slice(7, -7))
    total = 0.0
    for k, layer in enumerate(layers):
        expected = np.stack(
            [fftconvolve(c, psf.kernel, mode="same") + outside * c.mean() for c in layer.colour]
        )
        total = total + np.tensordot(mix, expected, axes=1)
        cover = fftconvolve(layer.coverage, psf.kernel, mode="same")
        cover = cover + outside * layer.coverage.mean()
        both = np.tensordot(mix, expected, axes=1)
        for found, wanted in (
            (plain.colour(k)[0], expected[0]),
            (plain.colour(k)[1], expected[1]),
            (mixed.colour(k)[0], both),
            (plain.coverage(k), cover),
        ):
            np.testing.assert_allclose(found[inner], wanted[inner], atol=3e-6)
    np.testing.assert_allclose(mixed.total([0, 1])[0][inner], total[inner], atol=1e-5)


@pytest.mark.parametrize("size", [(30, 45), (45, 30), (17, 17)])
def test_transfers_of_kernels_are_their_transforms(size):
    rng = np.random.default_rng(1)
    for kernel in (rng.random((9, 9)), disc_cells(4, 3.7), np.ones((1, 1))):
        half = kernel.shape[0] // 2
        padded = np.zeros(size)
        padded[: kernel.shape[0], : kernel.shape[0]] = kernel
        expected = np.fft.rfft2(np.roll(padded, (-half, -half), axis=(0, 1)))
        np.testing.assert_allclose(transfer_of(kernel, size), expected, atol=2e-5)


def test_a_psf_wider_than_its_view_is_refused():
    layers = random_layers((150, 170))
    wide = Psf(np.full((201, 201), 1.0 / 201**2), PITCH, 0.0)
    with pytest.raises(ic.InvalidInputError, match=r"201 samples wide.*pad the view"):
        SpectralBlur(LayerSpectra(layers), [wide, wide])


def test_one_pixel_is_an_image():
    options = {"fov_deg": 0.05, "resolution": 1, "wavelengths_nm": [550.0]}
    values = [
        ic.psf_baseline.render(ic.scenes.uniform(), EYE, psf=psf, field=field, **options)
        for psf, field in (("geometric", "centre"), ("wave", "centre"), ("geometric", 3))
    ]
    for image in values:
        assert image.irradiance.shape == (1, 1, 1)
        np.testing.assert_allclose(image.irradiance, values[0].irradiance, rtol=3e-6)


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"psf": "wavy"}, "did you mean wave"),
        ({"field": "patch"}, "did you mean patches"),
        ({"field": 0}, "field must be between 1"),
        ({"psf_error": 0.0}, "psf_error"),
        ({"psf_cache": "somewhere"}, "cache must be a PsfCache"),
    ],
)
def test_bad_options_are_refused(options, match):
    with pytest.raises(ic.InvalidInputError, match=match):
        ic.psf_baseline.render(
            ic.scenes.uniform(), reduced_eye(), fov_deg=1.0, resolution=4, **options
        )
