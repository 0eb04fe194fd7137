"""Rivals: the explanations of one difference share the odds of what they all explain.

Each rival has a prior, by how often such a thing happens, and the log likelihood ratios of the evidence. Looks that are
not independent count once (``odds``), for each rival by itself. What nobody has thought of stands at log odds 0 and is
never left out: so no rival is surer than the evidence for it, and one rival more never makes another surer.

Evidence that has nothing in common with any other comes of each stretch of a way anew, and what it speaks of may begin
at any time: it is added up in the order of time, and no rival falls below its prior (Page's cumulative sum, 1954), so
that what was well for long does not hide what has begun since.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from knowledge_sources.methods.belief.odds import (
    Alike,
    Look,
    add_looks,
    measure_common,
    to_log_odds,
    to_probability,
)
from world_models.entries import Difference, Evidence, Explanation, Rival
from world_models.entries.difference import RivalKind
from world_models.frames import Pose2

PRIORS: Mapping[RivalKind, float] = {
    "chance": 3.0, "thing": 0.0, "leaf": -1.0, "jamb": 0.0, "wall": 0.0, "dirt": -1.0,
    "still camera": -4.0, "late pictures": -4.5, "lens": -4.0, "focal length": -2.0,
    "mounting": -2.0, "wheels": -2.0, "turns": -2.0, "odometry": -4.0, "bumper": -4.0,
    "lamp": -2.0, "cover": -3.0, "exposure": -3.0, "elsewhere": -3.0, "pushed": -1.0, "mover": -1.0,
}
"""Log odds of a rival before any evidence, against what nobody has thought of: what is ordinary first."""
CHANCE_BESIDE = -2.0
"""Of chance where others stand beside in general, by some 8 cm: of eight one is within a centimetre."""
P_MISREAD = 0.02
"""Part of the looks that are misread as a whole: such a one looks as if its best rival were so (pictures of honest
missions, development seeds: 1 of 67 matched wrongly)."""
MAX_COUNTED = 12
"""So much evidence of one difference is kept: the strongest, and the newest of what is independent."""


def weigh_rivals(about: str, evidence: Sequence[Evidence], priors: Mapping[RivalKind, float] = PRIORS) -> Difference:
    """The difference that evidence of one name makes, in whatever order it came."""
    kept = sorted((*_keep([one for one in evidence if one.apart_m], _strength),
                   *_keep([one for one in evidence if not one.apart_m], _when)), key=_when)
    sums = {kind: _add(kind, priors[kind], kept) for kind in _list_kinds(kept)}
    most = max(0.0, *sums.values())
    total = math.exp(-most) + math.fsum(math.exp(log_odds - most) for log_odds in sums.values())
    rivals = [_tell(kind, kept, log_odds, math.exp(log_odds - most) / total) for kind, log_odds in sums.items()]
    rivals.sort(key=lambda rival: (-rival.log_odds, rival.kind))
    return Difference(about, tuple(rivals), tuple(kept), max(one.seen_s for one in evidence))


def add_evidence(known: Difference, one: Evidence) -> Difference:
    """What is known of a difference with one evidence more."""
    return weigh_rivals(one.about, (*known.counted, one))


def weigh_among(found: Difference, others: Sequence[Evidence]) -> Difference:
    """A difference of a door where others tell whether doors stand beside: so much likelier it does before a look."""
    known = weigh_rivals(found.about, others).find("jamb") if others else None
    if known is None:
        return found
    alone, beside = to_probability(PRIORS["chance"]), to_probability(CHANCE_BESIDE)
    chance = to_log_odds(alone + known.p * (beside - alone))
    return weigh_rivals(found.about, found.counted, {**PRIORS, "chance": chance})


def hedge(ratios: Mapping[RivalKind, float]) -> dict[RivalKind, float]:
    """Log likelihood ratios over chance as far as they stand where the look may be misread as a whole."""
    most, misread = max(0.0, *ratios.values()), P_MISREAD / (1.0 - P_MISREAD)
    least = math.log(math.exp(-most) + misread)
    return {kind: math.log(math.exp(ratio - most) + misread) - least for kind, ratio in ratios.items()}


def _list_kinds(evidence: Sequence[Evidence]) -> tuple[RivalKind, ...]:
    named = {e.kind for one in evidence for e in one.explanations}
    return tuple(kind for kind in PRIORS if kind in named)


def _keep(evidence: Sequence[Evidence], first: Callable[[Evidence], tuple[float, ...]]) -> list[Evidence]:
    return sorted(evidence, key=first, reverse=True)[:MAX_COUNTED]


def _add(kind: RivalKind, prior: float, evidence: Sequence[Evidence]) -> float:
    """The log odds of a rival by all evidence, the oldest first; what is nearest apart decides what is independent."""
    said = [(e.log_ratio, one) for one in evidence for e in one.explanations if e.kind == kind]
    alone = 0.0
    for ratio in (ratio for ratio, one in said if not one.apart_m):
        alone = max(0.0, alone + ratio)
    looks = [(Look(Pose2(one.x_m, one.y_m, one.heading_rad), ratio), one) for ratio, one in said if one.apart_m]
    if not looks:
        return prior + alone
    alike = Alike(max(one.apart_m for _, one in looks), max(one.apart_rad for _, one in looks))
    return prior + alone + add_looks([look for look, _ in looks], alike)


def _tell(kind: RivalKind, evidence: Sequence[Evidence], log_odds: float, p: float) -> Rival:
    """A rival in the words of the evidence that is surest of its size, the strongest of these; its size by all of it.

    What has no size, as a stretch that is too short to tell one, says nothing of it.
    """
    said = [(e, one) for one in evidence for e in one.explanations if e.kind == kind]
    sized = [told for told in said if told[0].sigma]
    best = max(reversed(sized or said), key=lambda told: (-told[0].sigma, told[0].log_ratio))[0]
    return Rival(kind, best.what, log_odds, p, *_measure(sized))


def _measure(said: Sequence[tuple[Explanation, Evidence]]) -> tuple[float, float]:
    """The size that independent evidence has in the mean, and its deviation: no less than how far apart they are.

    The surest counts whole; each other by what it has in common with none of the surer ones.
    """
    ordered = sorted(said, key=lambda told: (told[0].sigma, told[0].off, *_when(told[1])))
    looks, weights = list[Pose2](), list[float]()
    if not ordered:
        return 0.0, 0.0
    for told, one in ordered:
        alike, here = Alike(one.apart_m, one.apart_rad), Pose2(one.x_m, one.y_m, one.heading_rad)
        common = max((measure_common(here, other, alike) for other in looks), default=0.0) if one.apart_m else 0.0
        looks.append(here)
        weights.append((1.0 - common) / told.sigma**2)
    total = math.fsum(weights)
    off = math.fsum(w * told.off for w, (told, _) in zip(weights, ordered, strict=True)) / total
    chi2 = math.fsum(w * (told.off - off) ** 2 for w, (told, _) in zip(weights, ordered, strict=True))
    freedom = math.fsum(w * told.sigma**2 for w, (told, _) in zip(weights, ordered, strict=True)) - 1.0
    return off, math.sqrt(max(1.0, chi2 / freedom if freedom > 0.0 else 1.0) / total)


def _strength(one: Evidence) -> tuple[float, ...]:
    return max(abs(e.log_ratio) for e in one.explanations), *_when(one)


def _when(one: Evidence) -> tuple[float, ...]:
    return one.seen_s, one.x_m, one.y_m, one.heading_rad
