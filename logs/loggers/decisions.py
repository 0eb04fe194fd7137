"""Decisions: a plain sentence and a table row a cycle for people, and the whole record for programs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from blackboard.activation import Activation
from blackboard.change import Change
from blackboard.journal import Decision
from blackboard.servoing import Discrepancy
from logs.mirror import Moment
from logs.paths import RECORDS, TABLE
from logs.tape import Tape

TROUBLES = ("refuted", "not testable", "superseded", "abandoned", "doubted", "halted")
"""Statuses of milestones, sketches, goals, hypotheses and legs that stand for something gone wrong."""

COLUMNS = ("focus_level", "chosen_knowledge_source", "rating", "trigger_entry", "effects_on_the_board",
           "runner_up_with_rating", "waiting")
"""Of the decision table; the viewer makes a column as wide as its name."""

RECORD = "record"
"""The component that holds a decision's line."""


class Decisions:
    """Logs every decision in three forms."""

    def __init__(self, line_of: Callable[[Decision], str]) -> None:
        """``line_of`` gives a decision's line in the journal."""
        self._line_of = line_of

    def begin(self, tape: Tape) -> None:
        """Nothing holds at all times."""

    def log(self, tape: Tape, moment: Moment) -> None:
        decision = moment.decision
        tape.add(RECORDS, **{RECORD: self._line_of(decision)})
        tape.add(TABLE, text=sentence(decision), level=log_level(decision), **row(decision))


def sentence(decision: Decision) -> str:
    """What was decided, in words."""
    if decision.chosen is None:
        return "nobody acted"
    who = f"{_bid(decision.chosen)} on {decision.chosen.trigger.entry.ref}"
    if decision.refused:
        return f"{who}: refused, {decision.refused.splitlines()[-1]}"
    return f"{who}: {_deeds(decision.made)}"


def log_level(decision: Decision) -> str:
    """INFO for the ordinary; WARN when something was refused or goes wrong; ERROR when an expert raised."""
    if decision.refused:
        return "ERROR" if decision.refused.startswith("raised") else "WARN"
    return "WARN" if any(map(_is_trouble, decision.made)) else "INFO" if decision.made else "DEBUG"


def _is_trouble(change: Change) -> bool:
    value = change.entry.value
    if isinstance(value, Discrepancy):
        return value.exceeds or value.status == "escalated" or (value.is_open and value.magnitude is None)
    return getattr(value, "status", "") in TROUBLES


def row(decision: Decision) -> dict[str, str | float]:
    """The decision table's columns, by :data:`COLUMNS`."""
    chosen, second = decision.chosen, decision.runner_up
    values = (
        str(decision.focus),
        chosen.source.name if chosen else "",
        float(chosen.rating) if chosen else 0.0,
        str(chosen.trigger.entry.ref) if chosen else "",
        _deeds(decision.made),
        _bid(second) if second else "",
        float(decision.pending),
    )
    return dict(zip(COLUMNS, values, strict=True))


def _bid(activation: Activation) -> str:
    return f"{activation.source.name} (rating {activation.rating:.2f})"


def _deeds(made: tuple[Change, ...]) -> str:
    counts = Counter((change.kind.lower(), type(change.entry.value).__name__) for change in made)
    named = {(c.kind.lower(), type(c.entry.value).__name__): str(c.entry.ref) for c in made}
    parts = [f"{kind} {named[kind, what]}" if count == 1 else f"{kind} {count} x {what}"
             for (kind, what), count in counts.items()]
    return ", ".join(parts) or "did nothing"
