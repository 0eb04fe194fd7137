"""Referee: how a mission went, by what was decided and by the truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from blackboard.journal import Decision
from sim.body.simulated_body import SimulatedBody
from sim.stage import Stage
from sim.truth import cross_track_m
from world_models.entries.location import Hypothesis
from world_models.entries.percepts import PoseFix
from world_models.entries.task import Certificate, Goal, Leg, Milestone, Outcome, PlanSketch
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

FALSE_M = 0.15
"""A milestone is accepted falsely when the robot is further than this from the pose that was certified."""
FALSE_RAD = 0.06
"""Or turned by more than this."""


@dataclass(frozen=True, slots=True)
class MissionResult:
    """What is written to ``result.json``.

    Attributes:
        outcome: reached, lost, blocked or failed; reason: why.
        final_heading_error_rad: from the wanted heading; where none is wanted, from what Harvey believed.
        milestones: how many were verified, refuted, not testable and (by the truth) accepted falsely.
        replans: sketches adjusted or drawn anew; relocalizations: how often it found itself again.
        sketches: how many plan sketches were drawn.
        max_cross_track_m: how far the robot truly strayed from the line of the leg it was driving.
        amiss: which of the scenario's faults did not happen, or not as they were asked for, in words.
    """

    scenario: str
    seed: int
    outcome: str
    reason: str
    goal: str
    final_error_m: float
    final_heading_error_rad: float
    path_length_m: float
    sim_time_s: float
    wall_time_s: float
    frames: int
    decisions: int
    milestones: dict[str, int]
    replans: int
    relocalizations: int
    sketches: int
    collisions: int
    max_cross_track_m: float
    amiss: Sequence[str] = ()

    def record(self) -> dict[str, Any]:
        """As JSON types."""
        return {name: getattr(self, name) for name in self.__slots__}


class Counts:
    """A sink that counts what was decided."""

    def __init__(self) -> None:
        self.decisions = self.replans = self.relocalizations = self.sketches = 0
        self.milestones = {"verified": 0, "refuted": 0, "not_testable": 0}

    def __call__(self, decision: Decision) -> None:
        self.decisions += 1
        for change in decision.made:
            value, revision = change.entry.value, change.entry.revision
            if isinstance(value, Milestone) and value.status.replace(" ", "_") in self.milestones:
                self.milestones[value.status.replace(" ", "_")] += 1
            elif isinstance(value, PlanSketch):
                self.sketches += revision == 0
                self.replans += value.adjustments > 0 and value.verified and change.entry.author == "sketcher"
            elif isinstance(value, Goal):
                self.replans += value.status == "abandoned"
            elif isinstance(value, Hypothesis) and value.is_held:
                self.relocalizations += value.basis == "relocalization"


class Referee(Counts):
    """Counts, and compares what is believed with the truth; nobody on the board hears of it."""

    def __init__(self, robot: RobotModel, body: SimulatedBody) -> None:
        super().__init__()
        self._robot, self._body = robot, body
        self.milestones["false_accepts"] = 0
        self.max_cross_track_m = 0.0
        self._leg: Leg | None = None
        self._fix: Pose2 | None = None
        self._gone = 0

    def __call__(self, decision: Decision) -> None:
        self._follow()
        super().__call__(decision)
        for change in decision.made:
            value = change.entry.value
            if isinstance(value, Leg):
                self._leg = value if value.status == "moving" else None
            elif isinstance(value, PoseFix):
                self._fix = value.world_from_robot
            elif isinstance(value, Certificate) and value.verdict == "verified" and self._fix is not None:
                self.milestones["false_accepts"] += self._is_false(self._fix)

    def _follow(self) -> None:
        """How far the robot truly strayed from the leg that it was driving since the last decision."""
        track = self._body.track
        if self._leg is not None:
            start, end = Pose2(self._leg.x0_m, self._leg.y0_m, 0.0), Pose2(self._leg.x1_m, self._leg.y1_m, 0.0)
            strayed = (abs(cross_track_m(t.world_from_robot, start, end)) for t in track[self._gone:])
            self.max_cross_track_m = max(self.max_cross_track_m, *strayed, 0.0)
        self._gone = len(track)

    def _is_false(self, believed: Pose2) -> bool:
        true = self._body.truth.world_from_robot
        turned = abs(wrap_angle(believed.heading_rad - true.heading_rad))
        return believed.distance_to(true) > FALSE_M or turned > FALSE_RAD

    def result(
        self, stage: Stage, seed: int, outcome: Outcome, belief: Hypothesis | None, wall_time_s: float
    ) -> MissionResult:
        """What came of it; ``belief`` is the last one held."""
        score = stage.score(self._body.track)
        return MissionResult(
            scenario=stage.scenario.name,
            seed=seed,
            outcome=outcome.kind,
            reason=outcome.reason,
            goal=stage.scenario.goal,
            final_error_m=score.position_error_m,
            final_heading_error_rad=self._heading_error(score.heading_error_rad, belief),
            path_length_m=score.path_m,
            sim_time_s=score.time_s,
            wall_time_s=wall_time_s,
            frames=self._body.frames,
            decisions=self.decisions,
            milestones=self.milestones,
            replans=self.replans,
            relocalizations=self.relocalizations,
            sketches=self.sketches,
            collisions=score.collisions,
            max_cross_track_m=self.max_cross_track_m,
            amiss=self._body.missed_faults,
        )

    def _heading_error(self, wanted_rad: float | None, belief: Hypothesis | None) -> float:
        if wanted_rad is not None or belief is None:
            return wanted_rad or 0.0
        true = self._body.truth.world_from_robot
        return wrap_angle(belief.world_from_robot(self._robot.world).heading_rad - true.heading_rad)
