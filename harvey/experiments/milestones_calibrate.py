"""What evidence for a milestone is worth: weights fitted on floors that the experiment ``milestones`` does not use.

Writes ``conviction.toml``; put in the place of ``knowledge_sources/methods/conviction.toml`` it is what the judge goes
by. The limits for *verified* and *refuted* follow from the fitted probabilities of the same cases.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from harvey.experiments.milestones import calibration_error, judged_on, reliability
from harvey.experiments.milestones_trials import Judged
from harvey.experiments.report import Report
from harvey.experiments.trials import campaign_folder
from knowledge_sources.methods.conviction import CONVICTION, FITTED, TERMS, Conviction, fitted, terms

Floats = NDArray[np.float64]
FIRST_FLOOR, FLOORS, EACH = 1000, 30, 180
QUICK_FLOORS, QUICK_EACH = 1, 45
FALSE_ACCEPTS, FALSE_REJECTS = 0.001, 0.005
"""Parts of the wrong and of the right places, by the fitted probabilities, that the limits let through."""
LIMITS = np.geomspace(1e-5, 0.1, 81)
REFUTED = np.linspace(0.5, 0.999, 500)


def run(quick: bool, seed: int) -> Report:
    """Floors ``1000 + 100 seed`` and following."""
    folder = campaign_folder("milestones-calibrate", seed, quick=quick)
    floors, each = (QUICK_FLOORS, QUICK_EACH) if quick else (FLOORS, EACH)
    first = FIRST_FLOOR + 100 * seed
    told = [j for j in judged_on(first, floors, each, folder) if not j.is_same and not j.doubted]
    found = conviction_of(told)
    how = (f"{len(told)} cases of {floors} floors from {first} on: harvey experiment milestones-calibrate"
           f"{' --quick' if quick else ''} --seed {seed}")
    (folder / "conviction.toml").write_text(as_toml(found, how), encoding="utf-8")
    rows = [(name, now, new) for name, now, new in zip(
        (*TERMS, "bias", "accept up to", "refute from"),
        (*CONVICTION.weights, CONVICTION.bias, CONVICTION.accept, CONVICTION.refute),
        (*found.weights, found.bias, found.accept, found.refute), strict=True)]
    error = calibration_error(reliability(told))
    return Report(
        "What evidence for a milestone is worth", ("evidence", "in use", "fitted now"), tuple(rows),
        notes=(
            f"From {how}.", f"With what is in use, stated and found differ by {error:.2%} on average over these cases.",
            f"To go by it: cp {folder / 'conviction.toml'} {FITTED.relative_to(FITTED.parents[2])}",
        ),
        claims=(("no evidence speaks against a pose", min(found.weights) >= 0.0),),
    )


def conviction_of(told: Sequence[Judged]) -> Conviction:
    """The weights for what was judged, and the limits."""
    evidence, right = np.array([j.evidence for j in told]), np.array([not j.is_wrong for j in told])
    weighed = fitted(evidence, right, CONVICTION.accept, CONVICTION.refute)
    p = 1.0 / (1.0 + np.exp(np.clip(terms(evidence) @ np.array(weighed.weights) + weighed.bias, -700.0, 700.0)))
    weight = np.where(right, 1.0 / max(1, right.sum()), 1.0 / max(1, (~right).sum()))
    accept, refute = accept_limit(p, weight), refute_limit(p, weight)
    return Conviction(weighed.weights, weighed.bias, accept, refute)


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


def as_toml(conviction: Conviction, how: str) -> str:
    """The file of weights, with how they were made."""
    weights = "\n".join(f"{name} = {weight:.5f}" for name, weight in zip(TERMS, conviction.weights, strict=True))
    return (
        f"# What evidence for a pose is worth, in log odds; see conviction.py. Fitted on\n# {how}\n"
        f"# accept: below it lie {FALSE_ACCEPTS:.2%} of the wrong places; refute: above it {FALSE_REJECTS:.1%} of the"
        f" right ones.\n"
        f"bias = {conviction.bias:.5f}\naccept = {conviction.accept:.3g}\nrefute = {conviction.refute:.4g}\n\n"
        f"[weights]\n{weights}\n"
    )
