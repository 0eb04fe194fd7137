"""Journal: one Decision a cycle, written by the scheduler and by nobody else."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from blackboard.activation import Activation, Obviated
from blackboard.change import Change
from blackboard.encoding import ENCODERS, plain, quoted
from blackboard.entry import Entry, Ref
from blackboard.knowledge_source import KnowledgeSource
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
NOTHING = '""'
"""An empty text as JSON text."""


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
    if change.because:
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

    A line is the JSON text of :func:`decision_record`, written without making that first. What stands in several lines
    is written once and kept until the last of them: an activation is activated, runner-up, and chosen or obviated; what
    was made is seen in the next cycle.
    """

    def __init__(self) -> None:
        self._texts: dict[int, str] = {}
        self._bidders = _Bidders()
        self._last: Change | None = None
        self._last_ref = ""

    def __call__(self, d: Decision) -> str:
        """A decision's line, without its newline."""
        cycle, seen, observed, focus, activated, obviated, chosen, runner_up, pending, made, refused = d
        texts = self._texts
        told = ",".join([self._change(c) for c in observed]) if observed else ""
        refs = ",".join([self._ref(c) for c in seen]) if seen else ""
        bids = ",".join([self._bid(a) for a in activated]) if activated else ""
        next_best = "null" if runner_up is None else texts.get(runner_up.number) or self._bid(runner_up)
        dropped = ",".join([self._dropped(o) for o in obviated]) if obviated else ""
        executed = "null" if chosen is None else self._last_time(chosen)
        acts = ",".join([self._change(c) for c in made]) if made else ""
        return (
            f'{{"cycle":{cycle},"focus":"{WORDS[focus]}","observed":[{told}],"seen":[{refs}],"activated":[{bids}],'
            f'"obviated":[{dropped}],"chosen":{executed},"runner_up":{next_best},"pending":{pending},"made":[{acts}],'
            f'"refused":{quoted(refused) if refused else NOTHING}}}'
        )

    def _dropped(self, obviated: Obviated) -> str:
        a, reason = obviated
        return f'{self._last_time(a)[:-1]},"reason":{quoted(reason)}}}'

    def _bid(self, a: Activation) -> str:
        number, source, trigger, rating, since = a
        ref = self._last_ref if trigger is self._last else self._ref(trigger)
        text = self._texts[number] = (
            f'{{"number":{number},{self._bidders[source]},"trigger":{ref},"kind":"{type(trigger).__name__}",'
            f'"rating":{ENCODERS[type(rating)](rating)},"since":{since}}}'
        )
        return text

    def _last_time(self, a: Activation) -> str:
        """An activation that has come to its end."""
        text = self._texts.pop(a.number, None)
        if text is None:
            text = self._bid(a)
            del self._texts[a.number]
        return text

    def _ref(self, change: Change) -> str:
        """The revision's name, quoted; mostly the last one again: made, then seen, then the trigger of activations."""
        if change is not self._last:
            self._last, entry = change, change.entry
            self._last_ref = quoted(f"{entry.id}.{entry.revision}")
        return self._last_ref

    def _change(self, change: Change) -> str:
        id, revision, value, author, _cycle, because = change.entry
        self._last, self._last_ref = change, quoted(f"{id}.{revision}")
        kind = type(value)
        reasons = ""
        if change.because:
            reasons = f',"retracted_because":[{_refs(change.because)}]'
        return (
            f'{{"change":"{type(change).__name__}","entry":{self._last_ref},"type":{quoted(kind.__name__)},'
            f'"author":{quoted(author)},"because":[{_refs(because) if because else ""}],'
            f'"value":{ENCODERS[kind](value)}{reasons}}}'
        )


class _Bidders(dict[KnowledgeSource, str]):
    """What is told of a source with each of its activations."""

    def __missing__(self, source: KnowledgeSource) -> str:
        text = self[source] = f'"source":{quoted(source.name)},"level":"{WORDS[source.level]}"'
        return text


def _refs(refs: tuple[Ref, ...]) -> str:
    if len(refs) == 1:
        (id, revision), = refs
        return quoted(f"{id}.{revision}")
    return ",".join([quoted(f"{id}.{revision}") for id, revision in refs])
