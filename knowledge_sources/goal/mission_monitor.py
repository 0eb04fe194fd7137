"""Mission monitor (§4): every mission ends in a declared outcome."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from blackboard.board import View
from blackboard.change import Change, Posted, Quiescence, Revised, Watch
from blackboard.effect import Effect, Post
from blackboard.entry import Entry
from blackboard.level import Level
from knowledge_sources.questions import is_over, open_discrepancy, open_milestone
from knowledge_sources.robot_knowledge_source import OlderSource
from world_models.entries.location import Hypothesis, Place
from world_models.entries.task import Goal, Outcome


class MissionMonitor(OlderSource):
    """Declares ``reached`` when the goal is, and ``lost`` or ``failed`` when nothing is left to do before that."""

    level = Level.GOAL
    on = (
        Watch(Goal, (Revised,), lambda goal: goal.status == "reached"),
        Watch(Quiescence, (Posted,)),
    )
    writes = (Outcome,)

    def judge(self, view: View, trigger: Change) -> float | None:
        return None if is_over(view) else 1.0

    def answer(self, view: View, trigger: Change) -> Iterable[Effect]:
        if isinstance(trigger.entry.value, Goal):
            reason = f"every milestone on the way to {trigger.entry.value.destination} was verified"
            yield Post(Outcome("reached", reason), (trigger.entry,))
            return
        lost = open_discrepancy(view, Level.GOAL)
        if lost is not None:
            perhaps = view.where(Hypothesis, lambda h: h.status == "candidate")
            reason = f"{lost.value.what}, {_describe_places(perhaps)}"
            yield Post(Outcome("lost", reason), (trigger.entry, lost, *perhaps))
            return
        waiting, goal = open_milestone(view), view.latest(Goal)
        what = "nobody had anything left to do"
        if waiting is not None:
            what = f"nobody answered for {waiting.id} ({waiting.value.what})"
        unmet = tuple(entry for entry in (waiting, goal) if entry is not None)
        yield Post(Outcome("failed", what), (trigger.entry, *unmet))


def _describe_places(perhaps: Sequence[Entry[Hypothesis]]) -> str:
    """The places where the robot may be, in words."""
    places = []
    for entry in perhaps:
        h = entry.value
        places.append(f"{Place(h.locale, h.locale_from_robot.x_m, h.locale_from_robot.y_m)} ({h.weight:.0%})")
    if len(places) > 1:
        return f"and it is ambiguous where: {' or '.join(places)}"
    return f"and it is not sure where: perhaps {places[0]}" if places else "and nobody could tell where"
