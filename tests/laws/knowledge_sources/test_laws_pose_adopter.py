"""Laws of the pose adopter: the place that was found is the belief, whole, and the camera with which it was found."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Entry, Retract, Revise
from generated_boards import Bench, covariances, effect_on, made, poses, reasons
from harvey.testing import HALL, STUDY, check_source, plain_robot
from knowledge_sources.relocalizer.pose_adopter import pose_adopter
from world_models.entries import CameraState, Hypothesis, PlaceSearch, diagonal
from world_models.entries.location import Covariance
from world_models.frames import Pose2

SOURCE = pose_adopter
STEP = (0.01, -0.004, 0.0, 0.02, 0.0, 0.0, 0.0)


def find(bench: Bench, pose: Pose2, covariance: Covariance, *, as_nominal: bool = False, locale: str = HALL) -> tuple[
        Entry[Hypothesis], Entry[PlaceSearch]]:
    """A candidate, and the search that found it."""
    place = bench.put(Hypothesis(locale, pose, covariance, "relocalization", status="candidate", weight=0.6))
    return place, bench.put(PlaceSearch("found", "one place", None, as_nominal))


@settings(max_examples=40)
@given(poses, covariances, st.booleans(), st.sampled_from((HALL, STUDY)), st.booleans())
def test_the_belief_is_what_was_found_with_the_motions_it_had(
    pose: Pose2, covariance: Covariance, as_nominal: bool, locale: str, has_learnt: bool
) -> None:
    bench, robot = Bench(plain_robot()), plain_robot()
    _, report = bench.move()
    belief, doubt = bench.believe(motion=report.id), bench.doubt()
    told = bench.view["CameraState-1"]
    if has_learnt:
        bench.apply(Revise(told, told.value.moved(STEP), (told,)))
    place, search = find(bench, pose, covariance, as_nominal=as_nominal, locale=locale)
    effects = bench.ask(SOURCE, search)
    change = effect_on(effects, Hypothesis)
    assert change.entry.id == belief.id
    assert change.value == replace(
        place.value, status="held", weight=1.0, motion=report.id, correction=change.value.correction)
    before, after = (h.world_from_robot(robot.world) for h in (belief.value, place.value))
    dx, dy = after.x_m - before.x_m, after.y_m - before.y_m  # as seen from where it was believed to be
    c, s, by = math.cos(before.heading_rad), math.sin(before.heading_rad), change.value.correction
    assert (by.x_m, by.y_m) == pytest.approx((c * dx + s * dy, c * dy - s * dx), abs=1e-9)
    turn = after.heading_rad - before.heading_rad - by.heading_rad
    assert math.remainder(turn, math.tau) == pytest.approx(0.0, abs=1e-9)
    assert reasons(change) == {search.id, place.id, doubt.id, belief.id}
    (gone,) = [e for e in effects or () if isinstance(e, Retract)]
    assert gone.entry.id == place.id and reasons(gone) == {search.id}
    cameras = made(effects, CameraState)
    assert bool(cameras) == (as_nominal and has_learnt)
    if cameras:
        assert (cameras[0].lens, cameras[0].mount) == (told.value.lens, told.value.mount)
        assert reasons(effect_on(effects, CameraState)) == {search.id, told.id}
    bench.apply(*effects or ())
    assert bench.ask(SOURCE, search) is None


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    bench.doubt()
    place, search = find(bench, Pose2(3.0, 1.0, 0.5), diagonal(0.02, 0.01))
    check_source(SOURCE, bench, search, without=(place.id,))
