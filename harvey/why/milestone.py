"""The story of a milestone: why it was looked for, what was expected, seen and judged, and what followed."""

from __future__ import annotations

import difflib
from collections.abc import Iterator

from blackboard.servoing import Discrepancy
from harvey.errors import BadInput
from harvey.run_files.records import EntryRecord
from harvey.why import facts
from harvey.why.decisions import describe_decision
from harvey.why.history import History
from harvey.why.links import STRANGE, reason, words
from harvey.why.model.frames import tell_changes, tell_model_lines
from harvey.why.model.world_file import WorldFile
from harvey.why.sentences import sentence, value_of
from harvey.why.story import Step, Story
from world_models.entries.location import Hypothesis
from world_models.entries.task import Certificate, Milestone, PlanSketch

FOLLOWED = ("Certificate", "Milestone", "Discrepancy")
"""The entries of a verdict; what they wake is what follows."""

REVISIONS = 8
"""So many revisions of a milestone are looked at for its verdict."""
MAX_LISTED = 12
"""So many milestones are named where none is similar."""


def milestones(history: History, name: str) -> tuple[str, ...]:
    """Ids of the milestones that a user means: ``Milestone-10``, ``M1 of hallway``, ``M1``, ``check``.

    Raises:
        BadInput: there is none of that name; near ones are listed.
    """
    ids = [id for id in history.newest if id.startswith("Milestone-")]
    low = name.lower()
    if exact := [id for id in ids if low in (id.lower(), history.newest[id].lower(), id.rpartition("-")[2])]:
        return tuple(exact)
    called = {id: _name_of(history, id) for id in ids}
    found = tuple(id for id, what in called.items() if _means(low, what.lower()))
    if not found:
        history.verify()
        there = list(dict.fromkeys(what.partition(", because")[0] for what in called.values()))
        near = difflib.get_close_matches(name, there, n=4, cutoff=0.4) or there[:MAX_LISTED]
        more = f" ... ({len(there)} in all)" if len(near) == MAX_LISTED < len(there) else ""
        known = f"{', '.join(near)}{more}" if near else "of which there are none"
        raise BadInput(f"--milestone: expected a milestone of the run, {known}, got {name!r}")
    return found


def _name_of(history: History, id: str) -> str:
    value = _last(history, id).value
    return str(value.get("what", "")) if isinstance(value, dict) else ""


def _means(low: str, what: str) -> bool:
    return what == low or what.startswith((low + " ", low + ",")) or (" " in low and low in what)


def _last(history: History, id: str) -> EntryRecord:
    found = history.entry(history.newest[id])
    if found is None:
        raise BadInput(f"{id}: expected it in the journal, which says nothing of it")
    return found


def milestone_story(history: History, id: str, world: WorldFile | None = None) -> Story:
    """Everything about one milestone, in the order in which it happened.

    Args:
        world: tells from which file and line model lines come; None where that is not asked for.

    Raises:
        BadInput: its entries have other fields than those known here.
    """
    last = _last(history, id)
    try:
        return _story(history, id, last, world)
    except STRANGE as error:
        what = "expected a milestone and its evidence as this version writes them, got others"
        raise BadInput(f"{id}: {what} ({error!r})") from None


def _story(history: History, id: str, last: EntryRecord, world: WorldFile | None) -> Story:
    revisions = [record for number in range(REVISIONS) if (record := history.entry(f"{id}.{number}")) is not None]
    first = revisions[0] if revisions else last
    verdicts = (reason(history, record, "Certificate") for record in reversed(revisions))
    certificate = next((found for found in verdicts if found is not None), None)
    steps = [*_tell_origin(history, first), *_tell_expectation(history, last, certificate)]
    if certificate is not None:
        steps += _tell_verdict(history, certificate, world)
        steps += _tell_consequences(history, certificate)
    elif last.value["status"] != "withdrawn":
        steps.append(Step("judged", f"It was never judged: when the run ended it was {last.value['status']}.",
                          (last.ref,)))
    if last.value["status"] == "withdrawn":
        steps += _tell_withdrawal(history, last)
    name = facts.milestone_name(value_of(last, Milestone))
    head = f"{name[0].upper()}{name[1:]}: {last.value['status']}."
    return Story(last.ref, head, describe_decision(history, first), tuple(steps))


def _tell_withdrawal(history: History, last: EntryRecord) -> Iterator[Step]:
    yield Step("withdrawn", f"The {words(last.author)} withdrew it in cycle {last.cycle}.", (last.ref,))
    yield from (Step("changed", text, (frame.ref,)) for text, frame in tell_changes(history, last))


def _tell_origin(history: History, first: EntryRecord) -> Iterator[Step]:
    doubt, sketch = reason(history, first, "Discrepancy"), reason(history, first, "PlanSketch")
    if doubt is not None:
        yield Step("wanted", facts.doubt(value_of(doubt, Discrepancy)), (doubt.ref,))
    if sketch is not None:
        yield Step("wanted", facts.plan(value_of(sketch, PlanSketch)), (sketch.ref,))


def _tell_expectation(history: History, last: EntryRecord, certificate: EntryRecord | None) -> Iterator[Step]:
    judged = None if certificate is None else reason(history, certificate, "Milestone")
    looked = judged or last
    belief = reason(history, looked, "Hypothesis")
    if belief is not None:
        pose = facts.pose(value_of(belief, Hypothesis))
        yield Step("believed", f"It believed that it stood at {pose}.", (belief.ref,))
    yield Step("expected", facts.expectation(value_of(looked, Milestone)), (looked.ref,))


def _tell_verdict(history: History, certificate: EntryRecord, world: WorldFile | None) -> Iterator[Step]:
    fix, milestone = reason(history, certificate, "PoseFix"), reason(history, certificate, "Milestone")
    match = None if fix is None else reason(history, fix, "LineMatch")
    segments = None if match is None else reason(history, match, "Segments")
    frame = None if segments is None else reason(history, segments, "Frame")
    if fix is not None:
        refs = tuple(r.ref for r in (fix, match, segments, frame) if r is not None)
        yield Step("seen", facts.describe_line_match(history, fix), refs)
        yield from (Step("model", *told) for told in tell_model_lines(history, fix, world))
    judged = None if milestone is None else value_of(milestone, Milestone)
    said = facts.verdict(value_of(certificate, Certificate), judged)
    yield Step("judged", said[0].upper() + said[1:], (certificate.ref,))


def _tell_consequences(history: History, certificate: EntryRecord) -> Iterator[Step]:
    """What those did whom the verdict woke."""
    for record in history.written_by(certificate.cycle):
        if record.type not in FOLLOWED:
            continue
        for decision in history.naming(record.ref):
            if decision.chosen is None or decision.chosen.trigger != record.ref:
                continue
            said = "; ".join(f"{r.ref}: {sentence(r)}" for r in decision.made if r.type != "Discrepancy")
            text = said or "; ".join(sentence(r) for r in decision.made) or decision.refused or "nothing came of it"
            yield Step("followed", f"In cycle {decision.cycle} the {words(decision.chosen.source)} acted: {text}.",
                       (record.ref,))
