"""Laws of the milestone judge: verified, refuted or not testable just below and just above each number.

The verdicts of a table of weighed pictures; and, on the boards of a mission, how much evidence is asked for by whether
the robot is in doubt, has followed landmarks, or has not: each state has its own number, and that alone decides.
"""

from __future__ import annotations

import math
import re
from collections.abc import Hashable, Iterable, Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, NamedTuple, TypeVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Blackboard, Change, Effect, Entry, Index, Level, Post, Retract, Revise, View
from blackboard.board import TracedView
from experiments.generated.missions import OFFICE
from generated_boards import effect_on, made, near, reasons
from harvey.simulation.simulated_run import run_mission
from harvey.testing import Bench, check_source, copy_of
from harvey.wiring import knowledge_sources
from knowledge_sources.methods.belief import (
    MAX_CAMERA_CHI2,
    MAX_SLIP_CHI2,
    MIN_P_BELIEVED,
    SLIP_SIGMA_M,
    SLIP_SIGMA_RAD,
    to_log_odds,
    update,
)
from knowledge_sources.methods.calibration import compute_camera_covariance
from knowledge_sources.methods.features import MIN_CONTRAST
from knowledge_sources.methods.localization import MAX_ALIKE_LOG_RATIO
from knowledge_sources.methods.localization.aliasing import AliasView
from knowledge_sources.methods.verification import (
    MAX_FOLLOWED_PX,
    MAX_INEXACT_LOOKS,
    MAX_MILESTONE_LOOKS,
    MIN_MATCHED_LINES,
    MOTION_TOLERANCE_SIGMAS,
    P_WRONG_FOLLOWED,
    P_WRONG_IN_DOUBT,
    P_WRONG_UNFOLLOWED,
    POSE_CONFIDENCE,
    Verdict,
    Weighed,
    is_last_look,
    judge_place,
)
from knowledge_sources.methods.verification import weigh as weigh_method
from knowledge_sources.methods.verification.pose_confidence import compute_motion_tolerance_px
from knowledge_sources.methods.verification.weigh import (
    MAX_P_UNMISTAKABLE,
    OTHER_DIRECTIONS,
    _find_tolerance_px,
    _median_shift,
    _sum_log_odds,
)
from knowledge_sources.milestone.milestone_judge import Case, MilestoneJudge
from knowledge_sources.reads import (
    find_belief,
    find_camera,
    find_followed,
    find_p_not_alias,
    open_discrepancies,
    place_believed,
)
from knowledge_sources.reads.place_believed import MAX_P_FALSE_CLEAR, MAX_P_FALSE_UNMISTAKABLE, MAX_P_RIVAL
from knowledge_sources.reads.questions import HELD, MIN_FOLLOWED_LANDMARKS
from knowledge_sources.settings import DEFAULT, Settings
from sim.scenario import parse_scenario
from sim.stage import build_stage
from world_models.camera import YAW
from world_models.entries import (
    ALERT_LIMIT_M,
    OPEN,
    Certificate,
    Difference,
    Discrepancy,
    Hypothesis,
    Milestone,
    MilestoneVerdict,
    Protection,
    Rival,
    RivalKind,
    Segments,
    Track,
    Tracks,
    Travel,
    diagonal,
)
from world_models.frames import Pose2

T = TypeVar("T")
PLAN = DEFAULT.plan
SMALL = 1e-6
NO_LINES = np.zeros((0, 2, 2))
WIDE_RAD = OTHER_DIRECTIONS.turn_rad


def weigh(**changed: Any) -> Any:
    """A picture that is verified as it is, otherwise as said."""
    contrast = changed.pop("contrast", 40.0)
    matched = changed.pop("matched", 20)
    agreement = SimpleNamespace(matched=matched, visible=20, chance=0.2)
    plain = {
        "segments": Segments("CameraPicture-1", "Milestone-1", NO_LINES, np.zeros(0), contrast), "expected": 20,
        "patterned": changed.pop("patterned", 0),
        "lines": SimpleNamespace(agreement=agreement, coverage=0.9), "faces": changed.pop("faces", NO_FACES),
        "p_by_looks": 0.5 * POSE_CONFIDENCE.accept, "p_wrong": 0.1 * POSE_CONFIDENCE.accept,
        "most_p_wrong": POSE_CONFIDENCE.accept, "shift_px": 3.0, "tolerance_px": 10.0,
        "is_weak": False, "is_inexact": False, "camera_chi2": 0.0, "is_camera_known": True,
    }
    return SimpleNamespace(**(plain | changed))


