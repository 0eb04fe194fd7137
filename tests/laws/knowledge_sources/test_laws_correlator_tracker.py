"""Laws of the correlator tracker: by how many landmarks it corrects, when tracking has failed, what it learns.

It follows real templates through rendered pictures; where a landmark is not to be found, the picture is grey there.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import islice
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest

from blackboard import Effect, Entry, Level, Retract, Revise
from generated_boards import Bench, reasons
from harvey.testing import check_source
from knowledge_sources.action import correlator_tracker
from knowledge_sources.action.correlator_tracker import (
    ENOUGH_LANDMARKS,
    MAX_MISSES,
    MIN_AGREEING_LANDMARKS,
    MIN_AGREEING_PART,
    MIN_DRIFT_STRETCH_M,
    MIN_EXPECTED_LANDMARKS,
    MIN_LANDMARKS,
    MIN_REMAINING_PART,
    CorrelatorTracker,
)
from knowledge_sources.methods.features import read_picture
from knowledge_sources.methods.tracking import TEMPLATE_HALF_PX, TOLERANCE_SIGMAS, edge_alignment, select_landmarks
from knowledge_sources.settings import DEFAULT
from lab_pictures import ROOM, draw_places, photograph, robot, stage
from sim.render.sensor import compress_jpeg
from world_models.entries import (
    Anchor,
    CameraPicture,
    Discrepancy,
    Drift,
    FreeFloor,
    Hypothesis,
    Track,
    Tracks,
    covariance_tuple,
    diagonal,
)
from world_models.frames import Pose2

SURE, TURNED = diagonal(0.004, 0.001), diagonal(0.004, 0.02)
TURN_RAD, SLIP_RAD = math.radians(3.0), math.radians(0.6)
"""It turns by the first, and believes to have turned by less."""


class Setting(NamedTuple):
    """Pictures of before and after the turn, the landmarks of the first, and the poses at which they were taken."""

    before: bytes
    after: bytes
    tracks: tuple[Track, ...]
    start: Pose2
    end: Pose2


@cache
def setting() -> Setting:
    """The first place of some at which enough landmarks are seen before the turn and after it."""
    rng = np.random.default_rng(5)
    for start in islice(draw_places(rng), 40):
        end = Pose2(start.x_m, start.y_m, start.heading_rad + TURN_RAD)
        before = photograph(start, rng)
        found = select_landmarks(robot(), (), "CameraPicture-1", read_picture(before).grey, start)
        half = robot().camera.width / 2
        inside = tuple(track for track in found if abs(place_px(end, track)[0] - half) < half - 60)
        if len(inside) >= 2 * MIN_EXPECTED_LANDMARKS:
            return Setting(before, photograph(end, rng), inside, start, end)
    raise AssertionError("expected a place with enough landmarks")


def place_px(pose: Pose2, track: Track) -> tuple[float, float]:
    u, v = robot().camera.project(robot().camera_from_world(pose).apply(np.array(track.point_world)))
    return float(u), float(v)


def picture_of(
    found: int, hidden: int = 0, misses: int = 0, *, drift: Drift | None = None, doubt: Discrepancy | None = None,
    taken: int | None = None, unseen: int = 0, floors: Sequence[FreeFloor] = (),
) -> tuple[Bench, Entry[CameraPicture]]:
    """A picture in which so many landmarks that are followed are found, and so many are not."""
    seen = setting()
    tracks = [replace(track, misses=misses) for track in seen.tracks[:found + hidden]]
    image = read_picture(seen.after).grey.copy()
    for track in tracks[found:]:
        u, v = place_px(seen.end, track)
        image[max(0, round(v) - 15):round(v) + 16, max(0, round(u) - 15):round(u) + 16] = 128

    believed = Pose2(seen.end.x_m, seen.end.y_m, seen.end.heading_rad - SLIP_RAD)
    bench = Bench(robot())
    bench.put(Hypothesis.of_world(stage().world, ROOM, believed, np.array(TURNED), "odometry"))
    bench.put(CameraPicture(seen.before, 0, 0.0))
    anchor = Anchor("CameraPicture-1", seen.start.x_m, seen.start.y_m, covariance_tuple(np.array(SURE)))
    bench.put(Tracks("CameraPicture-1", TEMPLATE_HALF_PX, tuple(tracks), (anchor,),
                     len(tracks) if taken is None else taken, unseen))
    for value in (drift, doubt, *floors):
        if value is not None:
            bench.put(value)
    return bench, bench.put(CameraPicture(compress_jpeg(image, 95), 1, 1.0, "track"))


def follow(*of: int, **more: Any) -> list[Effect]:
    """What the tracker does with such a picture."""
    bench, picture = picture_of(*of, **more)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(edge_alignment, "MIN_EDGE_LINES", 10**6)  # so that only landmarks correct the belief
        effects = bench.ask(CorrelatorTracker(), picture)
    assert effects is not None
    return list(effects)


def written(effects: Sequence[Effect]) -> list[Any]:
    return [effect.value for effect in effects if not isinstance(effect, Retract)]


def corrections(effects: Sequence[Effect]) -> list[Hypothesis]:
    return [value for value in written(effects) if isinstance(value, Hypothesis)]


def discrepancies(effects: Sequence[Effect]) -> list[Discrepancy]:
    return [value for value in written(effects) if isinstance(value, Discrepancy)]


@pytest.mark.parametrize("found", [MIN_AGREEING_LANDMARKS - 1, MIN_AGREEING_LANDMARKS])
def test_so_many_landmarks_must_agree_that_one_alone_corrects_nothing(found: int) -> None:
    assert MIN_AGREEING_LANDMARKS >= 2
    corrected = corrections(follow(found))
    assert len(corrected) == (found >= MIN_AGREEING_LANDMARKS)
    for belief in corrected:
        off_rad = belief.world_from_robot(stage().world).heading_rad
        assert abs(off_rad - setting().end.heading_rad) < 0.2 * SLIP_RAD


@pytest.mark.parametrize("hidden", [MIN_EXPECTED_LANDMARKS - 1, MIN_EXPECTED_LANDMARKS])
def test_tracking_has_failed_where_enough_landmarks_are_expected_and_none_is_found(hidden: int) -> None:
    found = discrepancies(follow(0, hidden))
    has_failed = hidden >= MIN_EXPECTED_LANDMARKS
    assert [one.level for one in found if one.magnitude == math.inf] == [Level.ACTION] * has_failed


BARE = FreeFloor("camera", ROOM, 0.0, 0.0, (0.0, 0.1), (1.0,) * 2, (0.0,) * 2, ("thing",) * 2, (0.1,) * 2, (), 1.0)
DARK = replace(BARE, bearings_rad=(), near_m=(), far_m=(), ends=(), sigma_m=())


@pytest.mark.parametrize(("found", "unseen", "last", "doubts"), [
    (0, 2, BARE, True), (0, 1, BARE, False), (2, 2, BARE, False), (0, 2, DARK, False),
    (0, 2, replace(BARE, far_m=(0.0, 2.0)), False), (0, 2, replace(BARE, ends=("model",) * 2), False)])
def test_no_landmark_in_three_pictures_and_no_floor_where_it_should_be_is_a_doubt(
    found: int, unseen: int, last: FreeFloor, doubts: bool
) -> None:
    effects = follow(found, unseen=unseen, floors=(BARE, BARE, last))
    raised = [reasons(one) for one in effects if isinstance(one.value, Discrepancy) and one.value.exceeds]
    assert [found >= {"FreeFloor-1", "FreeFloor-2", "FreeFloor-3"} for found in raised] == [True] * doubts


def test_tracking_has_failed_where_too_small_a_part_of_them_agrees() -> None:
    expected = 2 * MIN_EXPECTED_LANDMARKS
    least = math.ceil(MIN_AGREEING_PART * expected)
    for agreeing in (least - 1, least):
        found = discrepancies(follow(agreeing, expected - agreeing))
        assert (math.inf in [one.magnitude for one in found]) == (agreeing < least)


def test_a_landmark_is_dropped_when_it_was_missed_so_often_in_a_row() -> None:
    hidden = 1
    for misses in (MAX_MISSES - 2, MAX_MISSES - 1):
        effects = follow(2, hidden, misses)
        (tracks,) = (value for value in written(effects) if isinstance(value, Tracks))
        kept = [track for track in tracks.items if track.template_frame == "CameraPicture-1"]
        assert len(kept) == 2 + (misses + 1 < MAX_MISSES)


def test_what_is_told_rests_on_the_picture_the_belief_and_the_landmarks() -> None:
    effects = follow(6)
    by_kind = {type(e.value): reasons(e) for e in effects if not isinstance(e, Retract)}
    assert by_kind[Tracks] == {"CameraPicture-2", "Hypothesis-1", "Tracks-1"}
    assert by_kind[Hypothesis] == {"CameraPicture-2", "Hypothesis-1", "Tracks"}
    assert by_kind[Discrepancy] == {"Hypothesis"}
    lost = {type(e.value): reasons(e) for e in follow(0, 6) if not isinstance(e, Retract)}
    assert lost == {Discrepancy: {"CameraPicture-2", "Hypothesis-1", "Tracks-1"},
                    Tracks: {"CameraPicture-2", "Hypothesis-1", "Tracks-1"}}


def test_the_difference_is_the_median_shift_and_its_bound_that_of_the_belief() -> None:
    seen, effects = setting(), follow(7)
    believed = Pose2(seen.end.x_m, seen.end.y_m, seen.end.heading_rad - SLIP_RAD)
    shifts = [math.dist(place_px(believed, t), place_px(seen.end, t)) for t in seen.tracks[:7]]
    (found,) = discrepancies(effects)
    assert found.magnitude == pytest.approx(sorted(shifts)[3], abs=0.5)
    ahead = [float(robot().camera_from_world(believed).apply(np.array(t.point_world))[2]) for t in seen.tracks[:7]]
    spread = math.hypot(0.02, 0.004 / sorted(ahead)[3])
    bound = DEFAULT.action.min_tolerance_px + TOLERANCE_SIGMAS * robot().camera.fx * spread
    assert found.bounds == (pytest.approx(min(bound, DEFAULT.plan.max_deviation_px)), DEFAULT.plan.max_deviation_px)
    assert found.level is Level.ACTION and found.unit == "px" and found.what.startswith("7 landmarks are ")


def test_where_tracking_has_failed_no_landmark_is_followed_and_the_belief_stays() -> None:
    effects = follow(0, 6)
    (tracks,) = [value for value in written(effects) if isinstance(value, Tracks)]
    assert (tracks.items, tracks.frame, tracks.taken) == ((), "CameraPicture-2", 0) and not corrections(effects)
    (found,) = discrepancies(effects)
    assert re.match(r"[56] of 6 landmarks are not where they were expected \(", found.what)  # one is found elsewhere


@pytest.mark.parametrize(("gone_m", "learns"), [(MIN_DRIFT_STRETCH_M - 1e-6, False), (MIN_DRIFT_STRETCH_M, True)])
def test_the_drift_is_learnt_where_the_robot_has_gone_far_enough(gone_m: float, learns: bool) -> None:
    start = setting().start.heading_rad
    drift = Drift(0.0, 0.011, start, TURN_RAD - SLIP_RAD, 1e-6, gone_m)
    effects = follow(7, drift=drift)
    found = [e for e in effects if isinstance(e.value, Drift)]
    assert len(found) == learns
    if learns:
        (belief,) = corrections(effects)
        heading = belief.world_from_robot(stage().world).heading_rad
        assert found[0].value == drift.update(robot().actuator, heading,
                                              math.sqrt(2.0) * belief.sigma_rad)
        assert found[0].value.curvature_per_m > 0.0  # it turned further left than the wheels say
        assert reasons(found[0]) == {"Drift-1", "Hypothesis"}


@pytest.mark.parametrize(("magnitude", "is_kept"), [(1.0, False), (1e9, True)])
def test_a_difference_beyond_its_bound_is_left_to_climb(magnitude: float, is_kept: bool) -> None:
    open_one = Discrepancy(Level.ACTION, "before", magnitude, (5.0, 30.0), "px")
    effects = follow(7, doubt=open_one)
    found = [e for e in effects if isinstance(e.value, Discrepancy)]
    assert len(found) == (not is_kept)
    assert all(isinstance(e, Revise) and e.entry.id == "Discrepancy-1" for e in found)


def test_few_landmarks_are_added_to_and_many_are_not() -> None:
    """Below the least always; from enough on never; between them below a part of those at the last renewal."""
    for found, taken, is_renewed in ((MIN_LANDMARKS - 1, 0, True), (MIN_LANDMARKS, 0, False),
                                     (6, 2 * 6, False), (6, 2 * 6 + 1, True)):
        effects = follow(found, taken=taken)
        (tracks,) = [value for value in written(effects) if isinstance(value, Tracks)]
        cut = [t for t in tracks.items if t.template_frame == "CameraPicture-2"]
        assert bool(cut) == is_renewed, (found, taken)
        assert tracks.taken == (len(tracks.items) if is_renewed else taken)
        assert {a.frame for a in tracks.anchors} == {t.template_frame for t in tracks.items}


def test_the_part_that_must_agree_is_enough() -> None:
    assert MIN_AGREEING_PART * 6 == 2.0
    assert math.inf not in [one.magnitude for one in discrepancies(follow(2, 4))]


@pytest.mark.parametrize("taken", [0, 6, 20, 60])
@pytest.mark.parametrize("more", [-1, 0, 1, 5])
def test_landmarks_are_taken_anew_where_fewer_are_left_than_serve(
    taken: int, more: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those count that should be in sight, were not missed too often, and whose template is of near here."""
    least = max(MIN_LANDMARKS, math.ceil(min(ENOUGH_LANDMARKS, MIN_REMAINING_PART * taken)))
    most = MAX_MISSES

    def follow(expected: bool, misses: int, frame: str) -> Any:
        return SimpleNamespace(expected=expected, track=SimpleNamespace(misses=misses, template_frame=frame))

    monkeypatch.setattr(correlator_tracker, "find_near_frames", lambda *_: {"near"})
    monkeypatch.setattr(correlator_tracker, "with_anchors", lambda *_: "as they are")
    monkeypatch.setattr(correlator_tracker, "find_camera", lambda _: None)
    monkeypatch.setattr(correlator_tracker, "compute_camera_covariance", lambda *_: None)
    monkeypatch.setattr(correlator_tracker, "take_new", lambda *_: "again")
    old = SimpleNamespace(value=SimpleNamespace(anchors=(), taken=taken))
    case: Any = SimpleNamespace(frame=SimpleNamespace(id="CameraPicture-9"), old=old,
                                belief=SimpleNamespace(seeing=SimpleNamespace(world=None), view=None))
    belief: Any = SimpleNamespace(world_from_robot=lambda _: None)
    useless = [follow(False, 0, "near"), follow(True, most, "near"), follow(True, 0, "far")]
    followed = [*useless, *[follow(True, most - 1, "near")] * (least + more)]
    found: Any = CorrelatorTracker()._renew(case, np.zeros((2, 2), np.uint8), followed, belief)
    assert (found != "again") == (more >= 0)


def test_it_keeps_the_laws_of_all_sources() -> None:
    for found, hidden in ((7, 0), (0, 6)):
        check_source(CorrelatorTracker, *picture_of(found, hidden))
