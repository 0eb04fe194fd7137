"""Law of what sights of the floor tell: certainty by plain odds, and what is seen free is forgotten."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Effect, Entry, Level, Post, Posted, Revise
from harvey.testing import answer, check_source
from knowledge_sources.methods.floor import FLOOR_VIEW_DISTANCE_M, MIN_OBSTACLE_CERTAINTY, MIN_THING_CERTAINTY
from knowledge_sources.methods.floor.ranges import MAX_RANGE_THING_M
from knowledge_sources.methods.floor.weigh_sight import (
    CAMOUFLAGED_FREE_ODDS,
    FREE_FLOOR_ODDS,
    LOOKS_FREE_ODDS,
    MAX_OBSTACLE_SIGMA_M,
    MIN_WAY_M,
)
from knowledge_sources.model.thing_mapper import ThingMapper
from knowledge_sources.settings import DEFAULT
from things_in_hall import CARTON, HALL, Hall, carton, known_by_sight
from world_models.entries import CameraPicture, Difference, Discrepancy, Evidence, FreeFloor, Obstacle, ObstacleStatus
from world_models.entries.floor import FloorSense

SOURCE, S = ThingMapper(), DEFAULT.action


def known(status: ObstacleStatus = "there", certainty: float = 0.9) -> Obstacle:
    return Obstacle(f"{HALL}/obstacle-1", HALL, CARTON, 0.03, 4.25, 1.2, 0.5, 0.4, 0.05, certainty, by="camera",
                    status=status)


def ask(hall: Hall, scan: FreeFloor) -> tuple[Entry[FreeFloor], tuple[Effect, ...] | None]:
    """What it makes of things by a sight, which is not carried out."""
    (change,) = hall.apply(Post(scan))
    effects = answer(SOURCE, hall.board.view, Posted(change.entry))
    return change.entry, None if effects is None else on_things(effects)


def on_things(effects: tuple[Effect, ...]) -> tuple[Effect, ...]:
    """Without the evidence, of which each is about one of the things."""
    things = tuple(effect for effect in effects if isinstance(effect.value, Obstacle))
    told = {effect.value.about for effect in effects if isinstance(effect.value, Evidence)}
    assert told <= {effect.value.name for effect in things}
    return things


def hold(hall: Hall, thing: Obstacle, *because: Entry[FreeFloor]) -> Entry[object]:
    """A thing that was seen, as certain as its difference."""
    hall.put(known_by_sight(thing, *((scan.value.x_m, scan.value.y_m) for scan in because)))
    return hall.put(thing, *because)


def probability(*odds: float) -> float:
    return math.prod(odds) / (1.0 + math.prod(odds))


def but_for_dirt(p: float) -> Any:
    """Dirt that came just now has its part, and no more."""
    return pytest.approx(p, abs=0.02)


def odds_of(p: float) -> float:
    return p / (1.0 - p)


@given(st.floats(0.0, 1.0), st.floats(0.01, 0.5), st.sampled_from((None, "suspected", "there", "gone")),
       st.sampled_from((None, Level.ACTION, Level.PLAN, Level.GOAL)))
@settings(max_examples=40, deadline=None)
def test_it_acts_where_a_sight_may_tell_of_a_thing_and_the_place_is_not_in_doubt(
    p_thing: float, sigma_m: float, status: ObstacleStatus | None, doubt: Level | None
) -> None:
    hall = Hall(())
    if status is not None:
        hall.put(known(status))
    if doubt is not None:
        hall.put(Discrepancy(doubt, "landmarks are elsewhere", 99.0, (4.0, 30.0), "px"))
    thing = replace(carton(p_thing), sigma_m=sigma_m)
    _, effects = ask(hall, hall.look(thing, seen_s=1.0))
    is_telling = p_thing >= MIN_THING_CERTAINTY and sigma_m <= MAX_OBSTACLE_SIGMA_M
    assert (effects is not None) == (doubt is None and (is_telling or status in ("suspected", "there")))
    if effects and status is None:
        assert is_telling


@given(st.floats(1.05 * MIN_THING_CERTAINTY, 0.99))
@settings(max_examples=20, deadline=None)
def test_what_was_not_known_is_as_certain_as_its_sight(p_thing: float) -> None:
    hall = Hall(())
    scan, effects = ask(hall, hall.look(carton(p_thing), seen_s=7.0))
    (effect,) = effects or ()
    assert isinstance(effect, Post) and tuple(effect.because) == (scan,)
    found: Obstacle = effect.value
    assert found.certainty == but_for_dirt(p_thing) and found.certainty <= p_thing
    assert found.status == ("there" if found.certainty >= MIN_OBSTACLE_CERTAINTY else "suspected")
    assert (found.name, found.seen_s, found.touched_s) == (f"{HALL}/obstacle-1", 7.0, None)
    assert shapely.hausdorff_distance(shapely.Polygon(found.footprint), shapely.Polygon(CARTON)) < 2e-3


@pytest.mark.parametrize("sense", ["camera", "ranges"])
@pytest.mark.parametrize("has_picture", [False, True])
def test_it_is_told_by_which_picture_or_reading(sense: FloorSense, has_picture: bool) -> None:
    hall = Hall(())
    frame = hall.put(CameraPicture(b"", 0, 7.0, "track"))
    scan = hall.put(replace(hall.look(carton(0.9), seen_s=7.0), sense=sense), *([frame] if has_picture else []))
    (effect,) = on_things(answer(SOURCE, hall.board.view, Posted(scan)) or ())
    told_by = frame.id if sense == "camera" and has_picture else scan.id
    assert isinstance(effect, Post) and effect.value.evidence.startswith(told_by)


@given(st.floats(0.55, 0.95), st.floats(0.55, 0.95), st.sampled_from((0.0, 0.25, 2.0 * FLOOR_VIEW_DISTANCE_M)))
@settings(max_examples=25, deadline=None)
def test_odds_multiply_only_where_it_is_seen_from_elsewhere(before: float, p_thing: float, ahead_m: float) -> None:
    hall = Hall(())
    first = hall.put(hall.look(seen_s=1.0))
    status: ObstacleStatus = "there" if before >= MIN_OBSTACLE_CERTAINTY else "suspected"
    old = hold(hall, known(status, before), first)
    scan, effects = ask(hall, hall.look(carton(p_thing), seen_s=9.0, ahead_m=ahead_m))
    (effect,) = effects or ()
    is_elsewhere = ahead_m >= FLOOR_VIEW_DISTANCE_M / 2.0
    expected = probability(odds_of(before), odds_of(p_thing)) if is_elsewhere else max(before, p_thing)
    of = hall.board.view.latest(Difference)
    assert isinstance(effect, Revise) and effect.entry is old and set(effect.because) == {scan, old, of}
    assert effect.value.certainty == but_for_dirt(min(expected, S.max_obstacle_certainty))
    assert effect.value.status == (
        "there" if old.value.is_there or effect.value.certainty >= MIN_OBSTACLE_CERTAINTY else "suspected")


@given(st.floats(0.3, 0.98), st.sampled_from((0.0, 0.5 * MIN_WAY_M, 1.1 * MIN_WAY_M, 0.3)), st.booleans(),
       st.booleans())
@settings(max_examples=40, deadline=None)
def test_floor_that_is_seen_free_from_elsewhere_lowers_the_odds_by_a_stated_factor(
    before: float, ahead_m: float, is_told: bool, is_camouflaged: bool
) -> None:
    """By less where it only looks free; and what looks like the floor is gone only where it would be told."""
    hall = Hall(())
    first = hall.put(hall.look(seen_s=1.0))
    old = hold(hall, replace(known("suspected", before), seen_s=2.0, is_camouflaged=is_camouflaged), first)
    look = hall.look(seen_s=6.0, ahead_m=ahead_m)
    scan, effects = ask(hall, look if is_told else replace(look, confirmed_m=()))
    assert effects is not None
    if ahead_m < MIN_WAY_M or (is_camouflaged and not is_told):
        assert effects == ()
        return
    (effect,) = effects
    assert isinstance(effect, Revise) and set(effect.because) == {scan, old, hall.board.view.latest(Difference)}
    odds = CAMOUFLAGED_FREE_ODDS if is_camouflaged else FREE_FLOOR_ODDS if is_told else LOOKS_FREE_ODDS
    certainty = probability(odds_of(before), odds)
    assert effect.value.certainty == pytest.approx(certainty, rel=1e-6)
    assert effect.value.status == ("gone" if certainty < S.min_gone_certainty else
                                   "there" if certainty >= MIN_OBSTACLE_CERTAINTY else "suspected")
    assert effect.value.seen_s == 2.0


@given(st.floats(2.45, 2.9), st.floats(0.02, 0.1), st.booleans(), st.floats(0.5, 1.5))
@settings(max_examples=25, deadline=None)
def test_free_floor_tells_as_much_as_it_is_of_where_a_thing_may_stand(
    far_m: float, sigma_m: float, is_heard: bool, from_m: float
) -> None:
    """What was surely there may stand beside its footprint: by its sigma, or anywhere in the cone of an echo."""
    hall = Hall(())
    thing = replace(known(certainty=0.98), sigma_m=sigma_m, seen_from_m=from_m)
    hold(hall, replace(thing, by="ranges") if is_heard else thing)
    _, effects = ask(hall, scan := hall.look(seen_s=9.0, far_m=far_m))
    cone_m = math.tan(math.radians(12.5)) * min(from_m, MAX_RANGE_THING_M)
    where = shapely.Polygon(CARTON).buffer(max(2.0 * sigma_m, cone_m * is_heard))
    seen = shapely.Point(scan.x_m, scan.y_m).buffer(far_m - scan.sigma_m[0], quad_segs=200)
    part = shapely.intersection(where, seen).area / where.area
    odds = odds_of((effects or ())[0].value.certainty) / odds_of(0.98)
    assert odds == pytest.approx(1.0 - part * (1.0 - FREE_FLOOR_ODDS), rel=0.1)


@given(st.floats(0.3, 0.999), st.floats(0.55, 0.95))
@settings(max_examples=10, deadline=None)
def test_what_was_gone_and_is_seen_now_is_another_thing(before: float, p_thing: float) -> None:
    hall = Hall(())
    hold(hall, known("gone", before))
    _, effects = ask(hall, hall.look(carton(p_thing), seen_s=9.0))
    (effect,) = effects or ()
    assert isinstance(effect, Post) and effect.value.certainty == but_for_dirt(p_thing)


@pytest.mark.parametrize(("by_x_m", "by_y_m", "is_same"), [(0.0, 0.45, True), (0.55, 0.45, False), (0.0, 0.6, False)])
def test_what_lies_aslant_beside_a_thing_is_another(by_x_m: float, by_y_m: float, is_same: bool) -> None:
    hall = Hall(())
    hall.put(known())
    beside = tuple((x + by_x_m, y + by_y_m) for x, y in CARTON)
    _, effects = ask(hall, hall.look(replace(carton(), footprint=beside), seen_s=9.0))
    assert isinstance((effects or ())[0], Revise) == is_same


@pytest.mark.parametrize(("part", "count"), [(0.7, 1), (0.3, 2)])
def test_another_part_of_a_thing_in_the_same_sight_is_not_another_thing(part: float, count: int) -> None:
    hall = Hall(())
    aside_m = 0.4 * (1.0 - part)
    _, effects = ask(hall, hall.look(carton(), carton(by_m=aside_m), seen_s=9.0))
    assert len(effects or ()) == count


def test_it_keeps_the_laws_of_all_sources() -> None:
    hall = Hall(())
    check_source(SOURCE, hall.bench, Posted(hall.put(hall.look(carton(0.9), seen_s=9.0))))


@given(st.floats(0.7, 1.0))
@settings(max_examples=5, deadline=None)
def test_dirt_explains_what_was_seen_at_its_pixels_before_and_nothing_beside_them(by_m: float) -> None:
    hall, at = Hall(), carton(0.7)
    there = carton(0.7, by_m=-by_m)  # beside it, at other pixels
    hall.see(at, there, seen_s=1.0)
    ahead = tuple((x + 0.7, y) for x, y in at.footprint)
    hall.see(replace(at, footprint=ahead), there, seen_s=2.0, ahead_m=0.7)
    assert [thing.status == "gone" for thing in hall.obstacles] == [True, False, True]
    assert "dirt on the lens" in hall.obstacles[0].evidence
