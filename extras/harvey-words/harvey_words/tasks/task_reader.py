"""Task reader (§3.3, §4): words become a task, or are answered with what was not understood."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import takewhile

from blackboard import Change, Effect, Entry, KnowledgeSource, Level, Post, Posted, Revise, View, Watch
from harvey_words.tasks.task_entries import Step, ToldTask, active_task, find_time_s
from harvey_words.tasks.task_places import find_places
from harvey_words.tasks.task_words import START, TaskWordsError, is_word_to_go_on, read_tokens, read_wanted, tells_way
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, NOT_ENDED, find_building, place_of
from world_models.building.locale_frame import FrameRequest
from world_models.commands import read_destination
from world_models.entries import GO_ON, Course, Goal, Impasse, MotorCommand, Place, Recovery, Redirection


class TaskReader(KnowledgeSource):
    """Says what it understood before anything moves, and puts the task on the board in place of what was to be done.

    A word for which a step waits ends that step. What cannot be understood is answered, and the robot goes on as
    before; what it was told at the start, it does nothing instead of: a wrong place is never silently the goal.
    """

    level, priority = Level.ACTION, Priority.ENTER
    on = (Watch(Redirection, (Posted,)), Watch(Goal, (Posted,), lambda goal: goal.is_active))
    needs = (NOT_ENDED, HELD)
    writes = (Redirection, ToldTask, Recovery, Impasse, FrameRequest)

    def bind(self, view: View, trigger: Change) -> Entry[Redirection] | None:
        """What was said first and is not answered yet; one place, on the way, is left to the goal changer."""
        return next((said for said in _list_unanswered(view) if active_task(view) or not _is_plain(said.value.text)
                     or _is_first(view, said)), None)

    def act(self, view: View, case: Entry[Redirection]) -> Iterable[Effect]:
        said, task, belief = case.value, active_task(view), HELD.of(view)
        for earlier in takewhile(lambda one: one.id != case.id, _list_unanswered(view)):
            yield Revise(earlier, replace(earlier.value, answer="but was asked again since"), (earlier, case))
        wait = view.latest(Recovery, lambda one: task is not None and one.fault == task.id and one.status != "over")
        if wait is not None and is_word_to_go_on(said.text):
            answer = Revise(case, replace(said, answer="and goes on with its task"), (case, wait))
            yield answer
            yield Revise(wait, replace(wait.value, status="over"), (answer, wait))
            return
        try:
            new = _read_task(view, said.text, replace(
                place_of(belief.value), heading_rad=belief.value.locale_from_robot.heading_rad))
        except ValueError as error:
            yield Revise(case, replace(said, answer=f"which cannot be: {error}"), (case,))
            if _is_first(view, case):
                yield Post(Impasse("failed", f"the task was not understood: {error}"), (case,))
            return
        order = " (in the order that is shortest)" if any(step.group for step in new.steps) else ""
        will = f"and will {', then '.join(step.tell()[0] for step in new.steps)}{order}"
        answer = Revise(case, replace(said, answer=will), (case, belief.entry))
        yield answer
        if task is not None:
            yield Revise(task, replace(task.value, status="given up"), (answer, task))
        yield Post(new, (answer, belief.entry))


def _list_unanswered(view: View) -> Sequence[Entry[Redirection]]:
    return view.where(Redirection, lambda asked: not asked.answer)


def _is_first(view: View, said: Entry[Redirection]) -> bool:
    """Whether it was said by the mission's file, before the robot has moved."""
    return said.value.by == "user" and view.latest(MotorCommand) is None and view.latest(Course) is None


def _is_plain(text: str) -> bool:
    """Whether it names one place and no more, or only lets the robot go on: the goal changer understands that."""
    if text == GO_ON or text.lstrip().startswith("("):
        return True
    try:
        wanted = read_wanted(text)
    except TaskWordsError:
        return not any(token.sort == "VERB" for token in read_tokens(text)[:1])
    return wanted == (Step("ptrans", wanted[0].phrase),) and wanted[0].phrase != START and not tells_way(text)


def _read_task(view: View, text: str, start: Place) -> ToldTask:
    """The task of a text; a place alone is one too. Raises ValueError, MissingEntryError."""
    building, now_s = find_building(view), find_time_s(view)
    try:
        wanted = read_wanted(text)
    except TaskWordsError:
        if not _is_plain(text):
            raise
        place = read_destination(text, building, building.find_rooms)
        return ToldTask(text, text, start, (Step("ptrans", text, place=place),))
    steps = tuple(replace(step, due_s=step.due_s and now_s + step.due_s)
                  for step in find_places(building, wanted, start))
    start = replace(start, heading_rad=None)
    return ToldTask(text, f"(do {' '.join(step.tell()[1] for step in wanted)})", start, steps)
