"""Referee: scores a run against the truth."""

from __future__ import annotations

from dataclasses import replace

from blackboard import Decision
from harvey.runner.result import MissionResult
from harvey.simulation.happenings import ContactWatch, HappeningWatch
from logs.explain.turning_points import Collision, Happening
from sim.body.simulated_body import SimulatedBody
from sim.stage import Stage
from sim.truth import cross_track_m
from world_models.building.world import World
from world_models.entries import Certificate, Goal, Hypothesis, Leg, Place, PoseFix
from world_models.frames import Pose2, wrap_angle

MAX_TRUE_ERROR_M = 0.15
"""A milestone is accepted falsely when the robot is further than this from the pose that was certified."""
MAX_TRUE_ERROR_RAD = 0.06
"""Or turned by more than this."""


class Referee:
    """A sink that compares what is believed with the truth; the board never hears of it."""

    def __init__(self, world: World, stage: Stage, body: SimulatedBody) -> None:
        self._world, self._stage, self._body = world, stage, body
        self._false_accepts = 0
        self._max_cross_track_m = 0.0
        self._leg: Leg | None = None
        self._destination: Place | None = None
        self._fix: Pose2 | None = None
        self._followed = 0
        self._contact_watch = ContactWatch(world, body)
        self._contacts: list[Collision] = []
        self._happening_watch = HappeningWatch(body, stage.scenario.moved)
        self._happened: list[Happening] = []

    def __call__(self, decision: Decision) -> None:
        self._follow()
        self._note_events(decision.cycle)
        for change in decision.made:
            value = change.entry.value
            if isinstance(value, Goal) and value.is_active and value.destination != self._destination:
                if self._destination is not None:
                    self._stage = self._stage.going_to(value.destination)
                self._destination = value.destination
            elif isinstance(value, Leg):
                self._leg = value if value.status == "moving" else None
            elif isinstance(value, PoseFix):
                self._fix = value.world_from_robot
            elif isinstance(value, Certificate) and value.verdict == "verified" and self._fix is not None:
                self._false_accepts += self._is_false(self._fix)

    def over(self) -> str | None:
        """Why the scenario's limits end the run now, by the truth; None as long as they do not."""
        truth, limits = self._body.truth, self._stage.scenario.limits
        if truth.collisions > limits.max_collisions:
            return f"{truth.collisions} collisions"
        return f"not there after {truth.path_m:.0f} m" if truth.path_m > limits.max_path_m else None

    def complete(self, result: MissionResult, belief: Hypothesis | None) -> MissionResult:
        """The result with the true errors; ``belief`` is the last one held."""
        self._note_events(result.decisions)
        score = self._stage.score(self._body.track)
        return replace(
            result,
            final_error_m=score.position_error_m,
            final_heading_error_rad=self._heading_error_rad(score.heading_error_rad, belief),
            path_length_m=score.path_m,
            sim_time_s=score.time_s,
            frames=self._body.frames,
            milestones={**result.milestones, "false_accepts": self._false_accepts},
            collisions=score.collisions,
            contacts=tuple(self._contacts),
            happened=tuple(self._happened),
            max_cross_track_m=self._max_cross_track_m,
            belief_off_m=None if belief is None else belief.world_from_robot(self._world).distance_to(
                self._body.truth.world_from_robot),
            amiss=self._body.missed_faults,
        )

    def _note_events(self, cycle: int) -> None:
        self._happened += [Happening(cycle, what) for what in self._happening_watch.new_happenings()]
        for contact in self._contact_watch.new_contacts():
            place = contact.place
            self._contacts.append(
                Collision(cycle, place.locale, place.x_m, place.y_m, contact.speed_m_per_s, contact.thing))

    def _follow(self) -> None:
        """How far the robot truly strayed from the leg that it was driving since the last decision."""
        track = self._body.track
        if self._leg is not None:
            start, end = Pose2(self._leg.x0_m, self._leg.y0_m, 0.0), Pose2(self._leg.x1_m, self._leg.y1_m, 0.0)
            strayed = (abs(cross_track_m(t.world_from_robot, start, end)) for t in track[self._followed:])
            self._max_cross_track_m = max(self._max_cross_track_m, *strayed, 0.0)
        self._followed = len(track)

    def _is_false(self, believed: Pose2) -> bool:
        true = self._body.truth.world_from_robot
        turned_rad = abs(wrap_angle(believed.heading_rad - true.heading_rad))
        return believed.distance_to(true) > MAX_TRUE_ERROR_M or turned_rad > MAX_TRUE_ERROR_RAD

    def _heading_error_rad(self, wanted_rad: float | None, belief: Hypothesis | None) -> float:
        if wanted_rad is not None or belief is None:
            return wanted_rad or 0.0
        true = self._body.truth.world_from_robot
        return wrap_angle(belief.world_from_robot(self._world).heading_rad - true.heading_rad)
