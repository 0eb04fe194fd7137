"""Fit the weights of the evidence for a milestone, on floors that the experiment ``milestones`` does not use.

Writes ``verification_weights.toml``; copied to ``knowledge_sources/methods/verification/`` the milestone judge uses it.
The limits for *verified* and *refuted* follow from the fitted probabilities of the same cases.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from experiments.perception.milestones import compute_calibration_error, compute_reliability, judge_floors
from experiments.perception.milestones_cases import has_identical_doors
from experiments.perception.milestones_trials import JudgedCase
from experiments.report import Report
from experiments.trials import campaign_folder
from knowledge_sources.methods.verification import (
    EVIDENCE_NAMES,
    POSE_CONFIDENCE,
    TERMS,
    WEIGHTS_FILE,
    EvidenceWeights,
    PoseConfidence,
    PoseEvidence,
    compute_terms,
)

Floats = NDArray[np.float64]
FIRST_FLOOR, FLOORS, EACH = 1000, 20, 60
QUICK_FLOORS, QUICK_EACH = 1, 30
MAX_FALSE_ACCEPTS, MAX_FALSE_REJECTS = 0.001, 0.002
"""Shares of wrong places accepted and of right places rejected, by the fitted probabilities."""
FIT_RIDGE = 0.02
"""Ridge penalty of the fit of evidence weights."""
LIMITS = np.geomspace(1e-5, 0.1, 81)
REFUTED = np.linspace(0.5, 0.999, 500)


def run(quick: bool, seed: int) -> Report:
    """Fit on floors ``1000 + 100 seed`` and following."""
    folder = campaign_folder("milestones-calibrate", seed, quick=quick)
    floors, each = (QUICK_FLOORS, QUICK_EACH) if quick else (FLOORS, EACH)
    first = FIRST_FLOOR + 100 * seed
    cases = [j for j in judge_floors(first, floors, each, folder) if not j.is_same and not j.doubted]
    found = fit_confidence(cases)
    how = (f"{len(cases)} cases of {floors} floors from {first} on, painted and textured: harvey experiment"
           f" milestones-calibrate{' --quick' if quick else ''} --seed {seed}")
    (folder / WEIGHTS_FILE.name).write_text(format_toml(found, how), encoding="utf-8")
    weights = (POSE_CONFIDENCE.lines_and_colors, found.lines_and_colors, POSE_CONFIDENCE.lines_only, found.lines_only)
    rows = list(zip((*TERMS, "bias"), *((*w.each, w.bias) for w in weights), strict=True))
    rows += [("accept up to", POSE_CONFIDENCE.accept, found.accept, None, None),
             ("refute from", POSE_CONFIDENCE.refute, found.refute, None, None)]
    error = compute_calibration_error(compute_reliability(cases))
    return Report(
        "Weights of the evidence for a milestone",
        ("evidence", "in use", "fitted now", "lines only: in use", "lines only: fitted now"), tuple(rows),
        notes=(
            f"From {how}.",
            f"With the weights in use, stated and found probability differ by {error:.2%} on average over these cases.",
            f"To use the fit: cp {folder / WEIGHTS_FILE.name} {WEIGHTS_FILE.relative_to(WEIGHTS_FILE.parents[3])}",
        ),
        claims=(("no evidence speaks against a pose",
                 min(*found.lines_and_colors.each, *found.lines_only.each) >= 0.0),),
    )


def fit_confidence(cases: Sequence[JudgedCase]) -> PoseConfidence:
    """Fit the weights to judged cases, and derive the limits.

    The weights are not fitted on floors of identical doors: which door it is, the judge asks of the places that look
    alike (:mod:`knowledge_sources.methods.localization.aliasing`). The limits are of all floors.
    """
    evidence, right = np.array([j.evidence for j in cases]), np.array([not j.is_wrong for j in cases])
    told = np.array([not has_identical_doors(j.floor) for j in cases])
    tested = told & (evidence[:, EVIDENCE_NAMES.index("color_count")] > 0.0)
    fitted = PoseConfidence(
        fit_weights(evidence[tested], right[tested]), fit_weights(remove_colors(evidence[told]), right[told]),
        POSE_CONFIDENCE.accept, POSE_CONFIDENCE.refute)
    p = np.array([fitted.p_false(PoseEvidence(*values)) for values in evidence.tolist()])
    weight = np.where(right, 1.0 / max(1, right.sum()), 1.0 / max(1, (~right).sum()))
    return replace(fitted, accept=find_accept_limit(p, weight, right), refute=find_refute_limit(p, weight))


def find_accept_limit(p: Floats, weight: Floats, right: NDArray[np.bool_]) -> float:
    """Find the largest limit below which few enough wrong places lie, as expected and as found, one apart."""
    all_wrong, most_found = float(np.sum(weight * p)), max(1.0, MAX_FALSE_ACCEPTS * float(np.count_nonzero(~right)))
    good = [limit for limit in LIMITS if np.sum((weight * p)[p <= limit]) <= MAX_FALSE_ACCEPTS * all_wrong
            and np.count_nonzero((p <= limit) & ~right) <= most_found]
    return float(max(good, default=LIMITS[0]))


def find_refute_limit(p: Floats, weight: Floats) -> float:
    """Find the smallest limit beyond which the expected share of right places is small enough."""
    all_right = float(np.sum(weight * (1.0 - p)))
    good = [limit for limit in REFUTED if np.sum((weight * (1.0 - p))[p >= limit]) <= MAX_FALSE_REJECTS * all_right]
    return float(min(good, default=REFUTED[-1]))


def format_toml(confidence: PoseConfidence, how: str) -> str:
    """Write the file of weights, with a comment on how they were fitted."""
    return (
        f"# Weights of the evidence for a pose, in log odds; see pose_confidence.py. Fitted on\n# {how}.\n"
        f"# accept: {MAX_FALSE_ACCEPTS:.2%} of the wrong places lie below it; refute: {MAX_FALSE_REJECTS:.1%} of the"
        f" right ones lie above it.\naccept = {confidence.accept:.3g}\nrefute = {confidence.refute:.4g}\n"
        f"\n[lines_and_colors]\n{_table(confidence.lines_and_colors)}"
        f"\n[lines_only]   # whatever the colors say\n{_table(confidence.lines_only)}"
    )


def _table(weights: EvidenceWeights) -> str:
    return "".join(f"{name} = {value:.5f}\n" for name, value in zip((*TERMS, "bias"), (*weights.each, weights.bias),
                                                                  strict=True))


def fit_weights(evidence: Floats, is_right: NDArray[np.bool_]) -> EvidenceWeights:
    """Fit non-negative weights to evidence (n, k) of right and wrong poses (n,) by ridge logistic regression.

    Right and wrong poses count the same in total. Solved by L-BFGS-B.
    """
    right, wrong = max(1, int(np.count_nonzero(is_right))), max(1, int(np.count_nonzero(~is_right)))
    share = np.where(is_right, 0.5 / right, 0.5 / wrong)
    sign = np.where(is_right, 1.0, -1.0)
    rows = np.column_stack([compute_terms(evidence), np.ones(len(evidence))])

    def cost(weights: Floats) -> tuple[float, Floats]:
        margin = sign * (rows @ weights)
        slope = -share * sign / (1.0 + np.exp(np.minimum(margin, 700.0)))
        ridge = FIT_RIDGE * weights[:-1] / len(evidence)
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
