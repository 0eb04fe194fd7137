"""Dependency withdrawer (§3.4): what rested on a locale frame that was revised is withdrawn."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import replace
from typing import NamedTuple

from blackboard import Change, Effect, Entry, Revise, Revised, View, Watch, rule
from knowledge_sources.methods.motion import leads_through, meets
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, active_goal, find_robot
from world_models.building.locale_frame import FrameRequest, LocaleFrame
from world_models.entries import Milestone, Obstacle, PlanSketch, Track, Tracks


class Case(NamedTuple):
    """A frame that was revised, and what rested on what it no longer says; ``unverified``: sketches, to be verified."""

    frame: Entry[LocaleFrame]
    milestones: tuple[Entry[Milestone], ...]
    superseded: tuple[Entry[PlanSketch], ...]
    unverified: tuple[Entry[PlanSketch], ...]
    tracks: Entry[Tracks] | None


def find_rested(view: View, trigger: Change) -> Case | None:
    """What rested on what a frame no longer says."""
    frame: Entry[LocaleFrame] = trigger.entry
    superseded = _find_misled(view, frame)
    misled = {sketch.id for sketch in superseded}
    gone = tuple(entry for entry in view.all(Milestone) if _is_overtaken(entry, frame, misled))
    unverified = {m.sketch for m in (entry.value for entry in gone) if m.status == "verified" and _holds(view, m)}
    tracks = view.latest(Tracks)
    is_lost = tracks is not None and len(_list_kept(tracks.value, frame.value)) < len(tracks.value.items)
    left = tuple(view[id] for id in sorted(unverified - misled))
    case = Case(frame, gone, superseded, left, tracks if is_lost else None)
    return case if any(case[1:]) else None


def _is_overtaken(entry: Entry[Milestone], frame: Entry[LocaleFrame], misled: Collection[str]) -> bool:
    """Whether a milestone that is awaited was predicted by what differs, or a verified one has lost a landmark."""
    m = entry.value
    if m.is_open and (_rests_on(entry, frame) or m.sketch in misled):
        return True
    return m.status == "verified" and _is_any_gone(m.landmarks, frame.value)


def _list_kept(tracks: Tracks, frame: LocaleFrame) -> tuple[Track, ...]:
    """The tracks of landmarks that a frame still has."""
    return tuple(track for track in tracks.items if not _is_any_gone((track.landmark,), frame))


def _rests_on(entry: Entry[Milestone], frame: Entry[LocaleFrame]) -> bool:
    """Whether a milestone was predicted from an earlier revision of a frame."""
    return any(ref.id == frame.id and ref.revision < frame.revision for ref in entry.because)


def _is_any_gone(landmarks: Iterable[str], frame: LocaleFrame) -> bool:
    """Whether one of the landmarks is a part of what a frame no longer has."""
    gone = [change.name for change in frame.changes if change.what in ("gone", "removed")]
    return any(name == thing or name.startswith(f"{thing}/") for name in landmarks for thing in gone)


def _holds(view: View, milestone: Milestone) -> bool:
    """Whether an active sketch goes on from a verified milestone."""
    sketch = view.get(milestone.sketch)
    if sketch is None or not isinstance(sketch.value, PlanSketch):
        return False
    s = sketch.value
    return s.is_active and s.verified and s.at == milestone.index


def _find_misled(view: View, frame: Entry[LocaleFrame]) -> tuple[Entry[PlanSketch], ...]:
    """The active sketches, all of them, where one passes through what has changed."""
    if active_goal(view) is None:
        return ()
    active, belief = view.where(PlanSketch, lambda sketch: sketch.is_active), HELD.find(view)
    found = [view.get(ref.id) for ref in frame.because if ref.id != frame.id]
    changed = [entry.value for entry in found if entry is not None and isinstance(entry.value, Obstacle)]
    is_misled = False
    if belief is not None and changed:
        robot = find_robot(view)
        is_misled = any(meets(sketch.value, obstacle, belief.pose, robot)
                        for sketch in active for obstacle in changed)
    if len(changed) < len(found) or not changed:  # something else differs too: a door, or what the file has
        is_misled = is_misled or any(leads_through(sketch.value, frame.value) for sketch in active)
    return active if is_misled else ()


@rule(on=Watch(LocaleFrame, (Revised,)), writes=(Milestone, PlanSketch, Tracks, FrameRequest), bind=find_rested,
      priority=Priority.ENTER)
def dependency_withdrawer(_view: View, case: Case) -> Iterable[Effect]:
    """Withdraws milestones, plan sketches and tracks that rested on what a frame no longer says.

    A milestone that waits to be judged is withdrawn where its prediction rested on the frame; one that was verified,
    where a landmark of it is gone: its place must be verified again. A sketch that led through a door that
    is now shut, or round a thing that is now gone, is superseded; the goal sketcher draws another. So is one whose way
    an obstacle blocks: it stands within the robot's radius and the least clearance of what is left of a leg.
    """
    frame, tracks = case.frame, case.tracks
    for milestone in case.milestones:
        yield Revise(milestone, replace(milestone.value, status="withdrawn"), (frame,))
    for sketch in case.superseded:
        yield Revise(sketch, replace(sketch.value, status="superseded"), (frame,))
    for sketch in case.unverified:
        yield Revise(sketch, replace(sketch.value, verified=False), (frame,))
    if tracks is not None:
        yield Revise(tracks, replace(tracks.value, items=_list_kept(tracks.value, frame.value)), (frame,))
