"""Law of doors that are looked at: what pictures from several places say is believed of the door, and no more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from archive_door import DOOR, before_door, photograph
from blackboard import Effect, Level, Post, Posted, Revise
from harvey.testing import answer, check_source
from knowledge_sources.methods.doors import MAX_LOG_ODDS, PRIOR_LOG_ODDS
from knowledge_sources.methods.doors.belief import MIN_PICTURES
from knowledge_sources.model.door_watcher import DoorWatcher
from knowledge_sources.model.floor_watcher import FloorWatcher
from knowledge_sources.reads import MAX_SIGMA_M, MAX_SIGMA_RAD
from things_in_hall import HALL, Hall
from world_models.entries import CameraPicture, Discrepancy, DoorState, Hypothesis, Outcome, diagonal
from world_models.frames import Pose2

SOURCE = DoorWatcher()
PLACES = ((2.5, 0.0), (1.6, 0.4))
"""How far before the door, and how far aside: pictures from these are independent."""


def stand(hall: Hall, away_m: float, aside_m: float, sigma_m: float = 0.01, sigma_rad: float = 0.005) -> Pose2:
    """The robot believes to stand before the door and to face it; its pose [world]."""
    pose, belief = before_door(away_m, aside_m), hall.belief()
    known = Hypothesis.of_world(hall.robot.world, HALL, pose, np.diag([1e-4, 1e-4, 1e-4]), "tracks")
    hall.apply(Revise(belief, replace(known, covariance=diagonal(sigma_m, sigma_rad)), (belief,)))
    return pose


def look(hall: Hall, is_shut: bool, pose: Pose2, time_s: float = 1.0, *, lights_on: bool = True) -> Any:
    """A picture from a pose."""
    return hall.put(CameraPicture(photograph(pose, is_shut, lights_on=lights_on), 0, time_s, "track"))


def ask(hall: Hall, frame: Any) -> Sequence[Effect] | None:
    """What it says of the door; other doors are left out."""
    effects = answer(SOURCE, hall.board.view, Posted(frame))
    return None if effects is None else [e for e in effects if e.value.door == DOOR]


@pytest.mark.parametrize(("sigma_m", "sigma_rad", "acts"), [
    (0.9 * MAX_SIGMA_M, 0.005, True), (1.1 * MAX_SIGMA_M, 0.005, False),
    (0.01, 0.9 * MAX_SIGMA_RAD, True), (0.01, 1.1 * MAX_SIGMA_RAD, False)])
def test_it_looks_while_the_belief_is_sharp_and_not_in_doubt(sigma_m: float, sigma_rad: float, acts: bool) -> None:
    hall = Hall(())
    frame = look(hall, True, stand(hall, *PLACES[0], sigma_m, sigma_rad))
    assert (ask(hall, frame) is not None) == acts
    for end in (Discrepancy(Level.PLAN, "elsewhere", None, (4.0, 30.0), "px"), Outcome("failed", "")):
        hall.put(end)
        assert ask(hall, frame) is None


def test_in_the_dark_nothing_is_told_of_doors_nor_of_the_floor() -> None:
    for lights_on in (False, True):
        hall = Hall(())
        frame = look(hall, True, stand(hall, *PLACES[0]), lights_on=lights_on)
        assert bool(ask(hall, frame)) == lights_on
        scan, *views = [e.value for e in answer(FloorWatcher(), hall.board.view, Posted(frame)) or ()]
        assert (bool(scan.bearings_rad), bool(views)) == (lights_on, lights_on) and not scan.things


def test_a_leaf_from_two_places_is_a_shut_door_and_what_is_beyond_opens_it_again() -> None:
    hall = Hall()  # with the model reviser, by whose frames it is believed to be shut
    known: Any = None
    for number, place in enumerate(PLACES, 1):
        frame = look(hall, True, stand(hall, *place), 1.0 * number)
        (effect,) = ask(hall, frame) or ()
        assert isinstance(effect, Post if known is None else Revise)
        reasons = (frame, hall.belief()) if known is None else (frame, hall.belief(), known)
        assert tuple(effect.because) == reasons
        now: DoorState = effect.value
        assert now.state == ("shut" if number >= MIN_PICTURES else "unknown") and now.pictures == number
        assert now.last.frame == frame.id and now.seen_s == 1.0 * number and now.last.log_ratio > 0.0
        if known is None:  # a door that the file has open is open, as far as nothing else tells
            assert now.log_odds == pytest.approx(min(now.last.log_ratio - PRIOR_LOG_ODDS, MAX_LOG_ODDS))
        hall.apply(effect)
        known = hall.board.view.latest(DoorState)
        assert ask(hall, frame) == []  # the same picture again says nothing new
    assert {(change.what, change.name) for change in hall.frame.changes} == {("shut", DOOR)}
    for number, place in enumerate(PLACES, 3):
        frame = look(hall, False, stand(hall, *place), 1.0 * number)
        for effect in ask(hall, frame) or ():
            assert effect.value.last.log_ratio < 0.0 and hall.board.view.latest(DoorState) in effect.because
            hall.apply(effect)
    now_open = hall.board.view.latest(DoorState)
    assert now_open is not None and now_open.value.state == "open" and hall.frame.changes == ()


def test_it_keeps_the_laws_of_all_sources() -> None:
    hall = Hall(())
    assert ask(hall, look(hall, False, stand(hall, *PLACES[0]))) == []  # it is as it is believed to be
    check_source(SOURCE, hall.bench, Posted(look(hall, True, stand(hall, *PLACES[0]))))
