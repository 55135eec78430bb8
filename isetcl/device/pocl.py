"""Making PoCL from the Python wheel work on processors newer than its compiler.

PoCL 3.0 carries LLVM 14, which calls processors it does not know (AMD Zen 4 and Zen 5, for
example) "generic"; its own clang front end then refuses that name with "unknown target CPU
'generic'", and no kernel can be built (pocl issue 1049). PoCL reads the name from its device record
at every build, so the cure is to put a name there that LLVM 14 knows and whose instructions this
processor has.

The record is private to PoCL. It is only touched where the two adjacent pointers that hold the
target triple and the processor name are found, pointing at exactly those texts.
"""

from __future__ import annotations

import ctypes
import logging
import struct
from pathlib import Path
from typing import BinaryIO, cast

log = logging.getLogger(__name__)

_RECORD_BYTES = 2048
_TRIPLE = b"x86_64-"
_UNKNOWN = b"generic"

# Names LLVM 14 knows, best first, with flags of /proc/cpuinfo that together imply the instructions
# the compiler would use (x86-64 psABI levels; Intel's Ice Lake server set).
_ICELAKE = (
    "avx512f avx512dq avx512cd avx512bw avx512vl avx512_vbmi2 avx512vbmi avx512ifma avx512_vnni "
    "avx512_bitalg avx512_vpopcntdq gfni vaes vpclmulqdq adx rdpid"
)
_V3 = "avx avx2 bmi1 bmi2 f16c fma abm movbe"
_V2 = "cx16 lahf_lm popcnt sse4_1 sse4_2 ssse3"
_TARGETS = (
    ("icelake-server", f"{_ICELAKE} {_V3} {_V2}"),
    ("x86-64-v4", f"avx512f avx512dq avx512cd avx512bw avx512vl {_V3} {_V2}"),
    ("x86-64-v3", f"{_V3} {_V2}"),
    ("x86-64-v2", _V2),
    ("x86-64", ""),
)

# The record keeps a pointer to the name for the life of the process, so the text must live as long.
_names: dict[str, ctypes.Array[ctypes.c_char]] = {}


def name_unknown_processor(record_address: int) -> str | None:
    """Give an "unknown" processor a name that PoCL's compiler accepts.

    Parameters
    ----------
    record_address
        Address of PoCL's device record (`pyopencl.Device.int_ptr`).

    Returns
    -------
    str or None
        The name written, or None if PoCL knows the processor or the record is not as expected.
    """
    slot = _processor_name_slot(record_address)
    if slot is None:
        return None
    name = best_target(_processor_flags())
    text = _names.setdefault(name, ctypes.create_string_buffer(name.encode()))
    ctypes.c_void_p.from_address(slot).value = ctypes.addressof(text)
    log.info("PoCL does not know this processor; building kernels for %s", name)
    return name


def best_target(flags: frozenset[str]) -> str:
    """The best LLVM 14 processor name whose instructions are all among the given cpuinfo flags."""
    return next(name for name, needed in _TARGETS if flags.issuperset(needed.split()))


def _processor_flags() -> frozenset[str]:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return frozenset()
    return next(
        (frozenset(line.split(":", 1)[1].split()) for line in lines if line.startswith("flags")),
        frozenset(),
    )


def _processor_name_slot(record_address: int) -> int | None:
    """Address of the pointer to the processor's name, if it says "generic"."""
    try:
        with open("/proc/self/mem", "rb", buffering=0) as raw:
            memory = cast(BinaryIO, raw)
            memory.seek(record_address)
            record = memory.read(_RECORD_BYTES)
            pointers = struct.unpack(f"<{len(record) // 8}Q", record[: len(record) // 8 * 8])
            for i in range(len(pointers) - 1):
                if not _text_at(memory, pointers[i]).startswith(_TRIPLE):
                    continue
                if _text_at(memory, pointers[i + 1]) == _UNKNOWN:
                    return record_address + 8 * (i + 1)
    except (OSError, ValueError, struct.error):
        return None
    return None


def _text_at(memory: BinaryIO, address: int) -> bytes:
    """The C string at an address; empty if nothing is mapped there."""
    if address < 4096 or address >= 1 << 47:
        return b""
    try:
        memory.seek(address)
        return bytes(memory.read(64)).split(b"\0", 1)[0]
    except OSError:
        return b""
