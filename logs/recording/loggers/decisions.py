"""Decisions: a plain sentence and a table row a cycle for people, and the whole record for programs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from blackboard.agenda import Activation
from blackboard.change import Change
from blackboard.journal import Decision
from blackboard.servoing import Discrepancy
from logs.recording.board_mirror import Moment
from logs.recording.logger import Logger, Panel, Subject, log_view
from logs.recording.messages import Messages
from logs.recording.palette import DONE, LEVELS, REJECTED
from logs.recording.paths import RECORDS, TABLE
from logs.recording.stream import TROUBLE, RecordingStream
from world_models import words

TROUBLES = ("refuted", "not testable", "superseded", "abandoned", "doubted", "halted")
"""Statuses of milestones, sketches, goals, hypotheses and legs that stand for something gone wrong."""

COLUMNS = ("focus_level", "chosen_knowledge_source", "rating", "trigger_entry", "effects_on_the_board",
           "runner_up_with_rating", "waiting")
"""Of the decision table; the viewer makes a column as wide as its name."""

MARKS: Mapping[str, str] = {"ERROR": f"{TROUBLE} ", "WARN": f"{TROUBLE} ", "INFO": "", "DEBUG": ""}

RECORD = "record"
"""The component that holds a decision's line."""


class Record:
    """A column of decisions' lines."""

    @classmethod
    def columns(cls, **components: Any) -> Iterable[Any]:
        return rr.AnyValues.columns(True, **components)


class TableRow:
    """Columns of the sentence and of the table."""

    @classmethod
    def columns(cls, **components: Any) -> Iterator[Any]:
        for name, values in components.items():
            kind = rr.TextLog if name in ("text", "level", "color") else None
            yield from kind.columns(**{name: values}) if kind else rr.AnyValues.columns(True, **{name: values})


class Decisions(Logger):
    """Logs every decision in three forms."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._line_of = subject.line_of
        self._messages = Messages()

    def panels(self) -> Sequence[Panel]:
        """The sentences, and behind them the table."""
        columns = [f"/{TABLE}:{name}" for name in COLUMNS]
        query = rrb.archetypes.DataframeQuery(timeline="cycle", select=["cycle", *columns])
        table = rrb.DataframeView(origin=TABLE, name="Decision table", query=query)
        return (Panel(log_view(TABLE, "What is decided: one decision a cycle", "body"), "decisions", 1, 13),
                Panel(table, "decisions", 1, 13))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        decision = moment.decision
        stream.log(RECORDS, Record, **{RECORD: [self._line_of(decision)]})
        level = log_level(decision)
        fields: dict[str, list[Any]] = {name: [value] for name, value in row(decision).items()}
        stream.log(TABLE, TableRow, text=[MARKS[level] + sentence(decision, self._messages)], level=[level],
                 color=[_colour(decision)], **fields)


def sentence(decision: Decision, messages: Messages) -> str:
    """What was seen and decided, in words."""
    seen = _describe_changes(decision.observed, messages)
    given = f" [{seen}]" if seen else ""
    done = _describe_changes(decision.made, messages) or "changes nothing"
    if decision.chosen is None:
        return f"nobody had anything to do{given}"
    who = words.source(decision.chosen.source.name)
    if decision.refused:
        return f"{who}: refused, {decision.refused.splitlines()[-1]}{given}"
    return f"{who}: {done}{given}"


def _describe_changes(changes: Iterable[Change], messages: Messages) -> str:
    return "; ".join(words.grouped(said for change in changes if (said := messages.message(change))))


def log_level(decision: Decision) -> str:
    """INFO for the ordinary; WARN when something was refused or goes wrong; ERROR when a knowledge source raised."""
    if decision.refused:
        return "ERROR" if decision.refused.startswith("raised") else "WARN"
    return "WARN" if any(map(_is_trouble, decision.made)) else "INFO" if decision.made else "DEBUG"


def _is_trouble(change: Change) -> bool:
    value = change.entry.value
    if isinstance(value, Discrepancy):
        return value.exceeds or value.status == "escalated" or (value.is_open and value.magnitude is None)
    return getattr(value, "status", "") in TROUBLES


def _colour(decision: Decision) -> tuple[int, int, int, int]:
    """Of the servo level at which the knowledge source works, as in the lanes; red where the act was refused."""
    if decision.refused:
        return REJECTED
    return LEVELS[str(decision.chosen.source.level)] if decision.chosen else DONE


def row(decision: Decision) -> dict[str, str | float]:
    """The decision table's columns, by :data:`COLUMNS`."""
    chosen, second = decision.chosen, decision.runner_up
    values = (
        str(decision.focus),
        chosen.source.name if chosen else "",
        float(chosen.rating) if chosen else 0.0,
        str(chosen.trigger.entry.ref) if chosen else "",
        _messages(decision.made),
        _bid(second) if second else "",
        float(decision.pending),
    )
    return dict(zip(COLUMNS, values, strict=True))


def _bid(activation: Activation) -> str:
    return f"{activation.source.name} (rating {activation.rating:.2f})"


def _messages(made: tuple[Change, ...]) -> str:
    counts = Counter((change.kind.lower(), type(change.entry.value).__name__) for change in made)
    named = {(c.kind.lower(), type(c.entry.value).__name__): str(c.entry.ref) for c in made}
    parts = [f"{kind} {named[kind, what]}" if count == 1 else f"{kind} {count} x {what}"
             for (kind, what), count in counts.items()]
    return ", ".join(parts) or "did nothing"


LOGGERS = (Decisions,)
