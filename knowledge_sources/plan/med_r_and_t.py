"""Med-R-and-T (§6.2.4): the robot's pose from line matches with outliers, by least median of squares."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from blackboard.board import View
from blackboard.change import Change, Posted, Watch
from blackboard.effect import Effect, Post
from blackboard.level import Level
from knowledge_sources.methods.pose import planar_from_lines
from knowledge_sources.questions import find_belief, find_robot
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries.percepts import LineMatch, PoseFix
from world_models.entries.task import Milestone
from world_models.frames import frozen


class MedRAndT(RobotKnowledgeSource):
    """Solves for the pose on the floor, and names the pairs that are outliers.

    The mounting of the camera is known (§3.2), so three of the six unknowns of §6.2 are left. Subsets of lines propose
    poses, the median residual of all lines chooses one, and the inliers refine it.
    """

    level = Level.PLAN
    watches = (Watch(LineMatch, (Posted,)),)
    writes = (PoseFix,)

    def rate(self, view: View, trigger: Change) -> float | None:
        return 0.8 if find_belief(view) is not None else None

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        match, belief, milestone = trigger.entry, find_belief(view), view.get(trigger.entry.value.milestone)
        if belief is None or milestone is None:
            return
        m: Milestone = milestone.value
        s, robot = self._settings.plan, find_robot(view).on_floor_of(belief.value.locale)
        prior = s.prior_covariance_factor * belief.value.covariance_world(robot.world)
        prior = prior + np.diag([s.prior_sigma_m**2, s.prior_sigma_m**2, s.prior_sigma_rad**2])
        found = planar_from_lines(
            match.value.lines_world,
            match.value.segments_px,
            robot.camera,
            robot.mount.camera_from_robot,
            belief.value.world_from_robot(robot.world),
            prior_covariance=prior,
            landmark_ids=[m.landmark_of[i] for i in match.value.pairs[:, 0]],
            sigma_px=self._settings.features.sigma_across_px,
            settings=self._settings.pose,
        )
        yield Post(
            PoseFix(
                match.id, found.world_from_robot, frozen(found.covariance), np.asarray(found.inliers, bool),
                frozen(found.residuals_px), tuple(reason or "" for reason in found.rejected),
            ),
            (match, belief),
        )
