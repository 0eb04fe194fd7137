"""Laws of the surveyor: a hall that is wider, or a door beside, is told by each picture; of an exact one nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Entry
from generated_boards import Bench, effect_on, made, mirrored, reasons, to_world
from harvey.testing import HALL, check_source, plain_robot
from knowledge_sources.methods.belief import weigh_rivals
from knowledge_sources.milestone_selector.view_predictor import ViewPredictor
from knowledge_sources.model import surveyor
from knowledge_sources.model.surveyor import Surveyor
from world_models.entries import (
    Certificate,
    Evidence,
    LineMatch,
    Milestone,
    PoseFix,
    Segments,
    diagonal,
)
from world_models.frames import Pose2

SOURCE, ROBOT, HERE, THERE = Surveyor(), plain_robot(), Pose2(2.0, 1.8, 0.05), Pose2(3.5, 2.2, -0.1)
WIDTH, DOOR = f"{HALL} from wall 0 to wall 2", "study-door"
Look = tuple[Bench, Entry[Certificate]]


def look(wider_m: float, door_m: float = 0.0, pose: Pose2 = HERE, *, order: int = 1, seed: int = 0,
         verdict: str = "verified") -> Look:
    """A picture of a hall that is so much wider, and its door so far beside."""
    bench, rng, there = Bench(ROBOT), np.random.default_rng(seed), to_world(pose)
    bench.believe(pose, diagonal(0.02, 0.01))
    milestone = bench.await_milestone(look_heading_rad=there.heading_rad)
    expected = bench.apply(effect_on(bench.ask(ViewPredictor(), milestone), Milestone))[0].entry
    m, off_m = expected.value, {f"{HALL} wall {i}": -0.5 * wider_m for i in (0, 2)} | {f"{DOOR} along": door_m}
    lines = m.errors.restate(1.0).displace(np.array(m.expected), np.array(
        [off_m.get(mode, 0.0) for mode in m.displacement_modes]))
    shown, _ = ROBOT.camera.project_segments(lines, ROBOT.camera_from_world(there))
    at = np.flatnonzero(np.isfinite(shown).all(axis=(1, 2)))[::order]
    shown = (shown + rng.normal(0.0, 0.2, shown.shape))[at]
    segments = bench.put(Segments("CameraPicture-1", expected.id, shown, np.full(len(shown), 0.3), 40.0))
    match = bench.put(LineMatch(expected.id, segments.id, np.column_stack([at, np.arange(len(at))]),
                                np.array(m.expected)[at], shown, 0.0, np.ones(len(lines))), expected)
    fix = bench.put(PoseFix(match.id, there, np.diag([1.6e-5, 1.6e-5, 1e-6]), np.ones(0, bool), np.zeros(0), ()), match)
    return bench, bench.put(Certificate(expected.id, fix.id, verdict, "", 9, 9, 9, 0.9, 1.0, 0.0, 0.0, 3.0, 30.0,  # type: ignore[arg-type]
                                        1e-3, 1e-3, 0.006), fix)


def tell(about: str, *looks: Look) -> list[Evidence]:
    return [told for bench, last in looks for told in made(bench.ask(SOURCE, last), Evidence) if told.about == about]

cases = st.sampled_from(((WIDTH, 0.1, 0.0), (WIDTH, -0.08, 0.0), (DOOR, 0.0, 0.1), (DOOR, 0.0, -0.1)))


@settings(max_examples=8, deadline=None)
@given(cases, st.integers(0, 99))
def test_what_stands_beside_is_told_and_looks_add_up(case: tuple[str, float, float], seed: int) -> None:
    about, *by = case
    looks = tell(about, *(look(*by, pose, seed=seed) for pose in (HERE, THERE)))
    one, both, twice, turned = (weigh_rivals(about, x).rivals for x in (looks[:1], looks, looks * 2, looks[::-1]))
    (first, *_), (beside, *_) = ([r for r in rivals if r.kind != "chance"] for rivals in (one, both))
    assert turned == both and first.p < beside.p and beside.sigma < first.sigma
    assert sum(by) == pytest.approx(beside.off, abs=2.0 * beside.sigma) and abs(beside.off) > 3.0 * beside.sigma
    assert [(r.p, r.sigma) for r in twice] == [pytest.approx((r.p, r.sigma)) for r in both]
    (back,), (other,) = tell(about, look(*by, seed=seed, order=-1)), tell(about, look(by[0], -by[1], mirrored(HERE)))
    assert back.explanations[1].off == pytest.approx(first.off, abs=0.005)
    assert abs(other.explanations[1].off) == pytest.approx(abs(sum(by)), abs=0.02)


@settings(max_examples=10, deadline=None)
@given(st.sampled_from((HERE, THERE, mirrored(HERE))), st.integers(0, 99), st.floats(-0.01, 0.01))
def test_of_a_building_as_it_was_measured_nothing_is_told(pose: Pose2, seed: int, by_m: float) -> None:
    assert not made(Bench.ask((seen := look(by_m, by_m, pose, seed=seed))[0], SOURCE, seen[1]), Evidence)


def test_what_all_pictures_share_makes_each_less_sure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(surveyor, "SHARED_SIGMA_M", 1.0)
    (wider,) = tell(WIDTH, look(0.1))
    assert wider.explanations[1].sigma >= 1.0 and not tell(DOOR, look(0.0, 0.1))  # of a door not sure enough


def test_a_door_is_told_by_a_sure_place_alone() -> None:
    assert not tell(DOOR, look(0.0, 0.1, verdict="not testable"))
    bench, last = look(0.1, verdict="not testable")
    (effect,) = bench.ask(SOURCE, last) or ()
    assert reasons(effect) == {"PoseFix-1", "Milestone-1", "Segments-1"}


def test_it_keeps_the_laws_of_all_sources() -> None:
    check_source(SOURCE, *look(0.1), without=("PoseFix-1", "Milestone-1", "Segments-1"))
