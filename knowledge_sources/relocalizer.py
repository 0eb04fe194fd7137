"""Relocalizer (§2, §4): goal-level perceptual servoing. Lost, it looks about until it knows, and begins anew."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from blackboard.board import View
from blackboard.change import Change, Posted, Revised, Watch
from blackboard.effect import Effect, Post, Retract, Revise
from blackboard.entry import Entry
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from knowledge_sources.expert import Expert
from knowledge_sources.methods.relocation import Candidate, Region, candidates
from knowledge_sources.questions import active_goal, held, is_over, is_settled, open_discrepancy
from world_models.body import Look, MotorCommand
from world_models.location import Hypothesis, Place
from world_models.percepts import Segments
from world_models.task import Goal

REGIONS = ((1.75, math.radians(45.0)), (1.75, math.radians(45.0)), (3.0, math.radians(90.0)), (6.0, math.pi))
"""How far from the last belief it is sought, probe after probe: radius [m] and turn [rad]."""
PROBES = 8
DARK = 6.0
WAITS = 150
"""So many dark frames are waited for light."""
TURN_RAD = math.radians(40.0)
CLEARER = 1.3
"""The best candidate must explain so much more than the next, or the place is ambiguous."""


class Relocalizer(Expert):
    """Generates hypotheses round the last belief, verifies each against the picture, and probes until one stands alone.

    A probe is a look; where that is not enough, a turn and another look. When it knows, a new top-level goal follows
    from the place where it is to the old destination, and so new sketches (§2). When it does not, it stays lost.
    """

    level = Level.GOAL
    closes = Level.GOAL
    watches = (
        Watch(Discrepancy, (Posted,), lambda d: d.is_open and d.level is Level.GOAL),
        Watch(Hypothesis, (Revised,), lambda h: h.is_held and h.basis == "odometry"),
        Watch(Segments, (Posted,), lambda s: s.milestone == ""),
    )
    writes = (Look, MotorCommand, Hypothesis, Goal, Discrepancy)

    def rate(self, view: View, trigger: Change) -> float | None:
        lost = open_discrepancy(view, Level.GOAL)
        return 0.7 if lost is not None and held(view) is not None and is_settled(view) and not is_over(view) else None

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        lost, belief = open_discrepancy(view, Level.GOAL), held(view)
        if lost is None or belief is None:
            return
        if not isinstance(trigger.entry.value, Segments):
            yield Post(Look("probe"), (trigger.entry, lost))
            return
        probes = _probes_since(view, lost)
        if trigger.entry.value.contrast < DARK:
            if len(probes) < WAITS:
                yield Post(Look("probe"), (trigger.entry, lost))
            return
        lit = sum(1 for p in probes if p.value.contrast >= DARK)
        yield from self._considered(view, trigger.entry, lost, belief, lit)

    def _considered(
        self, view: View, segments: Entry[Segments], lost: Entry[Discrepancy], belief: Entry[Hypothesis], probe: int
    ) -> Iterable[Effect]:
        for old in view.where(Hypothesis, lambda h: h.status == "candidate"):
            yield Retract(old, (segments,))
        radius_m, turn_rad = REGIONS[min(probe, len(REGIONS)) - 1]
        region = Region(belief.value.locale, belief.value.world_from_robot(self._robot.world), radius_m, turn_rad)
        found = candidates(self._robot, segments.value.segments_px, region)
        if found and _stands_alone(found):
            yield from self._found(view, segments, lost, belief, found[0])
            return
        weights = [c.evidence.agreement.accounted * c.evidence.coverage for c in found]
        for candidate, weight in zip(found, weights, strict=True):
            share = weight / math.fsum(weights)
            yield Post(self._hypothesis(candidate, belief.value, "candidate", share), (segments, belief))
        if probe < PROBES:
            yield Post(MotorCommand(TURN_RAD, 0.0), (segments, lost))

    def _found(
        self, view: View, segments: Entry[Segments], lost: Entry[Discrepancy], belief: Entry[Hypothesis],
        candidate: Candidate,
    ) -> Iterable[Effect]:
        """The belief is corrected, and a new top-level goal takes the place of the old one (§2)."""
        here = Revise(belief, self._hypothesis(candidate, belief.value, "held", 1.0), (segments, lost, belief))
        yield here
        yield Revise(lost, lost.value.corrected(), (here,))
        for level in (Level.ACTION, Level.PLAN):
            lower = open_discrepancy(view, level)
            if lower is not None:
                yield Revise(lower, lower.value.corrected(), (here,))
        goal = active_goal(view)
        if goal is None:
            return
        world, pose = self._robot.world, candidate.world_from_robot
        abandon = Revise(goal, replace(goal.value, status="abandoned"), (here,))
        yield abandon
        origin = Place.of_world(world, belief.value.locale, pose.x_m, pose.y_m)
        yield Post(Goal(origin, goal.value.destination), (here, abandon))

    def _hypothesis(self, candidate: Candidate, belief: Hypothesis, status: str, weight: float) -> Hypothesis:
        return Hypothesis.of_world(
            self._robot.world, belief.locale, candidate.world_from_robot, candidate.covariance, "relocalization",
            status=status, weight=weight, motion=belief.motion, evidence=_evidence(candidate),
        )


def _evidence(candidate: Candidate) -> str:
    a = candidate.evidence.agreement
    return (f"{a.accounted} of {a.seen} model lines that should be seen from there are in the picture,"
            f" {candidate.evidence.coverage:.0%} of their length")


def _stands_alone(found: tuple[Candidate, ...]) -> bool:
    """Whether the best explains clearly more than any other."""
    weights = [c.evidence.agreement.accounted * c.evidence.coverage for c in found]
    return len(weights) == 1 or weights[0] >= CLEARER * weights[1]


def _probes_since(view: View, lost: Entry[Discrepancy]) -> tuple[Entry[Segments], ...]:
    """The probes that were looked at since the robot is lost, this one included."""
    return tuple(s for s in view.since(Segments, lost.cycle) if s.value.milestone == "")
