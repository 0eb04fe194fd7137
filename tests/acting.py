"""How a test asks a knowledge source, as the scheduler does: bind, then act on what was bound."""

from __future__ import annotations

from blackboard import Change, Effect, KnowledgeSource, View


def answer(source: KnowledgeSource, view: View, trigger: Change) -> tuple[Effect, ...] | None:
    """The effects by which it answers a trigger; None where it could not act."""
    case = source.find_case(view, trigger)
    return None if case is None else tuple(source.act(view, case))


def rating(source: KnowledgeSource, view: View, trigger: Change) -> float | None:
    """How urgent it finds a trigger; None where it could not act."""
    case = source.find_case(view, trigger)
    return None if case is None else source.rate(case)
