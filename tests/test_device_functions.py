"""Functions of the kernels, one by one, against float64 numpy."""

from pathlib import Path

import numpy as np
import pytest
from oracles import bounce_numbers, concentric, owen_sobol, sobol_integers

from isetcl.device import program
from isetcl.device.elements import ELEMENT
from isetcl.device.layout import real_dtype
from isetcl.device.planes import run_on_planes
from isetcl.render import pack
from isetcl.render.kernel_config import KernelConfig

PROBES = Path(__file__).parent / "probes" / "functions.cl"
EPSILON = {"single": 2.0**-24, "double": 2.0**-53}


class Probe:
    """Calls a probe kernel on planes of values."""

    def __init__(self, device, precision, width=None):
        self.device = device
        self.real = real_dtype(precision)
        width = device.vector_width(precision) if width is None else width
        self.config = KernelConfig(precision, width, n_basis=3)
        source = program.assemble(
            PROBES, self.config.defines(device), pack.declarations(self.config)
        )
        self.source = source

    def __call__(self, name, planes, n_out, *more, first=()):
        return run_on_planes(
            self.device,
            self.config.precision,
            self.source,
            name,
            planes,
            n_out,
            *more,
            first=first,
            width=self.config.vector_width,
        )


@pytest.fixture
def probe(device, precision):
    return Probe(device, precision)


def test_sine_and_cosine_on_a_quarter_turn(probe, precision):
    x = np.linspace(-np.pi / 4, np.pi / 4, 4001).astype(probe.real).astype(float)
    s, c = probe("probe_sine_cosine", x, 2)
    assert np.max(np.abs(s - np.sin(x))) < 1.5 * EPSILON[precision]
    assert np.max(np.abs(c - np.cos(x))) < 1.5 * EPSILON[precision]


def test_rounding_helpers(probe):
    x = np.array([-2.5, -2.0, -0.5, -1e-7, 0.0, 0.2, 0.999, 1.0, 7.5, 1e6 + 0.5, np.inf, np.nan])
    finite = x[:10]
    floor, magnitude, larger, smaller, number, lanes = probe("probe_rounding", x, 6)
    np.testing.assert_array_equal(floor[:10], np.floor(finite.astype(probe.real)))
    np.testing.assert_allclose(magnitude[:10], np.abs(finite), rtol=1e-7)
    np.testing.assert_allclose(larger[:10], np.maximum(finite, 0.25), rtol=1e-7)
    np.testing.assert_allclose(smaller[:10], np.minimum(finite, 0.25), rtol=1e-7)
    np.testing.assert_array_equal(number, [1] * 10 + [0, 0])
    width = probe.config.vector_width
    np.testing.assert_array_equal(lanes, np.arange(len(x)) % width)


