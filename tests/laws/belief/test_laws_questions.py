"""Laws of what the board says of motions: the robot stands where all that was asked for is reported and believed."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from generated_boards import Bench
from harvey.testing import plain_robot
from knowledge_sources.reads import is_standing, is_up_to_date, last_motion
from world_models.entries import Course, MotionReport

motions = st.lists(st.sampled_from(("command", "course")), min_size=1, max_size=4)


@settings(max_examples=40)
@given(motions, st.sampled_from(("nothing", "reported", "believed")))
def test_it_is_up_to_date_where_the_last_motion_is_reported_and_believed(kinds: list[str], last: str) -> None:
    """Whatever moved it before that: a report of an earlier motion, or of another kind, is none of this one."""
    bench = Bench(plain_robot())
    belief = bench.believe()
    assert is_up_to_date(bench.view)
    for number, kind in enumerate(kinds):
        if kind == "command":
            command, report = bench.move()
        else:
            command = bench.put(Course("Leg-1", 0.3, 0.0))
            if number < len(kinds) - 1 or last != "nothing":
                report = bench.put(MotionReport(0.0, 0.3, 1.0, 1.0), command)
        motion = last_motion(bench.view)
        assert motion is not None and motion.id == command.id
        if number < len(kinds) - 1 or last == "believed":
            bench.revise(belief, motion=report.id)
    wanted = last == "believed"
    assert is_up_to_date(bench.view) == wanted
    assert not is_standing(bench.view) or wanted


@pytest.mark.parametrize("first", ["command", "course"])
def test_a_motion_that_was_just_asked_for_is_none_that_was_reported(first: str) -> None:
    bench = Bench(plain_robot())
    belief = bench.believe()
    command = bench.move()[0] if first == "command" else bench.put(Course("Leg-1", 0.3, 0.0))
    report = bench.put(MotionReport(0.0, 0.3, 1.0, 1.0), command)
    bench.revise(belief, motion=report.id)
    assert is_up_to_date(bench.view)
    bench.put(Course("Leg-1", 0.3, 0.0))
    assert not is_up_to_date(bench.view) and not is_standing(bench.view)
