"""Mission monitor (§4): every mission ends in a declared outcome."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from blackboard import Change, Effect, Entry, Level, Post, Posted, Quiescence, Revised, View, Watch, rule
from knowledge_sources.priority import Priority
from knowledge_sources.reads import NOT_ENDED, find_camera, open_discrepancy, open_impasse, open_milestone
from world_models.entries import AliasOdds, Goal, Hypothesis, Impasse, Obstruction, Outcome, Place

SURE_PLACE = 0.999
"""Where the place is less probable than this against those that look like it, the end says so."""


class Case(NamedTuple):
    """How the mission ends, and by what."""

    outcome: Outcome
    because: tuple[Entry[Any], ...]


def find_end(view: View, trigger: Change) -> Case:
    """The goal that is reached, else what leaves no way on, else what is left to do."""
    reached, impasse = view.latest(Goal, lambda goal: goal.status == "reached"), open_impasse(view)
    if reached is not None:
        why = f"every milestone on the way to {reached.value.destination} was verified"
        aliases = view.latest(AliasOdds, lambda odds: bool(odds.aliases) and odds.probability < SURE_PLACE)
        if aliases is None:
            return Case(Outcome("reached", why), (reached,))
        return Case(Outcome("reached", f"{why}, but {aliases.value.sentence()}"), (reached, aliases))
    if impasse is not None:
        return Case(Outcome(impasse.value.kind, impasse.value.reason), (impasse,))
    return _find_what_is_left(view, trigger.entry)


@rule(on=(Watch(Goal, (Revised,), lambda goal: goal.status == "reached"),
          Watch(Impasse, (Posted,), lambda impasse: impasse.is_open), Watch(Quiescence, (Posted,))),
      writes=Outcome, needs=(NOT_ENDED,), bind=find_end, level=Level.GOAL, priority=Priority.ENTER)
def mission_monitor(view: View, case: Case) -> Iterable[Effect]:
    """Declares how the mission ends: the goal is reached, somebody sees no way on, or nothing is left to do.

    Where it is not reached, what hides a part of each picture is said too; where it is, how likely the robot is at
    another place that looks the same.
    """
    (outcome, because), hidden = case, view.latest(Obstruction)
    if outcome.kind != "reached" and hidden is not None:
        camera = find_camera(view).pinhole
        said = f"{outcome.reason}; {hidden.value.words(camera.width, camera.height)}"
        outcome, because = replace(outcome, reason=said), (*because, hidden)
    yield Post(outcome, because)


def _find_what_is_left(view: View, still: Entry[Quiescence]) -> Case:
    """How a mission ends in which nothing is left to do."""
    lost = open_discrepancy(view, Level.GOAL)
    if lost is not None:
        perhaps = view.where(Hypothesis, lambda h: h.status == "candidate")
        return Case(Outcome("lost", f"{lost.value.what}, {_describe_places(perhaps)}"), (still, lost, *perhaps))
    waiting, goal = open_milestone(view), view.latest(Goal)
    what = "nobody had anything left to do"
    if waiting is not None:
        what = f"nobody answered for {waiting.id} ({waiting.value.what})"
    return Case(Outcome("failed", what), (still, *(entry for entry in (waiting, goal) if entry is not None)))


def _describe_places(perhaps: Sequence[Entry[Hypothesis]]) -> str:
    """The places where the robot may be, in words."""
    places = []
    for entry in perhaps:
        h = entry.value
        places.append(f"{Place(h.locale, h.locale_from_robot.x_m, h.locale_from_robot.y_m)} ({h.weight:.0%})")
    if len(places) > 1:
        return f"and it is ambiguous where: {' or '.join(places)}"
    return f"and it is not sure where: perhaps {places[0]}" if places else "and nobody could tell where"
