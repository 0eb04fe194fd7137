"""Answers of fifteen lines at most: how a run ended and what decided it, what the robot believed, how sure it was, and
how much room there is beside a thing.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from logs.explain import phrases
from logs.explain.model import WorldFile
from logs.explain.phrases import Sentence, Story, capital, headline, plainly, said, sentence
from logs.explain.true_errors import read_errors
from logs.explain.turning_points import read_turning_points
from logs.records import EntryRecord
from logs.run_directory import RunDirectory
from logs.run_errors import BadInput
from logs.timeline import Timeline
from world_models.entries import (
    BodyFault,
    Certificate,
    Difference,
    Discrepancy,
    DoorState,
    Footprint,
    Goal,
    Hypothesis,
    Impasse,
    Obstacle,
    Outcome,
    PlanSketch,
)
from world_models.words import count, listed, metres

if TYPE_CHECKING:
    from world_models.building.world import World

MOST_DECIDING = 2
"""So many things or doors are named that decided."""
Record = EntryRecord[Any]


def tell_end(run: RunDirectory, history: Timeline) -> Story:
    """How it ended: what for, the outcome, what decided, the last belief, and how often what went wrong on the way.

    Raises BadInput where the run has no outcome yet.
    """
    outcome = history.last(Outcome)
    if outcome is None:
        raise BadInput(f"{run.path}: expected a run with an outcome, got one that was cut off or goes on")
    steps = [*_tell_aim(history), *_tell_deciding(run, history, outcome)]
    off_m, held = run.read_result().get("belief_off_m"), history.held()
    if held is not None:
        off = "" if off_m is None else f" As only the simulator knows, that was {metres(off_m)} off."
        steps.append(said(f"{phrases.believed(held.value)}{off}", held, label="believed"))
    went = Counter(point.kind for point in read_turning_points(history, main=True))
    if went:
        times = listed([f"{kind} ({number})" for kind, number in went.items()], len(went))
        steps.append(Sentence(f"On the way, as harvey story {run.path} tells: {times}.", label="before"))
    return Story(headline(outcome), tuple(steps), outcome.ref)


def _tell_aim(history: Timeline, at: int | None = None) -> Iterator[Sentence]:
    """The goal, and the step of the plan that was carried out for it."""
    goal = _last(history, Goal, at)
    plans = [one for one in history.of_kind(PlanSketch, until=at) if not one.is_gone and not one.field("is_look")]
    plan = next((one for one in reversed(plans) if one.field("status") == "active"), plans[-1] if plans else None)
    if goal is not None and plan is not None and goal.value.is_active and plan.value.current is not None:
        sketch = plan.value
        step = f"; part {sketch.at + 1} of {len(sketch.subgoals)} of its plan, to {phrases.steps([sketch.current])}"
        way = f"From {phrases.place(goal.value.origin)} to {phrases.place(goal.value.destination)}"
        yield said(f"{way}{step}.", goal, plan, label="goal")
    elif goal is not None:
        yield said(phrases.goal(goal.value), goal, label="goal")


def _tell_deciding(run: RunDirectory, history: Timeline, outcome: Record) -> Iterator[Sentence]:
    """The doors, things, faults or doubts for which it ended, with their evidence; of a reached goal its check."""
    doors = [one for one in _newest(history, DoorState)
             if not one.value.is_passable and one.value.door in outcome.value.reason]
    impasse = history.nearest(outcome, Impasse)
    things = [] if impasse is None else [
        one for id in impasse.value.behind if (one := history.entry(history.newest.get(id, id))) is not None]
    others = [found for kind in (Discrepancy, BodyFault, Difference)
              if (found := history.nearest(outcome, kind)) is not None and not (doors or things)]
    for door in doors[:MOST_DECIDING]:
        yield said(plainly(door), door, label="decided")
    for thing in things[:MOST_DECIDING]:
        gap = tell_gap(run, history, thing)
        sure = f"{thing.value.certainty:.1%} sure" + (f", by {one}" if (one := thing.value.evidence) else "")
        yield said(f"{capital(thing.value.words())} ({thing.value.name}): {sure}.{gap}", thing, label="decided")
    if left := len(doors[MOST_DECIDING:]) + len(things[MOST_DECIDING:]):
        yield Sentence(f"{count(left, 'more door or thing', 'more doors and things')} did so.", label="decided")
    if outcome.value.kind != "reached":
        yield from (said(phrases.phrase(history, one), one, label="decided") for one in others[:MOST_DECIDING])
    if not (doors or things) and (verdict := history.nearest(outcome, Certificate)) is not None:
        yield said(phrases.phrase(history, verdict), verdict, label="checked")


def tell_thoughts(run: RunDirectory | None, history: Timeline, at: int | None) -> Iterator[Story]:
    """Where it believed to stand, what it doubted, what it knew otherwise than its model, and what it was to do."""
    held = history.held(at)
    when = "At the end" if at is None else f"In cycle {at}"
    head = f"{when} it had no belief." if held is None else f"{when}: {phrases.believed(held.value)}"
    steps = [*_tell_doubts(history, at)]
    perhaps = [one for one in _newest(history, Hypothesis, at) if one.field("status") == "candidate"]
    if perhaps:
        places = phrases.perhaps(one.value for one in perhaps)
        steps.append(said(f"It may have stood at {places}.", *perhaps[:MOST_DECIDING], label="thought"))
    found = [one for one in _newest(history, DoorState, at) if one.value.log_odds > 0.0]
    found += [one for one in _newest(history, Obstacle, at) if one.value.status != "gone"]
    if found:
        texts = [sentence(one).partition(";")[0] for one in found]
        steps.append(said(f"{capital(listed(texts, phrases.MAX_LISTED))}.", *found[:phrases.MAX_LISTED], label="known"))
    yield Story(head, (*steps, *_tell_aim(history, at)), "" if held is None else held.ref)


def _tell_doubts(history: Timeline, at: int | None) -> Iterator[Sentence]:
    doubts = [one for one in _newest(history, Discrepancy, at) if one.value.is_open]
    yield from (said(phrases.doubt(one.value), one, label="doubted") for one in doubts[-MOST_DECIDING:])


def tell_sureness(run: RunDirectory | None, history: Timeline, at: int | None) -> Iterator[Story]:
    """How far off it may have been by its own reckoning, by which verdict; and how far off it was, if that is known."""
    held = history.held(at)
    if held is None:
        yield Story("It had no belief.")
        return
    steps, verdict = [*_tell_doubts(history, at)], _last(history, Certificate, at)
    if verdict is not None:
        steps.append(said(phrases.phrase(history, verdict), verdict, label="checked"))
    try:
        errors = [] if run is None else read_errors(run, history, held.cycle if at is None else at)
    except BadInput:
        errors = []
    steps += [Sentence(f"As only the simulator knows, it stood {one.words()}.", label="truth") for one in errors[-1:]]
    when = "At the end" if at is None else f"In cycle {at}"
    yield Story(f"{when}: {phrases.believed(held.value)}", tuple(steps), held.ref)


def tell_round(run: RunDirectory | None, history: Timeline, at: int | None) -> Iterator[Story]:
    """Of each thing that is in the way, how much room there is beside it, and how much the robot needs."""
    there = [one for one in _newest(history, Obstacle, at) if one.value.status != "gone"]
    for thing in there[-phrases.MAX_LISTED:]:
        gap = "" if run is None else tell_gap(run, history, thing)
        room = gap or " How much room there is beside it nobody knows."
        yield Story(f"{capital(thing.value.words())} ({thing.value.name}).{room}", (), thing.ref)
    if not there:
        yield Story("Nothing that the model lacks was in the way.")


def tell_gap(run: RunDirectory, history: Timeline, thing: Record) -> str:
    """How much floor is free beside a thing, across the way to it, and how much the robot needs; "" where the world
    cannot be asked, or the robot believed to be elsewhere."""
    from knowledge_sources.methods.motion.subgoals import CLEARANCES_M  # here: other answers need none of the methods

    world, held, body = WorldFile(run).world, history.held(thing.cycle), _last(history, Footprint)
    if world is None or held is None or body is None or held.value.locale != thing.value.locale:
        return ""
    others = [one.value.footprint for one in _newest(history, Obstacle)
              if one.value.is_there and one.value.locale == thing.value.locale and one.id != thing.id]
    here = held.value.world_from_robot(world).position
    gaps_m = measure_gaps(world, thing.value, others, np.asarray(here))
    left, right = (metres(gap_m) if gap_m > 0.0 else "" for gap_m in gaps_m)
    room = f"{left + ' free' if left else 'No room'} on its left, {right or 'none'} on its right"
    return f" {room}; the robot needs {metres(2.0 * (body.value.radius_m + CLEARANCES_M[-1]))}."


def measure_gaps(
    world: World, thing: Obstacle, others: Sequence[Sequence[tuple[float, float]]], here: np.ndarray
) -> tuple[float, float]:
    """The free floor left and right of a thing [m], as seen from a place (2,) [world], between it and what is next.

    Measured across the way, over all of the thing's depth: what stands anywhere beside it counts.
    """
    import shapely

    footprint = np.asarray(thing.footprint, float)
    ahead = footprint.mean(axis=0) - here
    ahead /= max(float(np.linalg.norm(ahead)), 1e-9)
    turned = np.array([ahead, (-ahead[1], ahead[0])])  # along the way, and to its left

    def polygon(corners: Any) -> Any:
        return shapely.convex_hull(shapely.multipoints(np.asarray(corners, float) @ turned.T))

    near, low, far, high = polygon(footprint).bounds
    room = shapely.Polygon(np.asarray(world.outline(thing.locale), float) @ turned.T)
    strip = shapely.intersection(room, shapely.box(near, room.bounds[1], far, room.bounds[3]))
    solid = [polygon(corners) for corners in (*world.obstacles(thing.locale), *others)]
    ranges = [found.bounds for one in solid if not (found := shapely.intersection(one, strip)).is_empty]
    _, wall_right, _, wall_left = strip.bounds
    left = min([bottom for _, bottom, _, top in ranges if top > high], default=wall_left)
    right = max([top for _, bottom, _, top in ranges if bottom < low], default=wall_right)
    return max(0.0, left - high), max(0.0, low - right)


def _newest(history: Timeline, kind: type[Any], at: int | None = None) -> list[Record]:
    """The newest revision of each entry of a kind that was on the board then, or at the end."""
    found = {one.id: one for one in history.of_kind(kind, until=at)}
    gone = (history.retraction(one.ref) for one in found.values())
    return [one for one, end in zip(found.values(), gone, strict=True)
            if end is None or (at is not None and end.cycle > at)]


def _last(history: Timeline, kind: type[Any], at: int | None = None) -> Record | None:
    return next(reversed([one for one in history.of_kind(kind, until=at) if not one.is_gone]), None)
