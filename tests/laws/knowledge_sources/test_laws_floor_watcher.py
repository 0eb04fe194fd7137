"""Laws of the floor watcher: which pictures it looks at, with what it compares them, and what it keeps.

What a picture shows is the method's (``tests/laws/floor/``); here it answers what a law says, and notes what is asked.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Effect, Entry, Post
from generated_boards import Bench, made, reasons, to_world
from harvey.testing import HALL, check_source, plain_robot
from knowledge_sources.methods.floor import FLOOR_VIEW_DISTANCE_M, FLOOR_VIEW_TURN_RAD
from knowledge_sources.model import floor_watcher
from knowledge_sources.model.floor_watcher import (
    FLOOR_STEP_M,
    MAX_FLOOR_SIGMA_M,
    MAX_FLOOR_SIGMA_RAD,
    MAX_LIGHT_AGE_S,
    FloorWatcher,
)
from knowledge_sources.reads import HELD, find_motion_between
from world_models.entries import (
    CameraPicture,
    Course,
    Drift,
    FloorView,
    FreeFloor,
    Hypothesis,
    Light,
    MotionReport,
    diagonal,
)
from world_models.frames import Pose2

HERE = Pose2(3.0, 2.0, 0.4)
NOW_S, SMALL = 30.0, 1e-6
FORWARD_M = 0.12


def floor(seen_s: float = NOW_S, light: Light | None = None, at: Pose2 = HERE, sense: str = "camera") -> FreeFloor:
    eye = to_world(at @ Pose2(FORWARD_M, 0.0, 0.0))
    return FreeFloor(sense, HALL, eye.x_m, eye.y_m, (0.0,), (0.0,), (1.0,), ("sight",), (0.1,), (), seen_s,  # type: ignore[arg-type]
                     light)


@dataclass
class Eye:
    """In place of the method: what it was asked."""

    asked: list[tuple[Any, ...]] = field(default_factory=list)

    def __call__(self, *asked: Any) -> FreeFloor:
        self.asked.append(asked)
        return floor()


@pytest.fixture
def eye(monkeypatch: pytest.MonkeyPatch) -> Eye:
    found = Eye()
    monkeypatch.setattr(floor_watcher, "see_free_floor", found)
    return found


class Room:
    """A board with the robot at a place in the hall, and a picture from there."""

    def __init__(self, pose: Pose2 = HERE, sigma_m: float = 0.01, sigma_rad: float = 0.001) -> None:
        self.bench = Bench(plain_robot())
        self.belief: Entry[Hypothesis] = self.bench.believe(pose, diagonal(sigma_m, sigma_rad))
        self.frame: Entry[CameraPicture] | None = None

    def view(
        self, way_m: float, floor_m: float = 0.0, belief: str | None = None, aside_rad: float = 0.0
    ) -> Entry[FloorView]:
        """A picture that is kept, from so far aside, looking so far aside."""
        pose = to_world(Pose2(HERE.x_m, HERE.y_m + way_m, 0.0))
        frame = self.bench.put(CameraPicture(f"{way_m}".encode(), 0, 1.0, "track"))
        return self.bench.put(FloorView(
            frame.id, belief or self.belief.id, pose.x_m, pose.y_m, to_world(HERE).heading_rad + aside_rad, floor_m,
            1.0, 0.01, 0.002))

    def look(self) -> tuple[Effect, ...] | None:
        self.frame = self.bench.put(CameraPicture(b"now", 1, NOW_S, "track"))
        return self.bench.ask(FloorWatcher(), self.frame)

    def roll(self) -> None:
        course = self.bench.put(Course("Leg-1", 0.3, 0.0))
        self.bench.put(MotionReport(0.0, 0.1, 1.0, 1.0), course)
        self.belief = self.bench.revise(self.belief, motion="MotionReport-1")


@pytest.mark.parametrize("more", [-SMALL, SMALL])
def test_it_looks_while_place_and_heading_are_known(eye: Eye, more: float) -> None:
    for m, rad in ((MAX_FLOOR_SIGMA_M + more, 0.001), (0.01, MAX_FLOOR_SIGMA_RAD + more)):
        assert (Room(sigma_m=m, sigma_rad=rad).look() is not None) == (more < 0.0)


def test_a_picture_is_looked_at_once(eye: Eye) -> None:
    room = Room()
    effects = room.look()
    assert effects is not None and room.frame is not None
    room.bench.apply(*effects)
    assert room.bench.ask(FloorWatcher(), room.belief) is None
    assert room.look() is not None


@pytest.mark.parametrize("rolls", [False, True])
@pytest.mark.parametrize("sense", ["camera", "ranges"])
def test_on_the_move_it_looks_again_after_some_way(eye: Eye, rolls: bool, sense: str) -> None:
    for way_m in (FLOOR_STEP_M - SMALL, FLOOR_STEP_M + SMALL, -FLOOR_STEP_M + SMALL):
        room = Room()
        if rolls:
            room.roll()
        room.bench.put(floor(at=HERE @ Pose2(-way_m, 0.0, 0.0), sense=sense))
        is_near = rolls and sense == "camera" and abs(way_m) < FLOOR_STEP_M
        assert (room.look() is None) == is_near


@settings(max_examples=40)
@given(st.lists(st.tuples(
    st.sampled_from((0.0, 0.1, FLOOR_VIEW_DISTANCE_M - SMALL, FLOOR_VIEW_DISTANCE_M + SMALL, 0.9)),
    st.sampled_from((0.0, 0.0, 3.0)), st.sampled_from((None, None, "Hypothesis-9"))), max_size=5))
def test_it_compares_with_the_pictures_kept_from_far_enough_by_this_belief_on_this_floor(
    drawn: list[tuple[float, float, str | None]]
) -> None:
    with pytest.MonkeyPatch.context() as patch:
        eye = Eye()
        patch.setattr(floor_watcher, "see_free_floor", eye)
        room = Room()
        put = [room.view(*one) for one in drawn]
        effects = room.look()
    assert effects is not None and room.frame is not None
    kept = [e for e, (_, floor_m, belief) in zip(put, drawn, strict=True) if floor_m == 0.0 and belief is None]
    far = [e for e in reversed(kept) if abs(float(room.bench.view[e.value.frame].value.jpeg)) > FLOOR_VIEW_DISTANCE_M]
    ((robot, locale, pose, _, jpeg, earlier, seen_s, _, light),) = eye.asked
    assert (locale, jpeg, seen_s, light) == (HALL, b"now", NOW_S, None)
    assert math.dist(pose.position, to_world(HERE).position) < 1e-9 and robot.world.floor_m(HALL) == 0.0
    assert [seen.jpeg for seen in earlier] == [room.bench.view[e.value.frame].value.jpeg for e in far]
    held = HELD.of(room.bench.view)
    assert [(seen.pose, seen.since) for seen in earlier] == [
        (Pose2(e.value.x_m, e.value.y_m, e.value.heading_rad), find_motion_between(room.bench.view, e.value, held)[0])
        for e in far]
    (seen,) = [e for e in effects if isinstance(e.value, FreeFloor)]
    assert isinstance(seen, Post) and seen.value == floor()
    assert reasons(seen) == {room.frame.id, room.belief.id, *(e.id for e in kept)}
    is_kept = not kept or abs(float(room.bench.view[kept[-1].value.frame].value.jpeg)) > FLOOR_VIEW_DISTANCE_M
    here = to_world(HERE)
    assert made(effects, FloorView) == [FloorView(
        room.frame.id, room.belief.id, here.x_m, here.y_m, here.heading_rad, 0.0, NOW_S, room.belief.value.sigma_m,
        room.belief.value.sigma_rad, room.belief.value.motion)] * is_kept
    assert all(reasons(e) == {room.frame.id, room.belief.id} for e in effects if isinstance(e.value, FloorView))


@pytest.mark.parametrize("aside_rad", [0.0, FLOOR_VIEW_TURN_RAD - SMALL, FLOOR_VIEW_TURN_RAD + SMALL])
def test_it_keeps_a_picture_after_a_turn_on_the_spot(eye: Eye, aside_rad: float) -> None:
    for side in (-1.0, 1.0):
        room = Room()
        room.view(0.0, aside_rad=side * aside_rad)
        assert bool(made(room.look(), FloorView)) == (aside_rad > FLOOR_VIEW_TURN_RAD)


def test_it_names_the_reports_of_the_wheels_and_their_drift(eye: Eye) -> None:
    room = Room()
    _, before = room.bench.move(0.0, 0.1)
    kept = room.view(0.9)
    room.bench.revise(kept, motion=before.id)
    drift = room.bench.put(Drift(0.0, 0.01, 0.0))
    reports = [room.bench.move(0.0, 0.3)[1] for _ in range(3)]
    room.belief = room.bench.revise(room.belief, motion=reports[-1].id)
    (seen,) = [e for e in room.look() or () if isinstance(e.value, FreeFloor)]
    assert {drift.id, *(report.id for report in reports)} <= reasons(seen) and before.id not in reasons(seen)


@pytest.mark.parametrize("more_s", [-SMALL, SMALL])
def test_the_light_of_a_picture_tells_that_of_those_shortly_after(eye: Eye, more_s: float) -> None:
    room, light = Room(), (0.1, 0.0, 0.0)
    told = room.bench.put(floor(NOW_S - MAX_LIGHT_AGE_S - more_s, light))
    dark = room.bench.put(floor(NOW_S - 1.0))
    effects = room.look() or ()
    is_told = more_s < 0.0
    assert eye.asked[0][8] == (light if is_told else None)
    assert (told.id in reasons(effects[0])) == is_told and dark.id not in reasons(effects[0])


def test_it_keeps_the_laws_of_all_sources(eye: Eye) -> None:
    room = Room()
    room.view(0.9)
    check_source(FloorWatcher, room.bench, room.bench.put(CameraPicture(b"now", 1, NOW_S, "track")))
