"""Laws of the door toucher: a touch in the opening of a door that may be shut counts beside its pictures, once."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule

from blackboard import Entry
from generated_boards import LENGTH_M, WIDTH_M, Bench, effect_on, reasons
from harvey.testing import HALL, STUDY, check_source, plain_robot
from knowledge_sources.methods.doors import MAX_LOG_ODDS, PRIOR_LOG_ODDS, SHUT_LOG_ODDS, touch_door, update_door
from knowledge_sources.methods.doors.belief import (
    MAX_TOUCH_M,
    MIN_LOG_RATIO,
    MIN_PICTURES,
    OPEN_LOG_ODDS,
    TOUCH_LOG_RATIO,
)
from knowledge_sources.model.door_toucher import door_toucher
from world_models.entries import Contact, DoorPicture, DoorState, Outcome, diagonal
from world_models.frames import Pose2

SOURCE, SMALL = door_toucher, 1e-3
AHEAD = Contact("bumper", 0.0, 0.15, 34.3)
WALL_M = 0.2
"""Between hall and study, whose door is 1 m wide."""


def may_be_shut(ratio: float = 4.5, more: float = 2.5) -> DoorState:
    """By two pictures, from two places."""
    known: DoorState | None = None
    for x_m, said in ((0.0, ratio), (1.0, more)):
        picture = DoorPicture("CameraPicture-1", (0.0, 0.0, 9.0, 9.0), x_m, 0.0, 0.0, said, "a leaf")
        known = update_door(known, "study-door", (HALL, STUDY), picture, 1.0, is_believed_shut=False)
    assert known is not None and known.may_be_shut
    return known


def touch(
    rim: tuple[float, float], *, contact: Contact = AHEAD, sigma_m: float = 0.005, door: DoorState | None = None,
    then_moved: bool = False, **fields: Any
) -> tuple[Bench, Entry[DoorState], Any]:
    """The robot faces the study's door, and touches with its rim at a place of the hall; what is done then."""
    bench, robot = Bench(plain_robot()), plain_robot()
    known = bench.put(door or may_be_shut())
    command, report = bench.move(0.0, 0.4)
    bench.put(contact, command)
    if then_moved:
        _, report = bench.move(0.1, 0.0)
    belief = bench.believe(Pose2(rim[0] - robot.radius_m, rim[1], 0.0), diagonal(sigma_m, 0.002), motion=report.id)
    if fields:
        bench.put(fields["ended"])
    return bench, known, bench.ask(SOURCE, bench.revise(belief))


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize(("off_m", "is_in"), [(0.0, True), (0.3, True), (0.42, False), (0.8, False)])
def test_a_touch_between_the_jambs_is_the_leaf_s(off_m: float, is_in: bool, side: float) -> None:
    """To either side; near a jamb it may be the jamb."""
    bench, known, effects = touch((LENGTH_M + 0.05, 0.5 * WIDTH_M + side * off_m))
    assert (effects is not None) is is_in
    if is_in:
        effect = effect_on(effects, DoorState)
        assert effect.entry is known and reasons(effect) == {known.id, "Contact-1", "Hypothesis-1"}
        assert effect.value == touch_door(known.value, AHEAD.when_s) and effect.value.state == "shut"
        assert "touched" in effect.value.sentence() and bench.view[known.id] is known


@pytest.mark.parametrize(("deep_m", "is_in"), [
    (-MAX_TOUCH_M - SMALL, False), (-MAX_TOUCH_M + SMALL, True), (WALL_M + MAX_TOUCH_M - SMALL, True),
    (WALL_M + MAX_TOUCH_M + SMALL, False)])
def test_a_leaf_hangs_within_the_wall(deep_m: float, is_in: bool) -> None:
    _, _, effects = touch((LENGTH_M + deep_m, 0.5 * WIDTH_M))
    assert (effects is not None) is is_in


@pytest.mark.parametrize(("otherwise", "counts"), [
    ({}, True), ({"contact": Contact.of_stall(34.3)}, False), ({"sigma_m": 0.2}, False), ({"then_moved": True}, False),
    ({"door": touch_door(may_be_shut(), 1.0)}, False), ({"ended": Outcome("failed", "")}, False)])
