"""Laws of the lens monitor: a lens that is another is told by each look; of one that is as stated nothing is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Entry
from generated_boards import Bench, effect_on, mirrored, reasons, to_world
from harvey.testing import check_source, plain_robot
from knowledge_sources.methods.belief import weigh_rivals
from knowledge_sources.milestone.med_r_and_t import MedRAndT
from knowledge_sources.milestone_selector.view_predictor import ViewPredictor
from knowledge_sources.reads.place_believed import MAX_P_RIVAL
from knowledge_sources.senses.lens_monitor import lens_monitor
from world_models.entries import Evidence, LineMatch, Milestone, PoseFix, diagonal
from world_models.frames import Pose2

SOURCE, ROBOT, HERE = lens_monitor, plain_robot(), Pose2(2.0, 1.6, 0.15)
THERE = Pose2(1.0, 2.0, 0.0), Pose2(0.5, 3.2, -0.4)


def see(k1: float, pose: Pose2 = HERE, *, seed: int = 0, order: int = 1, **of: object) -> tuple[Bench, Entry[PoseFix]]:
    """A board with the fix of a picture that a lens has bent, whose lens is stated to bend nothing."""
    bench, rng = Bench(ROBOT), np.random.default_rng(seed)
    bench.revise(bench.view["CameraState-1"], covariance=tuple(map(tuple, np.diag([1e-6] * 5 + [0.04] * 2).tolist())))
    bench.believe(pose, diagonal(0.02, 0.01))
    milestone = bench.await_milestone(look_heading_rad=to_world(pose).heading_rad)
    expected = bench.apply(effect_on(bench.ask(ViewPredictor(), milestone), Milestone))[0].entry
    lines, pinhole = np.array(expected.value.expected), ROBOT.camera
    seen = pinhole.project_segments(lines, ROBOT.camera_from_world(to_world(pose)))[0]
    rays = pinhole.rays(seen + rng.normal(0.0, 0.15, seen.shape))
    bent = replace(pinhole, distortion=(k1, 0.0, 0.0, 0.0)).project(rays)
    pairs = np.column_stack([np.arange(len(lines))] * 2)[::order]
    match = bench.put(LineMatch(expected.id, "Segments-1", pairs, lines[::order], bent[::order], 0.0,
                                np.ones(len(lines))), expected)
    bench.revise(expected, **of)
    return bench, bench.apply(*bench.ask(MedRAndT(), match) or ())[0].entry


def tell(*of: tuple[Bench, Entry[PoseFix]]) -> list[Evidence]:
    return [effect_on(bench.ask(SOURCE, fix), Evidence).value for bench, fix in of]


bends = st.floats(0.07, 0.1).flatmap(lambda k1: st.sampled_from((-k1, k1)))


@settings(max_examples=10, deadline=None)
@given(bends, st.integers(0, 99))
def test_another_lens_is_told_and_by_how_much_and_looks_add_up(k1: float, seed: int) -> None:
    looks = tell(*(see(k1, pose, seed=seed) for pose in (HERE, *THERE)))
    for look in looks:
        lens = next(e for e in look.explanations if e.kind == "lens")
        assert lens.log_ratio == max(e.log_ratio for e in look.explanations)
        assert lens.off == pytest.approx(k1, rel=0.3, abs=3.0 * lens.sigma)
    p = [weigh_rivals("camera", some).p_misled for some in (looks[:1], looks[:1] * 3, looks[:2], looks)]
    assert MAX_P_RIVAL < p[0] < 0.1 < p[2] < 0.95 < p[3]
    assert p[1] == pytest.approx(p[0])  # twice the same is once


@settings(max_examples=10, deadline=None)
@given(st.floats(-0.005, 0.005), st.integers(0, 99), st.sampled_from((HERE, *THERE)))
def test_of_a_lens_that_is_as_stated_nothing_is_told(k1: float, seed: int, pose: Pose2) -> None:
    bench, fix = see(k1, pose, seed=seed)
    assert not bench.ask(SOURCE, fix)


@settings(max_examples=6, deadline=None)
@given(bends)
def test_neither_a_mirror_nor_the_order_of_lines_matters(k1: float) -> None:
    plain, other, backwards = tell(see(k1), see(k1, mirrored(HERE)), see(k1, order=-1))
    for one, two, three in zip(plain.explanations, other.explanations, backwards.explanations, strict=True):
        if one.kind in ("lens", "chance"):
            assert (two.kind, two.off) == (one.kind, pytest.approx(one.off, abs=0.01))
            assert three.log_ratio == pytest.approx(one.log_ratio, abs=0.1)


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench, fix = see(0.1)
    effects = check_source(SOURCE, bench, fix, without=("LineMatch-1",))
    assert reasons(effect_on(effects, Evidence)) == {fix.id, "LineMatch-1", "Milestone-1"}
    bench.revise(bench.view["Milestone-1"], displacement_modes=("hall/south-wall",),
                 displacements=((0.0, 0.0, 0.05, 0.0, 0.0),))
    assert not bench.ask(SOURCE, fix)  # the model is not exact
