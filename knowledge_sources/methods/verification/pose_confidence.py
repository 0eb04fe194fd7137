"""How sure is the evidence? The probability that a pose is wrong, as counted on rendered pictures of made-up floors.

The logarithm of the odds that the pose is right is a sum of the evidence, each part with a weight that is never
negative: more evidence never makes a pose less sure. Weights come from ``confidence.toml``, which tells how they were
fitted (``harvey experiment milestones-calibrate``), and hold for a robot that is at a wrong place as often as not; in
a mission it is so far less often, so that the probability is no smaller than it should be.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from knowledge_sources.methods.verification.pose_evidence import NAMES, PoseEvidence

Floats = NDArray[np.float64]
TOGETHER = (("covered", "sharp"), ("covered", "faces"), ("sharp", "faces"))
"""Parts of the evidence that say more together than each for itself: their products count too."""
TERMS = (*NAMES, *(f"{a}-and-{b}" for a, b in TOGETHER))
FITTED = Path(__file__).with_name("verification_weights.toml")
RIDGE = 0.02
"""What a weight costs in the fit: little data shall not make it sure of anything."""


@dataclass(frozen=True, slots=True)
class Weights:
    """What evidence is worth.

    Attributes:
        each: of each term of the evidence (:data:`TERMS`), none negative.
        bias: log odds of a right pose with no evidence at all.
    """

    each: tuple[float, ...]
    bias: float

    def p_false(self, evidence: Floats) -> Floats:
        """(n,) probability that the pose is wrong, of evidence (n, k)."""
        odds = terms(evidence) @ np.array(self.each) + self.bias
        return np.asarray(1.0 / (1.0 + np.exp(np.clip(odds, -700.0, 700.0))))

    @staticmethod
    def of_table(table: dict[str, Any]) -> Weights:
        """As ``confidence.toml`` has them."""
        return Weights(tuple(float(table[name]) for name in TERMS), float(table["bias"]))


@dataclass(frozen=True, slots=True)
class PoseConfidence:
    """How sure evidence makes.

    Attributes:
        seeing: weights where the colours of faces can be compared; blind: where only lines can.
        accept, refute: with p_false at most ``accept`` a pose is verified, from ``refute`` on it is refuted.
    """

    seeing: Weights
    blind: Weights
    accept: float
    refute: float

    def p_false(self, evidence: PoseEvidence) -> float:
        """Probability that the pose is wrong."""
        weights = self.seeing if evidence.faces_tested > 0.0 else self.blind
        return float(weights.p_false(evidence.values[None])[0])

    def accepts(self, p_false: float, wrong_before: float = 0.5) -> bool:
        """Whether a pose is to be believed that was wrong with probability ``wrong_before`` as it seemed before."""
        wrong, right = p_false * wrong_before, (1.0 - p_false) * (1.0 - wrong_before)
        return wrong <= self.accept * (wrong + right)

    @staticmethod
    def of_table(table: dict[str, Any]) -> PoseConfidence:
        """As ``confidence.toml`` has it."""
        return PoseConfidence(Weights.of_table(table["seeing"]), Weights.of_table(table["blind"]),
                          float(table["accept"]), float(table["refute"]))


def terms(evidence: Floats) -> Floats:
    """(n, t) the terms of evidence (n, k), which is nowhere negative: so each grows with each part."""
    at = {name: number for number, name in enumerate(NAMES)}
    products = [evidence[:, at[a]] * evidence[:, at[b]] for a, b in TOGETHER]
    return np.column_stack([evidence, *products])


POSE_CONFIDENCE = PoseConfidence.of_table(tomllib.loads(FITTED.read_text("utf-8")))
"""As it was fitted."""


def fitted(evidence: Floats, is_right: NDArray[np.bool_]) -> Weights:
    """The weights under which what was seen (n, k) is likeliest, right and wrong places counting the same in all."""
    right, wrong = max(1, int(np.count_nonzero(is_right))), max(1, int(np.count_nonzero(~is_right)))
    share = np.where(is_right, 0.5 / right, 0.5 / wrong)
    sign = np.where(is_right, 1.0, -1.0)
    rows = np.column_stack([terms(evidence), np.ones(len(evidence))])

    def cost(weights: Floats) -> tuple[float, Floats]:
        margin = sign * (rows @ weights)
        slope = -share * sign / (1.0 + np.exp(np.minimum(margin, 700.0)))
        ridge = RIDGE * weights[:-1] / len(evidence)
        value = float(np.sum(share * np.logaddexp(0.0, -margin)) + 0.5 * np.sum(ridge * weights[:-1]))
        return value, np.asarray(rows.T @ slope + np.append(ridge, 0.0))

    bounds = [(0.0, None)] * len(TERMS) + [(None, None)]
    found = minimize(cost, np.zeros(rows.shape[1]), jac=True, bounds=bounds, method="L-BFGS-B",
                     options={"maxiter": 2000, "ftol": 1e-14, "gtol": 1e-9})
    return Weights(tuple(float(w) for w in found.x[:-1]), float(found.x[-1]))


def unseen(evidence: Floats) -> Floats:
    """The evidence (n, k) as it would be if no face could be compared."""
    blind = evidence.copy()
    blind[:, [NAMES.index("faces"), NAMES.index("faces_tested")]] = 0.0
    return blind
