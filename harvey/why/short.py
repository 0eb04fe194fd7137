"""The whole chain from a motion down to pixels and model in one sentence."""

from __future__ import annotations

from collections.abc import Iterator

from harvey.run_files.records import EntryRecord
from harvey.why import facts
from harvey.why.history import History
from harvey.why.links import anchor_of, reason, tracks_of
from harvey.why.sentences import sentence, value_of
from world_models.entries.location import Hypothesis
from world_models.entries.percepts import Segments, Tracks
from world_models.entries.task import Leg, Milestone
from world_models.words import turn


def in_one_sentence(history: History, command: EntryRecord) -> str:
    """Why the robot moved as it did; "" for entries that are no motor command."""
    if command.type not in ("MotorCommand", "Course"):
        return ""
    parts = list(_because(history, command))
    return f"Harvey was told to {sentence(command)} {', '.join(parts)}." if parts else ""


def _because(history: History, command: EntryRecord) -> Iterator[str]:
    leg, milestone, belief = (reason(history, command, type) for type in ("Leg", "Milestone", "Hypothesis"))
    aim_rad = None if leg is None else value_of(leg, Leg).aim_rad
    if aim_rad is not None:
        yield f"because the line to follow lay {turn(aim_rad)} of where it believed that it faced"
    elif milestone is not None:
        yield f"because it had to face {facts.milestone_name(value_of(milestone, Milestone))} to look for it"
    elif leg is None and (segments := reason(history, command, "Segments")) is not None:
        seen = facts.seen_in(value_of(segments, Segments), reason(history, segments, "Frame"))
        yield f"because it did not know where it was, and did not find it out from {seen}"
    if belief is not None:
        yield from _seen(history, belief)
        yield from _matched(history, belief)


def _seen(history: History, belief: EntryRecord) -> Iterator[str]:
    """The landmark that was furthest from its prediction, and the pose that the prediction was made from."""
    tracks, before = tracks_of(history, belief), reason(history, belief, "Hypothesis")
    if value_of(belief, Hypothesis).basis != "tracks" or tracks is None or before is None:
        return
    value = value_of(tracks, Tracks)
    if not value.found_again():
        return
    frame = facts.picture(reason(history, belief, "Frame"), value.frame)
    yield f"because in {frame} {facts.off(value.found_again()[0])} ({tracks.ref})"
    yield f"made from pose {before.ref}"


def _matched(history: History, belief: EntryRecord) -> Iterator[str]:
    """The match that the belief goes back to."""
    anchor = anchor_of(history, belief)
    fix = None if anchor is None else reason(history, anchor, "PoseFix")
    match = None if fix is None else reason(history, fix, "LineMatch")
    whose = "" if value_of(belief, Hypothesis).basis == "tracks" else "where its pose was "
    if fix is not None and match is not None:
        yield f"{whose}made from match {match.id} of {facts.best_pairs(history, fix, match)}"
    elif anchor is not None:
        yield f"made from pose {anchor.ref} by {value_of(anchor, Hypothesis).basis}"
