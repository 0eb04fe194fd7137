"""Mover explainer: what somebody explains who walks there is no thing in the way."""

from __future__ import annotations

import math
from collections.abc import Iterable

import shapely

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revise, Revised, View, Watch
from harvey_people.seeing.following import MAX_UNSEEN_S
from harvey_people.seeing.mover import Mover
from knowledge_sources.methods.floor import judge_by, may_be_there
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, find_difference
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Evidence, Explanation, Obstacle

BODY_M = 0.35
"""A person's middle is so near to what is seen of a body and its legs."""
MOST_LOG_RATIO = 5.0
Case = tuple[tuple[Entry[Obstacle], Entry[Mover]], ...]
"""Things that were seen on the floor, each with who walked there then."""


class MoverExplainer(RobotKnowledgeSource):
    """Has those who walk compete with things that were seen before it was known that they do.

    Where one was when a thing was seen, it rather was that one. It is evidence of the thing's difference, beside what
    looks like a thing, a jamb or dirt; the thing stays as certain as it leaves it. A person who stands explains
    nothing: that is a thing in the way.
    """

    level, priority = Level.ACTION, Priority.ENTER  # before the model is revised by it
    on = (Watch(Obstacle, (Posted, Revised), may_be_there), Watch(Mover, (Revised,), lambda mover: mover.is_walking))
    needs = (HELD,)
    writes = (Obstacle, Evidence)

    def bind(self, view: View, trigger: Change) -> Case | None:
        """All things that somebody explains who rather walks than stands, and that were not told of that yet."""
        movers = tuple(view.where(Mover, lambda mover: mover.is_walking))
        things = tuple(view.where(Obstacle, lambda o: may_be_there(o) and o.touched_s is None)) if movers else ()
        walked = ((thing, next((mover for mover in movers if explains(mover.value, thing.value)), None))
                  for thing in things)
        return tuple((thing, mover) for thing, mover in walked
                     if mover is not None and not _was_told(view, thing.value)) or None

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        here = HELD.of(view).pose
        for thing, mover in case:
            ratio = min(MOST_LOG_RATIO, mover.value.log_odds)
            shows = f"{mover.value.name} was there, and walks at {mover.value.speed_m_per_s:.1f} m/s"
            told = Evidence(thing.value.name, shows, (Explanation("mover", "somebody who walks", round(ratio, 4)),),
                            here.x_m, here.y_m, 0.0, 0.0, math.tau, thing.value.seen_s)
            known = find_difference(view, thing.value.name)
            yield Post(told, (thing, mover))
            yield Revise(thing, judge_by(told, thing.value, known, self._settings.action), (thing, mover))


def explains(mover: Mover, thing: Obstacle) -> bool:
    """Whether somebody was where a thing was last seen, at that moment, to two standard deviations of the place.

    What both were last seen by was weighed by the mover watcher.
    """
    lasts_s = thing.seen_s - mover.at_s
    if not -MAX_UNSEEN_S <= lasts_s < 0.0:
        return False
    x, y = mover.state[:2] + lasts_s * mover.state[2:]
    seen = shapely.Polygon(thing.footprint)
    return bool(seen.distance(shapely.Point(x, y)) <= BODY_M + 2.0 * min(mover.sigma_m, BODY_M))


def _was_told(view: View, thing: Obstacle) -> bool:
    """Whether this sight of it was explained before."""
    return any(evidence.seen_s == thing.seen_s and any(e.kind == "mover" for e in evidence.explanations)
               for evidence in find_difference(view, thing.name).counted)
