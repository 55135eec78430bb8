"""Structs and enums that host and device share, declared once.

A struct has members of one type or an int alone: every member is `real` (float or double) or a
32-bit int. The C declaration and the numpy dtype are both made from the same list; a test asks
every device for the sizes it sees.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Literal

import numpy as np

Precision = Literal["single", "double"]
MemberType = Literal["real", "int"]


def real_dtype(precision: Precision) -> np.dtype:
    """The numpy type of `real`."""
    return np.dtype(np.float32 if precision == "single" else np.float64)


@dataclass(frozen=True)
class Member:
    """A struct member: name, type and, for an array, its length."""

    name: str
    type: MemberType = "real"
    length: int = 1


@dataclass(frozen=True)
class Struct:
    """A C struct and its numpy twin.

    Parameters
    ----------
    name
        Name of the C typedef.
    members
        Members in order.
    """

    name: str
    members: tuple[Member, ...]

    def c_declaration(self) -> str:
        """The typedef in OpenCL C."""
        lines = []
        for member in self.members:
            suffix = f"[{member.length}]" if member.length > 1 else ""
            lines.append(f"  {member.type} {member.name}{suffix};")
        return "typedef struct {\n" + "\n".join(lines) + f"\n}} {self.name};\n"

    def dtype(self, precision: Precision) -> np.dtype:
        """The numpy record type with the same layout (natural alignment)."""
        types = {"real": real_dtype(precision), "int": np.dtype(np.int32)}
        fields = []
        for member in self.members:
            shape = (member.length,) if member.length > 1 else ()
            fields.append((member.name, types[member.type], shape))
        return np.dtype(fields, align=True)


def c_enum(enum: type[IntEnum], prefix: str) -> str:
    """An IntEnum as #defines PREFIX_NAME, the same numbers on both sides."""
    return "".join(f"#define {prefix}_{member.name} {member.value}\n" for member in enum)
