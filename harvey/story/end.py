"""How a run ended, as the robot knew it; and how far that was from the truth, where the simulator says so."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from harvey.run_files.records import EntryRecord
from harvey.story.parts import Section, Sentence, sentence_of
from harvey.why import facts
from harvey.why.decisions import time_at
from harvey.why.history import History
from harvey.why.sentences import sentence, value_of
from world_models.entries.location import Hypothesis
from world_models.entries.task import Outcome
from world_models.words import count, metres


def headline(history: History) -> str:
    """``reached in cycle 774, 104.6 s into the run``; of a run without an outcome where its journal ends."""
    outcome = outcome_of(history)
    cycle = history.cycles[-1] if outcome is None else outcome.cycle
    time_s = time_at(history, cycle)
    when = f"in cycle {cycle}" + ("" if time_s is None else f", {time_s:.1f} s into the run")
    return f"cut off {when}" if outcome is None else f"{value_of(outcome, Outcome).kind} {when}"


def outcome_of(history: History) -> EntryRecord | None:
    """The outcome of a run; None where it has none."""
    return next(iter([*history.of_kind("Outcome")][-1:]), None)


def tell_end(history: History, result: Mapping[str, Any]) -> Section:
    """The outcome, the last belief, and the errors that only the simulator knows."""
    outcome, told = outcome_of(history), list[Sentence]()
    if outcome is not None:
        said = sentence(outcome)
        told.append(sentence_of(history, f"{said[:1].upper()}{said[1:]}.", outcome))
    told += _tell_belief(history)
    text = ", ".join(_truth(result))
    told.append(
        Sentence(
            f"In truth, by the simulator's result.json: {text}."
            if text
            else "Where it truly was nobody recorded: there is no result of the simulator."
        )
    )
    return Section("How it ended", tuple(told))


def _tell_belief(history: History) -> Iterator[Sentence]:
    for ref in reversed([ref for ref in history.refs if ref.startswith("Hypothesis-")]):
        record = history.entry(ref)
        if record is not None and value_of(record, Hypothesis).is_held:
            now = history.newest[record.id] == ref and history.retraction(ref) is None
            text = "It believed that it stood at" if now else "The last place where it had believed to stand was"
            yield sentence_of(history, f"{text} {facts.pose(value_of(record, Hypothesis))}.", record)
            return


def _truth(result: Mapping[str, Any]) -> Iterator[str]:
    off_m, touched, path_m = (result.get(key) for key in ("final_error_m", "collisions", "path_length_m"))
    if off_m is None:
        return
    yield f"it stood {metres(off_m)} from the goal"
    if path_m is not None:
        yield f"had driven {path_m:.1f} m"
    if touched is not None:
        yield f"had touched something {count(touched, 'time')}" if touched else "had touched nothing"
    wrong = (result.get("milestones") or {}).get("false_accepts")
    if isinstance(wrong, int):
        yield f"and accepted {count(wrong, 'milestone')} wrongly" if wrong else "and accepted no milestone wrongly"
