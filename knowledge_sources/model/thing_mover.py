"""Thing mover (§4): what was seen by a belief that proved a little wrong is moved as the belief is, not forgotten."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from blackboard import Change, Effect, Entry, Level, Post, Ref, Revise, Revised, View, Watch
from knowledge_sources.methods.floor import explain_seen_elsewhere, judge_by, may_be_there, move_thing
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, find_difference
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Certificate, Difference, Evidence, Hypothesis, Obstacle
from world_models.frames import Pose2, wrap_angle

MAX_DRIFT_M = 0.5  # a belief that was further off was not worn out on the way: the robot was kidnapped
MAX_DRIFT_RAD = 0.35  # the same of its heading


Case = tuple[Pose2, tuple[Entry[Obstacle], ...], tuple[Entry[Any], ...]]
"""The pose that was found, as seen from the one that was believed; what is moved; the certificate before it, if any."""


class ThingMover(RobotKnowledgeSource):
    """Moves what was seen on the floor since a milestone was last verified, where the belief was a little off.

    It was seen from the robot, so it stands where it stood as seen from there, less surely by what the belief was off.
    Was the robot kidnapped, what it saw on the way was seen before or after that: it stays where it is, or stands
    elsewhere, half as likely. A thing leaves only when its floor is seen free. What was touched stays: a
    contact was weighed at a milestone.
    """

    level, priority = Level.ACTION, Priority.REVISE
    on = (Watch(Hypothesis, (Revised,), lambda h: h.is_held and h.correction is not None),)
    needs = (HELD,)
    writes = (Obstacle, Evidence)

    def bind(self, view: View, trigger: Change) -> Case | None:
        """What was seen, and not touched, since a milestone was last verified."""
        sure = view.latest(Certificate, lambda certificate: certificate.verdict == "verified")
        seen = tuple(entry for entry in view.where(Obstacle, lambda o: may_be_there(o) and o.touched_s is None)
                     if sure is None or entry.cycle > sure.cycle)
        by: Pose2 | None = trigger.entry.value.correction
        return None if not seen or by is None else (by, seen, () if sure is None else (sure,))

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        (by, things, sure), held = case, HELD.of(view)
        belief, here = held.entry, held.pose
        moved_m, turned_rad = by.distance_to(Pose2(0.0, 0.0, 0.0)), abs(wrap_angle(by.heading_rad))
        for entry in things:
            because = (belief, entry, *sure)
            if moved_m > MAX_DRIFT_M or turned_rad > MAX_DRIFT_RAD:
                known = find_difference(view, entry.value.name)
                told = _doubt(known, entry.value, here, belief.ref)
                yield Post(told, because)
                yield Revise(entry, judge_by(told, entry.value, known, self._settings.action), because)
            else:
                evidence = f"moved with the belief, which {belief.ref} corrected"
                now = move_thing(held.world, entry.value, here @ by @ here.inverse(), moved_m, evidence)
                yield Revise(entry, now, because)


def _doubt(known: Difference, thing: Obstacle, here: Pose2, told_by: Ref) -> Evidence:
    shows = f"seen before or after the robot was kidnapped, as {told_by} tells"
    return Evidence(thing.name, shows, explain_seen_elsewhere(known), here.x_m, here.y_m, here.heading_rad,
                    MAX_DRIFT_M, MAX_DRIFT_RAD, thing.seen_s)