NO_FACES: Any = SimpleNamespace(is_testable=False, agreeing=0.0, count=0)
FEW, REFUTE, CHI2 = MIN_MATCHED_LINES, POSE_CONFIDENCE.refute, MAX_CAMERA_CHI2
UNSURE = {"p_wrong": POSE_CONFIDENCE.accept + SMALL}


@pytest.mark.parametrize(("changed", "verdict"), [
    ({}, "verified"),
    ({"contrast": MIN_CONTRAST + SMALL}, "verified"),
    ({"contrast": MIN_CONTRAST - SMALL}, "not testable"),
    ({"expected": FEW}, "verified"),
    ({"expected": FEW - 1}, "not testable"),
    ({"matched": FEW}, "verified"),
    ({"matched": FEW - 1}, "not testable"),
    (UNSURE, "not testable"),
    ({"p_by_looks": REFUTE - SMALL, **UNSURE}, "not testable"),
    ({"p_by_looks": REFUTE + SMALL, **UNSURE}, "refuted"),
    ({"p_by_looks": REFUTE + SMALL, **UNSURE, "is_inexact": True}, "not testable"),
    ({"p_by_looks": REFUTE + SMALL, **UNSURE, "is_camera_known": False}, "not testable"),
    ({"camera_chi2": CHI2 - SMALL}, "verified"),
    ({"camera_chi2": CHI2 + SMALL}, "refuted"),
    ({"shift_px": 10.0 - SMALL}, "verified"),
    ({"shift_px": 10.0 + SMALL}, "refuted"),
    ({"shift_px": math.inf}, "refuted"),
    ({"shift_px": 10.0 + SMALL, **UNSURE}, "not testable"),
])
def test_the_verdict_just_below_and_just_above_each_bound(changed: dict[str, Any], verdict: str) -> None:
    assert judge_place(weigh(**changed)).kind == verdict


@given(st.integers(0, 60), st.floats(1e-9, 1.0), st.floats(1e-9, 1.0), st.sampled_from([POSE_CONFIDENCE.accept, 0.03]),
       st.floats(0.0, 60.0), st.booleans())
@settings(max_examples=200, deadline=None)
def test_a_verdict_says_one_count_of_lines_and_the_bound_that_decided(
    matched: int, p_by_looks: float, p_wrong: float, most: float, shift_px: float, is_inexact: bool
) -> None:
    """Whatever it is, its reason has the figures of its fields, and no others of their kind."""
    said = judge_place(weigh(matched=matched, p_by_looks=p_by_looks, p_wrong=p_wrong, most_p_wrong=most,
                             shift_px=shift_px, is_inexact=is_inexact))
    assert re.findall(r"(\d+) of (\d+) lines", said.reason) == [(str(matched), "20")]
    told = re.findall(r"another place: ([^ ]+), (?:allowed|refuted from) (\S+)", said.reason)
    assert "e+" not in said.reason
    assert not told or [float(one.rstrip("%")) / (100.0 if "%" in one else 1.0) for one in told[0]] == pytest.approx(
        [said.p_wrong, said.most_p_wrong], rel=0.05)
    is_by_odds = said.kind == "verified" or p_by_looks >= REFUTE or p_wrong > most
    assert bool(told) is is_by_odds
    if said.kind == "verified" or not is_by_odds:
        assert said.p_wrong <= said.most_p_wrong
    else:
        assert said.p_wrong >= said.most_p_wrong


@pytest.mark.parametrize(("is_inexact", "most"), [(False, MAX_MILESTONE_LOOKS), (True, MAX_INEXACT_LOOKS)])
def test_it_looks_again_as_often_as_it_may(is_inexact: bool, most: int) -> None:
    for tried in range(most + 2):
        milestone: Any = SimpleNamespace(is_inexact=is_inexact, tried=(0.0,) * tried)
        assert is_last_look(milestone) is (tried + 1 >= most)


