"""Thing judge (§4: models are incomplete): a thing on the floor is as certain as its rivals leave it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from blackboard import Change, Effect, Entry, Revise, View, Watch
from knowledge_sources.methods.floor import judge_thing
from knowledge_sources.priority import Priority
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Difference, Obstacle


class ThingJudge(RobotKnowledgeSource):
    """Holds a thing for as certain as its difference says, whatever the evidence is of; gone where a rival has won.

    What the thing mapper weighs in one sight it enters at once; this enters what touches, the lens and a kidnap say.
    """

    priority = Priority.ENTER
    on = (Watch(Difference),)
    writes = (Obstacle,)

    def bind(self, view: View, trigger: Change) -> tuple[Entry[Difference], Entry[Obstacle], Obstacle] | None:
        """The thing that differs now from what is known of it."""
        found: Entry[Difference] = trigger.entry
        thing = view.latest(Obstacle, lambda o: o.name == found.value.about)
        if thing is None:
            return None
        judged = judge_thing(thing.value, found.value, self._settings.action)
        if judged == thing.value:
            return None
        return found, thing, replace(judged, evidence=f"{found.value.counted[-1].shows}: {found.value.odds_in_words()}")

    def act(self, view: View, case: tuple[Entry[Difference], Entry[Obstacle], Obstacle]) -> Iterable[Effect]:
        found, thing, judged = case
        yield Revise(thing, judged, (found, thing))
