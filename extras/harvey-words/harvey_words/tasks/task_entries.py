"""Told task (§3.3): what somebody wants, as steps in conceptual dependency, and what its sources ask of the board."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Literal

from blackboard import Effect, Entry, Revise, View, inference
from knowledge_sources.reads import active_goal, open_milestone
from world_models.entries import CameraPicture, MotionReport, Place, Recovery


@dataclass(frozen=True, slots=True)
class Step:
    """One step of a task.

    Attributes:
        act: ptrans, the robot goes; grasp, a helper loads a thing on it; atrans, somebody takes that; attend, it waits.
        phrase: the words for where to; place: that place, once it was looked up; what: the thing that is carried.
        other: the words for where to go where there is no way, instead: that place.
        group: steps next to each other of one group come in any order; 0 for none.
        wait_s: how long an attend lasts; 0 for until somebody says a word [s].
        due_s: by when it has to be done, from when it was told, then by the run's clock; 0 for no matter when [s].
        note: how it went, where that is not plain.
        is_told: whether the phrase tells a way, and names no place.
        mark: what the words of a way name here, by the model's name for it.
    """

    act: Literal["ptrans", "grasp", "atrans", "attend"]
    phrase: str = ""
    what: str = ""
    group: int = 0
    wait_s: float = 0.0
    due_s: float = 0.0
    other: str = ""
    place: Place | None = None
    instead: Place | None = None
    status: Literal["to do", "under way", "done", "failed"] = "to do"
    note: str = ""
    is_told: bool = False
    mark: str = ""

    def tell(self) -> tuple[str, str]:
        """What is done, in words and in conceptual dependency."""
        room, span = self.place.locale if self.place else self.phrase, f"{self.wait_s:g} s" if self.wait_s else "a word"
        by = f" by {self.mark}" * bool(self.mark)
        other = f", or where no way leads there to {self.instead.locale}" if self.instead else ""
        return {
            "ptrans": (f"go to {room}{by}{other}", f"(ptrans robot {self.place or room})"),
            "grasp": (f"have {self.what} loaded", f"(grasp helper {self.what})"),
            "atrans": (f"hand over {self.what}", f"(atrans {self.what} robot helper)"),
            "attend": (f"wait for {span}", f"(attend robot {span})")}[self.act]


@inference(keep=2, when=lambda task: not task.is_active)
@dataclass(frozen=True, slots=True)
class ToldTask:
    """What somebody wants of the robot.

    Attributes:
        text: as it was said; parse: its steps before their places were found, as an s-expression.
        start: where the robot was when it was told.
    """

    text: str
    parse: str
    start: Place
    steps: tuple[Step, ...]
    status: Literal["active", "ended", "given up"] = "active"

    @property
    def is_active(self) -> bool:
        return self.status == "active"

    @property
    def under_way(self) -> int | None:
        """The number of the step that is under way."""
        return next((number for number, step in enumerate(self.steps) if step.status == "under way"), None)

    def with_step(self, number: int, **changes: Any) -> ToldTask:
        """The same with another step; ended where none is left."""
        steps = (*self.steps[:number], replace(self.steps[number], **changes), *self.steps[number + 1:])
        left = any(one.status in ("to do", "under way") for one in steps)
        return replace(self, steps=steps, status=self.status if left else "ended")

    def sentence(self) -> str:
        said = (f"{step.tell()[0]}: {step.status}" + f" ({step.note})" * bool(step.note) for step in self.steps)
        return f"task {self.text!r}, {self.status}: {'; '.join(said)}"


def active_task(view: View) -> Entry[ToldTask] | None:
    """The task that is being done."""
    return view.latest(ToldTask, lambda task: task.is_active)


def find_time_s(view: View) -> float:
    """The body's time, as far as the board was told [s]."""
    told = (view.latest(MotionReport), view.latest(CameraPicture))
    waits = [wait.value.since_s + wait.value.waited_s for wait in view.all(Recovery)]
    return max((*(entry.value.sim_time_s for entry in told if entry is not None), *waits), default=0.0)


def leave_goal(view: View, because: Entry[ToldTask] | Revise) -> Iterable[Effect]:
    """What was pursued is not any more, and no milestone on the way to it waits to be judged."""
    goal, waiting = active_goal(view), open_milestone(view)
    if waiting is not None:
        yield Revise(waiting, replace(waiting.value, status="withdrawn"), (because, waiting))
    if goal is not None:
        yield Revise(goal, replace(goal.value, status="abandoned"), (because, goal))
