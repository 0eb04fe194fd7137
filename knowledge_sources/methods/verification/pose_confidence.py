"""The evidence for a pose, and the probability that the pose is wrong, by logistic regression.

The evidence is five numbers, each of which is better the larger it is. A covariance looks the same in the wrong
corridor; these numbers do not. They follow from sets of lines, segments and faces, so their order does not matter.
Lines count where they are found within a pixel: at the right pose they are, and in rooms of bricks and tiles that tells
them from the lines that the model does not have.

The log odds of a right pose are a sum of the evidence, each part with a weight that is never negative: more evidence
never makes a pose less certain. The weights in ``verification_weights.toml`` were fitted on rendered pictures of
generated floors, half of them textured as no model says (``harvey experiment milestones-calibrate``), with a prior of
one half; a mission is at a wrong place less often, so that the probability is not too small.
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.belief import compute_chi2
from knowledge_sources.methods.pose import compute_point_jacobian
from knowledge_sources.methods.verification.color_check import ColorCheck
from knowledge_sources.methods.verification.line_check import (
    MAX_LINE_WEIGHT_PX,
    LineCheck,
)
from world_models.frames import Pose2
from world_models.robot import RobotModel

MOTION_TOLERANCE_SIGMAS = 4.0
"""Deviations that the wheels are allowed: of three numbers, one in a thousand lies further out (chi-square with three
degrees of freedom)."""
MAX_BELIEF_SIGMAS = 6.0  # mahalanobis distance from the belief from which a pose gets no credit for being near it
MIN_P_FALSE = 1e-40  # probability of chance agreement that counts as certainty
LEAST_P_FALSE = 1e-4  # smallest probability of a wrong place by one picture: of less the cases of the fit say nothing
P_REPAINTED = 0.05  # probability that faces lost the model's colors, which then speak neither for a pose nor against it


@dataclass(frozen=True, slots=True)
class PoseEvidence:
    """What supports a pose; :mod:`knowledge_sources.methods.verification.pose_confidence` weighs it.

    Attributes:
        coverage: part of the lines' length in view that is covered within a pixel.
        significance: how improbable such agreement is by chance, on a log scale: 0 (p = 1) to 1 (p = 1e-40).
        proximity: 1 at the belief, 0 from a Mahalanobis distance of 6.
        color_agreement: part of the faces with the model's color, beyond chance; 0 where colors are not testable.
        color_count: number of compared faces; 0 where colors are not testable. It is not weighed.
    """

    coverage: float
    significance: float
    proximity: float
    color_agreement: float
    color_count: float

    @property
    def values(self) -> Floats:
        """(k,) in the order of the attributes."""
        return np.array(astuple(self))


EVIDENCE_NAMES = tuple(field.name for field in fields(PoseEvidence))


def compute_evidence(
    pose: Pose2, covariance: Floats, belief: Pose2, belief_covariance: Floats, lines: LineCheck, colors: ColorCheck
) -> PoseEvidence:
    """Compute the evidence for a pose.

    Args:
        pose, covariance: the pose in question, world; (3, 3) over (x, y, heading).
        belief, belief_covariance: the pose that was believed before, in the same form.
        lines, colors: the checks of the picture at the pose.
    """
    covered, projected = np.nan_to_num(lines.sharp.coverage), lines.projected_px
    span = np.linalg.norm(projected[:, 1] - projected[:, 0], axis=1)
    length = np.minimum(np.nan_to_num(span), MAX_LINE_WEIGHT_PX)
    sigmas = min(math.sqrt(compute_chi2(pose, belief, covariance + belief_covariance)), MAX_BELIEF_SIGMAS)
    return PoseEvidence(
        coverage=_ratio(length * covered, length),
        significance=math.log10(max(lines.sharp.p_false, MIN_P_FALSE)) / math.log10(MIN_P_FALSE),
        proximity=1.0 - sigmas / MAX_BELIEF_SIGMAS,
        color_agreement=max(colors.agreeing - colors.chance, 0.0) if colors.is_testable else 0.0,
        color_count=float(colors.count) if colors.is_testable else 0.0,
    )


def compute_motion_tolerance_px(
    robot: RobotModel, lines_world: Floats, pose: Pose2, covariance: Floats,
) -> float:
    """Compute how far lines (m, 2, 3) may lie from where they are expected, by a pose covariance (3, 3) [px].

    The median over the lines of so many standard deviations across each; 0 without lines.
    """
    if not len(lines_world):
        return 0.0
    across = _compute_slopes(robot, lines_world, pose)
    middle = across.mean(axis=1)
    sigmas = np.sqrt(np.einsum("nk,kl,nl->n", middle, covariance, middle))
    return MOTION_TOLERANCE_SIGMAS * float(np.median(sigmas))


def _ratio(part: Floats, whole: Floats) -> float:
    total = float(np.sum(whole))
    return float(np.sum(part)) / total if total > 1e-9 else 0.0


def _compute_slopes(robot: RobotModel, lines_world: Floats, pose: Pose2) -> Floats:
    """How the ends of lines move across them by (x, y, heading), (m, 2, 3) [px]."""
    _, pixels, slopes = compute_point_jacobian(
        lines_world.reshape(-1, 3), robot.camera, pose, robot.mount.camera_from_robot)
    ends = pixels.reshape(-1, 2, 2)
    along = ends[:, 1] - ends[:, 0]
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(np.linalg.norm(along, axis=1), 1e-9)[:, None]
    return np.asarray(np.einsum("nj,nejk->nek", normal, slopes.reshape(-1, 2, 2, 3)))


TERMS = ("coverage", "coverage-and-significance", "proximity", "color_agreement", "coverage-and-color_agreement")
"""What is weighed: parts of the evidence, and products of parts that are stronger together."""
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

        Colors that disagree may have been painted over since the model was made: so they speak against a pose that its
        lines support only by :data:`P_REPAINTED`.
        """
        values = evidence.values[None]
        by_lines = float(self.lines_only.p_false(values)[0])
        if not evidence.color_count:
            return by_lines
        repainted = by_lines / (by_lines + P_REPAINTED * (1.0 - by_lines))
        return min(repainted, float(self.lines_and_colors.p_false(values)[0]))

    @staticmethod
    def from_table(table: dict[str, Any]) -> PoseConfidence:
        """Read the weights and limits from ``verification_weights.toml``."""
        return PoseConfidence(
            EvidenceWeights.from_table(table["lines_and_colors"]), EvidenceWeights.from_table(table["lines_only"]),
            float(table["accept"]), float(table["refute"]))


def compute_terms(evidence: Floats) -> Floats:
    """Compute the terms (n, t) of evidence (n, k), none negative, so that each term grows with each part."""
    coverage, significance, proximity, color_agreement, _ = evidence.T
    return np.column_stack(
        [coverage, coverage * significance, proximity, color_agreement, coverage * color_agreement])


POSE_CONFIDENCE = PoseConfidence.from_table(tomllib.loads(WEIGHTS_FILE.read_text("utf-8")))
"""The fitted weights and limits."""
