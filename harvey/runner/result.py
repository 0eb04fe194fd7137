"""Result: how a mission went, as ``result.json`` holds it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from blackboard import RAISED, Activation, Decision, Posted
from logs.explain.turning_points import Collision, Happening, TurningPoint, TurningPointFinder, is_adjusted
from world_models.building.locale_frame import FrameRequest
from world_models.entries import (
    CameraLesson,
    CameraPicture,
    CameraState,
    Hypothesis,
    Milestone,
    MotionReport,
    Outcome,
    PictureRequest,
    PlanSketch,
    find_camera_lessons,
)
from world_models.units import FOOT_M, INCH_M
from world_models.words import count

PARTS = ("contacts", "happened", "turning_points", "camera")
"""What of a result is a list of parts with names."""
PROBE = "probe"
"""The purpose of a picture that is to tell where the robot is."""
UNFINISHED = "unfinished"
"""The outcome in ``result.json`` of a run that has none yet."""


@dataclass(frozen=True, slots=True)
class MissionResult:
    """How a mission went. What only the truth could tell is None on hardware.

    Attributes:
        outcome: reached, lost, blocked or failed; reason: why.
        final_heading_error_rad: from the wanted heading; where none is wanted, from what the robot believed.
        path_length_m, sim_time_s: true in the simulator; on hardware as the wheels claim.
        decisions: how many there were; waits: in how many of them an act only asked for locale frames, and waited.
        milestones: how many were verified, refuted, not testable and (by the truth) accepted falsely.
        replans: how often the plan was changed: withdrawn, all of its levels at once, or adjusted.
        relocalizations: how often it found itself again.
        sketches: how many plan sketches were drawn.
        max_cross_track_m: how far the robot truly strayed from the line of the leg it was driving.
        contacts: each of the collisions.
        turning_points: what changed the course of the run, as the robot itself knew it.
        camera: how the camera turned out to differ from its nominal state.
        amiss: which of the scenario's faults did not happen, or not as they were asked for, in words.
        probes: pictures that it asked for to find out where it is; None in the results of older versions.
        happened: what the simulator did to the robot and its building; None on hardware, and in the results of older
            versions.
        starved: which knowledge sources of other packages seldom got their turn, in words.
        refused: acts of which nothing applied, as their knowledge source raised or may not write that, in words.
        belief_off_m: true distance of where it believed to be at the end; None where nobody knows it.
    """

    scenario: str
    seed: int
    outcome: str
    reason: str
    goal: str
    final_error_m: float | None
    final_heading_error_rad: float | None
    path_length_m: float
    sim_time_s: float
    wall_time_s: float
    frames: int
    decisions: int
    milestones: Mapping[str, int | None]
    replans: int
    relocalizations: int
    sketches: int
    collisions: int | None
    max_cross_track_m: float | None
    amiss: Sequence[str] = ()
    contacts: Sequence[Collision] = ()
    turning_points: Sequence[TurningPoint] = ()
    waits: int = 0
    camera: Sequence[CameraLesson] = ()
    probes: int | None = None
    belief_off_m: float | None = None
    happened: Sequence[Happening] | None = None
    starved: Sequence[str] = ()
    refused: Sequence[str] = ()

    @property
    def error_m(self) -> float:
        """The final error; NaN where nobody knows the truth."""
        return math.nan if self.final_error_m is None else self.final_error_m

    @property
    def false_accepts(self) -> int:
        """How many milestones were accepted falsely, as far as that is known."""
        return self.milestones["false_accepts"] or 0

    def record(self) -> dict[str, Any]:
        """As JSON types."""
        record = {name: getattr(self, name) for name in self.__slots__}
        return record | {name: [asdict(one) for one in record[name]] for name in PARTS if record[name] is not None}

    @staticmethod
    def of_record(record: Mapping[str, Any]) -> MissionResult:
        """From JSON types. Raises TypeError where they are not those of a result."""
        contacts = tuple(Collision(**one) for one in record.get("contacts", ()))
        turning_points = tuple(TurningPoint(**one) for one in record.get("turning_points", ()))
        camera = tuple(CameraLesson(**one) for one in record.get("camera", ()))
        listed = record.get("happened")
        happened = None if listed is None else tuple(Happening(**one) for one in listed)
        return MissionResult(**{**record, "contacts": contacts, "turning_points": turning_points, "camera": camera,
                                "happened": happened, "refused": tuple(record.get("refused", ()))})


def format_error(error_m: float) -> str:
    """An error in millimetres and inches; beyond a metre in metres and feet; NaN is not known."""
    if math.isnan(error_m):
        return "not known"
    if abs(error_m) > 1.0:
        return f"{error_m:.2f} m ({error_m / FOOT_M:.1f} feet)"
    return f"{error_m * 1000.0:.1f} mm ({error_m / INCH_M:.2f} inches)"


MIN_WOKEN, MAX_STARVED_SHARE = 10, 0.1
"""A knowledge source starves that was woken so often at least, and acted in less than this share of it."""


class TurnCounts:
    """A sink that counts how often each knowledge source that is not Harvey's was woken, and how often it acted."""

    def __init__(self) -> None:
        self._woken, self._acted = Counter[str](), Counter[str]()
        self._best: dict[str, Activation] = {}

    def __call__(self, decision: Decision) -> None:
        for one in decision.activated:
            if not type(one.source).__module__.startswith("knowledge_sources."):
                name = one.source.name
                self._woken[name] += 1
                self._best[name] = max(self._best.get(name, one), one, key=lambda best: best.rating)
        if decision.chosen is not None:
            self._acted[decision.chosen.source.name] += 1

    def starved(self) -> tuple[str, ...]:
        """Those that seldom got their turn, a sentence each."""
        return tuple(self._tell(name) for name, woken in self._woken.items()
                     if woken >= MIN_WOKEN and self._acted[name] < MAX_STARVED_SHARE * woken)

    def _tell(self, name: str) -> str:
        best = self._best[name]
        return (f"{name} acted {count(self._acted[name], 'time')} of the {self._woken[name]} that it was woken: at the "
                f"{best.source.level} level, rated {best.rating:.2f} at most, others came first (harvey why RUN --not "
                f"{name}; docs/how-to/knowledge-source.md says which level and priority)")


