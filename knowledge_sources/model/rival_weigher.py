"""Rival weigher (§2, §4): what is not as expected has one explanation, and all that may explain it compete for it."""

from __future__ import annotations

from collections.abc import Iterable

from blackboard import Change, Effect, Posted, View, Watch, rule, to_say
from knowledge_sources.methods.belief import add_evidence
from knowledge_sources.priority import Priority
from world_models.entries import Difference, Evidence


@rule(on=Watch(Evidence, (Posted,)), writes=Difference, priority=Priority.ENTER)
def rival_weigher(view: View, case: Change) -> Iterable[Effect]:
    """Adds evidence to the difference that it is about, and weighs the rivals anew."""
    evidence = case.entry
    known = view.latest(Difference, lambda d: d.about == evidence.value.about)
    before = Difference.unknown(evidence.value.about) if known is None else known.value
    if evidence.value in before.counted:
        return
    effect = to_say(known, add_evidence(before, evidence.value), (evidence, *(() if known is None else (known,))))
    if effect is not None:
        yield effect
