"""Laws of the push monitor: a step is told where looks before and after agree on it, and wheels that err are none."""

from __future__ import annotations

import math
from collections.abc import Sequence

from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Entry
from generated_boards import Bench, made, reasons
from harvey.testing import check_source, plain_robot
from knowledge_sources.methods.belief import weigh_rivals
from knowledge_sources.senses.push_monitor import push_monitor
from world_models.actuator import ActuatorModel
from world_models.entries import Drift, Evidence, FloorView
from world_models.frames import Pose2

WHEELS, STILL, ASIDE = ActuatorModel(), Pose2(0.0, 0.0, 0.0), Pose2(0.0, 0.12, 0.0)
errors = st.lists(st.floats(-0.006, 0.006), min_size=4, max_size=4)


def look(*steps: Pose2, off_m: Sequence[float] = (0.0,) * 4, sigma_m: float = 0.005) -> tuple[Bench, Entry[FloorView]]:
    """Looks after ways of 0.6 m and a step, each off by so much."""
    bench, pose = Bench(plain_robot(actuator=WHEELS)), Pose2(2.0, 1.5, 0.7)
    bench.believe(pose)
    bench.put(Drift(0.0, 0.002, 0.7))
    for off, step in zip(off_m, steps, strict=False):
        _, report = bench.move(0.0, 0.6)
        pose = pose @ WHEELS.predict_motion(0.0, 0.6) @ step
        last = bench.put(FloorView("CameraPicture-1", "Hypothesis-1", pose.x_m + off, pose.y_m - off, pose.heading_rad,
                                   0.0, report.value.sim_time_s, sigma_m, 0.001, report.id))
    return bench, last


def tell(bench: Bench, last: Entry[FloorView]) -> list[Evidence]:
    return list(made(bench.ask(push_monitor, last), Evidence))


@settings(max_examples=40, deadline=None)
@given(errors, st.floats(-math.pi, math.pi), st.floats(0.2, 0.3))
def test_a_step_is_a_push_once_a_look_finds_it_again(off_m: list[float], to_rad: float, by_m: float) -> None:
    push = Pose2(by_m * math.cos(to_rad), by_m * math.sin(to_rad), 0.0)
    (told,) = tell(*look(STILL, STILL, push, STILL, off_m=off_m))
    assert (found := weigh_rivals(told.about, [told])).is_sure and found.leader.kind == "pushed"
    assert not tell(*look(STILL, STILL, push, off_m=off_m)) and not tell(*look(STILL, STILL, push, push.inverse()))


@settings(max_examples=40, deadline=None)
@given(errors, st.floats(-0.1, 0.1))
def test_looks_that_agree_or_tell_little_and_wheels_that_err_tell_of_none(off_m: list[float], by_m: float) -> None:
    assert not tell(*look(*[STILL] * 4, off_m=off_m)) and not tell(*look(*[Pose2(by_m, 0.0, 0.0)] * 4))
    assert not tell(*look(STILL, STILL, ASIDE, STILL, sigma_m=0.05))


def test_it_rests_on_the_looks_and_keeps_the_laws_of_all_sources() -> None:
    bench, last = look(STILL, STILL, ASIDE, STILL)
    (effect,) = bench.ask(push_monitor, last) or ()
    assert reasons(effect) == {f"FloorView-{number}" for number in range(1, 5)}
    check_source(push_monitor, bench, last)
