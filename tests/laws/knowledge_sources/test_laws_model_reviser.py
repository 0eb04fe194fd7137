"""Law of the model reviser: after any run of findings and tellings the frames say what the newest of each says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from blackboard import Post, Posted, Revise
from harvey.testing import answer, check_source
from knowledge_sources.methods.belief import weigh_rivals
from knowledge_sources.model.model_reviser import ModelReviser
from knowledge_sources.reads import find_building, list_filed_doors, name_model
from knowledge_sources.settings import DEFAULT
from things_in_hall import CARTON, HALL, Hall
from world_models.building.locale_frame import FRAME_OF, FrameChange, LocaleFrame
from world_models.building.model_errors import INEXACT_M, find_sigma_m, list_facing
from world_models.entries import (
    RISK,
    Difference,
    DoorPicture,
    DoorState,
    Evidence,
    Explanation,
    Obstacle,
    Rival,
    UserReport,
)
from world_models.entries.difference import DOORS, MODEL, SURE

SOURCE = ModelReviser()
DOOR, ROOMS = "archive-north-door", ("archive", HALL)
THING = f"{HALL}/obstacle-1"
LEAST_M = DEFAULT.action.min_footprint_change_m
found = st.tuples(st.just("found"), st.sampled_from(("suspected", "there", "gone")), st.sampled_from((0.0, 0.3, 3.0)))
seen = st.tuples(st.just("seen"), st.sampled_from(("open", "shut", "unknown")), st.just(0.0))
told = st.tuples(st.just("told"), st.sampled_from(("open", "shut", "gone")), st.just(0.0))
"""What is found of a thing and by how many times the least change it stands elsewhere; seen of a door; or told."""


def corners(by_m: float) -> tuple[tuple[float, float], ...]:
    return tuple((round(x + by_m, 3), y) for x, y in CARTON)


def make(what: str, state: Any, times: float) -> Obstacle | DoorState | UserReport:
    if what == "found":
        return Obstacle(THING, HALL, corners(times * LEAST_M), 0.03, 0.0, 0.0, 0.5, 0.4, 0.1, by="camera", seen_s=9.0,
                        status=state)
    if what == "seen":
        picture = DoorPicture("CameraPicture-1", (0.0, 0.0, 9.0, 9.0), 0.0, 0.0, 0.0, 3.0, "a leaf")
        return DoorState(DOOR, ROOMS, state, 0.99, 4.0, 2, picture, 5.0)
    return UserReport(DOOR if state != "gone" else THING, state)


def changes(hall: Hall, room: str) -> tuple[FrameChange, ...]:
    entry = hall.board.view.newest(FRAME_OF, room)
    assert entry is not None
    return entry.value.changes


def tell(hall: Hall, value: Any) -> Any:
    """Something is found, seen or told: revised, where it is known already."""
    known = None if isinstance(value, UserReport) else hall.board.view.latest(type(value))
    (change,) = hall.apply(Post(value) if known is None else Revise(known, value, (known,)))
    return change


@given(st.lists(found | seen | told, max_size=6))
@settings(max_examples=40, deadline=None)
def test_the_frames_say_what_the_newest_says(drawn: Sequence[tuple[str, Any, float]]) -> None:
    hall, shut, thing, taken_up = Hall((SOURCE,)), False, None, dict[str, str]()
    for what, state, times in drawn:
        change = tell(hall, make(what, state, times))
        answered = hall.board.view[change.entry.id].value
        before = shut, thing
        if what == "found":
            at_m = times * LEAST_M
            is_elsewhere = thing is None or abs(at_m - thing) >= LEAST_M
            thing = None if state != "there" else at_m if is_elsewhere else thing
        elif state in ("open", "shut"):
            shut = state == "shut"
        elif what == "told":
            assert isinstance(answered, UserReport)
            if thing is None:  # the file has no such thing, and it is not believed to be there
                assert answered.answer.startswith("which cannot be")
            thing = None
        if what == "told" and not answered.answer.startswith("which cannot be"):
            is_news = (shut, thing) != before
            assert answered.answer == ("and believes it from now on" if is_news else "which it knew already")
            taken_up[answered.what] = change.entry.id
        is_so = {DOOR: {"open": not shut, "shut": shut}, THING: {"gone": thing is None}}
        for entry_id in taken_up.values():
            report = hall.board.view[entry_id].value
            event(report.answer)
            assert report.answer == "but has found otherwise since" or is_so[report.what][report.state]
        expected = {("shut", DOOR)} if shut else set()
        assert {(c.what, c.name) for c in changes(hall, "archive")} == expected
        ours = {(c.what, c.name): c for c in changes(hall, HALL)}
        assert set(ours) == expected | ({("extra", THING)} if thing is not None else set())
        if thing is not None:
            extra = ours["extra", THING]
            assert extra.footprint == corners(thing) and extra.height_m == pytest.approx(0.5)


@pytest.mark.parametrize(("by_m", "height_m", "is_touched", "is_revised"), [
    (0.0, 0.4, False, False), (0.5 * LEAST_M, 0.4, False, False), (1.5 * LEAST_M, 0.4, False, True),
    (0.0, 0.5, False, False), (0.0, 0.6, False, True), (0.5 * LEAST_M, 0.4, True, True)])
def test_a_frame_is_revised_where_a_plan_may_change_by_it(
    by_m: float, height_m: float, is_touched: bool, is_revised: bool
) -> None:
    hall = Hall((SOURCE,))
    first = make("found", "there", 0.0)
    assert isinstance(first, Obstacle)
    tell(hall, first)
    before = hall.frame
    touched_s = first.seen_s if is_touched else None
    tell(hall, replace(first, footprint=corners(by_m), height_m=height_m, touched_s=touched_s))
    assert (hall.frame is not before) == is_revised and len(hall.frame.changes) == 1


@pytest.mark.parametrize(("what", "state", "rooms"), [
    ("found", "there", (HALL,)), ("seen", "shut", ROOMS), ("told", "shut", ROOMS)])
def test_each_frame_that_it_concerns_names_what_says_so_and_who(what: str, state: str, rooms: tuple[str, ...]) -> None:
    hall = Hall((SOURCE,))
    before = {entry.value.name: entry for entry in hall.board.view.all(LocaleFrame)}
    said = hall.put(make(what, state, 0.0))
    after = {entry.value.name: entry for entry in hall.board.view.all(LocaleFrame)}
    assert {room for room, entry in after.items() if entry.revision} == set(rooms)
    for room in rooms:
        assert after[room].because == (said.ref, before[room].ref)
        assert [change.by for change in after[room].value.changes] == ["test"]


def test_all_that_is_new_of_a_room_comes_into_its_frame_at_once() -> None:
    hall = Hall(())
    first = hall.put(make("found", "there", 0.0))
    moved = tuple((x + 1.5, y) for x, y in CARTON)
    second = hall.put(Obstacle(f"{HALL}/obstacle-2", HALL, moved, 0.03, 0.0, 0.0, 0.5, by="camera", seen_s=9.0))
    effects = answer(SOURCE, hall.board.view, Posted(first)) or ()
    (effect,) = effects
    assert {change.name for change in effect.value.changes} == {first.value.name, second.value.name}
    assert {entry.id for entry in effect.because} >= {first.id, second.id}
    hall.apply(*effects)
    assert answer(SOURCE, hall.board.view, Posted(second)) is None  # it is said already


@given(st.lists(st.tuples(st.sampled_from(("wall", "chance", "mounting")), st.floats(0.0, 4.6)), max_size=6))
@settings(max_examples=20, deadline=None)
def test_a_model_that_is_surely_inexact_is_so_in_every_room_until_acquitted(drawn: Sequence[tuple[Any, float]]) -> None:
    hall, is_inexact, evidence = Hall((SOURCE,)), False, list[Evidence]()
    for number, (kind, log_ratio) in enumerate(drawn):
        told = Explanation("chance", "", 0.0), Explanation(kind, "", log_ratio)
        evidence.append(Evidence(MODEL, "", told[kind == "chance":], 2.0 * number, 0.0, 0.0, 1.0, 0.3, float(number)))
        difference = weigh_rivals(MODEL, evidence)
        tell(hall, difference)
        leader, wall = difference.leader, difference.find("wall")
        is_inexact = (leader.kind != "chance" or bool(wall and wall.p > RISK)) if is_inexact else (
            leader.kind == "wall" and leader.p >= SURE)
        world = find_building(hall.board.view)
        assert [c.what for c in changes(hall, world.root)] == ["inexact"] * is_inexact
        assert {find_sigma_m(world, room) for room in ("archive", HALL)} == {INEXACT_M if is_inexact else 0.0}


@pytest.mark.parametrize("order", [1, -1])
def test_walls_that_are_farther_apart_explain_a_model_that_seems_inexact(order: int) -> None:
    hall = Hall((SOURCE,))
    world = find_building(hall.board.view)
    about, sides = next(iter(list_facing(world, HALL).items()))
    for name, off_m, sigma_m in ((about, 0.1, 0.01), (MODEL, 0.0, 0.05))[::order]:
        hall.put(Difference(name, (Rival("wall", "", 5.0, 0.99, off_m, sigma_m),), (), 1.0))
    drawn = {change.name: change for change in changes(hall, HALL)}
    assert set(drawn) == {side.mode for side in sides}
    assert bool(changes(hall, world.root)) == (order == -1)  # what was found before stays until looks acquit it
    hall.put(Difference(name_model(hall.board.view), tuple(
        Rival(kind, "", 1.0, p) for kind, p in (("chance", 0.9999), ("wall", RISK))), (), 2.0))  # type: ignore[arg-type]
    assert not changes(hall, world.root)
    assert sum(side.outward[:2] @ drawn[side.mode].by_m for side in sides) == pytest.approx(0.1, abs=0.003)
    for side in sides:
        assert all(drawn[side.mode] in changes(hall, room) for room in side.rooms)
        assert find_sigma_m(find_building(hall.board.view), HALL, side.mode) == pytest.approx(INEXACT_M, abs=1e-3)
    assert name_model(hall.board.view) == f"{MODEL} with 2 walls redrawn"  # of which nothing is known yet


@pytest.mark.parametrize("is_own", [False, True])
@pytest.mark.parametrize("order", [1, -1])
def test_one_sure_look_redraws_a_door_only_where_others_stand_beside(order: int, is_own: bool) -> None:
    hall, told = Hall((SOURCE,)), (Explanation("chance", "", 0.0), Explanation("jamb", "", 3.5, 0.1, 0.015))
    own = (door := list_filed_doors(hall.board.view)[DOOR]).pose_from(door.between[0])
    places = ((own.x_m, own.y_m),) * 2 if is_own else ((4.0, 0.0), (8.0, 0.0))
    looks = [Evidence(name, "", told, *at, 0.0, 0.3, 0.2, 1.0)
             for name, at in ((DOOR, (0.0, 0.0)), *((DOORS, place) for place in places))]
    first, last = (weigh_rivals(said[0].about, said) for said in (looks[:1], looks[1:])[::order])
    one = hall.put(first)
    assert not changes(hall, HALL) and not changes(hall, "archive")
    both = {one.id, hall.put(last).id}
    if is_own:  # what a door says of the doors says nothing more of itself
        assert not changes(hall, HALL)
        return
    for room in ROOMS:
        (drawn,), entry = changes(hall, room), hall.board.view.latest(LocaleFrame, lambda f, room=room: f.name == room)
        assert (drawn.what, drawn.name, drawn.sigma_m) == ("beside", DOOR, 0.015)
        assert entry is not None and {ref.id for ref in entry.because} >= both


def test_what_the_model_has_not_is_answered_and_revises_nothing() -> None:
    hall = Hall((SOURCE,))
    for what in ("no-such-door", f"{HALL}/obstacle-9"):
        change = tell(hall, UserReport(what, "shut"))
        assert hall.board.view[change.entry.id].value.answer.startswith("which cannot be")
    assert changes(hall, HALL) == ()


def test_it_keeps_the_laws_of_all_sources() -> None:
    for what in (("found", "there", 0.0), ("seen", "shut", 0.0)):
        hall = Hall(())
        check_source(SOURCE, hall.bench, Posted(hall.put(make(*what))))