def test_what_is_not_sure_or_was_counted_says_nothing(otherwise: dict[str, Any], counts: bool) -> None:
    """A touch that knows no direction or place, an older one, a second one of the same door; nor after the end."""
    _, _, effects = touch((LENGTH_M, 0.5 * WIDTH_M), **otherwise)
    assert (effects is not None) is counts


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench, known, _ = touch((LENGTH_M + 0.05, 0.5 * WIDTH_M))
    check_source(SOURCE, bench, bench.view["Hypothesis-1"], without=(known.id, "Contact-1"))


frames = st.builds(Pose2, st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.floats(-3.0, 3.0))


class DoorMachine(RuleBasedStateMachine):
    """Pictures from three places far apart and one touch, in any order and direction, against plain odds.

    Wherever the building stands, whatever was believed of the door, and however the robot turns at a place.
    """

    def __init__(self) -> None:
        super().__init__()
        self.known: DoorState | None = None
        self.views, self.is_touched, self.was_shut = dict[int, float](), False, False

    @initialize(frame=frames, is_believed_shut=st.booleans())
    def begin(self, frame: Pose2, is_believed_shut: bool) -> None:
        self.frame, self.is_believed_shut = frame, is_believed_shut

    @rule(place=st.integers(0, 2), turn_rad=st.floats(-3.0, 3.0),
          ratio=st.floats(-7.0, 7.0) | st.sampled_from((3.0, 6.0)))
    def see(self, place: int, turn_rad: float, ratio: float) -> None:
        at = self.frame @ Pose2(9.0 * place, 0.0, turn_rad)
        picture = DoorPicture("CameraPicture-1", (0.0, 0.0, 9.0, 9.0), at.x_m, at.y_m, at.heading_rad, ratio, "a leaf")
        now = update_door(self.known, "study-door", (HALL, STUDY), picture, 1.0, is_believed_shut=self.is_believed_shut)
        old = self.views.get(place, 0.0)
        if abs(ratio) < MIN_LOG_RATIO or (old * ratio > 0.0 and abs(old) >= abs(ratio)):
            assert now is None  # it is too little, or was said already
            return
        views = {**{at: told for at, told in self.views.items() if at != place}, place: ratio}
        if now is None:  # nothing is believed otherwise by it
            assert self.known is not None and self.known.log_odds == pytest.approx(self.odds(views))
            return
        self.views, self.known = views, now
        self.agree()

    @precondition(lambda self: self.known is not None and self.known.may_be_shut and not self.is_touched)
    @rule()
    def touch(self) -> None:
        assert self.known is not None
        now = touch_door(self.known, 9.0)
        assert now.log_odds == pytest.approx(min(self.known.log_odds + TOUCH_LOG_RATIO, MAX_LOG_ODDS))
        self.known, self.is_touched = now, True
        self.name_state()

    def odds(self, views: dict[int, float]) -> float:
        prior = PRIOR_LOG_ODDS if self.is_believed_shut else -PRIOR_LOG_ODDS
        told = prior + math.fsum(views.values()) + TOUCH_LOG_RATIO * self.is_touched
        return min(max(told, -MAX_LOG_ODDS), MAX_LOG_ODDS)

    def agree(self) -> None:
        assert self.known is not None and self.known.log_odds == pytest.approx(self.odds(self.views))
        assert self.known.touched_s == (9.0 if self.is_touched else None)
        assert self.known.pictures == len(self.views)
        self.name_state()

    def name_state(self) -> None:
        """Two that tell so shut it; what shut it once is held until it is open. As certain as it is likely."""
        assert self.known is not None
        enough = len(self.views) + self.is_touched >= MIN_PICTURES
        is_shut = self.known.log_odds >= SHUT_LOG_ODDS and enough
        is_open = self.known.log_odds <= OPEN_LOG_ODDS
        self.was_shut = is_shut or (self.was_shut and not is_open)
        sign = -1.0 if is_open else 1.0
        assert self.known.certainty == pytest.approx(1.0 / (1.0 + math.exp(-sign * self.known.log_odds)))
        assert self.known.state == ("open" if is_open else "shut" if self.was_shut else "unknown")


TestDoor = DoorMachine.TestCase
TestDoor.settings = settings(max_examples=150, stateful_step_count=8, deadline=None)
