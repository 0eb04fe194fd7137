"""What the robot was to do, and how it planned: goals and plan sketches, and what they were withdrawn for."""

from __future__ import annotations

from harvey.run_files.records import EntryRecord
from harvey.story.parts import Section, Sentence, sentence_of
from harvey.why import facts
from harvey.why.history import History
from harvey.why.links import nearest
from harvey.why.sentences import sentence, value_of
from world_models.entries.task import PlanSketch
from world_models.words import count, listed

WHAT_CHANGES = ("DoorState", "Obstacle", "Contact", "Told", "Redirection")
"""What changes the knowledge of a locale."""


def tell_errand(history: History) -> Section:
    """What was asked for, and what it was told on the way."""
    return Section(
        "What it was to do",
        tuple(
            sentence_of(history, f"{_capital(sentence(record))}.", record)
            for record in history.of_kind("Command", "Told", "Redirection")
            if record.observed
        ),
    )


def tell_plans(history: History) -> Section:
    """Each goal, each sketch, and each that was withdrawn."""
    told: list[Sentence] = []
    for record in history.of_kind("Goal", "PlanSketch"):
        text = _goal(record) if record.type == "Goal" else _sketch(history, record)
        told += [sentence_of(history, text, record)] if text else []
    return Section("How it planned", tuple(told))


def _goal(record: EntryRecord) -> str:
    return f"{_capital(sentence(record))}." if record.change == "Posted" or record.value["status"] != "active" else ""


def _sketch(history: History, record: EntryRecord) -> str:
    sketch = value_of(record, PlanSketch)
    if record.change == "Posted":
        look = "to look from elsewhere, " if sketch.is_look else ""
        return f"Plan {look}{sketch.where()}, {count(len(sketch.subgoals), 'part')}: to {_steps(sketch)}."
    if record.change != "Retracted" and sketch.status == "superseded":
        causes = listed([cause for ref in record.because if (cause := _cause(history, ref))]) or "it no longer held"
        part = f"in part {sketch.at + 1} of {len(sketch.subgoals)}"
        return f"The plan {sketch.where()} was withdrawn {part}, because of this: {causes}."
    return ""


def _steps(sketch: PlanSketch) -> str:
    return ", then ".join(
        facts.place(step.destination) + (f" by {step.passage}" if step.passage else "") for step in sketch.subgoals
    )


def _cause(history: History, ref: str) -> str:
    """What an entry says that a plan was withdrawn for, in its first clause."""
    record = history.entry(ref)
    if record is None:
        return ""
    if record.type == "Goal":
        asked = nearest(history, record, ("Redirection",))
        return "there was a new goal" if asked is None else f"it {sentence(asked).partition(';')[0]}"
    if record.type == "LocaleFrame":  # the changes of a frame are many; what made the last of them is told
        record = nearest(history, record, WHAT_CHANGES) or record
    return sentence(record).partition(";")[0]


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
