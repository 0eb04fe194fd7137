"""Model reviser (§3.4): what the robot is told of the building revises the frames of the locales that it concerns."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from blackboard.board import View
from blackboard.change import Change, Posted, Watch
from blackboard.effect import Effect, Revise
from blackboard.entry import Entry
from blackboard.level import Level
from knowledge_sources.priority import Priority
from knowledge_sources.questions import find_building, find_frames
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.building.locale_frame import UNDONE, FrameChange, LocaleFrame
from world_models.entries.user_reports import DOOR_STATES, UserReport


class ModelReviser(RobotKnowledgeSource):
    """Revises the frames of a door or a thing that somebody says is otherwise.

    A door is in the frames of both its rooms. What cannot be taken up, because the model has nothing of that name, is
    answered, and nothing is revised. It acts at once, before the next increment: the door may be just ahead.
    """

    level, priority = Level.ACTION, Priority.ENTER
    on = (Watch(UserReport, (Posted,)),)
    writes = (LocaleFrame, UserReport)

    def bind(self, view: View, trigger: Change) -> Entry[UserReport]:
        return trigger.entry

    def act(self, view: View, case: Entry[UserReport]) -> Iterable[Effect]:
        report = case
        try:
            frames = find_frames(view, find_building(view).find_elements(report.value.what))
            revised = [(frame, _revise(frame.value, report)) for frame in frames]
        except ValueError as error:
            yield Revise(report, replace(report.value, answer=f"which cannot be: {error}"), (report,))
            return
        changed = [(frame, value) for frame, value in revised if value.changes != frame.value.changes]
        answer = "" if changed else "as it was known"
        yield Revise(report, replace(report.value, answer=answer or "and took it over"), (report,))
        for frame, value in changed:
            yield Revise(frame, value, (report, frame))


def _revise(frame: LocaleFrame, report: Entry[UserReport]) -> LocaleFrame:
    """The frame as it is now known. Raises ValueError where it has nothing that could be so."""
    what, state = report.value.what, report.value.state
    if state == "gone" and any((change.what, change.name) == ("extra", what) for change in frame.changes):
        return frame.restored("extra", what)
    known = {(change.what, change.name) for change in frame.changes}
    filed = frame.filed or frame
    names = [door.name for door in filed.doorways] if state in DOOR_STATES else [thing.name for thing in filed.things]
    if what not in names:
        kind = "an open door" if state in DOOR_STATES else "a thing"
        raise ValueError(f"expected {kind} of {frame.name} ({', '.join(names) or 'it has none'}), got {what!r}")
    if state in UNDONE:
        return frame.restored(UNDONE[state], what)
    if (state, what) in known:
        return frame
    return frame.changed(FrameChange("shut" if state == "shut" else "gone", what, report.author))
