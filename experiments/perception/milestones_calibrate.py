"""What evidence for a milestone is worth: weights fitted on floors that the experiment ``milestones`` does not use.

Writes ``confidence.toml``; put in the place of ``knowledge_sources/methods/verification/verification_weights.toml`` it
is what the judge goes by. The limits for *verified* and *refuted* follow from the fitted probabilities of the same
cases.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from experiments.perception.milestones import calibration_error, judged_on, reliability
from experiments.perception.milestones_trials import Judged
from experiments.report import Report
from experiments.trials import campaign_folder
from knowledge_sources.methods.verification.pose_confidence import (
    FITTED,
    POSE_CONFIDENCE,
    TERMS,
    PoseConfidence,
    Weights,
    fitted,
    unseen,
)

Floats = NDArray[np.float64]
FIRST_FLOOR, FLOORS, EACH = 1000, 30, 180
QUICK_FLOORS, QUICK_EACH = 1, 45
FALSE_ACCEPTS, FALSE_REJECTS = 0.001, 0.002
"""Parts of the wrong and of the right places, by the fitted probabilities, that the limits let through."""
LIMITS = np.geomspace(1e-5, 0.1, 81)
REFUTED = np.linspace(0.5, 0.999, 500)


def run(quick: bool, seed: int) -> Report:
    """Floors ``1000 + 100 seed`` and following."""
    folder = campaign_folder("milestones-calibrate", seed, quick=quick)
    floors, each = (QUICK_FLOORS, QUICK_EACH) if quick else (FLOORS, EACH)
    first = FIRST_FLOOR + 100 * seed
    told = [j for j in judged_on(first, floors, each, folder) if not j.is_same and not j.doubted]
    found = fit_confidence(told)
    how = (f"{len(told)} cases of {floors} floors from {first} on: harvey experiment milestones-calibrate"
           f"{' --quick' if quick else ''} --seed {seed}")
    (folder / "confidence.toml").write_text(as_toml(found, how), encoding="utf-8")
    weights = POSE_CONFIDENCE.seeing, found.seeing, POSE_CONFIDENCE.blind, found.blind
    rows = list(zip((*TERMS, "bias"), *((*w.each, w.bias) for w in weights), strict=True))
    rows += [("accept up to", POSE_CONFIDENCE.accept, found.accept, None, None),
             ("refute from", POSE_CONFIDENCE.refute, found.refute, None, None)]
    error = calibration_error(reliability(told))
    return Report(
        "What evidence for a milestone is worth",
        ("evidence", "in use", "fitted now", "lines alone: in use", "fitted now"), tuple(rows),
        notes=(
            f"From {how}.", f"With what is in use, stated and found differ by {error:.2%} on average over these cases.",
            f"To go by it: cp {folder / 'confidence.toml'} {FITTED.relative_to(FITTED.parents[2])}",
        ),
        claims=(("no evidence speaks against a pose", min(*found.seeing.each, *found.blind.each) >= 0.0),),
    )


def fit_confidence(told: Sequence[Judged]) -> PoseConfidence:
    """The weights for what was judged, and the limits."""
    evidence, right = np.array([j.evidence for j in told]), np.array([not j.is_wrong for j in told])
    seeing, blind = fitted(evidence, right), fitted(unseen(evidence), right)
    p = seeing.p_false(evidence)
    weight = np.where(right, 1.0 / max(1, right.sum()), 1.0 / max(1, (~right).sum()))
    return PoseConfidence(seeing, blind, accept_limit(p, weight), refute_limit(p, weight))


def accept_limit(p: Floats, weight: Floats) -> float:
    """The largest limit below which, by the probabilities themselves, few enough of the wrong places lie."""
    all_wrong = float(np.sum(weight * p))
    good = [limit for limit in LIMITS if np.sum((weight * p)[p <= limit]) <= FALSE_ACCEPTS * all_wrong]
    return float(max(good, default=LIMITS[0]))


def refute_limit(p: Floats, weight: Floats) -> float:
    """The smallest limit beyond which few enough of the right places lie."""
    all_right = float(np.sum(weight * (1.0 - p)))
    good = [limit for limit in REFUTED if np.sum((weight * (1.0 - p))[p >= limit]) <= FALSE_REJECTS * all_right]
    return float(min(good, default=REFUTED[-1]))


def as_toml(confidence: PoseConfidence, how: str) -> str:
    """The file of weights, with how they were made."""
    return (
        f"# What evidence for a pose is worth, in log odds; see confidence.py. Fitted on\n# {how}\n"
        f"# accept: below it lie {FALSE_ACCEPTS:.2%} of the wrong places; refute: above it {FALSE_REJECTS:.1%} of the"
        f" right ones.\naccept = {confidence.accept:.3g}\nrefute = {confidence.refute:.4g}\n"
        f"\n[seeing]   # lines and the colours of faces\n{_table(confidence.seeing)}"
        f"\n[blind]   # lines alone, where no colours can be compared\n{_table(confidence.blind)}"
    )


def _table(weights: Weights) -> str:
    return "".join(f"{name} = {value:.5f}\n" for name, value in zip((*TERMS, "bias"), (*weights.each, weights.bias),
                                                                  strict=True))
