"""Journal: one Decision a cycle, written by the scheduler and by nobody else."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Callable, Mapping
from enum import Enum, IntEnum
from math import inf, isfinite, nan
from typing import Any, NamedTuple

from blackboard.agenda import Activation, Obviated
from blackboard.change import Change
from blackboard.entry import Entry, Ref
from blackboard.ladder import Flat, word_of

NOT_FINITE = frozenset(map(repr, (nan, inf, -inf)))
"""Floats that JSON has no word for; they are written as texts."""


def plain(value: Any) -> Any:
    """A value as JSON types: dataclasses and mappings become objects, arrays lists, bytes their length and SHA-256.

    A dataclass with a method ``journal_form`` stands in the journal as that says: by reference to where the rest is.

    Raises:
        ValueError: a value without a fixed order or form.
    """
    if isinstance(value, float):
        return value if isfinite(value) else repr(value)
    if type(value) is str or value is None:
        return value
    if isinstance(value, Enum):
        return value.name.lower()
    if isinstance(value, int | str):
        return value
    if isinstance(value, bytes):
        return {"bytes": len(value), "sha256": hashlib.sha256(value).hexdigest()}
    if isinstance(value, tuple | list):
        if set(map(type, value)) == {float} and all(map(isfinite, value)):
            return list(value)
        return [plain(v) for v in value]
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        if hasattr(value, "journal_form"):
            return plain(value.journal_form())
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    raise ValueError(f"expected a value of plain data, got a {type(value).__name__}")


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
        made: the changes of the act.
        refused: why an act was not applied (stale, raised, effect of a kind not its own), or "".
        used: the revisions of traced kinds that the act read, in order of kind and number.
        left: what left memory (:mod:`blackboard.retention`). It follows from the rest, so no journal has it.
    """

    cycle: int
    seen: tuple[Change, ...]
    observed: tuple[Change, ...]
    focus: IntEnum
    activated: tuple[Activation, ...]
    obviated: tuple[Obviated, ...]
    chosen: Activation | None
    runner_up: Activation | None
    pending: int
    made: tuple[Change, ...] = ()
    refused: str = ""
    used: tuple[Ref, ...] = ()
    left: tuple[Ref, ...] = ()


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
    if change.because:
        record["retracted_because"] = [str(ref) for ref in change.because]
    return record


def activation_record(a: Activation, flat: bool) -> dict[str, Any]:
    """An activation as JSON types; ``flat``: without its level."""
    return {
        "number": a.number,
        "source": a.source.name,
        **({} if flat else {"level": word_of(a.source.level)}),
        "trigger": str(a.trigger.entry.ref),
        "kind": a.trigger.kind,
        "rating": a.rating,
        "since": a.cycle,
    }


def decision_record(d: Decision) -> dict[str, Any]:
    """A decision as JSON types: every changed entry in full, everything else by name; levels where there are any."""
    flat = isinstance(d.focus, Flat)
    record = {
        "cycle": d.cycle,
        **({} if flat else {"focus": word_of(d.focus)}),
        "observed": [change_record(c) for c in d.observed],
        "seen": [str(c.entry.ref) for c in d.seen],
        "activated": [activation_record(a, flat) for a in d.activated],
        "obviated": [{**activation_record(o.activation, flat), "reason": o.reason} for o in d.obviated],
        "chosen": activation_record(d.chosen, flat) if d.chosen else None,
        "runner_up": activation_record(d.runner_up, flat) if d.runner_up else None,
        "pending": d.pending,
        "made": [change_record(c) for c in d.made],
        "refused": d.refused,
    }
    if d.used:
        record["used"] = [str(ref) for ref in d.used]
    return record


def decision_line(d: Decision) -> str:
    """One line of ``journal.jsonl``, without its newline: the same decision gives the same bytes."""
    return json.dumps(decision_record(d), separators=(",", ":"), allow_nan=False)
