"""The evidence for a pose, and the probability that the pose is wrong, by logistic regression.

The evidence is eight numbers, each of which is better the larger it is. A covariance looks the same in the wrong
corridor; these numbers do not. They follow from sets of lines, segments and faces, so their order does not matter.

The log odds of a right pose are a sum of the evidence, each part with a weight that is never negative: more evidence
never makes a pose less certain. The weights in ``verification_weights.toml`` were fitted on rendered pictures of
generated floors (``harvey experiment milestones-calibrate``) with a prior of one half; a mission is at a wrong place
less often, so that the probability is not too small.
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from knowledge_sources.methods.arrays import Floats, Mask
from knowledge_sources.methods.belief.places import compute_chi2
from knowledge_sources.methods.pose.planar import compute_point_jacobian
from knowledge_sources.methods.verification.color_check import ColorCheck
from knowledge_sources.methods.verification.line_check import (
    LINE_TOLERANCE_RAD,
    MAX_LINE_WEIGHT_PX,
    LineCheck,
    compute_coverage,
)
from knowledge_sources.settings import DEFAULT, VerificationSettings
from world_models.frames import Pose2
from world_models.robot import RobotModel

SHARP_TOLERANCE_PX = 1.0  # distance within which a covered line is sharp; chance spreads over the whole tolerance
PROBE_TURN_RAD = 0.4  # turn that is weighed like one metre of motion in the weakest direction of the evidence
MAX_LINE_MOTION_PX = 400.0  # motion of a line in the picture, by one metre, from which it weighs no more
MAX_BELIEF_SIGMAS = 6.0  # mahalanobis distance from the belief from which a pose gets no credit for being near it
MIN_P_FALSE = 1e-12  # probability of chance agreement that counts as certainty

NEAR_M = 0.1
"""Lines with an end nearer to the camera than this have no defined motion in the picture."""


@dataclass(frozen=True, slots=True)
class PoseEvidence:
    """What supports a pose; :mod:`knowledge_sources.methods.verification.pose_confidence` weighs it.

    Attributes:
        coverage: covered part of the lines' length in view.
        weakest_coverage: the same, lines weighted by their motion in the picture along the least constrained of five
            directions of pose error.
        sharpness: part of the covered length that is covered within a pixel.
        significance: how improbable such agreement is by chance, on a log scale: 0 (p = 1) to 1 (p = 1e-12).
        line_count: log2(1 + n) of the n matched lines.
        proximity: 1 at the belief, 0 from a Mahalanobis distance of 6.
        color_agreement: part of the faces with the model's color, beyond chance; 0 where colors are not testable.
        color_count: log2(1 + n) of the n compared faces; 0 where colors are not testable.
    """

    coverage: float
    weakest_coverage: float
    sharpness: float
    significance: float
    line_count: float
    proximity: float
    color_agreement: float
    color_count: float

    @property
    def values(self) -> Floats:
        """(k,) in the order of the attributes."""
        return np.array(astuple(self))


EVIDENCE_NAMES = tuple(field.name for field in fields(PoseEvidence))


def compute_evidence(
    robot: RobotModel, lines_world: Floats, segments_px: Floats, pose: Pose2, covariance: Floats, belief: Pose2,
    belief_covariance: Floats, lines: LineCheck, colors: ColorCheck,
) -> PoseEvidence:
    """Compute the evidence for a pose.

    Args:
        lines_world: (m, 2, 3) predicted lines [m, world].
        segments_px: (k, 2, 2) found in the picture.
        pose, covariance: the pose in question, world; (3, 3) over (x, y, heading).
        belief, belief_covariance: the pose that was believed before, in the same form.
        lines, colors: the checks of the picture at the pose.
    """
    agreement, projected = lines.agreement, lines.projected_px
    covered = np.nan_to_num(agreement.coverage)
    span = np.linalg.norm(projected[:, 1] - projected[:, 0], axis=1)
    length = np.minimum(np.nan_to_num(span), MAX_LINE_WEIGHT_PX)
    sharp = np.nan_to_num(compute_coverage(
        projected, segments_px, SHARP_TOLERANCE_PX, LINE_TOLERANCE_RAD))
    directions = _error_directions(PROBE_TURN_RAD)
    motion = length[:, None] * _compute_motion(robot, lines_world, pose, directions, MAX_LINE_MOTION_PX)
    sigmas = min(math.sqrt(compute_chi2(pose, belief, covariance + belief_covariance)), MAX_BELIEF_SIGMAS)
    return PoseEvidence(
        coverage=_ratio(length * covered, length),
        weakest_coverage=min(_ratio(motion[:, k] * covered, motion[:, k]) for k in range(len(directions))),
        sharpness=_ratio(length * sharp, length * covered),
        significance=math.log10(max(agreement.p_false, MIN_P_FALSE)) / math.log10(MIN_P_FALSE),
        line_count=math.log2(1.0 + agreement.matched),
        proximity=1.0 - sigmas / MAX_BELIEF_SIGMAS,
        color_agreement=max(colors.agreeing - colors.chance, 0.0) if colors.is_testable else 0.0,
        color_count=math.log2(1.0 + colors.count) if colors.is_testable else 0.0,
    )


def compute_motion_tolerance_px(
    robot: RobotModel, lines_world: Floats, pose: Pose2, covariance: Floats,
    settings: VerificationSettings = DEFAULT.verification,
) -> float:
    """Compute how far lines (m, 2, 3) may lie from where they are expected, by a pose covariance (3, 3) [px].

    The median over the lines of so many standard deviations across each; 0 without lines.
    """
    if not len(lines_world):
        return 0.0
    _, across = _compute_slopes(robot, lines_world, pose)
    middle = across.mean(axis=1)
    sigmas = np.sqrt(np.einsum("nk,kl,nl->n", middle, covariance, middle))
    return settings.motion_tolerance_sigmas * float(np.median(sigmas))


def _ratio(part: Floats, whole: Floats) -> float:
    total = float(np.sum(whole))
    return float(np.sum(part)) / total if total > 1e-9 else 0.0


def _error_directions(turn_rad: float) -> Floats:
    """(5, 3) pose errors (x, y [m], heading [rad]) in the robot's frame: ahead, left, both diagonals, and a turn."""
    return np.array([(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.7, 0.7, 0.0), (0.7, -0.7, 0.0), (0.0, 0.0, turn_rad)])


