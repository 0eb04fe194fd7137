"""What each knowledge source watches: one table, and every status of every kind against it.

Who watches too much is woken in vain; who watches too little sleeps through what it was made for.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from itertools import product
from typing import Any, get_args

import numpy as np
import pytest

from blackboard import Change, Entry, KnowledgeSource, Level, Posted, Quiescence, Retracted, Revised
from blackboard.kinds import always
from harvey.testing import SURE
from harvey.wiring import KNOWLEDGE_SOURCES, build
from knowledge_sources.settings import DEFAULT
from world_models.building.locale_frame import LocaleFrame
from world_models.entries import (
    GO_ON,
    MISLEADING,
    SENSES,
    STOP_KEY,
    BodyFault,
    CameraPicture,
    Certificate,
    Command,
    Contact,
    Difference,
    Discrepancy,
    DoorState,
    Evidence,
    FloorView,
    FreeFloor,
    Goal,
    Hypothesis,
    Impasse,
    Leg,
    LineMatch,
    Milestone,
    MilestoneVerdict,
    MotionReport,
    Obstacle,
    ObstacleStatus,
    Obstruction,
    Panorama,
    Place,
    PlaceSearch,
    PlanSketch,
    PoseFix,
    Ranges,
    Recovery,
    Redirection,
    RideReport,
    Rival,
    Segments,
    SketchStatus,
    Subgoal,
    UserReport,
)
from world_models.entries.body import RecoveryStatus
from world_models.entries.difference import MODEL
from world_models.entries.difference import SURE as SURE_P
from world_models.entries.task import GoalStatus, LegStatus, MilestoneStatus
from world_models.frames import Pose2

BOTH, HERE = (False, True), Pose2(2.0, 2.0, 0.0)
THERE = Place("hall", 1.0, 2.0)
WAY = tuple(Subgoal(THERE, THERE, primitive=primitive) for primitive in (False, True))


def vary(value: Any, **fields: Iterable[Any]) -> list[Any]:
    """A value with each of these values of its fields, in all combinations."""
    return [replace(value, **dict(zip(fields, chosen, strict=True))) for chosen in product(*fields.values())]


def differ(about: str, kind: Any, p: float) -> Difference:
    return Difference(about, (Rival(kind, "it is so", 3.0, p), Rival("chance", "chance", 0.0, 0.0)), (), 0.0)


CERTIFICATE = Certificate("Milestone-1", "PoseFix-1", "verified", "", 9, 9, 9, 0.9, 1.0, 0.0, 0.0, 3.0, 9.0, 0.1, 0.1,
                          0.1)
FLOOR = FreeFloor("camera", "hall", 0.0, 0.0, (), (), (), (), (), (), 1.0)
VALUES: Mapping[type[Any], list[Any]] = {
    BodyFault: vary(BodyFault("base", "", "", "MotorCommand-1", 1.0), what=(
        "link lost", "stopped", "base refuses", STOP_KEY)),
    CameraPicture: vary(CameraPicture(b"", 0, 0.0), purpose=("track", "milestone", "probe", "")),
    Contact: [Contact(by, 0.0, 0.1, 1.0) for by in ("bumper", "stall")],
    Certificate: vary(CERTIFICATE, verdict=get_args(MilestoneVerdict), p_false=(0.001, 0.03, 0.031, 0.5)),
    Difference: [differ(*case) for case in product((MODEL, "camera", "hall/obstacle-1"), (
        *sorted(SENSES), "wall", "thing"), (SURE_P - 1e-6, SURE_P, 1.0))],
    Discrepancy: vary(Discrepancy(Level.PLAN, "", None, (5.0, 30.0), "px"), level=tuple(Level),
                      magnitude=(None, 0.0, 5.0, 5.1, 30.0, 30.1, math.inf), status=("open", "corrected")),
    FreeFloor: vary(FLOOR, sense=("camera", "ranges"), things=((), (None,))),
    Goal: vary(Goal(THERE, THERE), status=get_args(GoalStatus)),
    Hypothesis: vary(Hypothesis("hall", HERE, SURE, ""), status=("held", "candidate"), correction=(None, HERE), basis=(
        "command", "odometry", "tracks", "milestone", "relocalization", "ride")),
    Impasse: vary(Impasse("blocked", ""), is_open=BOTH, behind=((), ("Obstacle-1",))),
    Leg: vary(Leg("PlanSketch-1", 0, 0.0, 0.0, 1.0, 0.0, 0.1), status=get_args(LegStatus)),
    Milestone: vary(Milestone("", 0, "", 0.0), status=get_args(MilestoneStatus)),
    Obstacle: vary(Obstacle("hall/obstacle-1", "hall", (), 0.1, 0.0, 0.0, 0.2), status=get_args(ObstacleStatus)),
    PlaceSearch: vary(PlaceSearch("found", ""), status=("found", "probe", "ambiguous"), probe=(None, (0.1, 0.0))),
    PlanSketch: vary(PlanSketch("Goal-1", (), "", WAY), path=((), (0,)), at=(0, 1, 2), verified=BOTH, is_look=BOTH,
                     status=get_args(SketchStatus)),
    Recovery: vary(Recovery("BodyFault-1", "MotorCommand-1", 1.0, 0.1), status=get_args(RecoveryStatus)),
    Redirection: vary(Redirection(""), text=("(hall (3,3,0))", GO_ON)),
    Segments: vary(Segments("CameraPicture-1", "", np.zeros((0, 2, 2)), np.zeros(0), 40.0),
                   milestone=("", "Milestone-1")),
}
"""Of each kind that is watched for what it says: all that tells one value from another."""
NEW, AGAIN, EITHER = (Posted,), (Revised,), (Posted, Revised)
Row = tuple[type[Any], tuple[type[Change], ...], Callable[[Any], bool]]


def is_held(belief: Hypothesis) -> bool:
    return belief.status == "held"


def is_judged(milestone: Milestone) -> bool:
    return milestone.status not in ("turning", "expected")


def is_verified(value: Certificate | Milestone) -> bool:
    return "verified" in (getattr(value, "status", ""), getattr(value, "verdict", ""))


def is_carried_out(sketch: PlanSketch) -> bool:
    return sketch.status == "active" and sketch.verified


def is_known_anew(belief: Hypothesis) -> bool:
    return is_held(belief) and belief.basis in ("milestone", "relocalization")


DOUBTS: Row = (Discrepancy, EITHER, always)
MOVED: Row = (Hypothesis, AGAIN, is_held)
WATCHES: Mapping[str, list[Row]] = {
    "alias_monitor": [(Certificate, NEW, is_verified)],
    "belief_checker": [DOUBTS, MOVED, (Milestone, AGAIN, is_judged)],
    "bumper_monitor": [(Contact, NEW, lambda felt: felt.by == "bumper"), (MotionReport, NEW, always)],
    "camera_calibrator": [(Certificate, NEW, is_verified)],
    "correction_monitor": [(Certificate, NEW, lambda c: c.verdict != "refuted" and c.p_false <= 0.03)],
    "correlator_tracker": [(CameraPicture, NEW, lambda f: f.purpose == "track")],
    "dead_reckoner": [(MotionReport, NEW, always)],
    "dependency_withdrawer": [(LocaleFrame, AGAIN, always)],
    "detour_finder": [(Leg, AGAIN, lambda leg: leg.status == "halted")],
    "discrepancy_raiser": [(Discrepancy, EITHER, lambda d: d.status == "open" and (d.magnitude or 0.0) > {
        Level.ACTION: 5.0, Level.PLAN: 30.0, Level.GOAL: math.inf}[d.level])],
    "door_toucher": [MOVED],
    "door_watcher": [(CameraPicture, NEW, lambda f: f.purpose == "track"), (Milestone, AGAIN, is_verified)],
    "elevator_rider": [(PlanSketch, EITHER, is_carried_out), (BodyFault, AGAIN, always)],
    "exposure_monitor": [(Segments, NEW, always)],
    "fault_handler": [
        (BodyFault, NEW, always), (BodyFault, AGAIN, lambda f: f.what in ("stopped", "base refuses")),
        (Contact, NEW, always), (Recovery, AGAIN, lambda r: r.status != "asked"),
        (Redirection, AGAIN, lambda asked: asked.text == GO_ON)],
    "floor_changer": [(RideReport, NEW, always)],
    "floor_watcher": [(CameraPicture, NEW, lambda f: f.purpose in ("track", "")), (Hypothesis, AGAIN, lambda h: (
        is_held(h) and h.basis in ("tracks", "milestone", "relocalization")))],
    "goal_changer": [(Redirection, NEW, always), (Goal, NEW, lambda goal: goal.status == "active")],
    "goal_closer": [(PlanSketch, AGAIN, lambda s: s.status == "done" and not s.path and not s.is_look)],
    "goal_renewer": [(Hypothesis, AGAIN, lambda h: is_held(h) and h.basis == "relocalization")],
    "goal_sketcher": [(Goal, NEW, lambda goal: goal.status == "active"), (PlanSketch, AGAIN, lambda s: not s.path and (
        s.status in ("halted", "superseded") or (s.status == "done" and s.is_look)))],
    "halt_explainer": [(Leg, AGAIN, lambda leg: leg.status == "halted"),
                       (Obstacle, EITHER, lambda thing: thing.status == "suspected")],
    "interpreter": [(Command, NEW, always)],
    "landmark_chooser": [(Hypothesis, AGAIN, is_known_anew)],
    "lens_monitor": [(PoseFix, NEW, always)],
    "line_finder": [(CameraPicture, NEW, lambda f: f.purpose in ("milestone", "probe"))],
    "localizer": [(Panorama, EITHER, always)],
    "lookout_planner": [(Impasse, NEW, lambda impasse: impasse.is_open and bool(impasse.behind))],
    "matcher": [(Segments, NEW, lambda seen: bool(seen.milestone))],
    "med_r_and_t": [(LineMatch, NEW, always)],
    "milestone_judge": [(PoseFix, NEW, always)],
    "milestone_passer": [(Milestone, AGAIN, lambda m: m.status in ("verified", "not testable"))],
    "mission_monitor": [(Goal, AGAIN, lambda goal: goal.status == "reached"),
                        (Impasse, NEW, lambda impasse: impasse.is_open), (Quiescence, NEW, always)],
    "model_reviser": [(UserReport, NEW, always), (Obstacle, EITHER, always), (DoorState, EITHER, always),
                      (Difference, EITHER, lambda d: any(r.kind in ("jamb", "wall") for r in d.rivals))],
    "motor": [(PlanSketch, EITHER, is_carried_out), (Leg, NEW, always), (Hypothesis, EITHER, is_held),
              (Milestone, EITHER, always), (Discrepancy, AGAIN, always), (BodyFault, AGAIN, always)],
    "obstruction_finder": [(Segments, NEW, lambda seen: bool(seen.milestone)), (Obstruction, EITHER, always),
                           (FreeFloor, EITHER, lambda floor: floor.sense == "camera" and floor.things != ())],
    "panorama_builder": [(Segments, NEW, lambda seen: not seen.milestone)],
    "path_follower": [(Leg, NEW, always), MOVED, (Discrepancy, EITHER, lambda d: d.status == "open"),
                      (Milestone, NEW, always), (PlanSketch, AGAIN, always)],
    "plan_adjuster": [(Certificate, NEW, is_verified)],
    "pose_adopter": [(PlaceSearch, NEW, lambda search: search.status == "found")],
    "probe_photographer": [(Discrepancy, NEW, lambda d: d.status == "open" and d.level is Level.GOAL),
                           (Hypothesis, AGAIN, lambda h: is_held(h) and h.basis == "odometry"),
                           (Segments, NEW, lambda seen: not seen.milestone)],
    "prober": [(PlaceSearch, NEW, lambda search: search.status == "probe" and search.probe is not None)],
    "push_monitor": [(FloorView, NEW, always)],
    "range_watcher": [(Ranges, NEW, always)],
    "refiner": [(PlanSketch, EITHER, lambda s: is_carried_out(s) and s.at == 0)],
    "rival_weigher": [(Evidence, NEW, always)],
    "sense_judge": [(Difference, EITHER, lambda d: d.rivals[0].p >= SURE_P and (
        d.rivals[0].kind in {*MISLEADING, "bumper"}))],
    "shut_door_explainer": [(Milestone, AGAIN, lambda m: m.status in ("refuted", "not testable"))],
    "sketch_advancer": [(Leg, AGAIN, lambda leg: leg.status == "arrived"),
                        (PlanSketch, AGAIN, lambda s: s.status == "done" and s.path != ())],
    "surveyor": [(Certificate, NEW, lambda c: c.verdict != "refuted")],
    "thing_mapper": [(FreeFloor, EITHER, always)],
    "thing_mover": [(Hypothesis, AGAIN, lambda h: is_held(h) and h.correction is not None)],
    "touch_finder": [(Hypothesis, AGAIN, is_known_anew)],
    "travel_breaker": [(Discrepancy, NEW, lambda d: d.level is Level.GOAL or d.magnitude == math.inf),
                       (Difference, EITHER, lambda d: d.rivals[0].p >= SURE_P and d.rivals[0].kind == "pushed")],
    "view_chooser": [(PlanSketch, EITHER, lambda s: s.status == "active" and not s.verified), DOUBTS, MOVED,
                     (Milestone, AGAIN, is_judged)],
    "view_predictor": [(Milestone, NEW, lambda m: m.status == "turning"), DOUBTS, MOVED],
    "view_updater": [(Obstruction, EITHER, always)],
    "wheels_calibrator": [(Difference, EITHER, lambda d: d.rivals[0].p >= SURE_P and d.rivals[0].kind == "wheels")],
    "yaw_calibrator": [(Hypothesis, AGAIN, lambda h: is_held(h) and h.basis == "milestone")],
}


@pytest.mark.parametrize("source", KNOWLEDGE_SOURCES, ids=lambda source: source.called())
def test_it_wakes_by_what_the_table_says_and_by_nothing_else(source: type[KnowledgeSource]) -> None:
    one, rows = build(source, DEFAULT), WATCHES[source.called()]
    assert {watch.value_type for watch in one.on} == {kind for kind, _, _ in rows}
    for kind, changes, where in rows:
        assert kind in VALUES or where is always
        assert kind in VALUES or {c for w in one.on if w.value_type is kind for c in w.kinds} == set(changes)
    for kind, values in VALUES.items():
        own = [(changes, where) for of, changes, where in rows if of is kind]
        for value, change in product(values, (Posted, Revised, Retracted)):
            wakes = any(watch.sees(change(Entry(f"{kind.__name__}-1", 1, value, "test", 1))) for watch in one.on)
            assert wakes == any(change in changes and where(value) for changes, where in own), (change, value)


def test_the_table_has_every_source_and_no_other() -> None:
    assert set(WATCHES) == {source.called() for source in KNOWLEDGE_SOURCES}
