"""Withdrawal is complete: nothing on the board rests on what the frames no longer say."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import Phase, event, example, given, settings
from hypothesis import strategies as st

from blackboard import RAISED, Post, Scheduler, View
from harvey.agent import build_agent
from harvey.replay.what_if import WhatIf
from harvey.runner.ports import tell_robot
from harvey.simulation.simulated_run import SimulatedRun, build_head
from logs.run_recorder import RunRecorder
from sim.stage import Stage
from two_doors import two_doors
from world_models.building.locale_frame import LocaleFrame
from world_models.entries import Milestone, Outcome, PlanSketch, Tracks, UserReport

DOORS = ("north-door", "south-door")
THINGS = ("study/table-1", "study/bookshelf-1", "study/picture-1", "study/notice-board-1", "study/picture-2",
          "parlour/rack-1", "parlour/window-1", "parlour/notice-board-1", "parlour/picture-1")
LANDMARKS = (*THINGS, "north-door", "study/north-wall", "study/east-wall", "parlour/north-wall", "parlour/east-wall")
CYCLES = 130

tellings = st.one_of(
    st.builds(UserReport, st.sampled_from(DOORS), st.sampled_from(("shut", "open"))),
    st.builds(UserReport, st.sampled_from(THINGS), st.sampled_from(("gone", "there"))),
    st.sampled_from(LANDMARKS),
)
"""What is told, or the name of a landmark that is removed."""
plans = st.dictionaries(st.integers(6, CYCLES - 20), tellings, min_size=1, max_size=4)
"""What happens before which cycle."""


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Stage:
    return two_doors(tmp_path_factory.mktemp("withdrawal"))


@given(plans)
@example({30: "parlour/notice-board-1"})  # a milestone waits that expects it
@example({44: "parlour/picture-1", 70: UserReport("parlour/rack-1", "gone")})  # one was verified by it; it is followed
@example({47: UserReport("north-door", "shut")})
@settings(max_examples=5, phases=(Phase.explicit, Phase.generate))
def test_nothing_rests_on_what_is_gone(stage: Stage, plan: Mapping[int, UserReport | str]) -> None:
    """A mission of which somebody revises the building at random cycles; looked at whenever nothing is to withdraw."""
    head = build_head(stage, 3)
    agent = build_agent(head)
    recorder = RunRecorder(None, head, agent.world, agent.robot)
    with SimulatedRun(stage, head, agent, recorder) as run:
        scheduler = run.scheduler
        tell_robot(scheduler, agent.robot)
        scheduler.post([Post(head.task())], "user")
        for cycle in range(1, CYCLES):
            _tell(scheduler, plan.get(cycle))
            decision = scheduler.step()
            assert decision is None or not decision.refused.startswith(RAISED), decision
            if _is_quiet(scheduler):
                assert list(_find_left_over(scheduler.view)) == [], cycle
            if decision is None or scheduler.view.latest(Outcome) is not None:
                break
        for milestone in scheduler.view.where(Milestone, lambda m: m.status == "withdrawn"):
            event(f"withdrawn {milestone.value.name()}")


def _tell(scheduler: Scheduler, what: UserReport | str | None) -> None:
    if isinstance(what, UserReport):
        scheduler.post([Post(what)], "user")
    elif what is not None:
        WhatIf((what,))(scheduler)


def _is_quiet(scheduler: Scheduler) -> bool:
    """Whether every telling was taken up, and every revision of a frame was answered."""
    concerned = (*scheduler.view.all(UserReport), *scheduler.view.all(LocaleFrame))
    unseen = {change.entry.id for change in scheduler._unseen}
    return not any(entry.id in unseen or any(a.source.name in ("model_reviser", "dependency_withdrawer")
                                             for a in scheduler._agenda.triggered_by(entry.id)) for entry in concerned)


def _find_left_over(view: View) -> Iterator[str]:
    """What is on the board and rests on something that the frames do not say any more."""
    frames = [entry.value for entry in view.all(LocaleFrame)]
    gone = {change.name for frame in frames for change in frame.changes if change.what in ("gone", "removed")}
    shut = {door.name for frame in frames for door in frame.shut_doorways}
    edges = _list_edges(frames)
    sketches = view.where(PlanSketch, lambda sketch: sketch.is_active)
    for milestone in view.all(Milestone):
        m = milestone.value
        goes_on = any(s.id == m.sketch and s.value.at == m.index and s.value.verified for s in sketches)
        if m.status == "verified" and goes_on and gone.intersection(m.landmarks):
            yield f"{milestone.ref} is verified by {gone.intersection(m.landmarks)}"
        if m.is_open:
            for line, k in zip(m.expected, m.landmark_of, strict=True):
                if not _is_on_any(np.array(line), edges.get(m.landmarks[k], np.zeros((0, 2, 3)))):
                    yield f"{milestone.ref} expects a line of {m.landmarks[k]}"
    for tracks in view.all(Tracks)[-1:]:
        followed = gone.intersection(track.landmark for track in tracks.value.items)
        if followed:
            yield f"{tracks.ref} follows {followed}"
    for sketch in sketches:
        if shut.intersection(subgoal.passage for subgoal in sketch.value.subgoals[sketch.value.at:]):
            yield f"{sketch.ref} passes through a shut door"


def _list_edges(frames: list[LocaleFrame]) -> dict[str, Any]:
    """(n, 2, 3) model lines of each landmark that the frames have [m, world]."""
    marks = [mark for frame in frames for part in frame.parts for _, mark in part.landmarks]
    names = {mark.name for mark in marks}
    return {name: np.concatenate([m.edges.lines_world for m in marks if m.name == name]) for name in names}


def _is_on_any(line: Any, edges: Any) -> bool:
    """Whether both ends of a line (2, 3) lie on one of the edges (n, 2, 3), to a millimetre."""
    along = edges[:, 1] - edges[:, 0]
    part = np.einsum("kj,nj->nk", line, along) - np.einsum("nj,nj->n", edges[:, 0], along)[:, None]
    part = np.clip(part / np.einsum("nj,nj->n", along, along)[:, None], 0.0, 1.0)
    nearest = edges[:, 0, None] + part[..., None] * along[:, None]
    return bool((np.linalg.norm(nearest - line, axis=2).max(axis=1) < 1e-3).any())