@pytest.mark.parametrize("p", [0.001, 0.1, 0.5, 0.9])
@pytest.mark.parametrize("log_odds", [-3.0, 0.0, 0.5, 3.0])
def test_what_was_told_changes_the_odds_by_bayes_rule(p: float, log_odds: float) -> None:
    updated = update(p, log_odds)
    assert updated / (1.0 - updated) == pytest.approx(p / (1.0 - p) * math.exp(log_odds))


class StateView(TracedView):
    """The board as if the robot were in doubt or not, had followed so many landmarks or none, and its heading were as
    uncertain as said.
    """

    __slots__ = ("_belief", "_doubt", "_tracks")

    def __init__(self, board: Blackboard, in_doubt: bool, followed: int, sigma_rad: float | None = None) -> None:
        super().__init__(board, ())
        held = find_belief(board.view)
        if held is not None and sigma_rad is not None:
            basis, covariance = "odometry", diagonal(1e-3, sigma_rad)
            held = held._replace(value=replace(held.value, covariance=covariance, basis=basis))
        self._belief = held
        doubt = Discrepancy(Level.PLAN, "a milestone is elsewhere", 9.0, (0.0, 30.0), "px")
        self._doubt = Entry("Discrepancy-999", 0, doubt, "test", 0, ()) if in_doubt else None
        track = Track("a", (0.0, 0.0, 0.0), "CameraPicture-1", (0.0, 0.0), 1.0, (0.0, 0.0), (1.0, 1.0), 1.0, 0.3)
        self._tracks = Entry("Tracks-999", 0, Tracks("CameraPicture-1", 10, (track,) * followed), "test", 0, ())

    def newest(self, index: Index[T], key: Hashable) -> Entry[T] | None:
        doubt: Any = self._doubt
        belief: Any = self._belief
        if index is HELD:
            return belief  # type: ignore[no-any-return]
        return doubt if index is OPEN and key is Level.PLAN else super().newest(index, key)

    def newest_first(self, kind: type[T]) -> Iterator[Entry[T]]:
        held: Any = self._tracks
        return iter((held,)) if kind is Tracks else super().newest_first(kind)


def tune(**plan: float) -> Settings:
    return replace(DEFAULT, plan=replace(PLAN, **plan))


def find_prior_at_bound(p_false: float) -> float:
    """The probability of a wrong place before a picture, by which it is just accepted."""
    odds = POSE_CONFIDENCE.accept / (1.0 - POSE_CONFIDENCE.accept) * (1.0 - p_false) / p_false
    return odds / (1.0 + odds)


def case_on(view: View, trigger: Change) -> Case:
    """What the judge finds for a pose fix."""
    case = MilestoneJudge().bind(view, trigger)
    assert case is not None
    return case


class Judged(NamedTuple):
    """A judgement of a mission: the board before it, a copy, and what woke the judge."""

    board: Blackboard
    trigger: Change


@pytest.fixture(scope="module")
def judged() -> list[Judged]:
    """The judgements of a mission."""
    found: list[Judged] = []

    def sources(settings: Settings) -> list[Any]:
        out: list[Any] = list(knowledge_sources(settings))
        judge = next(source for source in out if isinstance(source, MilestoneJudge))
        bind, act = judge.bind, judge.act
        bound: list[Change] = []

        def remember(view: View, trigger: Change) -> Any:
            bound[:] = [trigger]
            return bind(view, trigger)

        def noted(view: View, case: Any) -> Iterable[Effect]:
            found.append(Judged(copy_of(view._board), bound[0]))
            return act(view, case)

        judge.bind, judge.act = remember, noted
        return out

    run_mission(build_stage(parse_scenario(OFFICE)), 3, sources=sources)
    return found


def test_each_state_of_the_robot_asks_for_its_own_evidence(judged: list[Judged]) -> None:
    """In doubt, with landmarks followed, and without: on the board of each judgement of a mission."""
    least, checked = MIN_FOLLOWED_LANDMARKS, []
    states = {"p_wrong_in_doubt": ((True, least), (True, 0)), "p_wrong_followed": ((False, least), (False, least + 1)),
              "p_wrong_unfollowed": ((False, 0), (False, least - 1))}
    for board, trigger in judged:
        for own, boards in states.items():
            for in_doubt, followed in boards:
                view = StateView(board, in_doubt, followed, 1e-3)
                weighed = MilestoneJudge().weigh(view, case_on(view, trigger))
                assert weighed.is_weak is (in_doubt or followed < least)
                bound = find_prior_at_bound(weighed.p_false)
                for value, enough in ((bound * 0.99, True), (bound + 0.01 * (1.0 - bound), False)):
                    others = {name: (0.999 if enough else 1e-9) for name in states if name != own}
                    with pytest.MonkeyPatch.context() as patch:
                        for name, p in {**others, own: value}.items():
                            patch.setattr(weigh_method, name.upper(), p)
                        weighed = MilestoneJudge().weigh(view, case_on(view, trigger))
                    assert (weighed.p_wrong <= weighed.most_p_wrong) is enough, (own, in_doubt, followed, value)
                checked.append(own)
    assert set(checked) == set(states) and len(checked) >= 6


