"""Journal: one Decision a cycle, written by the scheduler and by nobody else."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from blackboard.activation import Activation, Obviated
from blackboard.change import Change, Retracted
from blackboard.encoding import encoder_of, plain, quoted
from blackboard.entry import Entry, Ref
from blackboard.level import WORDS, Level


class Decision(NamedTuple):
    """What one cycle saw, weighed and did.

    Attributes:
        cycle: its number.
        seen: the changes that were taken up.
        observed: those of them that came from outside: commands, camera, odometry.
        focus: the servo level in focus.
        activated: new activations.
        obviated: activations that were dropped, with reasons.
        chosen, runner_up: the activation that was executed and the next best.
        pending: how many were left.
        made: the changes that the act brought about.
        refused: why an act was not applied (stale, raised, effect of a kind not its own), or "".
    """

    cycle: int
    seen: tuple[Change, ...]
    observed: tuple[Change, ...]
    focus: Level
    activated: tuple[Activation, ...]
    obviated: tuple[Obviated, ...]
    chosen: Activation | None
    runner_up: Activation | None
    pending: int
    made: tuple[Change, ...] = ()
    refused: str = ""


Sink = Callable[[Decision], None]


def entry_record(entry: Entry[Any]) -> dict[str, Any]:
    """An entry as JSON types."""
    return {
        "entry": str(entry.ref),
        "type": type(entry.value).__name__,
        "author": entry.author,
        "because": [str(ref) for ref in entry.because],
        "value": plain(entry.value),
    }


def change_record(change: Change) -> dict[str, Any]:
    """A change as JSON types; a retraction that rests on something says so under ``retracted_because``."""
    record = {"change": change.kind, **entry_record(change.entry)}
    if isinstance(change, Retracted) and change.because:
        record["retracted_because"] = [str(ref) for ref in change.because]
    return record


def activation_record(a: Activation | None) -> dict[str, Any] | None:
    if a is None:
        return None
    return {
        "number": a.number,
        "source": a.source.name,
        "level": str(a.source.level),
        "trigger": str(a.trigger.entry.ref),
        "kind": a.trigger.kind,
        "rating": a.rating,
        "since": a.cycle,
    }


def decision_record(d: Decision) -> dict[str, Any]:
    """A decision as JSON types: every changed entry in full, everything else by name."""
    return {
        "cycle": d.cycle,
        "focus": str(d.focus),
        "observed": [change_record(c) for c in d.observed],
        "seen": [str(c.entry.ref) for c in d.seen],
        "activated": [activation_record(a) for a in d.activated],
        "obviated": [{**(activation_record(o.activation) or {}), "reason": o.reason} for o in d.obviated],
        "chosen": activation_record(d.chosen),
        "runner_up": activation_record(d.runner_up),
        "pending": d.pending,
        "made": [change_record(c) for c in d.made],
        "refused": d.refused,
    }


def decision_line(d: Decision) -> str:
    """One line of ``journal.jsonl``, without its newline: the same decision gives the same bytes."""
    return JournalLines()(d)


class JournalLines:
    """The decisions of one run as lines of its journal, one after the other.

    A line is the JSON text of :func:`decision_record`, written without making that first. An activation stands in
    several lines, as activated, as runner-up and as chosen or obviated; its text is made once and kept until then.
    """

    def __init__(self) -> None:
        self._texts: dict[int, tuple[Activation, str]] = {}

    def __call__(self, d: Decision) -> str:
        """A decision's line, without its newline."""
        activated = ",".join([self._text(a) for a in d.activated])
        runner_up = self._text(d.runner_up) if d.runner_up else "null"
        obviated = ",".join([f'{self._last_text(o.activation)[:-1]},"reason":{quoted(o.reason)}}}' for o in d.obviated])
        chosen = self._last_text(d.chosen) if d.chosen else "null"
        return (
            f'{{"cycle":{d.cycle},"focus":"{WORDS[d.focus]}","observed":[{_changes(d.observed)}],"seen":[{_seen(d.seen)}],'
            f'"activated":[{activated}],"obviated":[{obviated}],"chosen":{chosen},"runner_up":{runner_up},'
            f'"pending":{d.pending},"made":[{_changes(d.made)}],"refused":{quoted(d.refused)}}}'
        )

    def _text(self, a: Activation) -> str:
        known = self._texts.get(a.number)
        if known is not None and known[0] is a:
            return known[1]
        text = _activation(a)
        self._texts[a.number] = a, text
        return text

    def _last_text(self, a: Activation) -> str:
        known = self._texts.pop(a.number, None)
        return known[1] if known is not None and known[0] is a else _activation(a)


def _activation(a: Activation) -> str:
    source, trigger, rating = a.source, a.trigger, a.rating
    entry = trigger.entry
    return (
        f'{{"number":{a.number},"source":{quoted(source.name)},"level":"{WORDS[source.level]}",'
        f'"trigger":{quoted(f"{entry.id}.{entry.revision}")},"kind":"{type(trigger).__name__}",'
        f'"rating":{encoder_of(type(rating))(rating)},"since":{a.cycle}}}'
    )


def _changes(changes: tuple[Change, ...]) -> str:
    return ",".join([_change(c) for c in changes]) if changes else ""


def _change(change: Change) -> str:
    e = change.entry
    kind = type(e.value)
    reasons = ""
    if isinstance(change, Retracted) and change.because:
        reasons = f',"retracted_because":[{_refs(change.because)}]'
    return (
        f'{{"change":"{type(change).__name__}","entry":{quoted(f"{e.id}.{e.revision}")},"type":{quoted(kind.__name__)},'
        f'"author":{quoted(e.author)},"because":[{_refs(e.because)}],"value":{encoder_of(kind)(e.value)}{reasons}}}'
    )


def _refs(refs: Iterable[Ref]) -> str:
    return ",".join([quoted(f"{id}.{revision}") for id, revision in refs])


def _seen(changes: Iterable[Change]) -> str:
    return ",".join([quoted(f"{c.entry.id}.{c.entry.revision}") for c in changes])
