"""People masker: what people hide of a milestone is not asked of the picture."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revise, View, Watch
from harvey_people.behaving.people_entries import PeopleHide
from harvey_people.seeing.following import MAX_UNSEEN_S
from harvey_people.seeing.mover import Mover
from harvey_people.seeing.silhouette import outline, take_hidden
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import CameraPicture, Milestone, Segments


class Case(NamedTuple):
    """Segments of a milestone's picture, the milestone, what is left of it, who hides the rest, and the moment."""

    segments: Entry[Segments]
    milestone: Entry[Milestone]
    left: Milestone
    movers: tuple[Entry[Mover], ...]
    at_s: float


class PeopleMasker(RobotKnowledgeSource):
    """Takes from a milestone, before it is matched, the lines and the points of faces that people hide.

    Where they stand at the moment of the picture is predicted, each as wide as the doubt of that. So who hides a
    landmark neither refutes it nor is taken for it; where too few lines are left the milestone is not testable.
    """

    level, priority = Level.PLAN, Priority.REVISE  # before the matcher
    on = (Watch(Segments, (Posted,), lambda s: s.milestone != ""),)
    needs = (HELD,)
    writes = (Milestone, PeopleHide)

    def bind(self, view: View, trigger: Change) -> Case | None:
        segments: Entry[Segments] = trigger.entry
        milestone, picture = view.get(segments.value.milestone), view.get(segments.value.frame)
        if milestone is None or milestone.value.status != "expected" or picture is None:
            return None
        frame: CameraPicture = picture.value
        movers = tuple(view.where(Mover, lambda mover: (
            mover.status != "gone" and abs(frame.sim_time_s - mover.seen_s) <= MAX_UNSEEN_S)))
        belief = HELD.of(view)
        robot, here = belief.seeing, belief.pose
        hide = [(entry, found) for entry in movers
                if (found := outline(robot, here, entry.value, frame.sim_time_s)) is not None]
        if not hide:
            return None
        left = take_hidden(milestone.value, [found for _, found in hide], robot, here)
        if left is milestone.value:
            return None
        return Case(segments, milestone, left, tuple(entry for entry, _ in hide), frame.sim_time_s)

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        because = (case.segments, case.milestone, *case.movers, HELD.of(view).entry)
        of = len(case.milestone.value.expected)
        yield Post(PeopleHide(case.milestone.id, of - len(case.left.expected), of,
                              tuple(entry.value.name for entry in case.movers), case.at_s), because)
        yield Revise(case.milestone, case.left, because)