def test_where_no_other_view_is_left_all_looks_together_need_only_be_believed(judged: list[Judged]) -> None:
    """By the standard of the search that would find the same place again; before the last look by the stricter one."""
    most, believed, checked = MAX_MILESTONE_LOOKS, 1.0 - MIN_P_BELIEVED, set()
    for board, trigger in judged:
        view = StateView(board, True, 0)
        case = case_on(view, trigger)
        plain = case.milestone.value
        alone = to_log_odds(MilestoneJudge().weigh(view, case).p_false) + to_log_odds(P_WRONG_IN_DOUBT)
        for tried in (most - 2, most - 1):
            for wanted in (0.9 * POSE_CONFIDENCE.accept, 0.9 * believed, 1.1 * believed):
                told = (to_log_odds(wanted) - alone, *(0.0,) * (tried - 1))
                behind = tuple(plain.look_heading_rad + math.pi + k for k in range(tried))
                value = replace(plain, tried=behind, log_odds_so_far=told, displacement_modes=(), displacements=())
                looked: Any = SimpleNamespace(value=value)
                weighed = MilestoneJudge().weigh(view, case._replace(milestone=looked))
                assert weighed.p_wrong == pytest.approx(wanted, rel=1e-6)
                may_be = believed if tried + 1 == most else POSE_CONFIDENCE.accept
                assert weighed.most_p_wrong == may_be
                checked.add((tried, wanted <= may_be))
    assert len(checked) == 4


def test_landmarks_that_were_followed_speak_for_no_place_where_the_belief_leaves_much_open(
    judged: list[Judged]
) -> None:
    """And what is surely seen may lie as far off as the belief leaves open, though the plan level's window is less.

    Along level lines, which are half of some views, nothing moves as the robot turns: so the uncertainty is large.
    """
    least, judge, checked = MIN_FOLLOWED_LANDMARKS, MilestoneJudge(), []

    def check(board: Blackboard, trigger: Change) -> None:
        def weigh_at(sigma_rad: float) -> Weighed:
            view = StateView(board, False, least, sigma_rad)
            return judge.weigh(view, case_on(view, trigger))

        by_pixel = 1.0 / (MOTION_TOLERANCE_SIGMAS * weigh_at(1e-3).robot.camera.fx)
        sure, unsure = weigh_at(0.5 * MAX_FOLLOWED_PX * by_pixel), weigh_at(12.0 * MAX_FOLLOWED_PX * by_pixel)
        wide = weigh_at(16.0 * PLAN.max_deviation_px * by_pixel)
        checked.append((sure.is_weak, unsure.is_weak, wide.p_false <= POSE_CONFIDENCE.accept, wide.tolerance_px))

    for board, trigger in judged:
        check(board, trigger)
    assert any(is_sure for _, _, is_sure, _ in checked)
    for sure_is_weak, unsure_is_weak, is_sure, tolerance_px in checked:
        assert (sure_is_weak, unsure_is_weak) == (False, True)
        assert tolerance_px > 1.5 * PLAN.max_deviation_px if is_sure else tolerance_px == PLAN.max_deviation_px


def judge_on(one: Judged, view: View | None = None) -> tuple[Case, Weighed, tuple[Effect, ...]]:
    """What the judge finds on a board, how it weighs that, and what it makes of it."""
    judge, view = MilestoneJudge(), view or one.board.view
    case = case_on(view, one.trigger)
    return case, judge.weigh(view, case), tuple(judge.act(view, case))