def _compute_motion(robot: RobotModel, lines_world: Floats, pose: Pose2, directions: Floats, max_px: float) -> Floats:
    """(m, d) by how much each line moves across itself in the picture for each pose error (d, 3), bounded [px]."""
    if not len(lines_world):
        return np.zeros((0, len(directions)))
    ahead, across = _compute_slopes(robot, lines_world, pose)
    c, s = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    in_world = directions @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    motion = np.abs(across @ in_world.T).max(axis=1)
    motion[~ahead] = 0.0
    return np.asarray(np.minimum(motion, max_px))


def _compute_slopes(robot: RobotModel, lines_world: Floats, pose: Pose2) -> tuple[Mask, Floats]:
    """Which lines (m,) lie before the camera, and how their ends (m, 2, 3) move across them by (x, y, heading) [px]."""
    points, pixels, slopes = compute_point_jacobian(
        lines_world.reshape(-1, 3), robot.camera, pose, robot.mount.camera_from_robot)
    ends = pixels.reshape(-1, 2, 2)
    along = ends[:, 1] - ends[:, 0]
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(np.linalg.norm(along, axis=1), 1e-9)[:, None]
    across = np.einsum("nj,nejk->nek", normal, slopes.reshape(-1, 2, 2, 3))
    return np.all(points[:, 2].reshape(-1, 2) > NEAR_M, axis=1), np.asarray(across)


PRODUCTS = (("coverage", "sharpness"), ("coverage", "color_agreement"), ("sharpness", "color_agreement"))
"""Parts of the evidence that are stronger together: their products are terms too."""
TERMS = (*EVIDENCE_NAMES, *(f"{a}-and-{b}" for a, b in PRODUCTS))
WEIGHTS_FILE = Path(__file__).with_name("verification_weights.toml")


@dataclass(frozen=True, slots=True)
class EvidenceWeights:
    """The weights of a logistic regression.

    Attributes:
        each: of each of the :data:`TERMS`, none negative.
        bias: log odds of a right pose without evidence.
    """

    each: tuple[float, ...]
    bias: float

    def p_false(self, evidence: Floats) -> Floats:
        """Compute the probabilities (n,) of a wrong pose from evidence (n, k)."""
        odds = compute_terms(evidence) @ np.array(self.each) + self.bias
        return np.asarray(1.0 / (1.0 + np.exp(np.clip(odds, -700.0, 700.0))))

    @staticmethod
    def from_table(table: dict[str, Any]) -> EvidenceWeights:
        """Read the weights from a section of ``verification_weights.toml``."""
        return EvidenceWeights(tuple(float(table[name]) for name in TERMS), float(table["bias"]))


@dataclass(frozen=True, slots=True)
class PoseConfidence:
    """The probability that a pose is wrong, and the limits for a verdict.

    Attributes:
        lines_and_colors, lines_only: weights where the colors of faces are testable, and where they are not.
        accept: largest p_false of a verified pose.
        refute: smallest p_false of a refuted pose.
    """

    lines_and_colors: EvidenceWeights
    lines_only: EvidenceWeights
    accept: float
    refute: float

    def p_false(self, evidence: PoseEvidence) -> float:
        """Compute the probability that the pose is wrong.

        Colors that agree raise trust; colors that do not say that walls were painted, not that the robot is elsewhere:
        so a pose is never less certain than by its lines alone.
        """
        values = evidence.values[None]
        by_lines = float(self.lines_only.p_false(values)[0])
        return min(by_lines, float(self.lines_and_colors.p_false(values)[0])) if evidence.color_count else by_lines

    @staticmethod
    def from_table(table: dict[str, Any]) -> PoseConfidence:
        """Read the weights and limits from ``verification_weights.toml``."""
        return PoseConfidence(
            EvidenceWeights.from_table(table["lines_and_colors"]), EvidenceWeights.from_table(table["lines_only"]),
            float(table["accept"]), float(table["refute"]))


def compute_terms(evidence: Floats) -> Floats:
    """Compute the terms (n, t) of evidence (n, k), none negative, so that each term grows with each part."""
    at = {name: number for number, name in enumerate(EVIDENCE_NAMES)}
    products = [evidence[:, at[a]] * evidence[:, at[b]] for a, b in PRODUCTS]
    return np.column_stack([evidence, *products])


POSE_CONFIDENCE = PoseConfidence.from_table(tomllib.loads(WEIGHTS_FILE.read_text("utf-8")))
"""The fitted weights and limits."""
