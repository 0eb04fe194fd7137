"""What a difference between two runs comes from."""

from __future__ import annotations

from collections.abc import Collection

import pytest

from logs.explain.diff import grounds
from logs.records import DecisionRecord, EntryRecord
from memory_timeline import MemoryTimeline

BECAUSE = {
    "PictureRequest-1.0": (), "CameraPicture-1.0": ("PictureRequest-1.0",), "Belief-1.0": ("CameraPicture-1.0",),
    "CameraPicture-2.0": ("PictureRequest-1.0",),
    "Belief-1.1": ("CameraPicture-2.0", "Belief-1.0"), "Leg-1.0": ("Belief-1.1",),
    "Motion-1.0": ("Leg-1.0", "Belief-1.1"),
}


def build_history(otherwise: Collection[str]) -> MemoryTimeline:
    """A run that makes one entry a cycle, some of them otherwise."""
    entries = [EntryRecord("Posted", ref, "Note", "somebody", because, int(ref in otherwise), cycle, False)
               for cycle, (ref, because) in enumerate(BECAUSE.items(), 1)]
    return MemoryTimeline(
        DecisionRecord(e.cycle, "action", (), (), (), (), None, None, 0, (e,), "", {}) for e in entries)


@pytest.mark.parametrize(("differing", "way"), [
    (["Motion-1.0"], ["Motion-1.0"]),
    (["Motion-1.0", "Belief-1.1", "CameraPicture-2.0"], ["Motion-1.0", "Belief-1.1", "CameraPicture-2.0"]),
    (list(BECAUSE)[1:], ["Motion-1.0", "Belief-1.1", "Belief-1.0", "CameraPicture-1.0"]),
    ([ref for ref in BECAUSE if ref not in ("CameraPicture-1.0", "PictureRequest-1.0")],
     ["Motion-1.0", "Belief-1.1", "Belief-1.0"]),
])
def test_it_comes_from_the_oldest_difference_and_not_from_the_nearest(differing: list[str], way: list[str]) -> None:
    """A belief that differs since the first picture rests on the last one too, which differs as well."""
    assert [a.ref for a, _ in grounds(build_history(()), build_history(differing), "Motion-1.0")] == way
