"""Step closer: ends a task's step when its goal is reached, no way leads there, it is late, or its wait is over."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from blackboard import Change, Effect, Entry, KnowledgeSource, Level, Post, Posted, Revise, Revised, View, Watch
from harvey_words.tasks.task_entries import Step, ToldTask, active_task, find_time_s, leave_goal
from knowledge_sources.priority import Priority
from knowledge_sources.reads import NOT_ENDED, NOT_LOST
from world_models.entries import Goal, Impasse, Milestone, MotionReport, Outcome, Recovery

MOST_WAITED_S = 600.0  # so long it waits for somebody who is asked to help
SEEN = "was seen"
Case = tuple[Entry[ToldTask], int, Entry[Any]]
"""A task, the number of its step that is under way, and what happened."""


class StepCloser(KnowledgeSource):
    """Says how a step ended, and after the last how the task did, where that is not what the mission monitor says.

    Where a milestone shows what the words of a way name there, it says so too. A goal that is reached was a visit on
    the way, where steps are left. Where there is no way, the step leads to the other place that was named for this, or
    it failed, once nobody has another look to take; the rest is done.
    """

    level = Level.PLAN  # before the mission monitor, which is of the goal level
    on = (Watch(Goal, (Revised,), lambda goal: goal.status == "reached"), Watch(MotionReport, (Posted,)),
          Watch(Milestone, (Revised,), lambda milestone: milestone.status == "verified"),
          Watch(Impasse, (Posted,), lambda impasse: impasse.is_open and impasse.kind == "blocked"),
          Watch(Recovery, (Revised,), lambda wait: wait.status != "asked" and not wait.request))
    needs = (NOT_ENDED, NOT_LOST)
    writes = (ToldTask, Goal, Impasse, Milestone, Recovery, Outcome)

    def bind(self, view: View, trigger: Change) -> Case | None:
        task, cause = active_task(view), trigger.entry
        number = None if task is None else task.value.under_way
        if task is None or number is None:
            return None
        step, goal = task.value.steps[number], view.get(getattr(cause.value, "goal", ""))
        is_ours = {MotionReport: step.place is not None and 0.0 < step.due_s < find_time_s(view),
                   Recovery: step.place is None and getattr(cause.value, "fault", "") == task.id,
                   Milestone: step.mark in getattr(cause.value, "landmarks", ()) and SEEN not in step.note,
                   Impasse: goal is not None and goal.value.is_active}.get(type(cause.value), True)
        return (task, number, cause) if is_ours else None

    def rate(self, case: Case) -> float:
        late = {Impasse: Priority.LOOK, Recovery: Priority.MOVE}  # after the lookout planner, and after what was said
        return late.get(type(case[-1].value), Priority.ENTER)

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        task, number, cause = case
        if isinstance(cause.value, Milestone):
            step = task.value.steps[number]
            note = f"{step.mark} {SEEN}" + f"; {step.note}" * bool(step.note)
            yield Revise(task, task.value.with_step(number, note=note), (task, cause))
            return
        changes = _find_changes(task.value.steps[number], cause.value, find_time_s(view))
        if changes is None:
            yield Revise(cause, replace(cause.value, status="asked"), (task, cause))
            return
        ended = Revise(task, task.value.with_step(number, **changes), (task, cause))
        yield ended
        if isinstance(cause.value, Goal) and ended.value.is_active:
            yield Revise(cause, replace(cause.value, status="visited"), (ended, cause))
        elif isinstance(cause.value, Impasse):
            yield Revise(cause, replace(cause.value, is_open=False), (ended, cause))
        if not isinstance(cause.value, Goal):
            yield from leave_goal(view, ended)
        done = [step.status == "done" for step in ended.value.steps]
        if not ended.value.is_active and not (all(done) and isinstance(cause.value, Goal)):
            said = f"{sum(done)} of {len(done)} steps were done; {ended.value.sentence()}"
            yield Post(Outcome("reached" if all(done) else "blocked", said), (ended,))


def _find_changes(step: Step, cause: Any, now_s: float) -> dict[str, Any] | None:
    """How the step ends, or that it begins again to another place; None where it waits on."""
    if isinstance(cause, Impasse) and step.instead is not None:
        return {"status": "to do", "place": step.instead, "instead": None, "note": f"instead, as {cause.reason}"}
    if isinstance(cause, Impasse):
        return {"status": "failed", "note": cause.reason}
    is_over = isinstance(cause, Recovery) and (cause.status == "over" or 0.0 < step.wait_s <= cause.waited_s)
    if isinstance(cause, Goal) or is_over:
        return {"status": "done"}
    is_late = 0.0 < step.due_s < now_s
    if isinstance(cause, Recovery) and not is_late and (step.wait_s or cause.waited_s < MOST_WAITED_S):
        return None
    return {"status": "failed", "note": f"not done after {now_s:.0f} s"}
