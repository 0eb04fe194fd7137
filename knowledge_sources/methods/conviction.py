"""How sure is the evidence? The probability that a pose is wrong, as counted on rendered pictures of made-up floors.

The logarithm of the odds that the pose is right is a sum of the evidence, each part with a weight that is never
negative: more evidence never makes a pose less sure. Weights come from ``conviction.toml``, which tells how they were
fitted (``harvey experiment milestones-calibrate``), and hold for a robot that is at a wrong place as often as not; in
a mission it is so far less often, so that the probability is no smaller than it should be.
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from knowledge_sources.methods.evidence import NAMES, Evidence

Floats = NDArray[np.float64]
TOGETHER = (("covered", "sharp"), ("covered", "faces"), ("sharp", "faces"))
"""Parts of the evidence that say more together than each for itself: their products count too."""
TERMS = (*NAMES, *(f"{a}-and-{b}" for a, b in TOGETHER))
FITTED = Path(__file__).with_name("conviction.toml")
RIDGE = 0.02
"""What a weight costs in the fit: little data shall not make it sure of anything."""


@dataclass(frozen=True, slots=True)
class Conviction:
    """What evidence is worth.

    Attributes:
        weights: of each term of the evidence (:data:`TERMS`), none negative.
        bias: log odds of a right pose with no evidence at all.
        accept, refute: with p_false at most ``accept`` a pose is verified, from ``refute`` on it is refuted.
    """

    weights: tuple[float, ...]
    bias: float
    accept: float
    refute: float

    def p_false(self, evidence: Evidence) -> float:
        """Probability that the pose is wrong."""
        parts = terms(evidence.values[None])[0].tolist()
        odds = self.bias + math.fsum(w * x for w, x in zip(self.weights, parts, strict=True))
        return 1.0 / (1.0 + math.exp(min(max(odds, -700.0), 700.0)))

    @staticmethod
    def of_table(table: dict[str, Any]) -> Conviction:
        """As ``conviction.toml`` has it."""
        weights = tuple(float(table["weights"][name]) for name in TERMS)
        return Conviction(weights, float(table["bias"]), float(table["accept"]), float(table["refute"]))


def terms(evidence: Floats) -> Floats:
    """(n, t) the terms of evidence (n, k), which is nowhere negative: so each grows with each part."""
    at = {name: number for number, name in enumerate(NAMES)}
    products = [evidence[:, at[a]] * evidence[:, at[b]] for a, b in TOGETHER]
    return np.column_stack([evidence, *products])


CONVICTION = Conviction.of_table(tomllib.loads(FITTED.read_text("utf-8")))
"""As it was fitted."""


def fitted(evidence: Floats, is_right: NDArray[np.bool_], accept: float, refute: float) -> Conviction:
    """The weights under which what was seen (n, k) is likeliest, right and wrong places counting the same in all."""
    share = np.where(is_right, 0.5 / max(1, np.count_nonzero(is_right)), 0.5 / max(1, np.count_nonzero(~is_right)))
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
    return Conviction(tuple(float(w) for w in found.x[:-1]), float(found.x[-1]), accept, refute)
