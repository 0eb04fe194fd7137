"""What if: what a robot knows, revised with the author "what if", to see what it would have done.

Landmarks and faces that are taken away are no part of the locale frames any more, and the robot's entries have the
values that were set; building and body stay as they are. The revisions are observations like any other: they stand in
the journal, and a replay takes them from there. Line segments are left out of pictures where they are found.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import replace
from difflib import get_close_matches
from typing import Any

import numpy as np

from blackboard import Change, Effect, Entry, Post, Revise, Scheduler, View
from harvey.agent_settings import build_believed
from harvey.errors import BadInput
from knowledge_sources.milestone.line_finder import LineFinder
from knowledge_sources.settings import Settings
from logs.records import WHAT_IF, DecisionRecord
from world_models.building.changes import element_names
from world_models.building.locale_frame import FrameChange, FrameRequest, LocaleFrame
from world_models.entries import CameraPicture, CameraState, Footprint, Segments, Wheels
from world_models.frame_store import FrameStore
from world_models.frames import frozen
from world_models.words import listed

MAX_SUGGESTED, MIN_SIMILARITY = 6, 0.5


class WhatIf:
    """Revises what is on a board where it is not as it is to be; called before each cycle.

    A frame comes to the board at the end of a cycle, so no act reads it before it is revised here. What is revised
    already, as in a run that is replayed, stays as it is.
    """

    def __init__(self, removed: Sequence[str] = (), pairs: Iterable[tuple[str, str]] = ()) -> None:
        """What is to be different.

        Args:
            removed: names of landmarks, whose lines go, and of faces.
            pairs: (key, value) as after ``--set``; only what the robot believes of itself is used.

        Raises:
            BadInput: a value cannot be used.
        """
        self._removals = tuple(FrameChange("removed", name, WHAT_IF) for name in dict.fromkeys(removed))
        self._believed = build_believed(pairs)
        self._checked: tuple[Entry[LocaleFrame], ...] = ()

    def __call__(self, scheduler: Scheduler) -> None:
        """Tell a scheduler what its board is to be revised by, if anything."""
        view = scheduler.view
        if effects := [*self._revise_robot(view), *self._revise_frames(view)]:
            scheduler.post(effects, WHAT_IF)

    def _revise_robot(self, view: View) -> Iterator[Effect]:
        """The robot's entries as they were at the start; what is learnt of them later stands."""
        for kind in (CameraState, Wheels, Footprint):
            entry: Entry[Any] | None = view.latest(kind)
            if entry is not None and entry.revision == 0:
                value = self._believed(entry.value)
                if value is not entry.value:
                    yield Revise(entry, value, (entry,))

    def _revise_frames(self, view: View) -> Iterator[Effect]:
        if not self._removals:
            return
        checked, self._checked = set(map(id, self._checked)), view.all(LocaleFrame)
        for entry in self._checked:
            if id(entry) in checked:
                continue
            frame, names = entry.value, element_names(entry.value.parts)
            for change in self._removals:
                if change.name in names and change not in frame.changes:
                    frame = frame.changed(change)
            if frame is not entry.value:
                yield Revise(entry, frame, (entry,))


def check_removals(names: Sequence[str], store: FrameStore, sources: Sequence[str]) -> None:
    """Validate the names of landmarks and faces.

    Raises:
        BadInput: the world has none of a name; near names are listed, those of knowledge sources too.
    """
    for name in names:
        if not _is_in_its_locale(name, store) and name not in (known := element_names(store.world.parts)):
            raise BadInput(f"--without {name}: expected {_suggest(name, sources, known)}, got {name!r}")


def _is_in_its_locale(name: str, store: FrameStore) -> bool:
    """Whether the locale that a name tells has this landmark or face; no other is read."""
    _, answered = store.answer(FrameRequest(elements=(name,)))
    locales = answered.answers[0].locales
    return any(name in element_names(store.frame(locale).parts) for locale in locales)


def _suggest(name: str, sources: Sequence[str], elements: Set[str]) -> str:
    """The names that the user may have meant."""
    known = sorted({*sources, *elements}, key=lambda known: (known.count("/"), known))
    meant = [text for text in known if name.lower() in text.lower()]
    meant = meant or get_close_matches(name, known, MAX_SUGGESTED, MIN_SIMILARITY)
    names = ", ".join(meant[:MAX_SUGGESTED]) or f"a knowledge source ({', '.join(sources)}), a landmark or a face"
    return f"{names}, or as 'CameraPicture-88 segment 12'"


SEGMENT = re.compile(r"camerapicture[- ](\d{1,9})[ ,-]+segment[- ](\d{1,9})", re.IGNORECASE | re.ASCII)
MAX_LISTED = 12
"""So many frames are listed."""


def is_segment(name: str) -> bool:
    """Whether a name is of a segment, as ``CameraPicture-88 segment 12``."""
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

    def act(self, view: View, case: Change) -> Iterable[Effect]:
        hidden = [segment for frame, segment in self._segments if case.entry.id == f"CameraPicture-{frame}"]
        for effect in super().act(view, case):
            if isinstance(effect, Post) and isinstance(effect.value, Segments) and hidden:
                yield Post(_hide(effect.value, hidden), effect.because)
            else:
                yield effect


def check_segments(records: Sequence[DecisionRecord], names: Sequence[str], hidden: Sequence[str]) -> None:
    """Validate the names of segments against a run. Raises BadInput where it has no such frame or segment.

    Args:
        names: as ``CameraPicture-88 segment 12``; other names are passed over.
        hidden: what was taken from the run itself: segments keep the numbers that they have without that.
    """
    wanted = parse_segments(names)
    if not wanted:
        return
    frames = [entry.id for decision in records for entry in decision.observed if entry.kind is CameraPicture]
    counts, already = _count_segments(records), parse_segments(hidden)
    for frame, segment in wanted:
        name = f"CameraPicture-{frame}"
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