@pytest.mark.parametrize("in_doubt", [False, True])
def test_what_it_writes_follows_from_the_verdict(judged: list[Judged], in_doubt: bool) -> None:
    """A certificate by fix and milestone; all else by that; the deviation as the plan level's, within its window."""
    for one in judged:
        board = copy_of(one.board)
        for doubt in board.view.where(Discrepancy, lambda d: d.level is Level.PLAN):
            board.apply([Retract(doubt)], author="test", cycle=10**6)
        if in_doubt:
            board.apply([Post(Discrepancy(Level.PLAN, "by a law", 9.0, (0.0, 30.0), "px"))], author="test", cycle=10**6)
        case, weighed, effects = judge_on(Judged(board, one.trigger))
        said = effect_on(effects, Certificate)
        followed = {entry.id for entry in (
            *find_followed(board.view), *board.view.all(Travel), *open_discrepancies(board.view))}
        assert reasons(said) == {case.fix.id, case.milestone.id, *followed}
        assert (said.value.milestone, said.value.fix) == (case.milestone.id, case.fix.id)
        off = case.fix.value.world_from_robot.minus(case.belief.value.world_from_robot(weighed.robot.world))
        assert said.value.deviation_m == pytest.approx(math.hypot(*off[:2]))
        assert said.value.deviation_rad == pytest.approx(off[2])
        judged_one = effect_on(effects, Milestone)
        assert judged_one.entry is case.milestone and reasons(judged_one) == {"Certificate"}
        assert judged_one.value == replace(case.milestone.value, status=said.value.verdict)
        found = effect_on(effects, Discrepancy)
        most_px = max(PLAN.max_deviation_px, weighed.tolerance_px)
        is_measured = said.value.verdict == "verified" or weighed.shift_px > most_px
        assert (found.value.level, found.value.unit, found.value.bounds) == (Level.PLAN, "px", (0.0, most_px))
        assert found.value.magnitude == (weighed.shift_px if is_measured else math.inf)
        assert reasons(found) == {"Certificate"} and isinstance(found, Revise) == in_doubt


@settings(max_examples=40)
@given(st.lists(st.tuples(*[st.floats(0.0, 200.0)] * 4, *[st.floats(-30.0, 30.0)] * 4, st.booleans()), max_size=7))
def test_how_far_lines_are_off_is_the_median_of_their_middles(lines: list[tuple[float, ...]]) -> None:
    """Turned about its middle a line is where it was; what is out of view tells nothing."""
    numbers = np.array([line[:8] for line in lines]).reshape(-1, 2, 2, 2)
    before, after = numbers[:, 0], numbers[:, 0] + numbers[:, 1]
    after[np.array([line[8] for line in lines], bool)] = np.nan
    off = [math.dist(a.mean(axis=0), b.mean(axis=0)) for a, b in zip(before, after, strict=True)
           if np.isfinite(b).all()]
    assert _median_shift(before, after) == (pytest.approx(float(np.median(off))) if off else math.inf)


@pytest.mark.parametrize("tolerance_px", [1.0, 99.0])
@pytest.mark.parametrize(("off", "verdict"), [(0.5, "verified"), (2.0, "refuted"), (0.5, "refuted"), (2.0, "verified"),
                                              (0.5, "not testable"), (2.0, "not testable")])
@pytest.mark.parametrize("is_last", [False, True])
def test_the_deviation_is_measured_where_the_place_is_known_or_is_beyond_the_window(
    judged: list[Judged], tolerance_px: float, off: float, verdict: MilestoneVerdict, is_last: bool
) -> None:
    """The window is the plan level's at least; where nothing was told and another look is left, nothing is said."""
    one, judge = judged[0], MilestoneJudge()
    view = one.board.view
    case, most_px = case_on(view, one.trigger), max(PLAN.max_deviation_px, tolerance_px)
    weighed = replace(judge.weigh(view, case), tolerance_px=tolerance_px, shift_px=off * most_px)
    tried = (1.0,) * (MAX_MILESTONE_LOOKS - 1 if is_last else 0)
    looked = replace(case.milestone.value, tried=tried, log_odds_so_far=(0.0,) * len(tried))
    milestone: Any = case.milestone._replace(value=looked)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(judge, "weigh", lambda *_: weighed)
        patch.setattr(judge, "_hold_against_others", lambda *_: Verdict(verdict, "so", 1e-3, 0.006))
        effects = tuple(judge.act(view, case._replace(milestone=milestone)))
    found = made(effects, Discrepancy)
    assert bool(found) == (verdict != "not testable" or is_last)
    if found:
        is_measured = verdict == "verified" or off > 1.0
        assert found[0].bounds == (0.0, most_px)
        assert found[0].magnitude == (pytest.approx(off * most_px) if is_measured else math.inf)


