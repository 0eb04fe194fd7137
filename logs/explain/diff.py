"""Where two runs part, and why: the first decision that differs, field by field or down to the observation or setting
that it comes from; and how far apart they went."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from itertools import islice, takewhile, zip_longest
from typing import TYPE_CHECKING, Any, NamedTuple

from logs.explain.phrases import sentence
from logs.records import DecisionRecord, EntryRecord, as_line, is_a
from logs.run_directory import RunDirectory
from logs.tables import table
from logs.timeline import Timeline
from world_models import words
from world_models.entries import CameraPicture, Goal, Hypothesis, Milestone, MotorCommand, PlanSketch
from world_models.words import count, metres

if TYPE_CHECKING:
    from logs.run_head import RunHead

MOST_VALUES, MOST_SETTINGS = 20, 8
"""How many differing values of a decision, and how many settings, are shown."""
LONGEST = 60
"""Of a value [characters]."""
IGNORED = frozenset({"harvey", "code", "arithmetic", "folder", "world_sha256"})
"""Of a run's head: what is compared elsewhere, or follows from the rest."""
Records = Sequence[EntryRecord[Any]]
Maybe = EntryRecord[Any] | None


class _Absent:
    """A value that is not there."""

    def __str__(self) -> str:
        return "nothing"


ABSENT = _Absent()


def first_difference(ours: Timeline, theirs: Timeline) -> tuple[int, DecisionRecord | None, DecisionRecord | None]:
    """How many decisions agree, to the byte, and the pair that does not; (n, None, None) where all do."""
    lines = zip(*(map(history.line, history.cycles) for history in (ours, theirs)), strict=False)
    agreed = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], lines))
    return agreed, ours.cycle_of(agreed + 1), theirs.cycle_of(agreed + 1)


def describe(agreed: int, one: DecisionRecord | None, other: DecisionRecord | None) -> Iterator[str]:
    """The answer in plain words; the runs are called first and second."""
    if one is None and other is None:
        yield f"The two runs agree in all of their {count(agreed, 'decision')}."
        return
    yield f"The two runs agree for {count(agreed, 'decision')}."
    if one is None or other is None:
        (ended, name), d = (("first", "second"), other) if one is None else (("second", "first"), one)
        acts = "nothing is chosen" if d is None or d.chosen is None else (
            f"in cycle {d.cycle} {d.chosen.source} acts on {d.chosen.trigger}")
        yield f"Then the {ended} run ends, while the {name} goes on: {acts}."
        return
    yield f"In cycle {one.cycle} they differ:"
    yield from _acts(one, other)
    yield from (f"    {text}" for text in _values(one.data, other.data, MOST_VALUES))


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


def _values(a: Any, b: Any, most: int) -> list[str]:
    """The differing values of two JSON values, the first of them in a few words each."""
    leaves = [f"{path}: {_short(one)} against {_short(other)}" for path, one, other in differing_leaves(a, b)]
    return leaves[:most] + [f"and {len(leaves) - most} more"] * (len(leaves) > most)


def _short(value: Any) -> str:
    """A value in a few words."""
    text = f"{len(value)} values" if isinstance(value, list) and len(value) > 4 else str(value)
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


class Parting(NamedTuple):
    """Where two runs part.

    Attributes:
        observation: ref of the first entry from outside that is not the same in both; "" where all are.
        decision: cycle of the first decision that does something else; 0 where none does.
        motion: the first motor command that differs; "" where none does.
    """

    observation: str
    decision: int
    motion: str


def parting(ours: Timeline, theirs: Timeline, agreed: int) -> Parting:
    """Where two runs part that agree in their first ``agreed`` decisions."""
    observation, decision, motion = "", 0, ""
    for a, b in islice(zip(ours.decisions(), theirs.decisions(), strict=False), agreed, None):
        observation = observation or _first(a.observed, b.observed)
        if not decision and (_acted(a) != _acted(b) or a.refused != b.refused or _first(a.made, b.made)):
            decision = a.cycle
        motion = motion or _first(*([one for one in d.made if one.kind is MotorCommand] for d in (a, b)))
    return Parting(observation, decision, motion)


def _first(ours: Records, theirs: Records) -> str:
    """The first entry that is not the same in both; "" where all are."""
    differing = (a or b for a, b in zip_longest(ours, theirs) if not same(a, b))
    return next((one.ref for one in differing if one is not None), "")