def tell_refusal(decision: Decision) -> str:
    """Who raised in a decision that was refused, or may not write something, and why."""
    who = decision.chosen.source.name if decision.chosen else "a knowledge source that was asked"
    return (f"{who} {'raised' if decision.refused.startswith(RAISED) else 'was refused:'}"
            f" {decision.refused.strip().splitlines()[-1]}")


class Refusals:
    """A sink that counts what was refused; a source that raises on every act is not heard of otherwise."""

    def __init__(self) -> None:
        self._counts = Counter[str]()

    def __call__(self, decision: Decision) -> None:
        if decision.refused:
            self._counts[tell_refusal(decision)] += 1

    def told(self) -> tuple[str, ...]:
        """A sentence for each, the most frequent first."""
        return tuple(f"{what} ({count(times, 'time')})" for what, times in self._counts.most_common())


class RunCounts:
    """A sink that counts what was decided, and adds up what the wheels claim."""

    def __init__(self) -> None:
        self.decisions = self.waits = self.replans = self.relocalizations = self.sketches = self.frames = 0
        self.probes = 0
        self._withdrawn_in: int | None = None
        self.milestones = {"verified": 0, "refuted": 0, "not_testable": 0}
        self.path_m = self.time_s = 0.0
        self.turning_points: list[TurningPoint] = []
        self.turns, self.refusals = TurnCounts(), Refusals()
        self.nominal_camera: CameraState | None = None
        self.camera: CameraState | None = None
        self._finder = TurningPointFinder()

    def __call__(self, decision: Decision) -> None:
        self.decisions += 1
        self.turns(decision)
        self.refusals(decision)
        self.waits += bool(decision.made) and all(isinstance(c.entry.value, FrameRequest) for c in decision.made)
        self.turning_points += [point for point in self._finder.find(decision) if point.is_main]
        for change in decision.observed:
            value = change.entry.value
            if isinstance(value, MotionReport):
                self.path_m += value.move_m
                self.time_s = value.sim_time_s
            self.frames += isinstance(value, CameraPicture)
            if isinstance(value, CameraState):
                self.nominal_camera = self.camera = value
        for change in decision.made:
            value, revision = change.entry.value, change.entry.revision
            if isinstance(value, CameraState):
                self.camera = value
            if isinstance(value, Milestone) and value.status.replace(" ", "_") in self.milestones:
                self.milestones[value.status.replace(" ", "_")] += 1
            elif isinstance(value, PictureRequest):
                self.probes += value.purpose == PROBE and isinstance(change, Posted)
            elif isinstance(value, PlanSketch):
                self.sketches += revision == 0
                self.replans += is_adjusted(value, change.entry.author)
                if value.status == "superseded" and self._withdrawn_in != decision.cycle:
                    self.replans += 1
                    self._withdrawn_in = decision.cycle
            elif isinstance(value, Hypothesis) and value.is_held:
                self.relocalizations += value.basis == "relocalization"

    def camera_lessons(self) -> tuple[CameraLesson, ...]:
        """How the camera turned out to differ from its nominal state."""
        if self.nominal_camera is None or self.camera is None:
            return ()
        return find_camera_lessons(self.nominal_camera, self.camera)

    def result(self, name: str, seed: int, goal: str, outcome: Outcome, wall_time_s: float) -> MissionResult:
        """How it went, without the truth."""
        return MissionResult(
            scenario=name, seed=seed, outcome=outcome.kind, reason=outcome.reason, goal=goal,
            final_error_m=None, final_heading_error_rad=None, path_length_m=self.path_m, sim_time_s=self.time_s,
            wall_time_s=wall_time_s, frames=self.frames, decisions=self.decisions,
            milestones={**self.milestones, "false_accepts": None}, replans=self.replans,
            relocalizations=self.relocalizations, sketches=self.sketches, collisions=None, max_cross_track_m=None,
            turning_points=tuple(self.turning_points), waits=self.waits, camera=self.camera_lessons(),
            probes=self.probes, starved=self.turns.starved(),
            refused=self.refusals.told(),
        )
