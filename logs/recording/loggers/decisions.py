"""Decisions: a plain sentence and a table row a cycle for people, and the whole record for programs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from blackboard import Change, Decision, Retracted, Revised
from logs.recording.logger import Logger, Moment, Panel, Subject, log_view
from logs.recording.palette import DONE, LEVELS, REJECTED
from logs.recording.paths import RECORDS, TABLE
from logs.recording.stream import TROUBLE, Mixed, RecordingStream
from world_models import words
from world_models.building.locale_frame import FrameRequest, LocaleFrame, has_answer
from world_models.entries import Discrepancy, Drift, Hypothesis, Leg, Milestone

TROUBLES = ("refuted", "not testable", "superseded", "abandoned", "halted")
"""Statuses of milestones, sketches, goals, hypotheses and legs that stand for something gone wrong."""
COLUMNS = ("focus_level", "chosen_knowledge_source", "rating", "trigger_entry", "effects_on_the_board",
           "runner_up_with_rating", "waiting")
"""Of the decision table; the viewer makes a column as wide as its name."""
MARKS: Mapping[str, str] = {"ERROR": f"{TROUBLE} ", "WARN": f"{TROUBLE} ", "INFO": "", "DEBUG": ""}
RECORD = "record"
"""The component that holds a decision's line."""
ROW = Mixed(text=rr.TextLog, level=rr.TextLog, color=rr.TextLog)
"""The sentence, and what else the table has."""


class Decisions(Logger):
    """Logs every decision in three forms."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
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
        stream.log(RECORDS, ROW, **{RECORD: [self.subject.line_of(decision)]})
        level = log_level(decision)
        fields: dict[str, list[Any]] = {name: [value] for name, value in row(decision).items()}
        stream.log(TABLE, ROW, text=[MARKS[level] + sentence(decision, self._messages)], level=[level],
                   color=[_colour(decision)], **fields)


class Messages:
    """Words changes in their order; it remembers the last pose hypotheses, to tell by how much each was corrected."""

    def __init__(self) -> None:
        self._hypotheses: dict[str, Hypothesis] = {}

    def message(self, change: Change) -> str:
        """The first clause of the entry's own sentence; "" for a change that is not worth a word."""
        value = change.entry.value
        if isinstance(change, Retracted):
            return f"no longer believes {change.entry.id}"
        if isinstance(value, Hypothesis):
            return self._hypothesis(change, value)
        if isinstance(value, LocaleFrame):  # of a frame as filed the answered request tells, in the same cycle
            said = words.listed([one.sentence() for one in value.changes])
            return (f"believes of {value.name}: {said}" if said else
                    f"believes of {value.name} again what the file says" if isinstance(change, Revised) else "")
        if isinstance(value, FrameRequest) and has_answer(value):
            return _describe_answer(value)
        return "" if _is_detail(change) else words.brief(value)

    def _hypothesis(self, change: Change, new: Hypothesis) -> str:
        old = self._hypotheses.get(change.entry.id)
        self._hypotheses[change.entry.id] = new
        if not new.is_held or old is None or old.locale != new.locale or new.basis in ("command", "relocalization"):
            return words.brief(new)
        return f"the belief moves by {new.distance_from(old)}, by {new.basis}"


def _describe_answer(request: FrameRequest) -> str:
    errors = {answer.asked: answer.error for answer in request.answers if answer.error}
    asked = [name or "the whole building" for name in request.locales if name not in errors]
    known = [f"what is known of {words.listed(asked)}"] * bool(asked)
    places = [f"{answer.asked} is in {words.listed(answer.locales)}" for answer in request.answers if answer.locales]
    return f"answer: {', '.join([*known, *places, *errors.values()])}"


def _is_detail(change: Change) -> bool:
    """What another entry of the same cycle says already, or what changes with every move."""
    value = change.entry.value
    if isinstance(value, Leg | Milestone) and isinstance(change, Revised):
        return value.status == "moving" if isinstance(value, Leg) else not value.is_open
    return isinstance(value, Drift)


def sentence(decision: Decision, messages: Messages) -> str:
    """What was seen and decided, in words."""
    seen = _describe_changes(decision.observed, messages)
    given = f" [{seen}]" if seen else ""
    done = _describe_changes(decision.made, messages) or "changes nothing"
    if decision.chosen is None:
        return f"nobody had anything to do{given}"
    done = f"refused, {decision.refused.splitlines()[-1]}" if decision.refused else done
    return f"{words.source(decision.chosen.source.name)}: {done}{given}"


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
        str(decision.focus), chosen.source.name if chosen else "", float(chosen.rating) if chosen else 0.0,
        str(chosen.trigger.entry.ref) if chosen else "", _describe_effects(decision.made),
        f"{second.source.name} (rating {second.rating:.2f})" if second else "", float(decision.pending))
    return dict(zip(COLUMNS, values, strict=True))


def _describe_effects(made: Sequence[Change]) -> str:
    """What was done to entries of each kind: by the name of the entry where it is one."""
    counts = Counter((change.kind.lower(), type(change.entry.value).__name__) for change in made)
    named = {(change.kind.lower(), type(change.entry.value).__name__): change.entry.ref for change in made}
    parts = [f"{done} {named[done, kind]}" if number == 1 else f"{done} {number} x {kind}"
             for (done, kind), number in counts.items()]
    return ", ".join(parts) or "did nothing"


LOGGERS = (Decisions,)
