"""Laws of the door toucher: a touch in the opening of a door that may be shut counts beside its pictures, once."""

from __future__ import annotations

from typing import Any

import pytest

from blackboard import Entry, Posted, Revised
from generated_boards import HALL, LENGTH_M, STUDY, WIDTH_M, Bench, effect_on, plain_robot, reasons, wakes
from knowledge_sources.methods.doors import MAX_LOG_ODDS, PRIOR_LOG_ODDS, SHUT_LOG_ODDS, touch_door, update_door
from knowledge_sources.methods.doors.belief import MAX_TOUCH_M, TOUCH_LOG_RATIO
from knowledge_sources.model.door_toucher import door_toucher
from world_models.entries import Contact, DoorPicture, DoorState, Hypothesis, Outcome, diagonal
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


def test_a_touch_counts_beside_pictures_whichever_comes_first_and_alone_shuts_no_door() -> None:
    door, late = may_be_shut(4.5, 2.5), DoorPicture("p", (0.0, 0.0, 9.0, 9.0), 5.0, 0.0, 0.0, 2.5, "a leaf")
    touched = touch_door(door, 9.0)
    assert touched.log_odds == pytest.approx(min(door.log_odds + TOUCH_LOG_RATIO, MAX_LOG_ODDS))
    after = update_door(touched, door.door, door.between, late, 2.0, is_believed_shut=False)
    before = update_door(door, door.door, door.between, late, 2.0, is_believed_shut=False)
    assert after is not None and before is not None and after.touched_s == 9.0
    assert after.log_odds == pytest.approx(touch_door(before, 9.0).log_odds)
    assert TOUCH_LOG_RATIO - PRIOR_LOG_ODDS < 0.0 < SHUT_LOG_ODDS


def test_it_wakes_when_the_belief_has_the_motion() -> None:
    bench = Bench(plain_robot())
    belief = bench.believe()
    assert wakes(SOURCE, Revised(belief)) and not wakes(SOURCE, Posted(belief))
    lost = bench.put(Hypothesis(HALL, Pose2(2.0, 2.0, 0.0), diagonal(0.01, 0.01), "tracks", status="candidate"))
    assert not wakes(SOURCE, Revised(lost))