@pytest.mark.parametrize("in_doubt", [False, True])
@pytest.mark.parametrize("stands", [False, True])
@pytest.mark.parametrize("is_sure", [False, True])
@pytest.mark.parametrize("motion_px", [1.0, 1000.0])
def test_how_far_the_lines_may_be_by_all_that_it_depends_on(
    in_doubt: bool, stands: bool, is_sure: bool, motion_px: float
) -> None:
    """What the wheels can do, as it was put down, or the matcher's window: at most that, or for what is sure at least.
    """
    before: Any = SimpleNamespace(in_doubt=in_doubt, stands=stands)
    window_px, wheels_px = PLAN.max_deviation_px, DEFAULT.action.min_tolerance_px + motion_px
    wanted = {(False, False): min(wheels_px, window_px), (False, True): max(wheels_px, window_px)}.get(
        (in_doubt, is_sure), window_px)
    if stands:
        wanted = max(wheels_px, window_px) if in_doubt or is_sure else wheels_px
    assert _find_tolerance_px(before, motion_px, is_sure, DEFAULT) == pytest.approx(wanted)


def test_what_the_wheels_can_do_and_what_the_picture_leaves_open_count_together(judged: list[Judged]) -> None:
    """Twice as unsure a solution leaves as much more open as twice as unsure a belief.

    In an unmistakable place it is as much as what a search finds may be off, to be the place where it was tracked to.
    """
    asked, slipped = 0, 0
    judge = MilestoneJudge(tune(max_deviation_px=0.01))  # so small a window that it decides nothing
    for one in judged:
        view = StateView(one.board, False, 9, 0.02)
        case = case_on(view, one.trigger)
        for more in (0.0, 1e-2):
            fix = replace(case.fix.value, covariance=case.fix.value.covariance + np.diag([more, more, 1e-2 * more]))
            entry: Any = SimpleNamespace(value=fix, id=case.fix.id)
            weighed = judge.weigh(view, case._replace(fix=entry))
            if weighed.p_false <= POSE_CONFIDENCE.accept:
                slip, sigmas = np.zeros(3), MOTION_TOLERANCE_SIGMAS
                if weighed.p_wrong <= MAX_P_UNMISTAKABLE:
                    slip = np.square([SLIP_SIGMA_M, SLIP_SIGMA_M, SLIP_SIGMA_RAD])
                    sigmas = math.sqrt(MAX_SLIP_CHI2)
                open_px = sigmas / MOTION_TOLERANCE_SIGMAS * compute_motion_tolerance_px(
                    weighed.robot, np.array(case.milestone.value.expected), weighed.before,
                    weighed.covariance + fix.covariance + np.diag(slip))
                assert weighed.tolerance_px == pytest.approx(DEFAULT.action.min_tolerance_px + open_px)
                asked, slipped = asked + 1, slipped + bool(slip.any())
    assert asked > 1 and slipped


@pytest.mark.parametrize("more", [-0.5, 0.0, 3.0])
def test_where_the_yaw_of_the_camera_is_open_again_so_is_the_heading(judged: list[Judged], more: float) -> None:
    """The heading follows the camera; a yaw that is surer than before makes no heading surer."""
    one = judged[0]
    view = one.board.view
    case = case_on(view, one.trigger)
    known = compute_camera_covariance(find_camera(view))
    now = known.copy()
    now[YAW, YAW] *= 1.0 + more
    step = (0.004, -0.003, 0.002, 0.01, 0.0, 0.0, 0.0)
    fix = replace(case.fix.value, camera_step=step, camera_covariance=tuple(map(tuple, now.tolist())))
    entry: Any = SimpleNamespace(value=fix, id=case.fix.id)
    plain, weighed = MilestoneJudge().weigh(view, case), MilestoneJudge().weigh(view, case._replace(fix=entry))
    before = case.belief.value.covariance_world(plain.robot.world)
    was = find_camera(view).mount
    moved = was.tilt_rad + 0.004, was.roll_rad - 0.003, was.height_m + 0.01
    mount = weighed.robot.mount  # the picture is weighed with the camera as it was solved for
    assert (mount.tilt_rad, mount.roll_rad, mount.height_m) == pytest.approx(moved)
    assert np.allclose(weighed.covariance, before + np.diag([0.0, 0.0, max(more, 0.0) * known[YAW, YAW]]))


