"""Laws of the landmark chooser: all landmarks are taken again from the newest picture, and the drift starts afresh."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import islice

import numpy as np
import pytest

from blackboard import Effect, Level, Post, Revise
from generated_boards import Bench, effect_on, made, reasons, to_world
from harvey.testing import check_source, plain_robot
from knowledge_sources.action.landmark_chooser import landmark_chooser
from knowledge_sources.methods.features import read_picture
from knowledge_sources.methods.tracking import edge_alignment, select_landmarks
from lab_pictures import ROOM, draw_places, photograph, robot, stage
from sim.render.sensor import compress_jpeg
from world_models.entries import Anchor, CameraPicture, Drift, Hypothesis, Segments, Tracks, diagonal
from world_models.frames import Pose2

SURE = diagonal(0.004, 0.002)


@pytest.fixture()
def no_edges(monkeypatch: pytest.MonkeyPatch) -> None:
    """So that the belief stays as it is."""
    monkeypatch.setattr(edge_alignment, "MIN_EDGE_LINES", 10**6)


@cache
def setting() -> tuple[Pose2, bytes]:
    """A place in the laboratory from which landmarks are seen, and the picture from there."""
    rng = np.random.default_rng(5)
    for pose in islice(draw_places(rng), 40):
        jpeg = photograph(pose, rng)
        if len(select_landmarks(robot(), (), "CameraPicture-2", read_picture(jpeg).grey, pose)) >= 8:
            return pose, jpeg
    raise AssertionError("expected a place with enough landmarks")


def choose(*, off_rad: float = 0.0, has_old: bool = True, lost: Level | None = None,
           seen_in: str = "CameraPicture-1") -> tuple[Bench, tuple[Effect, ...] | None]:
    """A board after a milestone, and what the chooser makes of it."""
    pose, jpeg = setting()
    bench = Bench(robot())
    if has_old:
        bench.put(CameraPicture(jpeg, 0, 0.0, "milestone"))
        bench.put(Tracks("CameraPicture-1", 9, (), (Anchor("CameraPicture-1", 0.0, 0.0, SURE),), 5))
        bench.put(Drift(0.003, 0.004, 9.0, 0.5, 0.6, 0.7))
    else:
        bench.put(CameraPicture(b"an older one", 0, 0.0, "milestone"))
    bench.put(CameraPicture(jpeg, 1, 1.0, "milestone"))
    believed = Pose2(pose.x_m, pose.y_m, pose.heading_rad + off_rad)
    belief = bench.put(Hypothesis.of_world(stage().world, ROOM, believed, np.array(SURE), "odometry", motion="m"))
    lines = bench.put(Segments(seen_in, "Milestone-1", np.zeros((0, 2, 2)), np.zeros(0), 40.0), bench.view[seen_in])
    belief = bench.apply(Revise(belief, replace(belief.value, basis="milestone"), (lines, belief)))[0].entry
    if lost is not None:
        bench.doubt(lost)
    return bench, bench.ask(landmark_chooser, belief)


@pytest.mark.parametrize("has_old", [False, True])
@pytest.mark.usefixtures("no_edges")
def test_all_landmarks_are_of_the_newest_picture(has_old: bool) -> None:
    effects = choose(has_old=has_old)[1]
    effect = effect_on(effects, Tracks)
    tracks, (pose, jpeg) = effect.value, setting()
    expected = select_landmarks(robot(), (), "CameraPicture-2", read_picture(jpeg).grey, pose)
    assert [t.landmark for t in tracks.items] == [t.landmark for t in expected] and tracks.taken == len(expected) >= 8
    assert np.allclose([t.template_px for t in tracks.items], [t.template_px for t in expected])
    assert tracks.frame == "CameraPicture-2" and {t.template_frame for t in tracks.items} == {"CameraPicture-2"}
    (anchor,) = tracks.anchors
    assert anchor.frame == "CameraPicture-2" and np.allclose((anchor.x_m, anchor.y_m), pose.position)
    assert np.allclose(anchor.covariance, SURE)
    assert isinstance(effect, Revise if has_old else Post)
    assert reasons(effect) == {"CameraPicture-2", "Hypothesis-1"}
    assert not made(effects, Hypothesis)  # it was aligned with nothing


@pytest.mark.parametrize("has_old", [False, True])
@pytest.mark.usefixtures("no_edges")
def test_a_new_stretch_of_the_drift_starts_at_the_believed_heading(has_old: bool) -> None:
    effects = choose(has_old=has_old)[1]
    assert made(effects, Drift) == [Drift(0.003, 0.004, pytest.approx(setting()[0].heading_rad))] * has_old
    if has_old:
        assert reasons(effect_on(effects, Drift)) == {"Tracks"}


@pytest.mark.usefixtures("no_edges")
def test_the_stretch_starts_at_the_heading_in_the_world_whatever_the_locale() -> None:
    """The plain house is turned in the world, and the picture is of a fog."""
    bench, pose = Bench(plain_robot()), Pose2(3.0, 2.0, 0.4)
    belief = bench.believe(pose)
    bench.put(CameraPicture(compress_jpeg(np.full((256, 256), 128, np.uint8), 90), 0, 0.0, "milestone"))
    bench.put(Drift(0.003, 0.004, 9.0))
    effects = bench.ask(landmark_chooser, bench.revise(belief))
    assert made(effects, Drift) == [Drift(0.003, 0.004, pytest.approx(to_world(pose).heading_rad))]
    assert made(effects, Tracks)[0].items == ()


def test_the_belief_is_aligned_with_the_edges_before_landmarks_are_cut() -> None:
    effects = choose(off_rad=0.003)[1]
    effect = effect_on(effects, Hypothesis)
    heading = effect.value.world_from_robot(stage().world).heading_rad
    assert abs(heading - setting()[0].heading_rad) < 0.5 * 0.003
    assert (effect.value.basis, effect.value.motion, effect.value.locale) == ("tracks", "m", ROOM)
    assert reasons(effect) == {"CameraPicture-2", "Hypothesis-1", "Tracks"}
    assert made(effects, Drift)[0].heading_rad == pytest.approx(heading)


def test_the_same_picture_twice_is_once() -> None:
    """By the picture of its milestone the belief gets neither another pose nor surer; by a newer one it does."""
    for picture, times in (("CameraPicture-1", 1), ("CameraPicture-2", 0)):
        assert len(made(choose(off_rad=0.003, seen_in=picture)[1], Hypothesis)) == times


def test_it_keeps_the_laws_of_all_sources() -> None:
    check_source(landmark_chooser, bench := choose()[0], bench.view["Hypothesis-1"])
