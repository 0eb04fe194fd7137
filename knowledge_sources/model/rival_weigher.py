"""Rival weigher (§2, §4): what is not as expected has one explanation, and all that may explain it compete for it."""

from __future__ import annotations

from collections.abc import Iterable

from blackboard import Change, Effect, Posted, View, Watch, rule, to_say
from knowledge_sources.methods.belief import add_evidence
from knowledge_sources.priority import Priority
from knowledge_sources.reads import find_difference
from world_models.entries import Difference, Evidence


@rule(on=Watch(Evidence, (Posted,)), writes=Difference, priority=Priority.ENTER)
def rival_weigher(view: View, case: Change) -> Iterable[Effect]:
    """Adds evidence to the difference that it is about, and weighs the rivals anew."""
    evidence = case.entry
    known = find_difference(view, evidence.value.about)
    before = () if known is None else (known,)
    if any(evidence.value in entry.value.counted for entry in before):
        return
    effect = to_say(known, add_evidence(None if known is None else known.value, evidence.value), (evidence, *before))
    if effect is not None:
        yield effect
