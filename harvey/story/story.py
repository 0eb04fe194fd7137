"""The story of a run: its first lines, its sections and its milestones; as a page of text and as JSON types."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from textwrap import fill
from typing import Any

from harvey.errors import BadInput
from harvey.run_files.run_directory import RunDirectory
from harvey.story.end import headline, tell_end
from harvey.story.errand import tell_errand, tell_plans
from harvey.story.head import levels_off, run_name
from harvey.story.lost import tell_lost
from harvey.story.met import tell_camera, tell_contacts, tell_things
from harvey.story.milestones import MilestoneRow, milestone_lines, read_milestones
from harvey.story.parts import Section, Sentence
from harvey.story.turns import read_turning_points, turn_lines
from harvey.why.history import History
from harvey.why.journal import JournalHistory
from harvey.why.links import STRANGE
from logs.turning_points import TurningPoint

WIDTH = 120
MILESTONES = "Milestones"
LEGEND = """\
Places are in metres in each room's own frame. Times are by the body's clock. All of it is from the journal, as the
robot knew it, except where the simulator is named. Names in brackets are entries: ask on with harvey why RUN NAME, or
with harvey why RUN --at CYCLE."""


@dataclass(frozen=True, slots=True)
class RunStory:
    """What happened in a run.

    Attributes:
        opening: its first lines.
        turning_points: all of them, as the robot knew them.
        sections: what happened, by subject.
        milestones: what became of each.
    """

    opening: tuple[str, ...]
    turning_points: tuple[TurningPoint, ...]
    sections: tuple[Section, ...]
    milestones: tuple[MilestoneRow, ...]

    def record(self) -> dict[str, Any]:
        """As JSON types."""
        return asdict(self)


def opening(run: RunDirectory, history: History) -> Iterator[str]:
    """Which run it is, how it ended, and what went wrong on the way: the first lines of a story.

    Raises:
        BadInput: the journal has no decision, or ``result.json`` is malformed.
    """
    if not history.cycles:
        history.verify()
        raise BadInput(f"{history.source}: expected at least one decision, got none")
    try:
        yield f"{run_name(run)}: {headline(history)}."
        yield from levels_off(run)
        yield from turn_lines(history, run.read_result())
    except STRANGE as error:
        raise _strange(history, error) from error


def first_lines(path: Path | None) -> tuple[str, ...]:
    """As :func:`opening`, of a run that has just ended; none where it is not on the disk."""
    if path is None:
        return ()
    run = RunDirectory(path)
    return tuple(opening(run, JournalHistory(run.journal)))


def tell_run(run: RunDirectory, history: History) -> RunStory:
    """The story of a run. Raises BadInput where journal or ``result.json`` cannot be read as this version's."""
    first = tuple(opening(run, history))
    try:
        return _tell(first, history, run.read_result())
    except STRANGE as error:
        raise _strange(history, error) from error


def _tell(first: tuple[str, ...], history: History, result: Mapping[str, Any]) -> RunStory:
    turns = tuple(read_turning_points(history))
    sections = (
        tell_errand(history),
        tell_plans(history),
        tell_lost(history),
        tell_contacts(history, turns, result),
        tell_things(turns),
        tell_camera(history),
        tell_end(history, result),
    )
    return RunStory(first, turns, sections, read_milestones(history))


def _strange(history: History, error: Exception) -> BadInput:
    return BadInput(f"{history.source}: expected entries as this version writes them, got others ({error!r})")


def story_lines(story: RunStory) -> Iterator[str]:
    """The page; the milestones stand before how it ended."""
    yield from story.opening
    *before, last = story.sections
    for section in before:
        yield from ("", section.title, *_lines(section))
    yield from ("", MILESTONES, *(f"  {line}" for line in milestone_lines(story.milestones)))
    yield from ("", last.title, *_lines(last))
    yield from ("", LEGEND)


def _lines(section: Section) -> Iterator[str]:
    heads = [_head(sentence) for sentence in section.sentences]
    width = max(map(len, heads), default=0)
    for head, sentence in zip(heads, section.sentences, strict=True):
        refs = f"  [{', '.join(sentence.refs)}]" if sentence.refs else ""
        first = f"  {head:<{width}}" + "  " * (width > 0)
        yield fill(
            sentence.text + refs,
            WIDTH,
            initial_indent=first,
            subsequent_indent=" " * len(first),
            break_on_hyphens=False,
        )


def _head(sentence: Sentence) -> str:
    if sentence.cycle is None:
        return ""
    return f"cycle {sentence.cycle}" + ("" if sentence.time_s is None else f"  {sentence.time_s:7.1f} s")
