"""Dry run: a mission before it is driven: which milestones it will have, and how well each fixes the pose.

The real knowledge sources plan, select and drive, but odometry is ideal and every expected milestone is verified. So
the dry run has the plan that the mission will have, as long as nothing goes wrong.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from blackboard import (
    RAISED,
    Change,
    Effect,
    KnowledgeSource,
    Level,
    Post,
    Posted,
    Quiescence,
    Revise,
    Revised,
    Scheduler,
    Sink,
    View,
    Watch,
)
from harvey.runner.ports import build_scheduler
from harvey.wiring import knowledge_sources
from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.features import SIGMA_ACROSS_PX
from knowledge_sources.methods.verification import (
    CHECK_TOLERANCE_M,
    MAX_SIGMA_PART,
    MAX_SIGMA_RAD,
    MIN_LINES,
    MIN_MATCHED_LINES,
    POSE_CONFIDENCE,
    check_lines,
    compute_evidence,
    compute_view_quality,
    predict_color_check,
    predict_face_colors,
    predict_lines,
)
from knowledge_sources.reads import find_belief, find_robot
from knowledge_sources.settings import DEFAULT, Settings
from logs.tables import table
from world_models.building.world import World
from world_models.entries import (
    Command,
    Hypothesis,
    Milestone,
    MotionReport,
    MotorCommand,
    Outcome,
    Place,
    PlanSketch,
    Ride,
    RideReport,
    diagonal,
)
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel
from world_models.words import count

ALIAS_MIN_COVERAGE = 0.8  # part of the lines that another place must show to look like a milestone
ALIAS_MIN_COLORS = 0.8  # part of the colors that another place must show to look like a milestone
MAX_COLOR_DIFFERENCE = 0.08  # largest difference of two colors, 0..1, that are the same

PLANNING_SOURCES = ("interpreter", "goal_sketcher", "refiner", "view_chooser", "view_predictor", "milestone_passer",
                    "sketch_advancer", "goal_closer", "motor", "dead_reckoner", "elevator_rider", "floor_changer",
                    "mission_monitor")
MAX_CYCLES = 20_000
FIX_SIGMA_M, FIX_SIGMA_RAD = 0.003, 0.001
"""Standard deviations of the pose after a milestone is verified in the dry run [m, rad]."""


@dataclass(frozen=True, slots=True)
class MilestonePreview:
    """A milestone to come.

    Attributes:
        what: in words.
        locale, x_m, y_m: where it will be looked for, in the locale's frame.
        look_heading_rad: in which direction [rad, world].
        landmarks: how many; lines: how many of their lines.
        sigma_m, sigma_rad: predicted standard deviations of the pose that they fix.
        p_false: probability of a false pose that the milestone judge would state if all were seen where expected.
        alike: another place of the same locale that looks like it, in words, or "".
        verdict: clear; weak (the pose would be uncertain, or p_false too high); ambiguous (another place looks like
            it); or not testable (too few lines are visible from the path).
    """

    what: str
    locale: str
    x_m: float
    y_m: float
    look_heading_rad: float
    landmarks: int
    lines: int
    sigma_m: float
    sigma_rad: float
    verdict: str
    p_false: float = 0.0
    alike: str = ""


class AcceptEveryMilestone(KnowledgeSource):
    """Verifies every expected milestone."""

    level = Level.PLAN
    on = (Watch(Milestone, (Posted, Revised), lambda m: m.status == "expected"),)
    writes = (Milestone, Hypothesis)

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        belief, milestone = find_belief(view), trigger.entry
        if belief is not None:
            sure = replace(belief.value, covariance=diagonal(FIX_SIGMA_M, FIX_SIGMA_RAD), basis="milestone")
            yield Revise(belief, sure, (milestone,))
            yield Revise(milestone, replace(milestone.value, status="verified"), (milestone,))


class IdealBodyPort:
    """Answers every command as if it had been carried out exactly."""

    name = "body"

    def answer(self, change: Change) -> Iterable[Effect]:
        value = change.entry.value
        if isinstance(change, Posted) and isinstance(value, MotorCommand):
            yield Post(MotionReport(value.turn_rad, value.move_m, 0.0, 0.0), (change.entry,))
        elif isinstance(change, Posted) and isinstance(value, Ride):
            yield Post(RideReport(value.passage, value.destination, 0.0, 0.0), (change.entry,))


Otherwise = Callable[[Scheduler], None]


def not_otherwise(_scheduler: Scheduler) -> None:
    """The robot is as it knows itself."""


def dry_run(
    world: World, robot: RobotModel, task: Command, settings: Settings = DEFAULT, what_if: Otherwise = not_otherwise
) -> tuple[tuple[MilestonePreview, ...], Outcome]:
    """The milestones in the order in which they will come, and how the dry run of the mission ends.

    ``what_if`` revises what the robot believes of itself (:class:`harvey.replay.what_if.WhatIf`).
    """
    scheduler = build_dry_run(world, robot, settings)
    what_if(scheduler)
    scheduler.post([Post(replace(task, start_covariance=diagonal(FIX_SIGMA_M, FIX_SIGMA_RAD)))], "user")
    previews: list[MilestonePreview] = []
    while scheduler.view.latest(Outcome) is None and scheduler.cycle < MAX_CYCLES:
        decision = scheduler.step()
        if decision is None:
            scheduler.post([Post(Quiescence(scheduler.cycle))], "scheduler")
        elif decision.refused.startswith(RAISED):
            return tuple(previews), Outcome("failed", decision.refused.strip().splitlines()[-1])
        else:
            previews += _previews(scheduler.view, decision.made)
    outcome = scheduler.view.latest(Outcome)
    return tuple(previews), outcome.value if outcome else Outcome("failed", f"not there after {MAX_CYCLES} cycles")


def build_dry_run(
    world: World, robot: RobotModel, settings: Settings = DEFAULT, sinks: Sequence[Sink] = ()
) -> Scheduler:
    """The planning knowledge sources round a board that knows the robot and can ask for the building."""
    sources = [source for source in knowledge_sources(settings) if source.name in PLANNING_SOURCES]
    return build_scheduler([*sources, AcceptEveryMilestone()], world, replace(robot, continuous=False),
                           ports=(IdealBodyPort(),), sinks=sinks)


def _previews(
    view: View, made: Sequence[Change]
) -> list[MilestonePreview]:
    """Previews of the milestones that were just verified."""
    belief = find_belief(view)
    if belief is None:
        return []
    values = (change.entry.value for change in made)
    milestones = (v for v in values if isinstance(v, Milestone) and v.status == "verified")
    return [_preview(find_robot(view), view, belief.value, milestone) for milestone in milestones]


def _preview(
    robot: RobotModel, view: View, belief: Hypothesis, milestone: Milestone
) -> MilestonePreview:
    lines = np.array(milestone.expected, float).reshape(-1, 2, 3)
    pose = belief.world_from_robot(robot.world)
    mount = robot.on_floor_of(belief.locale).mount
    quality = compute_view_quality(lines, robot.camera, mount.camera_from_robot, pose, SIGMA_ACROSS_PX)
    most_m = MAX_SIGMA_PART * (_tolerance_m(view, milestone) or CHECK_TOLERANCE_M)
    sharp = quality.sigma_m <= most_m and quality.sigma_rad <= MAX_SIGMA_RAD
    standing = robot.on_floor_of(belief.locale)
    seen = len(lines) >= MIN_MATCHED_LINES
    p_false = predict_p_false(standing, pose, lines, np.array(diagonal(FIX_SIGMA_M, FIX_SIGMA_RAD))) if seen else 1.0
    other = find_alias(standing, belief.locale, pose, lines) if seen else None
    clear = sharp and len(lines) >= MIN_LINES and p_false <= POSE_CONFIDENCE.accept
    return MilestonePreview(
        milestone.what, belief.locale, belief.locale_from_robot.x_m, belief.locale_from_robot.y_m,
        milestone.look_heading_rad, len(milestone.landmarks), len(lines), quality.sigma_m, quality.sigma_rad,
        "not testable" if not seen else "ambiguous" if other is not None else "clear" if clear else "weak",
        p_false, "" if other is None else str(Place.of_world(robot.world, belief.locale, other.x_m, other.y_m)),
    )


def _tolerance_m(view: View, milestone: Milestone) -> float | None:
    """Tolerance of the subgoal that the milestone ends [m]; None where it ends none."""
    sketch = view.get(milestone.sketch)
    if sketch is None or not isinstance(sketch.value, PlanSketch) or milestone.index < 1:
        return None
    return float(sketch.value.subgoals[milestone.index - 1].tolerance_m)


def predict_p_false(
    robot: RobotModel, pose: Pose2, lines_world: Floats, covariance: Floats,
) -> float:
    """Predict the probability of a wrong pose if lines (m, 2, 3) and colors are all seen where they are expected.

    ``covariance`` (3, 3) over (x, y, heading) [world] is that of the fix, and of the belief.
    """
    projected = robot.camera.project_segments(lines_world, robot.camera_from_world(pose))[0]
    projected = projected[np.isfinite(projected).all(axis=(1, 2))]
    lines = check_lines(robot, lines_world, projected, pose)
    colors = predict_color_check(predict_face_colors(robot, pose))
    return POSE_CONFIDENCE.p_false(compute_evidence(pose, covariance, pose, covariance, lines, colors))


def find_alias(
    robot: RobotModel, locale: str, pose: Pose2, lines_world: Floats,
) -> Pose2 | None:
    """Find another pose in the same locale from which the model looks the same; None if there is none."""
    colors = _get_colors(robot, pose)
    for other in _repeat(robot, locale, pose):
        segments = predict_lines(robot, other).segments_px
        if check_lines(robot, lines_world, segments, pose).coverage >= ALIAS_MIN_COVERAGE:
            there = _get_colors(robot, other)
            difference = np.abs(colors[:, None] - there[None]).max(axis=2).min(axis=1, initial=1.0)
            if np.mean(difference <= MAX_COLOR_DIFFERENCE) >= ALIAS_MIN_COLORS:
                return other
    return None


def _get_colors(robot: RobotModel, pose: Pose2) -> Floats:
    """(n, 3) of the faces in view."""
    return np.array([color for color, _ in predict_face_colors(robot, pose)]).reshape(-1, 3)


def _repeat(robot: RobotModel, locale: str, pose: Pose2) -> Iterator[Pose2]:
    """Poses where a locale may repeat itself: turned by half a turn, and at each other of its doors."""
    corners = robot.world.outline(locale)
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    yield Pose2(2.0 * float(middle[0]) - pose.x_m, 2.0 * float(middle[1]) - pose.y_m,
                wrap_angle(pose.heading_rad + np.pi))
    doors = [doorway.pose_from(locale) for doorway in robot.world.doorways_of(locale)]
    if doors:
        nearest = min(doors, key=pose.distance_to)
        own = nearest.inverse() @ pose
        yield from (door @ own for door in doors if door is not nearest)


def format_previews(ahead: Sequence[MilestonePreview]) -> str:
    """The milestones to come, one a row."""
    columns = ("milestone", "in", "x m", "y m", "looking", "landmarks", "lines", "place mm", "heading deg",
               "chance elsewhere", "verdict")
    return table(columns, [
        (p.what, p.locale, f"{p.x_m:.2f}", f"{p.y_m:.2f}", f"{math.degrees(p.look_heading_rad):.0f}",
         str(p.landmarks), str(p.lines), f"{p.sigma_m * 1000:.1f}", f"{math.degrees(p.sigma_rad):.2f}",
         f"{p.p_false:.1g}", f"{p.verdict}: {p.alike} looks like it" if p.alike else p.verdict)
        for p in ahead])


def summarize_dry_run(ahead: Sequence[MilestonePreview], outcome: Outcome) -> tuple[str, bool]:
    """How the dry run of a mission ends, and whether nothing speaks against driving it.

    A dry run verifies every milestone, so reaching the goal says little where one is not testable or ambiguous.
    """
    doubtful = [(verdict, sum(1 for p in ahead if p.verdict == verdict)) for verdict in ("not testable", "ambiguous")]
    doubts = [f"{count(number, 'milestone')} {verdict}" for verdict, number in doubtful if number]
    weak = sum(1 for p in ahead if p.verdict == "weak")
    if outcome.kind == "reached" and doubts:
        return f"may not reach its goal: of {len(ahead)} on the way, {' and '.join(doubts)}", False
    if outcome.kind == "reached":
        return f"ends: reached, {outcome.reason}" + (f"; {count(weak, 'milestone')} weak" if weak else ""), True
    return f"ends: {outcome.kind}, {outcome.reason}" + (f"; {' and '.join(doubts)}" if doubts else ""), False
