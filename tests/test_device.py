"""Finding, testing and refusing devices; assembling and building programs."""

import ctypes
import json
import os
import struct
import subprocess
import sys

import numpy as np
import pytest

import isetcl as ic
from isetcl.device import choose, devices, pocl, program, selftest
from isetcl.device.layout import Member, Struct
from isetcl.errors import DeviceError, KernelBuildError


@pytest.fixture
def no_records(tmp_path, monkeypatch):
    """Self-test results go to an empty folder."""
    monkeypatch.setattr(selftest, "records_path", lambda: tmp_path / "cache" / "selftest.json")
    return tmp_path / "cache" / "selftest.json"


def test_the_device_passes_its_self_test(device, precision):
    result = selftest.run(device, precision)
    assert result.failures == ()
    assert result.ray_error_mm <= {"single": 1e-5, "double": 1e-11}[precision]
    assert result.rays_per_s > 1e6


def test_an_unfused_multiply_add_is_found():
    real = np.dtype(np.float32)
    a, b, c = selftest._operands(real)
    exact = [x.astype(np.float64) for x in (a, b, c)]
    good = np.stack(
        [
            exact[0] * exact[1] + exact[2],
            np.sqrt(exact[0]),
            exact[0] / exact[1],
            exact[0] * exact[1] - exact[2] ** 2,
        ]
    ).astype(np.float32)
    assert selftest._judge(real, a, b, c, good) == []
    unfused = good.copy()
    unfused[0] = a * b + c
    assert any("not fused" in f for f in selftest._judge(real, a, b, c, unfused))
    rough_root = good.copy()
    rough_root[1] *= np.float32(1 + 4e-7)
    assert any("square root" in f for f in selftest._judge(real, a, b, c, rough_root))
    rough_division = good.copy()
    rough_division[2] *= np.float32(1 + 4e-7)
    assert any("division" in f for f in selftest._judge(real, a, b, c, rough_division))
    cancelled = good.copy()
    cancelled[3] = a * b - c * c
    assert any("difference of products" in f for f in selftest._judge(real, a, b, c, cancelled))


def test_a_device_that_traces_wrongly_is_refused_with_the_reason(device, no_records, monkeypatch):
    monkeypatch.setattr(selftest, "reference_ray_error_mm", lambda *_: 0.01)
    with pytest.raises(
        DeviceError, match=r"failed the self-test.*reference rays are wrong by 0\.01 mm"
    ):
        selftest.require(device)


def test_a_device_that_cannot_build_is_refused_with_the_reason(device, no_records, monkeypatch):
    def refuse(*_):
        raise KernelBuildError("unknown target CPU")

    monkeypatch.setattr(selftest, "check_arithmetic", refuse)
    with pytest.raises(DeviceError, match="unknown target CPU"):
        selftest.require(device)


def test_self_test_results_are_kept_and_used(device, no_records, monkeypatch):
    first = selftest.examine(device)
    assert json.loads(no_records.read_text())
    monkeypatch.setattr(selftest, "run", lambda *_: pytest.fail("examined twice"))
    assert selftest.examine(device) == first


def test_a_damaged_record_of_self_tests_is_ignored(device, no_records):
    no_records.parent.mkdir()
    no_records.write_text("{ not json")
    assert selftest.examine(device).passed


def test_the_fastest_device_that_passes_is_chosen(device, monkeypatch):
    speeds = {"slow": (1e6, ()), "fast": (9e6, ()), "broken": (99e6, ("wrong",))}

    class Fake:
        def __init__(self, name):
            self.name = name

    def examine(fake, precision="single"):
        speed, failures = speeds[fake.name]
        return selftest.SelfTest(precision, failures, 0.0, speed)

    monkeypatch.setattr(selftest, "examine", examine)
    fakes = [Fake(name) for name in speeds]
    assert selftest.fastest(fakes).name == "fast"


def test_a_device_is_found_by_index_and_by_part_of_its_name(device):
    assert choose.find_device(device.index) is device
    part = device.name[:5].upper()
    assert part in choose.find_device(part).name.upper()


def test_the_environment_variable_names_the_device_unless_an_argument_does(device, monkeypatch):
    monkeypatch.setenv("ISETCL_DEVICE", "no such thing")
    with pytest.raises(DeviceError, match="no such thing"):
        choose.find_device()
    assert choose.find_device(device.index) is device


