"""Questions about the whole run: when was it lost, where did it touch anything, how far off was it in truth."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping

from harvey.run_files.run_directory import RunDirectory
from harvey.story.lost import tell_lost
from harvey.story.met import tell_contacts
from harvey.story.parts import Section
from harvey.story.truth import error_at, read_errors, sigmas
from harvey.story.turns import read_turning_points
from harvey.why.history import History
from harvey.why.story import Step, Story

BEYOND = 3.0
"""An error of more standard deviations is told as that."""


def answers(run: RunDirectory, history: History, question: str, at: int | None = None) -> list[Story] | None:
    """The answer's stories, of ``how far off`` in the cycle ``at``, else up to then; None where it is another question.

    Raises:
        BadInput: what it takes is not recorded.
    """
    asked = set(re.findall(r"[a-z]+", question.lower()))
    answer = next((answer for words, answer in ANSWERS.items() if asked & words), None)
    return None if answer is None else list(answer(run, history, at))


def _tell_lost(run: RunDirectory, history: History, at: int | None) -> Iterator[Story]:
    del run
    yield from _stories(tell_lost(history), at, "Up to then it was not lost.")


def _tell_touched(run: RunDirectory, history: History, at: int | None) -> Iterator[Story]:
    section = tell_contacts(history, tuple(read_turning_points(history)), run.read_result())
    yield from _stories(section, at, "Up to then it touched nothing.")


def _stories(section: Section, at: int | None, nothing: str) -> Iterator[Story]:
    told = [one for one in section.sentences if at is None or (one.cycle is not None and one.cycle <= at)]
    for one in told:
        when = "" if one.cycle is None else f"In cycle {one.cycle}" + (
            ": " if one.time_s is None else f", {one.time_s:.1f} s into the run: ")
        yield Story(one.refs[0] if one.refs else "", f"{when}{one.text}", "", ())
    if not told:
        yield Story("", nothing, "", ())


def _tell_error(run: RunDirectory, history: History, at: int | None) -> Iterator[Story]:
    """In a cycle; else at the end, at its worst, and when it was first further off than it was sure."""
    source = "As only the simulator knows, by the run's recording."
    if at is not None:
        history.decision(at)
        error = error_at(run, history, at)
        text = "it had no belief, or had not moved yet" if error is None else f"it stood {error.words()}"
        yield Story("" if error is None else error.ref, f"In cycle {at} {text}.", source, ())
        return
    errors = read_errors(run, history)
    if not errors:
        yield Story("", "It had no belief that could be held against the truth.", source, ())
        return
    worst, beyond = max(errors, key=lambda error: error.off_m), [one for one in errors if sigmas(one) > BEYOND]
    steps = [Step("worst", f"In cycle {worst.cycle} it stood {worst.words()}.", (worst.ref,))]
    if beyond:
        first = beyond[0]
        steps.append(Step("beyond", f"In {len(beyond)} of {len(errors)} beliefs it was off by more than {BEYOND:.0f}"
                                    f" sigma, first in cycle {first.cycle}: {first.words()}.", (first.ref,)))
    yield Story(errors[-1].ref, f"At the end, in cycle {errors[-1].cycle}, it stood {errors[-1].words()}.", source,
                tuple(steps))


Answer = Callable[[RunDirectory, History, int | None], Iterator[Story]]
ANSWERS: Mapping[frozenset[str], Answer] = {
    frozenset({"lost"}): _tell_lost,
    frozenset({"touch", "touched", "contact", "contacts", "collide", "collided", "collision", "collisions", "hit"}):
        _tell_touched,
    frozenset({"far", "off", "truth", "truly", "error"}): _tell_error,
}
"""By words of the question; the first that fits."""
