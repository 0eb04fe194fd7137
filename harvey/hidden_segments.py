"""Hidden segments: line segments left out of pictures, to see what a run would have done without them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from blackboard.board import View
from blackboard.change import Change
from blackboard.effect import Effect, Post
from harvey.errors import BadInput
from knowledge_sources.plan.line_finder import LineFinder
from knowledge_sources.settings import Settings
from logs.records import DecisionRecord
from world_models.entries.body import Frame
from world_models.entries.percepts import Segments
from world_models.frames import frozen
from world_models.words import listed

SEGMENT = re.compile(r"frame[- ](\d{1,9})[ ,-]+segment[- ](\d{1,9})", re.IGNORECASE | re.ASCII)
MAX_LISTED = 12
"""So many frames are listed."""


def is_segment(name: str) -> bool:
    """Whether a name is of a segment, as ``Frame-88 segment 12``."""
    return SEGMENT.fullmatch(name) is not None


def parse_segments(names: Iterable[str]) -> tuple[tuple[int, int], ...]:
    """(frame, segment) of the names that are of segments."""
    return tuple((int(m[1]), int(m[2])) for name in names if (m := SEGMENT.fullmatch(name)))


class SegmentHider(LineFinder):
    """The line finder, with some segments of some pictures left out."""

    def __init__(self, settings: Settings, segments: Sequence[tuple[int, int]]) -> None:
        """``segments``: (number of the Frame entry, segment) to be left out."""
        super().__init__(settings)
        self._segments = tuple(segments)

    @property
    def name(self) -> str:
        return "line_finder"

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        hidden = [segment for frame, segment in self._segments if trigger.entry.id == f"Frame-{frame}"]
        for effect in super().act(view, trigger):
            if isinstance(effect, Post) and isinstance(effect.value, Segments) and hidden:
                yield Post(_hide(effect.value, hidden), effect.because)
            else:
                yield effect


def check_segments(records: Sequence[DecisionRecord], names: Sequence[str], hidden: Sequence[str]) -> None:
    """Validate the names of segments against a run. Raises BadInput where it has no such frame or segment.

    Args:
        names: as ``Frame-88 segment 12``; other names are passed over.
        hidden: what was taken from the run itself: segments keep the numbers that they have without that.
    """
    wanted = parse_segments(names)
    if not wanted:
        return
    frames = [entry.id for decision in records for entry in decision.observed if entry.kind is Frame]
    counts, already = _count_segments(records), parse_segments(hidden)
    for frame, segment in wanted:
        name = f"Frame-{frame}"
        where = f"--without {name} segment {segment}: expected"
        if name not in frames:
            raise BadInput(f"{where} a frame of the run, {_ends(frames)}, got {name}")
        if name not in counts:
            looked = listed([one for one in frames if one in counts], MAX_LISTED)
            raise BadInput(
                f"{where} a frame in which segments were looked for, {looked or 'which none was'}, got {name}")
        total = counts[name] + len({pair for pair in already if pair[0] == frame})
        if segment >= total:
            raise BadInput(f"{where} a segment of {name}, {_ends(range(total))}, got {segment}")


def _hide(found: Segments, hidden: Sequence[int]) -> Segments:
    kept = np.setdiff1d(np.arange(len(found.segments_px)), hidden)
    return replace(found, segments_px=frozen(found.segments_px[kept]), sigma_px=frozen(found.sigma_px[kept]))


def _count_segments(records: Sequence[DecisionRecord]) -> Mapping[str, int]:
    """Frame by id -> how many segments were found in it."""
    made = (entry.fields for decision in records for entry in decision.made if entry.kind is Segments)
    whole = (v for v in made if isinstance(v, dict) and isinstance(v.get("segments_px"), list))
    return {str(v.get("frame")): len(v["segments_px"]) for v in whole}


def _ends(names: Sequence[object]) -> str:
    """The first and the last."""
    return f"{names[0]} to {names[-1]}" if names else "which has none"