def test_an_unknown_device_is_refused_with_the_list(device):
    with pytest.raises(DeviceError, match=f"nvidia.*found.*{device.name[:6]}"):
        choose.find_device("nvidia")


def test_without_any_device_the_message_says_how_to_get_one(monkeypatch):
    monkeypatch.setattr(choose, "list_devices", lambda: ())
    with pytest.raises(DeviceError, match="pip install pocl-binary-distribution"):
        choose.find_device()


def test_includes_are_inlined_once_and_lines_keep_their_numbers():
    source = program.assemble("direct.cl", {"WIDTH": 1})
    assert "#include" not in source
    assert source.count("} rayv;") == 1
    lines = source.splitlines()
    # After every #line directive the numbering follows the file.
    name, number = None, 0
    checked = 0
    for line in lines:
        if line.startswith("#line"):
            number, name = int(line.split()[1]), line.split('"')[1]
            continue
        if name and name.endswith(".cl"):
            original = program._read(name).splitlines()
            if not original[number - 1].startswith("#include"):
                assert line == original[number - 1]
                checked += 1
            number += 1
    assert checked > 300


def test_a_kernel_that_does_not_compile_says_where_and_keeps_the_source(device, tmp_path):
    bad = tmp_path / "bad.cl"
    bad.write_text('#include "lib/real.cl"\nkernel void f(global real *x) {\n  x[0] = oops;\n}\n')
    source = program.assemble(bad, device.defines("single"))
    with pytest.raises(KernelBuildError, match=r"source saved as (\S+);") as caught:
        program.build(device, source)
    assert "oops" in str(caught.value)
    assert f"{bad}:3" in str(caught.value)


def test_a_missing_include_is_a_clear_error(tmp_path):
    bad = tmp_path / "bad.cl"
    bad.write_text('#include "lib/nothing.cl"\n')
    with pytest.raises(KernelBuildError, match=r"lib/nothing\.cl"):
        program.assemble(bad, {})


def test_programs_and_kernels_are_built_once(device):
    source = program.assemble("selftest.cl", device.defines("single"))
    assert program.build(device, source) is program.build(device, source)
    assert program.kernel(device, source, "arithmetic") is program.kernel(
        device, source, "arithmetic"
    )


def test_no_fast_math_option_is_ever_passed(device):
    assert not any("fast" in o or "unsafe" in o or "finite" in o for o in device.build_options)


def test_struct_layouts_follow_natural_alignment():
    layout = Struct("t", (Member("a", "int"), Member("b"), Member("c", length=3)))
    assert layout.dtype("single").itemsize == 20
    assert layout.dtype("double").itemsize == 40
    assert layout.c_declaration() == "typedef struct {\n  int a;\n  real b;\n  real c[3];\n} t;\n"


ZEN5 = (
    "fpu sse sse2 ssse3 fma cx16 sse4_1 sse4_2 movbe popcnt avx f16c lahf_lm abm bmi1 avx2 bmi2 "
    "avx512f avx512dq adx avx512ifma avx512cd avx512bw avx512vl avx512vbmi avx512_vbmi2 gfni vaes "
    "vpclmulqdq avx512_vnni avx512_bitalg avx512_vpopcntdq rdpid"
)


@pytest.mark.parametrize(
    ("flags", "target"),
    [
        (ZEN5, "icelake-server"),
        (ZEN5.replace("gfni", ""), "x86-64-v4"),
        (
            "cx16 lahf_lm popcnt sse4_1 sse4_2 ssse3 avx avx2 bmi1 bmi2 f16c fma abm movbe",
            "x86-64-v3",
        ),
        ("cx16 lahf_lm popcnt sse4_1 sse4_2 ssse3 avx", "x86-64-v2"),
        ("sse2", "x86-64"),
    ],
)
def test_an_unknown_processor_gets_the_best_name_its_flags_allow(flags, target):
    assert pocl.best_target(frozenset(flags.split())) == target


def fake_record(triple: bytes, processor: bytes):
    """A device record as PoCL lays it out: somewhere inside, pointers to triple and processor."""
    texts = [ctypes.create_string_buffer(t) for t in (b"pthread", triple, processor, b"FULL")]
    words = [0] * 300
    for place, text in zip((68, 79, 80, 72), texts, strict=True):
        words[place] = ctypes.addressof(text)
    record = ctypes.create_string_buffer(struct.pack("<300Q", *words), 2400)
    return record, texts