@pytest.mark.parametrize("there", ["here", "far"])
def test_where_as_much_agrees_at_a_candidate_of_a_search_nothing_is_verified(judged: list[Judged], there: str) -> None:
    asked = 0
    for one in judged:
        board = copy_of(one.board)
        belief = board.view.newest(HELD, True)
        assert belief is not None
        pose = belief.value.locale_from_robot
        pose = pose if there == "here" else Pose2(pose.x_m, pose.y_m, pose.heading_rad + math.pi)
        was = judge_on(one)
        if effect_on(was[2], Certificate).value.verdict != "verified":
            continue
        asked += 1
        board.apply([Post(Hypothesis(belief.value.locale, pose, diagonal(0.02, 0.01), "relocalization",
                                     status="candidate"))], author="test", cycle=10**6)
        said = effect_on(judge_on(Judged(board, one.trigger))[2], Certificate).value
        assert said.verdict == ("not testable" if there == "here" else "verified")
        assert there == "far" or (said.p_false == 0.5 and "Hypothesis-" in said.reason and "50%" in said.reason)
    assert asked > 0


@pytest.mark.parametrize(("kind", "p", "verdict"), [
    ("lens", MAX_P_RIVAL, "verified"), ("lens", MAX_P_RIVAL + SMALL, "not testable"), ("dirt", 1.0, "verified")])
def test_where_a_sense_may_tell_wrong_places_nothing_is_verified(
    judged: list[Judged], kind: RivalKind, p: float, verdict: str
) -> None:
    for one in (one for one in judged if effect_on(judge_on(one)[2], Certificate).value.verdict == "verified"):
        board = copy_of(one.board)
        differs = Difference("camera", (Rival(kind, "another", 1.0, p),), (), 0.0)
        board.apply([Post(differs)], author="test", cycle=10**6)
        said = effect_on(judge_on(Judged(board, one.trigger))[2], Certificate).value
        assert said.verdict == verdict and ("camera differs, another" in said.reason) == (verdict != "verified")


