"""Who reads one run says the same: the board that its journal makes, the Python interface, and the turning points."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import harvey
from blackboard import Level
from logs.explain.turning_points import read_turning_points
from logs.records import DecisionRecord
from logs.timeline import Timeline, find_belief
from rebuilt_board import RebuiltBoard, open_board
from recorded_runs import Recorded
from world_models.entries import OPEN, Hypothesis


def fold(recorded: Recorded, name: str) -> Iterator[tuple[RebuiltBoard, DecisionRecord]]:
    """Each decision of a run with the board as it is after it."""
    board = open_board(recorded(name))
    for decision in Timeline(recorded(name).journal).decisions():
        for record in (*decision.observed, *decision.made):
            board.put(record)
        yield board, decision


@pytest.mark.parametrize("name", ["kidnap", "office"])
def test_the_believed_track_is_that_of_the_board(name: str, recorded: Recorded) -> None:
    """Each revision of what is held, once; what a search for the place takes for possible is no part of it."""
    run, track, seen, perhaps = harvey.open_run(recorded(name).path), [], set(), 0
    world = run.head.load_world()
    for board, _ in fold(recorded, name):
        perhaps += len(board.board.view.where(Hypothesis, lambda h: not h.is_held))
        held = find_belief(board.board.view)
        if held is not None and held.ref not in seen:
            seen.add(held.ref)
            track.append((held.cycle, held.value.world_from_robot(world)))
    assert [(point.cycle, point.pose) for point in run.believed_track()] == track
    assert bool(perhaps) == (name == "kidnap")


@pytest.mark.parametrize("name", ["kidnap", "office"])
def test_it_is_told_to_be_lost_where_the_board_says_so_and_at_the_place_that_it_believes(
    name: str, recorded: Recorded
) -> None:
    history = Timeline(recorded(name).journal)
    told = {point.cycle: point.text for point in read_turning_points(history) if point.kind == "lost"}
    was, found = False, dict[int, str]()
    for board, decision in fold(recorded, name):
        is_lost = board.board.view.newest(OPEN, Level.GOAL) is not None
        belief = find_belief(board.board.view)
        if is_lost and not was:
            assert belief is not None
            pose = belief.value.locale_from_robot
            found[decision.cycle] = f"{belief.value.locale} ({pose.x_m:.2f}, {pose.y_m:.2f}) m"
        was = is_lost
    assert told.keys() == found.keys() and all(told[cycle].startswith(place) for cycle, place in found.items())
    assert bool(found) == (name == "kidnap")