def same(a: Maybe, b: Maybe) -> bool:
    """Whether two runs say the same of an entry, to the last bit."""
    return a == b if a is None or b is None else a == b and as_line(a.fields) == as_line(b.fields)


def _acted(d: DecisionRecord) -> tuple[str, str]:
    return ("", "") if d.chosen is None else (d.chosen.source, d.chosen.trigger)


def grounds(ours: Timeline, theirs: Timeline, ref: str) -> Iterator[tuple[EntryRecord[Any], EntryRecord[Any]]]:
    """From an entry that differs to the oldest difference that it rests on, by the shortest way.

    What is nearest is not what it came from: a belief that differs since the first picture rests on the last one too.
    """
    above: dict[str, str] = {ref: ""}
    met, roots = [ref], list[str]()
    for name in met:  # which grows meanwhile
        below = _differing(ours, theirs, name)
        roots += [name] * (not below)
        for under in below:
            if under not in above:
                above[under] = name
                met.append(under)
    way = [min(roots, key=lambda name: (ours.cycle_of_ref(name), name), default=ref)]
    while above[way[-1]]:
        way.append(above[way[-1]])
    for name in reversed(way):
        a, b = ours.entry(name), theirs.entry(name)
        if a is not None and b is not None:
            yield a, b


def _differing(ours: Timeline, theirs: Timeline, ref: str) -> list[str]:
    """The reasons of an entry that both runs have and that are not the same in both."""
    a, b = ours.entry(ref), theirs.entry(ref)
    shared = [name for name in a.because if name in b.because] if a is not None and b is not None else []
    pairs = ((name, ours.entry(name), theirs.entry(name)) for name in dict.fromkeys(shared))
    return [name for name, one, other in pairs if one is not None and other is not None and not same(one, other)]


def settings(first: RunHead, second: RunHead) -> Iterator[str]:
    """What was set differently, and by which code and on what it was decided where both say so and differ."""
    if first.harvey != second.harvey:
        yield f"decided by harvey {first.harvey} against {second.harvey}"
    elif first.code and second.code and first.code != second.code:
        yield f"decided by different code: {first.code} against {second.code}"
    if first.arithmetic and second.arithmetic and first.arithmetic != second.arithmetic:
        yield f"calculated on different processors: {first.arithmetic} against {second.arithmetic}"
    ours, theirs = ({key: value for key, value in json.loads(json.dumps(asdict(head))).items() if key not in IGNORED}
                    for head in (first, second))
    yield from _values(ours, theirs, MOST_SETTINGS)


def because(ours: Timeline, theirs: Timeline, agreed: int, settings: tuple[str, ...]) -> Iterator[str]:
    """Why the runs part, in sentences. The runs are called first and second."""
    where = parting(ours, theirs, agreed)
    if where.observation:
        late = 0 < where.decision < (ours.cycle_of_ref(where.observation) or theirs.cycle_of_ref(where.observation))
        later = ", after they had decided differently" if late else ""
        yield from _tell_entry(ours, theirs, where.observation, "observation", later)
        if all(is_a(history.entry(where.observation), CameraPicture) for history in (ours, theirs)):
            yield "  (the same picture was asked for, and another came: other noise, or the robot stood elsewhere)"
    if where.decision:
        yield from _tell_decision(ours, theirs, where, settings)
    if where.motion and where.motion != where.observation:
        yield from _tell_entry(ours, theirs, where.motion, "motion")
        yield from _tell_grounds(ours, theirs, where.motion)


def _tell_entry(ours: Timeline, theirs: Timeline, ref: str, what: str, later: str = "") -> Iterator[str]:
    cycle = ours.cycle_of_ref(ref) or theirs.cycle_of_ref(ref)
    yield f"The first {what} that differs is {ref}, in cycle {cycle}{later}:"
    yield from _both(ours.entry(ref), theirs.entry(ref))


def _both(a: Maybe, b: Maybe) -> Iterator[str]:
    yield f"  first:  {sentence(a) if a else 'none'}"
    yield f"  second: {sentence(b) if b else 'none'}"
    if a is not None and b is not None and sentence(a) == sentence(b) and not same(a, b):
        paths = [path for path, _, _ in differing_leaves(a.fields, b.fields)]
        yield f"  (they differ in {', '.join(paths[:4])})"


