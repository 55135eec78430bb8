"""What a plan decides, and why."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Decision:
    """One thing a plan decided, and why."""

    feature: str
    choice: str
    reason: str


def left_out(notes: list[Decision], feature: str, needed: bool, why: str, why_not: str) -> bool:
    """Note that a feature is in, or left out; returns whether it is needed."""
    notes.append(Decision(feature, "in" if needed else "left out", why if needed else why_not))
    return needed
