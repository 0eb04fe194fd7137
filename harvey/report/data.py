"""What a report's page scrubs through: decisions, entries with what they rest on, poses, candidates."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from harvey.run_files.records import EntryRecord
from harvey.why.decisions import time_at
from harvey.why.history import History
from harvey.why.links import words
from harvey.why.sentences import sentence, value_of
from world_models.building.world import World
from world_models.entries.location import Hypothesis


def cycles(history: History) -> Iterator[dict[str, Any]]:
    """Each decision: who acted, woken by what, and what came of it."""
    for decision in history.decisions():
        chosen = decision.chosen
        yield {
            "cycle": decision.cycle, "time_s": time_at(history, decision.cycle), "level": decision.focus,
            "who": "" if chosen is None else words(chosen.source), "trigger": "" if chosen is None else chosen.trigger,
            "observed": [record.ref for record in decision.observed if record.change != "Retracted"],
            "made": [record.ref for record in decision.made if record.change != "Retracted"],
            "refused": decision.refused}


def entries(history: History) -> dict[str, dict[str, Any]]:
    """Every revision by its ref: what it says, who wrote it when, and what it rests on."""
    found = {}
    for ref in history.refs:
        record = history.entry(ref)
        if record is not None:
            found[ref] = {"says": sentence(record), "by": words(record.author), "cycle": record.cycle,
                          "because": list(record.because)}
    return found


def beliefs(history: History, world: World | None) -> Iterator[dict[str, Any]]:
    """Each belief that was held: its pose and ellipse in the world frame; nothing where the world is not known."""
    for record in _hypotheses(history) if world is not None else ():
        value = value_of(record, Hypothesis)
        if world is not None and value.is_held:
            yield {"cycle": record.cycle, "ref": record.ref, "locale": value.locale, **placed(value, world)}


def candidates(history: History, world: World | None) -> Iterator[dict[str, Any]]:
    """Each place that came into question: from which cycle until which, and with which weight."""
    for record in _hypotheses(history) if world is not None else ():
        value = value_of(record, Hypothesis)
        if world is None or value.status != "candidate":
            continue
        id, _, revision = record.ref.rpartition(".")
        ends = (history.entry(f"{id}.{int(revision) + 1}"), history.retraction(record.ref))
        yield {"cycle": record.cycle, "until": min((end.cycle for end in ends if end is not None), default=None),
               "ref": record.ref, "locale": value.locale, "weight": value.weight, "place": value.place(),
               "evidence": value.evidence, **placed(value, world)}


def _hypotheses(history: History) -> Sequence[EntryRecord]:
    return [record for record in history.of_kind("Hypothesis") if record.change != "Retracted"]


def placed(value: Hypothesis, world: World) -> dict[str, float]:
    """Pose [m, rad] and one-sigma ellipse [m; angle of its longer axis, rad] in the world frame."""
    pose = value.world_from_robot(world)
    variances, axes = np.linalg.eigh(value.covariance_world(world)[:2, :2])
    small, large = np.sqrt(np.maximum(variances, 0.0))
    return {"x": pose.x_m, "y": pose.y_m, "heading": pose.heading_rad, "sigma": float(large),
            "sigma_short": float(small), "along": float(np.arctan2(axes[1, 1], axes[0, 1])),
            "sigma_heading": value.sigma_rad}