def test_all_lanes_sees_a_single_failure(probe):
    width = probe.config.vector_width
    ones = np.ones(width)
    assert probe("probe_all_lanes", ones, 1)[0, 0] == 1
    for place in {0, width // 2, width - 1}:
        holed = ones.copy()
        holed[place] = -1.0
        assert probe("probe_all_lanes", holed, 1)[0, 0] == 0


def test_the_disc_map_is_shirley_s(probe, precision):
    u, v = np.meshgrid(np.linspace(0, 0.9999, 41), np.linspace(0, 0.9999, 41))
    u, v = (w.ravel().astype(probe.real).astype(float) for w in (u, v))
    x, y = probe("disc_points", [u, v], 2)
    ex, ey = concentric(u, v)
    # Where the two squares tie, either formula gives the same point.
    assert np.max(np.hypot(x - ex, y - ey)) < 6 * EPSILON[precision]
    assert np.max(np.hypot(x, y)) <= 1.0 + 4 * EPSILON[precision]


def test_the_disc_map_has_no_nan_at_the_centre(probe):
    x, y = probe("disc_points", [[0.5], [0.5]], 2)
    assert (x[0], y[0]) == (0.0, 0.0)


def test_turns_are_those_of_atan2(probe, precision):
    angle = np.linspace(-np.pi, np.pi, 2001)[1:-1]
    x = (np.cos(angle) * 3.0).astype(probe.real).astype(float)
    y = (np.sin(angle) * 3.0).astype(probe.real).astype(float)
    (turn,) = probe("probe_turn", [x, y], 1)
    assert np.max(np.abs(turn - np.arctan2(y, x) / (2 * np.pi))) < 2 * EPSILON[precision]


@pytest.mark.parametrize("dimension", range(8))
def test_scrambled_points_are_those_of_the_numpy_version(probe, precision, dimension):
    streams = np.array([0, 1, 77, 123456], dtype=np.uint32)
    got = probe("sobol_points", streams.astype(float), 64, np.int32(64), np.int32(dimension))
    bits = 24 if precision == "single" else 31
    for i, stream in enumerate(streams):
        expected = owen_sobol(np.arange(64), dimension, np.full(64, stream), bits)
        np.testing.assert_array_equal(got[:, i], expected)


@pytest.mark.parametrize("bounce", [0, 1, 7])
def test_the_numbers_of_a_bounce_are_those_of_the_numpy_version(device, precision, bounce):
    samples, bits, stream = 200, 8, 4321
    probe = Probe(device, precision)
    got = probe(
        "probe_bounce", np.full(samples, float(stream)), 8, np.int32(bits), np.int32(bounce)
    )
    expected = bounce_numbers(
        np.arange(samples), bits, stream, bounce, 24 if precision == "single" else 31
    )
    np.testing.assert_array_equal(got, expected)
    # In every set all 256 samples fill every box of 16 x 16 of the first two dimensions once.
    full = bounce_numbers(np.arange(256), bits, stream, bounce, 24)
    for set_ in (0, 4):
        boxes = np.floor(full[set_] * 16) * 16 + np.floor(full[set_ + 1] * 16)
        assert len(np.unique(boxes)) == 256


@pytest.mark.parametrize("log2_count", [3, 5, 8, 10])
@pytest.mark.parametrize("pair", [(0, 1), (2, 3)])
def test_scrambled_points_stay_stratified(probe, log2_count, pair):
    # Elementary intervals: 2^m points of a (t, m, s)-net put 2^t into every box of area 2^(t-m).
    # Dimensions (0, 1) have t = 0, (2, 3) at most 2 (Joe & Kuo's table).
    count = 1 << log2_count
    t = 0 if pair == (0, 1) else 2
    x, y = (probe("sobol_points", [5.0], count, np.int32(count), np.int32(d))[:, 0] for d in pair)
    for k in range(log2_count - t + 1):
        columns, rows = 1 << k, 1 << (log2_count - t - k)
        boxes = np.floor(x * columns).astype(int) * rows + np.floor(y * rows).astype(int)
        filled = np.bincount(boxes, minlength=columns * rows)
        assert filled.min() == filled.max() == 1 << t


def test_every_aligned_block_of_the_sequence_is_stratified_too(probe):
    # Bands take consecutive blocks of the sequence.
    points = probe("sobol_points", [9.0], 256, np.int32(256), np.int32(0))[:, 0]
    for block in points.reshape(8, 32):
        assert np.bincount(np.floor(block * 32).astype(int), minlength=32).tolist() == [1] * 32


def test_coordinates_stay_below_one(probe):
    streams = np.arange(4096, dtype=float)
    values = probe("sobol_points", streams, 16, np.int32(16), np.int32(1))
    assert values.min() >= 0.0
    assert values.max() < 1.0
    assert abs(values.mean() - 0.5) < 0.005


def test_no_pixel_of_any_replicate_is_left_unscrambled():
    # The hash of 0 is 0: without its offset, pixel 0 of seed 0 would draw the unscrambled points.
    from isetcl.render.sobol import stream

    words = {stream(seed, replicate) for seed in range(64) for replicate in range(64)}
    assert len(words) == 64 * 64
    assert 0 not in words


def test_streams_scramble_independently(probe):
    # Correlation of the same sample in neighbouring pixels, over many: none, within 4 sigma.
    values = probe("sobol_points", np.arange(8192, dtype=float), 4, np.int32(4), np.int32(0))
    one, other = values[1, :-1], values[1, 1:]
    assert abs(np.corrcoef(one, other)[0, 1]) < 4 / np.sqrt(len(one))


def test_polynomials_are_evaluated_as_numpy_does(probe, precision):
    camera = np.zeros(1, dtype=pack.CAMERA.dtype(precision))
    coefficients = [1.5, -0.25, 0.125, 3.0]
    camera["chord"][0, :4] = coefficients
    camera["n_chord"] = 4
    s = np.linspace(0, 1, 65).astype(probe.real).astype(float)
    (got,) = probe("probe_horner", s, 1, first=(camera,))
    expected = np.polynomial.polynomial.polyval(s, coefficients)
    assert np.max(np.abs(got - expected)) < 16 * EPSILON[precision]


def test_structs_have_the_same_size_on_both_sides(device, precision):
    import pyopencl as cl

    probe = Probe(device, precision)
    out = np.zeros(8, dtype=np.int32)
    buffer = cl.Buffer(device.context, cl.mem_flags.WRITE_ONLY, out.nbytes)
    kernel = program.kernel(device, probe.source, "probe_sizes")
    kernel.set_args(buffer)
    cl.enqueue_nd_range_kernel(device.queue, kernel, (1,), (1,))
    cl.enqueue_copy(device.queue, out, buffer)
    n, channels = probe.config.n_basis, probe.config.texture_channels
    structs = (
        ELEMENT,
        pack.CAMERA,
        pack.PUPIL,
        pack.PATCH,
        pack.SPHERE,
        pack.scene_struct(n),
        pack.material_struct(n),
        pack.image_struct(n, channels),
    )
    assert out.tolist() == [s.dtype(precision).itemsize for s in structs]


def test_the_direction_numbers_are_joe_and_kuo_s():
    # scipy ships the same table; compare the unscrambled sequences.
    from isetcl.render.sobol import directions

    table = np.array(directions(), dtype=np.uint64).reshape(8, 32)
    for dimension in range(8):
        words = sobol_integers(64, dimension)
        for index in range(64):
            digits = 0
            for bit in range(6):
                if index >> bit & 1:
                    digits ^= int(table[dimension, bit])
            assert int(f"{digits:032b}"[::-1], 2) == int(words[index])


def test_seeds_beyond_32_bits_differ():
    from isetcl.render.sobol import stream

    assert len({stream(s << 32, 0) for s in range(64)}) == 64