@pytest.mark.parametrize("margin", [-9.0, -1.0, 0.0, 1.0, 9.0])
@pytest.mark.parametrize("is_near", [False, True])
def test_a_place_that_repeats_itself_is_held_against_it_by_bayes_rule(
    judged: list[Judged], margin: float, is_near: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By how much more agrees here, up to what is chance; and by how much nearer to the belief this place is."""
    one, most = judged[0], MAX_ALIKE_LOG_RATIO
    view = StateView(one.board, True, 0)
    judge, case = MilestoneJudge(), case_on(view, one.trigger)
    weighed = replace(judge.weigh(view, case), p_false=1e-3, is_weak=True)
    near = Pose2(weighed.pose.x_m + 0.05, weighed.pose.y_m, weighed.pose.heading_rad)
    other = near if is_near else Pose2(weighed.pose.x_m + 3.0, weighed.pose.y_m, weighed.pose.heading_rad)
    monkeypatch.setattr(place_believed, "list_aliases", lambda *_, **__: [AliasView(other, margin)])
    verdict = judge._hold_against_others(view, case, weighed, Verdict("verified", "so", 1e-3, MAX_P_RIVAL))
    spread = weighed.covariance + case.fix.value.covariance + 1e-9 * np.eye(3)
    (own, away) = (float(d @ np.linalg.solve(spread, d)) for d in (
        pose.minus(weighed.before) for pose in (weighed.pose, other)))
    p_there = find_p_not_alias(view)
    share = 0.5 * (1.0 - p_there)
    against = (p_there * math.exp(-0.5 * max(away - own, 0.0)) + share) * math.exp(min(max(-margin, -most), most))
    p = against / (p_there + share + against)
    assert verdict.kind == ("verified" if p <= MAX_P_RIVAL else "not testable")
    assert verdict.p_wrong == pytest.approx(1e-3 if p <= MAX_P_RIVAL else p, rel=1e-3)
    assert verdict.p_alias == pytest.approx(0.0 if p <= MAX_P_RIVAL else p, rel=1e-3)


@pytest.mark.parametrize(("p_false", "is_weak", "asked"), [
    (MAX_P_FALSE_UNMISTAKABLE * 0.99, True, None), (MAX_P_FALSE_UNMISTAKABLE * 1.01, True, False),
    (MAX_P_FALSE_UNMISTAKABLE * 1.01, False, None), (MAX_P_FALSE_CLEAR * 0.99, True, False),
    (MAX_P_FALSE_CLEAR * 1.01, True, True), (MAX_P_FALSE_CLEAR * 1.01, False, None)])
def test_how_far_it_is_held_against_the_rest_of_the_room(
    judged: list[Judged], p_false: float, is_weak: bool, asked: bool | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is unmistakable, or was expected, is not; what is clear with its repetitions; else with the whole room."""
    one, searched = judged[0], []
    judge, view = MilestoneJudge(), one.board.view
    case = case_on(view, one.trigger)
    weighed = replace(judge.weigh(view, case), p_false=p_false, is_weak=is_weak)
    monkeypatch.setattr(place_believed, "list_aliases", lambda *_, search, **__: searched.append(search) or [])
    assert judge._hold_against_others(view, case, weighed, Verdict("verified", "so", p_false, 1.0)).kind == "verified"
    assert searched == ([] if asked is None else [asked])


@given(st.floats(0.0, 0.5), st.floats(0.0, 0.5), st.sampled_from(("verified", "refuted", "not testable")),
       st.integers(1, 4), st.booleans())
def test_a_place_that_may_be_off_by_more_than_the_alert_limit_is_looked_at_once_more(
    place_m: float, before_m: float, kind: MilestoneVerdict, look: int, is_camera_known: bool
) -> None:
    """Not after the last look, not where the belief is no better, not while the picture has to tell of the camera.

    But it is always said.
    """
    milestone = Milestone("PlanSketch-1", 0, "M1", 0.0, tried=(0.0,) * (look - 1))
    case: Any = SimpleNamespace(
        fix=SimpleNamespace(value=SimpleNamespace(protection=Protection(place_m, 0.01, "hall/north-wall"))),
        milestone=SimpleNamespace(value=milestone),
        belief=SimpleNamespace(value=SimpleNamespace(protection_m=before_m)))
    weighed: Any = SimpleNamespace(is_camera_known=is_camera_known)
    before = Verdict(kind, "as it is", 0.001, 0.01)
    after = MilestoneJudge(DEFAULT)._hold_against_single_lies(case, weighed, before)
    if place_m <= ALERT_LIMIT_M or kind != "verified":
        assert after == before
        return
    is_asked_again = is_camera_known and before_m <= ALERT_LIMIT_M and not is_last_look(milestone)
    assert after.kind == ("not testable" if is_asked_again else "verified")
    assert "alert limit" in after.reason and "north-wall" in after.reason
    assert (after.p_wrong, after.most_p_wrong) == (before.p_wrong, before.most_p_wrong)


def test_it_keeps_the_laws_of_all_sources(judged: list[Judged]) -> None:
    assert P_WRONG_FOLLOWED < P_WRONG_UNFOLLOWED < P_WRONG_IN_DOUBT  # in doubt most is asked
    for one in judged[:2]:
        bench = Bench()
        bench.board = one.board
        milestone = case_on(one.board.view, one.trigger).milestone
        check_source(MilestoneJudge, bench, one.trigger, without=(milestone.id,))


@given(st.lists(st.tuples(st.floats(-3.0, 3.0), near(WIDE_RAD, 0.5 * WIDE_RAD) | st.just(0.0)), min_size=1, max_size=1))
def test_an_earlier_look_adds_only_what_this_one_does_not_show(looks: list[tuple[float, float]]) -> None:
    """In proportion to how far it is turned from this one, up to the width of a picture; to either side."""
    ((odds, aside_rad),) = looks
    milestone = Milestone("", 0, "", 0.7, tried=(0.7 + aside_rad,), log_odds_so_far=(odds,))
    assert _sum_log_odds(milestone) == pytest.approx(odds * min(abs(aside_rad) / WIDE_RAD, 1.0))