def _tell_decision(ours: Timeline, theirs: Timeline, where: Parting, settings: tuple[str, ...]) -> Iterator[str]:
    one, other = ours.decision(where.decision), theirs.decision(where.decision)
    head = f"The first decision that differs is in cycle {where.decision}"
    if _acted(one) != _acted(other):
        yield f"{head}:"
        yield from _acts(one, other)
    else:
        ref = _first(one.made, other.made)
        yield f"{head}, of the {words.source(_acted(one)[0])}: {ref or 'nothing'}"
        yield from _both(*(next((r for r in d.made if r.ref == ref), None) for d in (one, other)))
        if one.refused != other.refused:
            yield f"  refused in the {'first' if one.refused else 'second'}: {(one.refused or other.refused).strip()}"
        yield from _tell_grounds(ours, theirs, ref)
    if not where.observation or ours.cycle_of_ref(where.observation) > where.decision:
        yield from _minds(one, other, settings)


def _minds(one: DecisionRecord, other: DecisionRecord, settings: tuple[str, ...]) -> Iterator[str]:
    """Everything that came from outside was the same: then who decides is not."""
    for name, a, b in (("first", one, other), ("second", other, one)):
        if sources := sorted({c.source for c in a.activated} - {c.source for c in b.activated}):
            yield f"  able to act only in the {name}: {', '.join(map(words.source, sources))}"
    why = "see \"set differently\" above" if settings else "the runs name no setting that differs"
    yield f"Until then both observed the same, so the knowledge sources, their settings or their code differ: {why}."


def _tell_grounds(ours: Timeline, theirs: Timeline, ref: str) -> Iterator[str]:
    """What the difference comes from, down to what was observed."""
    for a, b in list(grounds(ours, theirs, ref))[1:]:
        yield f"  because of {a.ref}" + (", which came from outside" if a.observed else "") + ":"
        yield from (f"  {line}" for line in _both(a, b))


def _acts(one: DecisionRecord, other: DecisionRecord) -> Iterator[str]:
    """Who acts in each of two decisions, and what comes of it."""
    for name, d in (("first: ", one), ("second:", other)):
        if d.chosen is None:
            yield f"  {name} nobody acts"
        else:
            made = "; ".join(f"{r.ref}: {sentence(r)}" for r in d.made[:2])
            who = words.source(d.chosen.source)
            yield f"  {name} the {who} on {d.chosen.trigger}, rated {d.chosen.rating:.2f}: {made}"


def apart(first: RunDirectory, second: RunDirectory, ours: Timeline, theirs: Timeline) -> str:
    """How the two runs went, side by side."""
    rows = [["decisions", str(len(ours.cycles)), str(len(theirs.cycles))]]
    for kind in (MotorCommand, CameraPicture, Milestone, PlanSketch, Goal):
        rows.append([kind.__name__, *(str(len(h.ids_of(kind))) for h in (ours, theirs))])
    a, b = first.read_result(), second.read_result()
    for key in ("outcome", "final_error_m", "sim_time_s", "path_length_m", "relocalizations", "collisions"):
        if key in a or key in b:
            cells = (result.get(key) for result in (a, b))
            rows.append([key, *(f"{cell:.4g}" if isinstance(cell, float) else str(cell) for cell in cells)])
    far, at = _furthest(ours, theirs)
    tail = f"\nthe two beliefs were furthest apart before {at}: {metres(far)}" if at else ""
    return table(["", "first", "second"], rows) + tail


def _furthest(ours: Timeline, theirs: Timeline) -> tuple[float, str]:
    """How far apart the robots believed to stand when they gave the same motor command by number [m]."""
    far, at = 0.0, ""
    for ref in (ref for ref in ours.refs if ref.startswith("MotorCommand-")):
        a, b = ours.entry(ref), theirs.entry(ref)
        if a is None or b is None:
            break
        here, there = ours.reason(a, Hypothesis), theirs.reason(b, Hypothesis)
        if here is None or there is None or here.value.locale != there.value.locale:
            continue
        away = here.value.locale_from_robot.distance_to(there.value.locale_from_robot)
        if away > far:
            far, at = away, a.id
    return far, at
