"""What the live page shows: made from decisions on the server's thread, so that the run only hands them over."""

from __future__ import annotations

import json
import math
from collections import deque
from queue import Empty, SimpleQueue
from typing import Any, NamedTuple

from blackboard import Change, Decision, Entry, Level, Retracted, highest
from harvey.report.data import place_in_picture, placed, shrink
from world_models import words
from world_models.building.world import World
from world_models.camera import Camera
from world_models.entries import (
    CameraPicture,
    Discrepancy,
    Goal,
    Hypothesis,
    LineMatch,
    Milestone,
    PlanSketch,
    PoseFix,
    Redirection,
    Segments,
)

DECISIONS, MILESTONES, SAID = 12, 12, 3
"""So many of the last are shown."""
TRAIL, TRAIL_STEP_M = 500, 0.1
"""So many of the last places, so far from one another, are kept."""


class Shown(NamedTuple):
    """A decision as far as it is shown.

    Attributes:
        trigger: the change that woke who was chosen, or the name of its entry.
        changes: what was observed and what was made.
    """

    cycle: int
    level: str
    who: str
    trigger: Change | str
    refused: str
    changes: tuple[Change, ...]


class LiveState:
    """Follows a run; a sink of it.

    Calling it hands a decision over and never waits. Everything else belongs to one other thread, the server's. What is
    kept does not grow with the run, but for what that thread has not taken yet.
    """

    def __init__(self, world: World, camera: Camera) -> None:
        self._world, self._camera = world, camera
        self._new: SimpleQueue[Decision | Shown | str] = SimpleQueue()
        self._decisions: deque[Shown] = deque(maxlen=DECISIONS)
        self._milestones: dict[str, Milestone] = {}
        self._believed: dict[str, Hypothesis] = {}
        self._belief: tuple[str, Hypothesis] | None = None
        self._picture: dict[str, Any] | None = None
        self._frame: Entry[CameraPicture] | None = None
        self._segments: Entry[Segments] | None = None
        self._match: Entry[LineMatch] | None = None
        self._lines: dict[str, Any] = {}
        self._goal: Entry[Goal] | None = None
        self._sketches: dict[str, PlanSketch] = {}
        self._said: dict[str, Redirection] = {}
        self._doubts: dict[str, Discrepancy] = {}
        self._trail: deque[tuple[str, float, float]] = deque(maxlen=TRAIL)
        self.ended = ""

    def __call__(self, decision: Decision) -> None:
        """The run's thread hands a decision over."""
        self._new.put(decision)

    def show(self, shown: Shown) -> None:
        """The same for a run that is only read."""
        self._new.put(shown)

    def end(self, how: str) -> None:
        """The run's thread says that there will be no more, and how it ended."""
        self._new.put(how)

    def take(self) -> bool:
        """Take what was handed over; whether there was anything."""
        taken = False
        while True:
            try:
                new = self._new.get_nowait()
            except Empty:
                return taken
            taken = True
            if isinstance(new, str):
                self.ended = new
                continue
            shown = new if isinstance(new, Shown) else _shown(new)
            self._decisions.append(shown)
            for change in shown.changes:
                self._follow(change)

    def message(self, state: str) -> str:
        """All that is shown, as JSON in one line; ``state`` is the gate's."""
        belief = None
        if self._belief is not None:
            ref, held = self._belief
            belief = {"ref": ref, "locale": held.locale, "says": held.sentence(), **placed(held, self._world)}
        candidates = [
            {"id": id, "locale": one.locale, "place": one.place(), "weight": one.weight, "evidence": one.evidence,
             **placed(one, self._world)}
            for id, one in self._believed.items() if one.status == "candidate"]
        contents = {
            "state": "ended" if self.ended else state, "ended": self.ended,
            "cycle": self._decisions[-1].cycle if self._decisions else 0,
            "time_s": None if self._frame is None else self._frame.value.sim_time_s,
            "goal": "" if self._goal is None else self._goal.value.destination.words(),
            "lost": next((doubt.what for doubt in self._doubts.values()), ""),
            "way": self._list_way(), "trail": list(self._trail),
            "belief": belief, "candidates": candidates, "picture": self._draw_picture(),
            "milestones": [{"id": id, "what": one.what, "status": one.status}
                           for id, one in self._milestones.items()],
            "said": [one.sentence() for one in self._said.values()],
            "decisions": [_row(decision) for decision in self._decisions],
        }
        return json.dumps(contents, separators=(",", ":"))

    def _follow(self, change: Change) -> None:
        entry, value = change.entry, change.entry.value
        for kept, shows in ((self._sketches, isinstance(value, PlanSketch) and value.is_active),
                            (self._doubts, isinstance(value, Discrepancy) and value.is_open and value.level is highest(
                                Level))):
            kept.pop(entry.id, None)
            if shows and not isinstance(change, Retracted):
                kept[entry.id] = value
        if isinstance(value, Hypothesis):
            self._believed.pop(entry.id, None)
            if not isinstance(change, Retracted):
                if value.is_held:
                    self._belief = str(entry.ref), value
                    self._walk(value)
                elif value.status == "candidate":
                    self._believed[entry.id] = value
        elif isinstance(change, Retracted):
            return
        elif isinstance(value, Goal):
            self._goal = entry if value.is_active else self._goal
        elif isinstance(value, Milestone):
            self._milestones.pop(entry.id, None)
            self._milestones[entry.id] = value
            while len(self._milestones) > MILESTONES:
                del self._milestones[next(iter(self._milestones))]
        elif isinstance(value, Redirection):
            self._said[entry.id] = value
            while len(self._said) > SAID:
                del self._said[next(iter(self._said))]
        elif isinstance(value, CameraPicture):
            self._frame = entry
            self._lines = {}
        elif isinstance(value, Segments):
            self._segments = entry
            if self._shows(value.frame):
                self._lines = {"found": place_in_picture(value.segments_px, self._camera)}
        elif isinstance(value, LineMatch):
            self._match = entry
        elif isinstance(value, PoseFix):
            self._agree(value)

    def _walk(self, belief: Hypothesis) -> None:
        here = belief.world_from_robot(self._world)
        if not self._trail or math.dist(self._trail[-1][1:], here.position) >= TRAIL_STEP_M:
            self._trail.append((belief.locale, round(here.x_m, 3), round(here.y_m, 3)))

    def _list_way(self) -> list[tuple[str, float, float]]:
        """Where the sketches of the goal lead from here, the most detailed first."""
        goal = None if self._goal is None else self._goal.id
        way: list[tuple[str, float, float]] = []
        asked = sorted((s for s in self._sketches.values() if s.goal == goal), key=lambda s: -len(s.path))
        for depth, sketch in enumerate(asked):
            for subgoal in sketch.subgoals[sketch.at + (depth > 0):]:
                there = subgoal.destination.in_world(self._world)
                way.append((subgoal.destination.locale, round(there.x_m, 3), round(there.y_m, 3)))
        return way

    def _agree(self, fix: PoseFix) -> None:
        match, seen = self._match, self._segments
        if (match is not None and seen is not None and fix.match == match.id and match.value.segments == seen.id
                and self._shows(seen.value.frame)):
            self._lines["agreed"] = place_in_picture(match.value.segments_px[fix.inliers], self._camera)

    def _shows(self, frame: str) -> bool:
        return self._frame is not None and self._frame.id == frame

    def _draw_picture(self) -> dict[str, Any] | None:
        if self._frame is None:
            return None
        ref = str(self._frame.ref)
        if self._picture is None or self._picture["ref"] != ref:
            data, size = shrink(self._frame.value.jpeg)
            self._picture = {"ref": ref, "jpeg": data, "size": size}
        return {**self._picture, **self._lines}


def _shown(decision: Decision) -> Shown:
    chosen = decision.chosen
    return Shown(
        decision.cycle, str(decision.focus), "" if chosen is None else words.source(chosen.source.name),
        "" if chosen is None else chosen.trigger, decision.refused, (*decision.observed, *decision.made))


def _row(shown: Shown) -> dict[str, Any]:
    return {
        "cycle": shown.cycle, "level": shown.level, "refused": shown.refused.strip().split("\n")[-1],
        "who": shown.who, "trigger": shown.trigger if isinstance(shown.trigger, str) else _says(shown.trigger),
        "made": [{"says": _says(change), "because": [str(ref) for ref in change.because or change.entry.because]}
                 for change in shown.changes],
    }


def _says(change: Change) -> str:
    gone = "; no longer believed" if isinstance(change, Retracted) else ""
    return f"{change.entry.ref}: {words.sentence(change.entry.value)}{gone}"
