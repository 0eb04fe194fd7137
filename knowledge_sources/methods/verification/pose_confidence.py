"""The probability that a pose is wrong, from the evidence for it, by logistic regression.

The log odds of a right pose are a sum of the evidence, each part with a weight that is never negative: more evidence
never makes a pose less certain. The weights in ``verification_weights.toml`` were fitted on rendered pictures of
generated floors (``harvey experiment milestones-calibrate``) with a prior of one half; a mission is at a wrong place
less often, so that the probability is not too small.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from knowledge_sources.methods.arrays import Floats, Mask
from knowledge_sources.methods.verification.pose_evidence import EVIDENCE_NAMES, PoseEvidence
from knowledge_sources.settings import DEFAULT
from knowledge_sources.settings.verification import VerificationSettings

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
        """Compute the probability that the pose is wrong."""
        weights = self.lines_and_colors if evidence.color_count > 0.0 else self.lines_only
        return float(weights.p_false(evidence.values[None])[0])

    def accepts(self, p_false: float, prior_wrong: float = 0.5) -> bool:
        """Whether a pose is accepted that was wrong with probability ``prior_wrong`` before (Bayes' rule)."""
        wrong, right = p_false * prior_wrong, (1.0 - p_false) * (1.0 - prior_wrong)
        return wrong <= self.accept * (wrong + right)

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


def fit_weights(
    evidence: Floats, is_right: Mask, settings: VerificationSettings = DEFAULT.verification
) -> EvidenceWeights:
    """Fit non-negative weights to evidence (n, k) of right and wrong poses (n,) by ridge logistic regression.

    Right and wrong poses count the same in total. Solved by L-BFGS-B.
    """
    from scipy.optimize import minimize  # loaded when first used: missions have their weights

    right, wrong = max(1, int(np.count_nonzero(is_right))), max(1, int(np.count_nonzero(~is_right)))
    share = np.where(is_right, 0.5 / right, 0.5 / wrong)
    sign = np.where(is_right, 1.0, -1.0)
    rows = np.column_stack([compute_terms(evidence), np.ones(len(evidence))])

    def cost(weights: Floats) -> tuple[float, Floats]:
        margin = sign * (rows @ weights)
        slope = -share * sign / (1.0 + np.exp(np.minimum(margin, 700.0)))
        ridge = settings.fit_ridge * weights[:-1] / len(evidence)
        value = float(np.sum(share * np.logaddexp(0.0, -margin)) + 0.5 * np.sum(ridge * weights[:-1]))
        return value, np.asarray(rows.T @ slope + np.append(ridge, 0.0))

    bounds = [(0.0, None)] * len(TERMS) + [(None, None)]
    solution = minimize(cost, np.zeros(rows.shape[1]), jac=True, bounds=bounds, method="L-BFGS-B",
                        options={"maxiter": 2000, "ftol": 1e-14, "gtol": 1e-9}).x
    return EvidenceWeights(tuple(float(w) for w in solution[:-1]), float(solution[-1]))


def remove_colors(evidence: Floats) -> Floats:
    """Return the evidence (n, k) as it would be if no colors could be compared."""
    lines_only = evidence.copy()
    lines_only[:, [EVIDENCE_NAMES.index("color_agreement"), EVIDENCE_NAMES.index("color_count")]] = 0.0
    return lines_only
