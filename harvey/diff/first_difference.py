"""Diff: the first decision in which two runs differ, field by field, in plain words."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import zip_longest
from typing import Any

from harvey.run_files.records import Candidate, DecisionRecord, EntryRecord, as_line
from harvey.why.sentences import sentence
from world_models.words import count

MEANINGS: Mapping[str, str] = {
    "cycle": "the number of the cycle",
    "observed": "what came from outside",
    "seen": "the changes taken up",
    "obviated": "what was dropped from the agenda",
    "focus": "the level in focus",
    "activated": "who could act",
    "chosen": "what was chosen",
    "runner_up": "what came second",
    "pending": "how many were left pending",
    "made": "what the act brought about",
    "refused": "why the act was refused",
}
"""The fields of a decision, in the order in which one follows from the other."""

MOST = 6
"""How many differing values of one field are told."""

LONGEST = 60


class _Absent:
    """A value that is not there."""

    def __str__(self) -> str:
        return "nothing"


ABSENT = _Absent()


def first_difference(
    ours: Iterable[DecisionRecord], theirs: Iterable[DecisionRecord]
) -> tuple[int, DecisionRecord | None, DecisionRecord | None]:
    """How many decisions agree, and the pair that does not; (n, None, None) where all do."""
    agreed = 0
    for one, other in zip_longest(ours, theirs):
        if one is None or other is None or one.line != other.line:
            return agreed, one, other
        agreed += 1
    return agreed, None, None


def describe(agreed: int, one: DecisionRecord | None, other: DecisionRecord | None) -> Iterator[str]:
    """The answer in plain words; the runs are called first and second."""
    if one is None and other is None:
        yield f"The two runs agree in all of their {count(agreed, 'decision')}."
        return
    yield f"The two runs agree for {count(agreed, 'decision')}."
    if one is None or other is None:
        ended, name = ("first", "second") if one is None else ("second", "first")
        yield f"Then the {ended} run ends, while the {name} goes on: {_what(one or other)}."
        return
    yield f"In cycle {one.cycle} they differ:"
    if not (fields := [key for key in MEANINGS if as_line(one.data[key]) != as_line(other.data[key])]):
        yield "  only in how the line is written"
    for key in fields:
        yield f"  {MEANINGS[key]} ({key}):"
        yield from _field(key, one, other)


def _field(key: str, one: DecisionRecord, other: DecisionRecord) -> Iterator[str]:
    if key in ("observed", "made"):
        yield from _entries(getattr(one, key), getattr(other, key))
        return
    for name, decision in (("first", one), ("second", other)):
        yield f"    {name + ':':<8}{_to_text(key, decision)}"


def _entries(ours: tuple[EntryRecord, ...], theirs: tuple[EntryRecord, ...]) -> Iterator[str]:
    for a, b in zip_longest(ours, theirs):
        if a is not None and b is not None and _same(a, b):
            continue
        if a is not None and b is not None and a.ref == b.ref:
            yield f"    {a.ref}:"
            yield f"      first:  {sentence(a)}"
            yield f"      second: {sentence(b)}"
            yield from (f"      {line}" for line in _values(a, b))
        else:
            yield from (f"    only in the {name}: {e.ref}: {sentence(e)}"
                        for name, e in (("first", a), ("second", b)) if e is not None)


def _same(a: EntryRecord, b: EntryRecord) -> bool:
    return a == b and as_line(a.value) == as_line(b.value)


def _values(a: EntryRecord, b: EntryRecord) -> list[str]:
    """The differing leaves of two records of the same entry."""
    pairs = (("author", a.author, b.author), ("change", a.change, b.change), ("rests on", a.because, b.because))
    lines = [f"{name}: {short(x)} against {short(y)}" for name, x, y in pairs if x != y]
    leaves = [f"{path}: {short(x)} against {short(y)}" for path, x, y in differing_leaves(a.value, b.value)]
    more = [f"and {len(leaves) - MOST} more values"] if len(leaves) > MOST else []
    return lines + leaves[:MOST] + more


def differing_leaves(a: Any, b: Any, path: str = "") -> Iterator[tuple[str, Any, Any]]:
    """(path, left, right) of each value in which two JSON values differ; lists of other lengths differ as wholes.

    What only one of two objects has is :data:`ABSENT` in the other.
    """
    ours, theirs = ({} if x is ABSENT else x for x in (a, b))
    if isinstance(ours, Mapping) and isinstance(theirs, Mapping) and (ours or theirs):
        for key in {**ours, **theirs}:
            yield from differing_leaves(ours.get(key, ABSENT), theirs.get(key, ABSENT), f"{path}.{key}".lstrip("."))
    elif isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        for index, (x, y) in enumerate(zip(a, b, strict=True)):
            yield from differing_leaves(x, y, f"{path}[{index}]")
    elif ABSENT in (a, b) or as_line(a) != as_line(b):
        yield path or "value", a, b


def short(value: Any) -> str:
    """A value in a few words."""
    text = f"{len(value)} values" if isinstance(value, list) and len(value) > 4 else str(value)
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


def _to_text(key: str, d: DecisionRecord) -> str:
    value = getattr(d, key)
    if isinstance(value, tuple):
        return ", ".join(_candidate(v) if isinstance(v, Candidate) else str(v) for v in value) or "nothing"
    if isinstance(value, Candidate):
        return _candidate(value)
    return "nothing" if value in (None, "") else str(value).rstrip().splitlines()[-1]


def _candidate(c: Candidate) -> str:
    return f"{c.source} on {c.trigger} rated {c.rating:.4g}" + (f" ({c.reason})" if c.reason else "")


def _what(d: DecisionRecord | None) -> str:
    if d is None or d.chosen is None:
        return "nothing is chosen"
    return f"in cycle {d.cycle} {d.chosen.source} acts on {d.chosen.trigger}"