def test_a_generic_processor_name_is_replaced_in_place():
    record, texts = fake_record(b"x86_64-unknown-linux-gnu", b"generic")
    written = pocl.name_unknown_processor(ctypes.addressof(record))
    assert written in {name for name, _ in pocl._TARGETS}
    pointer = struct.unpack_from("<Q", record.raw, 80 * 8)[0]
    assert ctypes.string_at(pointer) == written.encode()
    assert texts[2].value == b"generic"


@pytest.mark.parametrize(
    ("triple", "processor"),
    [(b"x86_64-unknown-linux-gnu", b"skylake-avx512"), (b"aarch64-linux", b"generic"), (b"", b"")],
)
def test_a_known_processor_or_an_unexpected_record_is_left_alone(triple, processor):
    record, _texts = fake_record(triple, processor)
    before = record.raw
    assert pocl.name_unknown_processor(ctypes.addressof(record)) is None
    assert record.raw == before


def test_a_wild_address_is_survived():
    assert pocl.name_unknown_processor(8) is None


def test_double_precision_on_a_device_without_it_is_refused(device, monkeypatch):
    monkeypatch.setattr(devices.Device, "has_double", property(lambda self: False))
    with pytest.raises(DeviceError, match="no float64"):
        ic.trace_rays(ic.eyes.navarro(), [0, 0, -1], [0, 0, 1], 550.0, precision="double")


@pytest.mark.slow
def test_no_opencl_platform_at_all_is_a_clear_error(tmp_path):
    code = "import isetcl as ic; ic.trace_rays(ic.eyes.navarro(), [0, 0, -1], [0, 0, 1], 550.0)"
    result = subprocess.run(
        [sys.executable, "-c", code],
        env={
            "OCL_ICD_VENDORS": str(tmp_path / "none"),
            "PATH": "/usr/bin:/bin",
            "HOME": str(tmp_path),
        },
        capture_output=True,
        text=True,
        check=False,
    )
    assert "no OpenCL device was found; install PoCL" in result.stderr


def test_a_record_is_not_used_for_another_driver(device, monkeypatch):
    from isetcl.device import selftest

    key = selftest._record_key(device, "single")
    assert key != selftest._record_key(device, "double")
    described = device.describe()
    monkeypatch.setattr(type(device), "describe", lambda self: described | {"driver": "other"})
    assert selftest._record_key(device, "single") != key
    monkeypatch.undo()
    monkeypatch.setattr(selftest, "declarations", lambda: "/* changed */")
    assert selftest._record_key(device, "single") != key


def test_division_is_asked_to_be_rounded(device):
    import pyopencl as cl

    if device.raw.single_fp_config & cl.device_fp_config.CORRECTLY_ROUNDED_DIVIDE_SQRT:
        assert "-cl-fp32-correctly-rounded-divide-sqrt" in device.build_options


def test_wrong_rays_by_a_micrometre_are_refused(device, tmp_path, monkeypatch):
    from isetcl.device import selftest

    monkeypatch.setattr(selftest, "records_path", lambda: tmp_path / "s.json")
    monkeypatch.setattr(selftest, "reference_ray_error_mm", lambda *_: 2e-5)
    assert not selftest.run(device, "single").passed


_VARIABLES = ("XDG_CACHE_HOME", "POCL_CACHE_DIR", "HOME")


@pytest.mark.slow
@pytest.mark.parametrize("variable", _VARIABLES)
def test_caches_that_cannot_be_written_are_replaced(variable, tmp_path):
    wrong = tmp_path / "file"
    wrong.write_text("no folder")
    environment = dict(os.environ)
    for name in ("XDG_CACHE_HOME", "POCL_CACHE_DIR"):
        environment.pop(name, None)
    code = (
        "import isetcl as ic\n"
        "ic.render(ic.scenes.uniform(), ic.eyes.navarro(), resolution=2, spp=2)"
    )
    result = subprocess.run(
        [sys.executable, "-c", code],
        env=environment | {variable: str(wrong)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    assert "cannot be written" in result.stderr


def test_an_empty_name_names_no_device():
    from isetcl.device.choose import find_device

    with pytest.raises(ic.InvalidInputError, match="device must be a name"):
        find_device("")
