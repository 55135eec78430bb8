"""Functions of the kernels that bend rays, one by one, against float64 numpy."""

from pathlib import Path

import numpy as np
import pytest
from oracles import concentric

import isetcl as ic
from isetcl.device import program
from isetcl.device.bending import SCATTER_NODES, Bend, add_bends
from isetcl.device.elements import ELEMENT, PackedEye, declarations, pack_eye
from isetcl.device.layout import real_dtype
from isetcl.eye.bending.ray_bending import Airy, Hurb, bend
from isetcl.eye.prescription import ElementKind, elements
from isetcl.render import pack
from isetcl.render.kernel_config import KernelConfig

pytestmark = pytest.mark.usefixtures("one_register")

PROBES = Path(__file__).parent / "probes" / "bend.cl"
EPSILON = {"single": 2.0**-24, "double": 2.0**-53}
MODELS = {
    "airy": Airy(),
    "iset3d": Hurb.iset3d(),
    "optrace": Hurb("optrace", 1.0),
    "isotropic": Hurb("isotropic"),
}
STOP = ic.Stop(3.6, 4.0, (0.3, -0.2), 2.5, 30.0)


class Probe:
    """Calls probe kernels on planes of values."""

    def __init__(self, device, precision, diffraction="airy"):
        self.device, self.precision = device, precision
        self.real = real_dtype(precision)
        self.width = device.vector_width(precision)
        config = KernelConfig(precision, self.width, diffraction=diffraction, has_scatter=True)
        self.source = program.assemble(
            PROBES,
            config.defines(device),
            declarations() + pack.eye_declarations() + pack.sobol_declaration(),
        )

    def __call__(self, name, planes, n_out, table=None):
        import pyopencl as cl

        planes = np.atleast_2d(np.asarray(planes, dtype=self.real))
        n = planes.shape[1]
        padded = -(-n // self.width) * self.width
        # The last lanes repeat a value, so that none of them is outside of what a function takes.
        data = np.concatenate([planes, np.repeat(planes[:, -1:], padded - n, axis=1)], axis=1)
        flags = cl.mem_flags
        context = self.device.context
        given = [] if table is None else [table.astype(self.real)]
        buffers = [
            cl.Buffer(context, flags.COPY_HOST_PTR, hostbuf=np.ascontiguousarray(b))
            for b in (*given, data)
        ]
        out = np.empty((n_out, padded), dtype=self.real)
        result = cl.Buffer(context, flags.READ_WRITE, out.nbytes)
        kernel = program.kernel(self.device, self.source, name)
        kernel.set_args(*buffers, np.int32(padded), result)
        cl.enqueue_nd_range_kernel(self.device.queue, kernel, (padded // self.width,), (1,))
        cl.enqueue_copy(self.device.queue, out, result)
        return out[:, :n].astype(np.float64)

    def rounded(self, values):
        """Values as the kernel is given them."""
        return np.asarray(values, dtype=self.real).astype(np.float64)


def table_of(model, scatter, precision, wavelength=550.0):
    """The numbers of a stop in Navarro's eye, from its place in the table."""
    sequence = elements(ic.eyes.navarro(3.0), wavelength)
    packed = add_bends(
        pack_eye([sequence], "scene", precision),
        [sequence],
        STOP,
        [wavelength],
        diffraction=model,
        scatter=scatter,
    )
    at = next(i for i, e in enumerate(sequence) if e.kind is ElementKind.STOP)
    return packed.table[int(packed.elements["bend"][at]) :]


def test_logarithms(device, precision):
    probe = Probe(device, precision)
    x = np.concatenate([np.geomspace(1e-9, 1.0, 4001), 1 - np.geomspace(1e-6, 0.9, 2000), [1.0]])
    x = probe.rounded(x)
    (found,) = probe("probe_log", x, 1)
    exact = np.log(x)
    assert np.max(np.abs(found - exact) - 4 * EPSILON[precision] * np.abs(exact)) <= 0


def test_draws_are_a_direction_and_a_share(device, precision):
    probe = Probe(device, precision)
    grid = (np.arange(64) + 0.5) / 64
    u, v = (probe.rounded(g.ravel()) for g in np.meshgrid(grid, grid))
    x, y, beyond = probe("probe_draw", [u, v], 3)
    px, py = concentric(u, v)
    radius = np.hypot(px, py)
    np.testing.assert_allclose(x * radius, px, atol=4 * EPSILON[precision])
    np.testing.assert_allclose(y * radius, py, atol=4 * EPSILON[precision])
    np.testing.assert_allclose(beyond, 1 - radius**2, atol=4 * EPSILON[precision])
    corner = probe("probe_draw", [[0.0, 0.5], [0.0, 0.5]], 3)
    assert np.all(np.isfinite(corner))
    assert np.all(corner[2] > 0)


@pytest.mark.parametrize("name", MODELS)
def test_bends_are_those_of_the_host(device, precision, name):
    probe = Probe(device, precision, name)
    rng = np.random.default_rng(3)
    n, wavelength = 4000, 550.0
    index = float(elements(ic.eyes.navarro(3.0), wavelength)[2].n_before)
    radius, turn, way = np.sqrt(rng.uniform(size=n)), *(2 * np.pi * rng.uniform(size=(2, n)))
    disc = 0.999 * np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)
    points = probe.rounded(STOP.rim_mm(disc))
    slopes = rng.uniform(-0.4, 0.4, (n, 2))
    along = -np.sqrt(index**2 - np.sum(slopes**2, axis=1))
    t = probe.rounded(np.concatenate([slopes, along[:, None]], axis=1))
    draw = probe.rounded(np.stack([np.cos(way), np.sin(way)], axis=1))
    beyond = probe.rounded(
        np.concatenate([1 - rng.uniform(size=n - 50), np.geomspace(1e-6, 1, 50)])
    )
    table = table_of(MODELS[name], ic.ScatterModel(), precision)
    got = probe("probe_diffract", [*points.T, *t.T, *draw.T, beyond], 4, table)
    expected = bend(MODELS[name], STOP, points, t, wavelength, beyond, draw)
    # A bend is 1e-4 typically; the table of the Airy pattern adds what the host's inverse has not.
    change = np.hypot(*(expected[:, :2] - t[:, :2]).T)
    relative = {"single": 1e-4, "double": 1e-9}[precision] + (5e-3 if name == "airy" else 0.0)
    kept = np.isfinite(expected[:, 2])
    assert np.array_equal(got[3] == 1, kept)
    error = np.max(np.abs(got[:2].T - expected[:, :2]), axis=1)
    assert np.mean(kept) > 0.99
    limit = relative * change + 4 * EPSILON[precision]
    # Beside a dark ring v changes fast, and beside the rim the distance to it is rounded.
    assert np.mean(error[kept] > limit[kept]) < (0.02 if name == "airy" else 0.002)
    length = np.sqrt(np.sum(got[:3, kept] ** 2, axis=0))
    np.testing.assert_allclose(length, index, rtol=8 * EPSILON[precision] / 0.9)


def test_scatter_turns_by_the_model_s_angles(device, precision):
    probe = Probe(device, precision)
    model = ic.ScatterModel(70.0, 1.0)
    rng = np.random.default_rng(5)
    n = 3000
    t = rng.normal(size=(n, 3))
    t = probe.rounded(t / np.linalg.norm(t, axis=1)[:, None])
    way = 2 * np.pi * rng.uniform(size=n)
    draw = np.stack([np.cos(way), np.sin(way)], axis=1)
    beyond = probe.rounded(rng.uniform(1e-4, 1.0, n))
    table = table_of(None, model, precision)
    got = probe("probe_scatter", [*t.T, *draw.T, beyond], 3, table).T
    np.testing.assert_allclose(np.linalg.norm(got, axis=1), 1.0, rtol=1e-6)
    angle = np.degrees(
        np.arctan2(np.linalg.norm(np.cross(t, got), axis=1), np.sum(t * got, axis=1))
    )
    turned = beyond < model.fraction
    assert np.max(angle[~turned]) < (0.03 if precision == "single" else 1e-6)
    expected = model.angle_of(1 - beyond[turned] / model.fraction)
    np.testing.assert_allclose(angle[turned], expected, rtol=2e-3, atol=0.005)
    assert table[Bend.FRACTION] == pytest.approx(model.fraction, rel=1e-6)


def test_every_band_has_its_wavelength_and_all_share_a_table():
    eye, wavelengths = ic.eyes.navarro(3.0), (450.0, 650.0)
    sequences = [elements(eye, w) for w in wavelengths]
    packed = add_bends(
        pack_eye(sequences, "scene", "double"),
        sequences,
        STOP,
        wavelengths,
        diffraction=Hurb.iset3d(),
        scatter=ic.ScatterModel(),
    )
    kinds = [e.kind for sequence in sequences for e in sequence]
    places = [packed.elements["bend"][i] for i, k in enumerate(kinds) if k is ElementKind.STOP]
    assert len(set(places)) == 2
    index = [float(eye.indices(w)[2]) for w in wavelengths]
    for place, wavelength, n in zip(places, wavelengths, index, strict=True):
        # dT = n tan sigma: lambda in vacuum, though the direction is as long as the index.
        expected = n / (1.41 * 2 * np.pi / (wavelength * 1e-6))
        assert packed.table[place + Bend.SCALE] == pytest.approx(expected, rel=1e-12)
        table = int(place + packed.table[place + Bend.SCATTER_TABLE])
        half = packed.table[table : table + SCATTER_NODES]
        assert half[0] == pytest.approx(np.tan(np.radians(0.05)), rel=1e-6)
        assert half[-1] == pytest.approx(1.0, rel=1e-4)


def test_eyes_without_bends_are_packed_as_they_were():
    sequence = elements(ic.eyes.navarro(3.0), 550.0)
    packed = pack_eye([sequence], "scene", "single")
    same = add_bends(packed, [sequence], STOP, [550.0], diffraction=None, scatter=None)
    assert same is packed
    assert isinstance(packed, PackedEye)
    assert packed.elements.dtype == ELEMENT.dtype("single")
