"""Thing withdrawer (§4): what was seen by a belief that proved wrong is taken back."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, NamedTuple

from blackboard.board import View
from blackboard.change import Change, Revised, Watch
from blackboard.effect import Effect, Revise
from blackboard.entry import Entry
from blackboard.level import Level
from knowledge_sources.methods.floor.found_things import may_be_there
from knowledge_sources.priority import Priority
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries.location import Hypothesis
from world_models.entries.obstacle import Obstacle
from world_models.entries.task import Certificate


class Case(NamedTuple):
    """The belief by which the robot was found again, what is taken back, and the certificate after which it was seen.

    Attributes:
        sure: the last milestone that was verified, if one was.
    """

    belief: Entry[Hypothesis]
    things: tuple[Entry[Obstacle], ...]
    sure: tuple[Entry[Any], ...]


class ThingWithdrawer(RobotKnowledgeSource):
    """Takes back what was seen on the floor since a milestone was last verified, where the robot was lost since.

    Its place rests on a belief that proved wrong; what is there is seen anew. What was touched stays.
    """

    level, priority = Level.ACTION, Priority.REVISE
    on = (Watch(Hypothesis, (Revised,), lambda h: h.is_held and h.basis == "relocalization"),)
    writes = (Obstacle,)

    def bind(self, view: View, trigger: Change) -> Case | None:
        """What was seen, and not touched, since a milestone was last verified."""
        sure = view.latest(Certificate, lambda certificate: certificate.verdict == "verified")
        seen = tuple(entry for entry in view.where(Obstacle, lambda o: may_be_there(o) and o.touched_s is None)
                     if sure is None or entry.cycle > sure.cycle)
        return Case(trigger.entry, seen, () if sure is None else (sure,)) if seen else None

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        told = f"taken back: its place rested on a belief that {case.belief.ref} proved wrong"
        for entry in case.things:
            gone = replace(entry.value, status="gone", certainty=0.0, evidence=told)
            yield Revise(entry, gone, (case.belief, entry, *case.sure))
