"""A lost robot at its bounds: what is believed of a place just below and just above each number that decides it.

A table of boards or results, and the decision that follows. Both sides of each bound must occur.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blackboard import Level
from experiments.generated.floors import generated_floor
from knowledge_sources.methods.belief import MAX_SLIP_CHI2, MIN_P_BELIEVED, SLIP_SIGMA_M, SLIP_SIGMA_RAD
from knowledge_sources.methods.features import MIN_BRIGHTNESS, MIN_CONTRAST
from knowledge_sources.methods.localization import (
    ALIKE_LOG_NOISE,
    LOST_AGAIN_ODDS,
    MAX_FAR_PROBES,
    MAX_HYPOTHESES,
    MAX_SEARCHED_VIEWS,
    MIN_LOG_LIKELIHOOD,
    MIN_P_SURE,
    MIN_VIEWS,
    P_STATED,
    REFUTING_LOG_RATIO,
    LocalizationStatus,
    StatedPlace,
    compute_prior,
    describe,
    find_far_action,
    place_search,
    prefer_reachable,
    weigh_prior,
)
from knowledge_sources.methods.localization.global_localization import (
    LocalizationResult,
    PlaceCandidate,
    decide,
    rank_candidates,
)
from knowledge_sources.methods.localization.next_view import SensingAction
from knowledge_sources.methods.localization.none_of_these import MIN_P_PLACE, compute_p_place
from knowledge_sources.methods.localization.place_odds import FAR_FROM_CHANCE_LOG, compute_place_odds, is_within_reach
from knowledge_sources.methods.localization.refinement import PoseLikelihood
from knowledge_sources.reads import count_refuted, find_p_not_alias, find_p_there
from knowledge_sources.reads import is_dark as is_picture_dark
from knowledge_sources.reads.place_believed import MIN_P_ALIAS, P_DISPLACED_TO_ALIAS
from world_models.actuator import ActuatorModel
from world_models.camera import Camera, CameraMount
from world_models.entries import AliasOdds, Discrepancy, PlaceOdds, Segments
from world_models.frames import Pose2
from world_models.robot import RobotModel

FOUND, PROBE, AMBIGUOUS = LocalizationStatus.FOUND, LocalizationStatus.PROBE, LocalizationStatus.AMBIGUOUS
LOOKS = [Pose2(0.0, 0.0, 0.5 * k) for k in range(8)]
SMALL = 1e-6
FAR = FAR_FROM_CHANCE_LOG
ACTION = SensingAction(0.3, 0.6, 1.0)
ROBOT = RobotModel(generated_floor(11, 4, symmetric=True).world, Camera.from_field_of_view(1.1), CameraMount(1.0, 0.1),
                   ActuatorModel())


def place(x_m: float = 2.0, log: float = 40.0, accepted: bool = True, room: str = "corridor-0") -> PlaceCandidate:
    likelihood = PoseLikelihood(20, 20, log, 1.0)
    return PlaceCandidate(room, Pose2(x_m, 2.0, 0.0), np.diag([1e-4, 1e-4, 1e-5]), likelihood, accepted)


@pytest.mark.parametrize(("places", "looks", "status"), [
    ((place(),), MIN_VIEWS, FOUND),
    ((place(),), MIN_VIEWS + 1, FOUND),
    ((place(),), MIN_VIEWS - 1, PROBE),
    ((place(),), 1, PROBE),
    ((place(accepted=False),), MIN_VIEWS, PROBE),
    ((place(accepted=False),), MIN_VIEWS + 3, PROBE),
    ((), MIN_VIEWS, PROBE),
    ((place(2.0), place(6.0, accepted=False)), MIN_VIEWS, PROBE),
])
def test_one_accepted_place_is_found_after_enough_looks(
    places: tuple[PlaceCandidate, ...], looks: int, status: LocalizationStatus
) -> None:
    assert MIN_VIEWS > 1
    assert decide(ROBOT, places, LOOKS[:looks]).status is status


parts = st.floats(0.0, 1.0)


@given(log=st.floats(-30.0, 200.0), explained=parts, more=parts, missing=st.integers(0, 20))
def test_more_evidence_never_makes_none_of_these_likelier(
    log: float, explained: float, more: float, missing: int
) -> None:
    """Whatever share of its lines a place shows, by sums over its looks."""
    looks = (40, 36, 0.5 * log), (40, 20 - missing, 0.5 * log)
    weak, whole = (PoseLikelihood(80, 56 - missing, log, explained, seen) for seen in (looks, looks[:1]))
    p = compute_p_place(weak)
    assert 0.0 < p <= compute_p_place(whole)
    assert p <= compute_p_place(replace(weak, log_likelihood=log + 10.0 * more))
    assert p <= compute_p_place(replace(weak, explained=explained + more * (1.0 - explained)))


def test_what_wrong_places_show_is_not_believed_and_what_right_ones_show_is() -> None:
    """The best of a floor on which the robot was not, and where it was in a room of textures that nobody had told."""
    def rate(log: float, explained: float, *looks: tuple[int, int, float]) -> float:
        return compute_p_place(PoseLikelihood(45, 24, log, explained, looks))

    wrong, right = ((9.0, 0.51), (12.0, 0.12), (18.9, 0.2), (16.9, 0.35)), ((40.0, 0.04), (31.0, 0.15), (24.0, 0.35))
    assert all(rate(*seen) < MIN_P_PLACE for seen in wrong) and all(rate(*seen) >= MIN_P_PLACE for seen in right)
    assert rate(30.0, 0.3, (40, 36, 30.0), (20, 4, 0.0)) < MIN_P_PLACE <= rate(30.0, 0.3)  # one look tells against it
    assert rate(80.0, 0.3, (40, 36, 80.0), (20, 0, 0.0)) >= MIN_P_PLACE  # which something may have hidden


def test_unlikely_places_are_dropped_and_refuted_ones_unless_they_look_alike() -> None:
    def rank(*logs: float, alike: bool = False, looks: int = 1) -> list[float]:
        found = [place(2.0 + k, log) for k, log in enumerate(logs)]
        return [c.likelihood.log_likelihood for c in rank_candidates(found, lambda one, other: alike, looks)]

    low = MIN_LOG_LIKELIHOOD
    assert rank(low + SMALL) == [low + SMALL] and rank(low - SMALL) == []
    near, far = 50.0 - REFUTING_LOG_RATIO + SMALL, 50.0 - REFUTING_LOG_RATIO - SMALL
    assert rank(50.0, near) == [50.0, near] and rank(50.0, far) == [50.0]
    for looks in (1, 2, 7):  # of places that look alike the noise of every look may have pointed one way
        bound = 50.0 - REFUTING_LOG_RATIO - looks * ALIKE_LOG_NOISE
        assert rank(50.0, bound + SMALL, alike=True, looks=looks) == [50.0, bound + SMALL]
        assert rank(50.0, bound - SMALL, alike=True, looks=looks) == [50.0]
    many = [50.0 - SMALL * k for k in range(MAX_HYPOTHESES + 3)]
    assert rank(*many) == many[:MAX_HYPOTHESES]


def test_one_look_of_which_half_is_missing_refutes_where_another_place_shows_it() -> None:
    """Sums over looks hide it: as much is missing in a single look as in the whole at a wrong place."""
    def seen(x_m: float, *looks: tuple[int, int, float]) -> PlaceCandidate:
        return replace(place(x_m), likelihood=PoseLikelihood(40, 27, sum(look[2] for look in looks), 1.0, looks))

    def rank(*found: PlaceCandidate) -> list[float]:
        return [c.world_from_robot.x_m for c in rank_candidates(found, lambda one, other: False, len(found))]

    whole, half = seen(2.0, (20, 17, 14.0), (20, 17, 14.0)), seen(4.0, (20, 18, 16.0), (20, 10, 5.0))
    assert rank(whole, half) == [2.0]
    better = seen(4.0, (20, 20, 40.0), (20, 10, 5.0))
    assert rank(whole, better) == [4.0, 2.0]  # the likeliest refutes no place that shows what itself does not
    assert rank(seen(2.0, (20, 10, 4.0), (20, 17, 14.0)), better) == [4.0, 2.0]  # a look each: neither is right


HERE = StatedPlace(Pose2(2.0, 2.0, 0.0), np.diag([1e-4, 1e-4, 1e-5]), 0.5)


def find_prior_probability(p_told: float, logs: tuple[float, float]) -> float:
    return compute_place_odds(logs, [True, False], [False, False], p_told)[0]


@pytest.mark.parametrize(("tied", "bound"), [(True, MIN_P_BELIEVED), (False, MIN_P_SURE)])
def test_the_told_place_is_believed_at_the_stated_odds(tied: bool, bound: float) -> None:
    """By the prior alone, with two places of equal pictures: the posterior is the prior."""
    two = (place(2.0), place(9.0))
    seen = LocalizationResult(AMBIGUOUS if tied else PROBE, two, None if tied else SensingAction(1.0, 0.0, 1.0))

    def weigh(p_told: float, looks: int = MIN_VIEWS, result: LocalizationResult = seen) -> LocalizationStatus:
        return weigh_prior(result, replace(HERE, p_prior=p_told), lambda one, other: False, looks).status

    above, below = bound + 0.5 * (1.0 - bound), bound - 1e-3
    assert find_prior_probability(above, (40.0, 40.0)) == pytest.approx(above)
    assert weigh(above) is FOUND and weigh(below) is seen.status
    assert weigh(above, MIN_VIEWS - 1) is seen.status
    doubtful = replace(seen, candidates=(place(2.0, accepted=False), place(9.0)))
    assert weigh(above, result=doubtful) is seen.status
    elsewhere = replace(seen, candidates=(place(9.0), place(12.0)))
    assert weigh(above, result=elsewhere).name == seen.status.name
    assert MIN_P_BELIEVED < MIN_P_SURE


@pytest.mark.parametrize(("log", "looks", "x_m", "expected"), [
    (FAR, MAX_SEARCHED_VIEWS, 2.0, FOUND), (FAR - SMALL, 9, 2.0, PROBE),
    (FAR, MAX_SEARCHED_VIEWS - 1, 2.0, PROBE), (2.0 * FAR, 9, 9.0, PROBE)])
def test_where_it_was_told_to_be_it_need_only_be_far_from_chance(
    log: float, looks: int, x_m: float, expected: LocalizationStatus
) -> None:
    """A model that is inexact lacks so many lines that no share of them is enough; elsewhere that rules a place out."""
    seen = LocalizationResult(PROBE, (place(x_m, log, accepted=False),), SensingAction(1.0, 0.0, 1.0))
    assert weigh_prior(seen, replace(HERE, p_prior=0.9), lambda one, other: False, looks).status is expected


def test_a_place_is_the_told_one_up_to_the_stated_distance() -> None:
    covariance = np.diag([0.02, 0.03, 0.01])
    beyond = np.diag(np.square([SLIP_SIGMA_M, SLIP_SIGMA_M, SLIP_SIGMA_RAD]))
    sigma_m = float(np.sqrt((2.0 * covariance + beyond)[0, 0]))
    for part, is_there in ((0.999, True), (1.001, False)):
        pose = Pose2(part * sigma_m * np.sqrt(MAX_SLIP_CHI2), 0.0, 0.0)
        assert is_within_reach(pose, covariance, Pose2(0.0, 0.0, 0.0), covariance) is is_there


def test_each_time_it_was_lost_again_the_told_place_is_less_likely() -> None:
    odds = [p / (1.0 - p) for p in (compute_prior(times) for times in range(4))]
    assert odds[0] == pytest.approx(P_STATED / (1.0 - P_STATED))
    assert [b / a for a, b in pairwise(odds)] == pytest.approx([LOST_AGAIN_ODDS] * 3)


class Reach:
    """A building in which wheels lead to some rooms."""

    def __init__(self, *rooms: str) -> None:
        self.rooms = rooms

    def route(self, origin: str, room: str) -> object:
        return () if room in self.rooms else None


@pytest.mark.parametrize(("reach", "places", "status", "room"), [
    (("a",), (place(room="a"), place(room="b")), FOUND, "a"),
    (("b",), (place(room="a"), place(room="b")), FOUND, "b"),
    (("a",), (place(room="a", accepted=False), place(room="b")), AMBIGUOUS, ""),
    (("a",), (place(room="a", accepted=False),), AMBIGUOUS, ""),
    (("a", "b"), (place(room="a"), place(room="b")), AMBIGUOUS, ""),
    ((), (place(room="a"), place(room="b")), AMBIGUOUS, ""),
])
def test_the_only_place_within_reach_is_believed_if_it_stands_by_itself(
    reach: tuple[str, ...], places: tuple[PlaceCandidate, ...], status: LocalizationStatus, room: str
) -> None:
    building: Any = Reach(*reach)
    found = prefer_reachable(building, LocalizationResult(AMBIGUOUS, places), "here")
    assert found.status is status
    assert status is not FOUND or [c.room for c in found.candidates] == [room]


@pytest.mark.parametrize(("accepted", "status", "looks", "has_next", "asks"), [
    (2, AMBIGUOUS, MIN_VIEWS, True, True), (3, AMBIGUOUS, MIN_VIEWS, True, True),
    (1, AMBIGUOUS, MIN_VIEWS, True, False), (2, FOUND, MIN_VIEWS, True, False),
    (2, AMBIGUOUS, MIN_VIEWS - 1, True, False), (2, PROBE, MIN_VIEWS, False, True),
    (2, PROBE, MAX_SEARCHED_VIEWS - 1, True, False), (2, PROBE, MAX_SEARCHED_VIEWS, True, True),
    (2, PROBE, MAX_FAR_PROBES - 1, True, True), (2, PROBE, MAX_FAR_PROBES, True, False)])
def test_a_far_view_is_looked_for_between_places_that_nothing_near_tells_apart(
    accepted: int, status: LocalizationStatus, looks: int, has_next: bool, asks: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(place_search, "choose_far_action", lambda *given: asked.append(given) or ACTION)
    places = (*(place(2.0 + 4.0 * k) for k in range(accepted)), place(20.0, accepted=False))
    result = LocalizationResult(status, places, ACTION if has_next else None)
    found = find_far_action(ROBOT, result, LOOKS[:1] * looks, ["corridor-0"])
    assert (found is ACTION) == bool(asked) == asks
    if asks:
        assert [h.world_from_robot for h in asked[0][1]] == [c.world_from_robot for c in places]


@pytest.mark.parametrize("degrees", [30.0, -30.0])
@pytest.mark.parametrize("move_m", [0.0, 0.6])
def test_what_is_said_of_a_probe_is_what_is_done(degrees: float, move_m: float) -> None:
    action = SensingAction(math.radians(degrees), move_m, 1.0)
    for is_far in (False, True):
        said = describe(LocalizationResult(PROBE, (place(),), action), is_far=is_far)
        assert f"a turn by {degrees:.0f} degrees" in said and (f"a move of {move_m:.1f} m" in said) == (move_m > 0.0)
        assert ("view that tells" in said) == is_far


def test_a_dark_frame_is_dark_by_contrast_and_brightness_together() -> None:
    def is_dark(contrast: float, brightness: float) -> bool:
        empty = np.zeros((0, 2, 2))
        return is_picture_dark(Segments("CameraPicture-1", "", empty, np.zeros(0), contrast, brightness))

    assert is_dark(MIN_CONTRAST - SMALL, MIN_BRIGHTNESS - SMALL)
    assert not is_dark(MIN_CONTRAST + SMALL, MIN_BRIGHTNESS - SMALL)
    assert not is_dark(MIN_CONTRAST - SMALL, MIN_BRIGHTNESS + SMALL)


def believing(p_twins: float | None = None, refuted: int | None = None, doubt: Any = None) -> Any:
    """A view of a board with these odds."""
    known = {
        AliasOdds: None if p_twins is None else SimpleNamespace(value=SimpleNamespace(probability=p_twins)),
        PlaceOdds: None if refuted is None else SimpleNamespace(value=SimpleNamespace(refuted=refuted), cycle=5),
    }
    return SimpleNamespace(latest=lambda kind: known[kind], newest=lambda index, level: doubt)


def test_the_prior_is_the_smaller_of_what_was_told_and_what_twins_leave() -> None:
    def find(p_twins: float | None, times: int) -> float:
        return find_p_there(believing(p_twins), times)

    assert find(None, 0) == pytest.approx(P_STATED)
    assert find(P_STATED - 0.1, 0) == pytest.approx(P_STATED - 0.1)
    assert find(min(1.0, P_STATED + 0.01), 0) == pytest.approx(P_STATED)
    assert find(0.0, 0) == MIN_P_ALIAS
    assert find(None, 1) < find(None, 0)


def test_against_aliases_all_pictures_count_up_to_what_is_sure() -> None:
    assert find_p_not_alias(believing()) == pytest.approx(P_STATED)
    assert find_p_not_alias(believing(refuted=1)) == pytest.approx(compute_prior(1))
    assert find_p_not_alias(believing(0.9)) == pytest.approx(0.9)
    assert find_p_not_alias(believing(1.0)) == pytest.approx(MIN_P_SURE)
    in_doubt = find_p_not_alias(believing(0.9, doubt=object()))
    assert in_doubt == pytest.approx(0.9 * (1.0 - P_DISPLACED_TO_ALIAS))


@pytest.mark.parametrize(("magnitude", "cycle", "counts"), [
    (41.0, 6, True), (41.0, 4, False), (math.inf, 6, False), (None, 6, False)])
def test_only_what_was_measured_speaks_against_a_place(magnitude: float | None, cycle: int, counts: bool) -> None:
    """Lost because nothing could be told is no evidence; nor is what was before the place was believed by odds."""
    cause = SimpleNamespace(value=Discrepancy(Level.PLAN, "it", magnitude, (0.0, 30.0), "px"))
    doubt: Any = SimpleNamespace(cycle=cycle, because=(SimpleNamespace(id="Discrepancy-1"),))
    view = believing(refuted=2)
    view.get = lambda name: cause
    assert count_refuted(view, doubt) == 2 + counts
    assert count_refuted(view) == 2 and count_refuted(believing(), doubt) == 0


def test_another_place_that_is_likelier_speaks_against_it() -> None:
    doubt: Any = SimpleNamespace(cycle=9, because=(SimpleNamespace(id="AliasOdds-1"),))
    view = believing(refuted=0)
    view.get = lambda name: SimpleNamespace(value=object())
    assert count_refuted(view, doubt) == 1
