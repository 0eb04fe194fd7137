"""The whole chain from a motion down to pixels and model in one sentence."""

from __future__ import annotations

from collections.abc import Iterator

from harvey.run_files.records import EntryRecord
from harvey.why import facts
from harvey.why.facts import followed
from harvey.why.history import History
from harvey.why.links import anchor_of, reason, tracks_of
from harvey.why.sentences import sentence
from world_models.words import turn


def in_one_sentence(history: History, command: EntryRecord) -> str:
    """Why the robot moved as it did; "" for entries that are no motor command."""
    if command.type not in ("MotorCommand", "Course"):
        return ""
    parts = list(_because(history, command))
    return f"Harvey was told to {sentence(command)} {', '.join(parts)}." if parts else ""


def _because(history: History, command: EntryRecord) -> Iterator[str]:
    leg, milestone, belief = (reason(history, command, type) for type in ("Leg", "Milestone", "Hypothesis"))
    if leg is not None and leg.value.get("aim_rad") is not None:
        yield f"because the line to follow lay {turn(leg.value['aim_rad'])} of where it believed that it faced"
    elif milestone is not None:
        yield f"because it had to face {facts.milestone_name(milestone.value)} to look for it"
    elif leg is None and (segments := reason(history, command, "Segments")) is not None:
        yield "because it did not know where it was"
        yield f"and {sentence(segments)} did not tell"
    if belief is not None:
        yield from _seen(history, belief)
        yield from _matched(history, belief)


def _seen(history: History, belief: EntryRecord) -> Iterator[str]:
    """The landmark that was furthest from its prediction, and the pose that the prediction was made from."""
    tracks, before = tracks_of(history, belief), reason(history, belief, "Hypothesis")
    if belief.value["basis"] != "tracks" or tracks is None or before is None or not followed(tracks.value):
        return
    frame = facts.frame_number(reason(history, belief, "Frame"), tracks.value["frame"])
    yield f"because in {frame} {facts.off(followed(tracks.value)[0])} ({tracks.ref})"
    yield f"made from pose {before.ref}"


def _matched(history: History, belief: EntryRecord) -> Iterator[str]:
    """The match that the belief goes back to."""
    anchor = anchor_of(history, belief)
    fix = None if anchor is None else reason(history, anchor, "PoseFix")
    match = None if fix is None else reason(history, fix, "LineMatch")
    whose = "" if belief.value["basis"] == "tracks" else "where its pose was "
    if fix is not None and match is not None:
        yield f"{whose}made from match {match.id} of {facts.best_pairs(history, fix, match)}"
    elif anchor is not None:
        yield f"made from pose {anchor.ref} by {anchor.value['basis']}"
