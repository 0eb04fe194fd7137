"""Segments that are to be taken away: whether the run had them at all, lest nothing be taken and nothing change."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from harvey.agent import parse_segments
from harvey.errors import BadInput
from harvey.run_files.records import DecisionRecord
from world_models.words import listed

MOST = 12
"""So many frames are listed."""


def check_segments(records: Sequence[DecisionRecord], names: Sequence[str], hidden: Sequence[str]) -> None:
    """Raises BadInput where a frame or a segment is not of the run; says what there is.

    Args:
        names: as ``frame 88 segment 12``; other names are passed over.
        hidden: what was taken from the run itself: segments keep the numbers that they have without that.
    """
    wanted = parse_segments(names)
    if not wanted:
        return
    frames, found, already = _frames(records), _found(records), parse_segments(hidden)
    for frame, segment in wanted:
        where = f"--without frame {frame} segment {segment}: expected"
        if frame not in frames.values():
            raise BadInput(f"{where} a frame of the run, {_range(frames.values())}, got {frame}")
        counts = [n for ref, n in found.items() if frames.get(ref) == frame]
        if not counts:
            looked = listed([number for ref, number in frames.items() if ref in found], MOST)
            raise BadInput(
                f"{where} a frame in which segments were looked for, {looked or 'which none was'}, got {frame}")
        there = max(counts) + len({pair for pair in already if pair[0] == frame})
        if segment >= there:
            raise BadInput(f"{where} a segment of frame {frame}, {_range(range(there))}, got {segment}")


def _frames(records: Sequence[DecisionRecord]) -> Mapping[str, int]:
    """Frame by id -> its number."""
    seen = (entry for decision in records for entry in decision.observed if entry.type == "Frame")
    return {entry.id: int(entry.value["number"]) for entry in seen}


def _found(records: Sequence[DecisionRecord]) -> Mapping[str, int]:
    """Frame by id -> how many segments were found in it."""
    made = (entry.value for decision in records for entry in decision.made if entry.type == "Segments")
    whole = (v for v in made if isinstance(v, dict) and isinstance(v.get("segments_px"), list))
    return {str(v.get("frame")): len(v["segments_px"]) for v in whole}


def _range(numbers: Iterable[int]) -> str:
    have = sorted(numbers)
    return f"{have[0]} to {have[-1]}" if have else "which has none"
