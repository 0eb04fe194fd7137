"""Obstruction finder (§4: models are incomplete): finds what occludes the lens and hides a part of each picture."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import islice

import numpy as np

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revise, Revised, View, Watch, to_say
from knowledge_sources.methods.floor import (
    MAX_FIXED_LOOKS,
    MIN_MOVED_M,
    build_polygon,
    enclose,
    explain_seen_in_patch,
    find_fixed,
    is_behind,
    judge_by,
    may_be_there,
)
from knowledge_sources.methods.localization import CameraView, update_obstruction
from knowledge_sources.priority import Priority
from knowledge_sources.reads import active_goal, find_difference, find_robot, unmeasured_doubt
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Evidence, FreeFloor, Obstacle, Obstruction, Segments
from world_models.frames import Pose2

MAX_OBSTRUCTION_LOOKS = 6  # number of last looks that are compared
MIN_OBSTRUCTION_LOOKS = 3  # what stands still in so many looks is before the camera; in two it may by chance
MIN_OBSTRUCTION_PART = 0.04  # smallest part of the picture that an obstruction covers


class ObstructionFinder(RobotKnowledgeSource):
    """Finds what is at the same place in pictures taken in several directions: it is before the camera.

    It acts when a milestone was not testable or the belief is in doubt, before the new picture is judged; and when what
    seems to stand on the floor keeps its place in the picture. While the robot is lost, the panorama builder does the
    same with its own pictures. Things on the floor that were seen nowhere but there are rather dirt.
    """

    level, priority = Level.PLAN, Priority.REVISE
    on = (
        Watch(Segments, (Posted,), lambda s: s.milestone != ""),
        Watch(FreeFloor, (Posted, Revised), lambda f: f.sense == "camera" and bool(f.things)),
        Watch(Obstruction, (Posted, Revised)),
    )
    writes = (Obstruction, Obstacle, Evidence)

    def bind(self, view: View, trigger: Change) -> tuple[Effect, ...] | None:
        """The change of what the board says of an obstruction, or of what was seen in it; None where there is none."""
        value, change = trigger.entry.value, None
        if isinstance(value, Obstruction):
            return tuple(self._take_back(view, trigger.entry)) or None
        if isinstance(value, FreeFloor):
            change = _find_fixed_box(view, trigger.entry)
        else:
            milestone = view.get(value.milestone)
            if milestone is not None and (milestone.value.tried or unmeasured_doubt(view) is not None):
                change = self._find_change(view)
        return None if change is None else (change,)

    def act(self, view: View, case: tuple[Effect, ...]) -> Iterable[Effect]:
        yield from case

    def _find_change(self, view: View) -> Effect | None:
        """The obstruction in all of the last looks, or in fewer, as it may be new; to be said, or None."""
        looks, known = _list_last_looks(view, MAX_OBSTRUCTION_LOOKS), view.latest(Obstruction)
        views = [CameraView(s.value.segments_px, Pose2(0.0, 0.0, heading_rad), np.zeros((3, 3)))
                 for s, heading_rad in looks]
        if len(views) < MIN_OBSTRUCTION_LOOKS:
            return None
        camera, before = find_robot(view).camera, None if known is None else known.value
        found = (update_obstruction(views[:number], camera, before, MIN_OBSTRUCTION_PART)
                 for number in range(len(views), MIN_OBSTRUCTION_LOOKS - 1, -1))
        now = next((one for one in found if one is not None), None)
        return to_say(known, now, (*(s for s, _ in looks), *(() if known is None else (known,))))

    def _take_back(self, view: View, found: Entry[Obstruction]) -> Iterable[Effect]:
        """Things that rest on nothing but sights within an obstruction are dirt."""
        shows = f"all that was seen of it is {found.ref}, which is before the camera"
        for entry in view.where(Obstacle, lambda o: may_be_there(o) and o.by == "camera" and o.touched_s is None):
            polygon = build_polygon(entry.value.footprint)
            sights = [(look, thing.box_px) for look in view.all(FreeFloor) for thing in look.value.things
                      if build_polygon(thing.footprint).intersects(polygon)]
            if sights and all(is_behind(box, found.value) for _, box in sights):
                last, known = sights[-1][0].value, find_difference(view, entry.value.name)
                dirt = Evidence(entry.value.name, shows, explain_seen_in_patch(MAX_FIXED_LOOKS), last.x_m, last.y_m,
                                0.0, MIN_MOVED_M, math.tau, last.seen_s)
                because = (found, entry, *dict.fromkeys(look for look, _ in sights))
                yield Post(dirt, because)
                yield Revise(entry, judge_by(dirt, entry.value, known, self._settings.action), because)


def _find_fixed_box(view: View, now: Entry[FreeFloor]) -> Effect | None:
    """The obstruction that a look at the floor shows with earlier ones, where the board does not say it."""
    known, camera = view.latest(Obstruction), find_robot(view).camera
    looks = [entry for entry in view.newest_first(FreeFloor) if entry.value.sense == "camera" and entry is not now]
    for thing in now.value.things:
        fixed = find_fixed(thing, (look.value.things for look in looks), camera)
        if len(fixed) == MAX_FIXED_LOOKS and (known is None or not is_behind(thing.box_px, known.value)):
            found = enclose([thing.box_px, *fixed.values()], None if known is None else known.value)
            because = (now, *(looks[number] for number in fixed), *(() if known is None else (known,)))
            return to_say(known, found, because)
    return None


def _list_last_looks(view: View, most: int) -> list[tuple[Entry[Segments], float]]:
    """The last looks for milestones, each with its heading [rad, world], the newest first.

    None is older than the goal: when lost, the robot did not know its heading.
    """
    goal = active_goal(view)
    since = 0 if goal is None else goal.cycle
    looked = ((s, view.get(s.value.milestone)) for s in view.newest_first(Segments) if s.cycle >= since)
    known = ((s, m.value.look_heading_rad) for s, m in looked if m is not None)
    return list(islice(known, most))
