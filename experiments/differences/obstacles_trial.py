"""One mission among things that the robot's model lacks, judged by the truth."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray

from blackboard.change import Change
from blackboard.entry import Ref
from blackboard.journal import Decision
from experiments.generated.missions import write_cluttered_mission
from harvey.campaign.campaign import Task, run_task
from sim.body.collision import Obstacles, find_free_floor, find_shortest_way
from sim.differences.table import NO_DIFFERENCES
from sim.scenario import Scenario
from sim.stage import Stage, build_stage
from world_models.building.locale_frame import LocaleFrame
from world_models.building.world import World
from world_models.entries.body import Look, MotorCommand
from world_models.entries.location import Hypothesis
from world_models.entries.obstacle import Contact, Obstacle
from world_models.frames import Pose2

Segments = NDArray[np.float64]
Corners = Sequence[tuple[float, float]]

SAME_M = 0.02
"""What is this near to something of the model, the model has: a poster on a wall."""
MAX_OFF_M = 0.15
"""An obstacle is false where nothing that the model lacks is as near as this to its footprint."""
NEAR_M = 2.0
"""A stop is needless where nothing that the model lacks is as near as this to the robot's axis."""


@dataclass(frozen=True, eq=False)
class Lacking:
    """Everything solid that the robot's model lacks, on the floor plane [m, world]."""

    lines: shapely.Geometry

    @staticmethod
    def of_segments(true: Segments, model: Segments) -> Lacking:
        """What of the true segments (n, 2, 2) is not among those of the model."""
        known = shapely.buffer(shapely.union_all(shapely.linestrings(model)), SAME_M) if len(model) else None
        lines = shapely.union_all(shapely.linestrings(true)) if len(true) else shapely.MultiLineString()
        return Lacking(lines if known is None else shapely.difference(lines, known))

    @staticmethod
    def of_stage(stage: Stage) -> Lacking:
        """What the building of a stage has beside its world file."""
        model = build_stage(_without_difference(stage.scenario)).building.obstacles
        return Lacking.of_segments(stage.building.obstacles.segments_world, model.segments_world)

    def distance_m(self, corners: Corners) -> float:
        """From a footprint, or a point, to the nearest of it; infinite where the model lacks nothing."""
        distance = float(shapely.distance(_shape(corners), self.lines))
        return math.inf if math.isnan(distance) else distance

    def is_false(self, footprint: Corners) -> bool:
        """Whether an obstacle is where nothing is that the model lacks."""
        return self.distance_m(footprint) > MAX_OFF_M

    def is_needless(self, x_m: float, y_m: float) -> bool:
        """Whether a stop here has no reason in the truth."""
        return self.distance_m([(x_m, y_m)]) > NEAR_M


def _without_difference(scenario: Scenario) -> Scenario:
    """The same in a building that is as its world file says."""
    return replace(scenario, details=(), truth=NO_DIFFERENCES, told=(), moved=(), faults=())


def _shape(corners: Corners) -> shapely.Geometry:
    """The hull of corners: a polygon, a line or a point."""
    return shapely.MultiPoint(np.asarray(corners, float)).convex_hull


def find_shortest_m(obstacles: Obstacles, start: Pose2, goal: Pose2) -> float | None:
    """The length of the shortest way that the truth allows, touching allowed [m]; None where there is none."""
    way = find_shortest_way(find_free_floor(obstacles), start, goal)
    return None if way is None else float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())


def judge(outcome: str, shortest_m: float | None) -> str:
    """How a mission ended, by the truth: an outcome, where ``blocked`` is right or wrong."""
    if outcome != "blocked":
        return outcome
    return "blocked rightly" if shortest_m is None else "blocked wrongly"


def count_stops(motions: Iterable[str]) -> int:
    """How often the robot stopped for the floor: looks and creeps in a row, with no other motion between, are one.

    Args:
        motions: ``go``, ``look`` (for the floor) and ``creep``, in the order of the run.
    """
    stops, before = 0, "go"
    for motion in motions:
        stops += motion != "go" and before == "go"
        before = motion
    return stops


MAX_DRAWS, NEXT_DRAW = 20, 50_000_000
"""Where a seed's floor has no room for what is wanted, another's is taken, this far away."""
CLUTTERED, BARRED, EMPTY = "cluttered", "barred", "empty"
EXTRA = "\n[[truth.extra]]"
RING = ("ranges.sensors", "24")
MAX_CREEP_M_PER_S = 0.1

Pairs = tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Trial:
    """A mission.

    Attributes:
        row: of the table.
        seed: of its floor, its clutter and the run.
        floor: cluttered (a way is left), barred (none is) or empty.
        settings: (key, value) as in ``--set key=value``.
    """

    row: str
    seed: int
    floor: str
    settings: Pairs = ()


@dataclass(frozen=True, slots=True)
class TrialEnd:
    """How a mission ended.

    Attributes:
        row, seed, floor: of the trial.
        verdict: reached, blocked rightly, blocked wrongly, lost or failed.
        reason: the robot's own words.
        error_m: true distance from the goal.
        path_m, shortest_m: way driven, and the shortest that truth allows, None where there is none.
        time_s: the robot's.
        contact_speeds: of each contact [m/s]; answered: of how many contacts something was concluded.
        obstacles: how many were there in the robot's belief at any time; false_obstacles: where nothing was.
        stops: for the floor; needless: those with nothing near that the model lacks.
        false_accepts: milestones accepted at wrong places.
        wall_s: processor time and waiting.
    """

    row: str
    seed: int
    floor: str
    verdict: str
    reason: str
    error_m: float
    path_m: float
    shortest_m: float | None
    time_s: float
    contact_speeds: list[float]
    answered: int
    obstacles: int
    false_obstacles: list[str]
    stops: int
    needless: int
    false_accepts: int
    wall_s: float

    @property
    def is_good(self) -> bool:
        """Whether it reached its goal, or rightly said that no way leads there."""
        return self.verdict in ("reached", "blocked rightly")


@dataclass
class Witness:
    """A sink that keeps what the robot concluded of things in its way.

    Attributes:
        world: the robot's.
        lacking: what its model lacks, by the truth.
        contacts, answered: the contacts, and those of them on which a conclusion rests.
        obstacles: names of those that were there; false: names of those where nothing was, by the truth.
        motions, needless: go, look or creep, in order; of those with no reason in the truth.
    """

    world: World
    lacking: Lacking
    contacts: list[Ref] = field(default_factory=list)
    answered: set[Ref] = field(default_factory=set)
    obstacles: set[str] = field(default_factory=set)
    false: dict[str, str] = field(default_factory=dict)
    motions: list[str] = field(default_factory=list)
    needless: list[str] = field(default_factory=list)
    _at: tuple[float, float] | None = None

    def __call__(self, decision: Decision) -> None:
        for change in (*decision.observed, *decision.made):
            self._note(change, decision.cycle)

    def _note(self, change: Change, cycle: int) -> None:
        entry, value = change.entry, change.entry.value
        if isinstance(value, Contact):
            self.contacts.append(entry.ref)
        elif isinstance(value, Obstacle | LocaleFrame):
            self.answered.update(ref for ref in entry.because if ref in self.contacts)
        if isinstance(value, Obstacle) and value.is_there:
            self.obstacles.add(value.name)
            if self.lacking.is_false(value.footprint) and value.name not in self.false:
                off_m = self.lacking.distance_m(value.footprint)
                self.false[value.name] = f"{value.words()}, {off_m:.2f} m off, cycle {cycle}"
        elif isinstance(value, Hypothesis) and value.is_held:
            pose = value.world_from_robot(self.world)
            self._at = pose.x_m, pose.y_m
        elif isinstance(value, Look | MotorCommand):
            self._note_motion(value)

    def _note_motion(self, value: Look | MotorCommand) -> None:
        if isinstance(value, Look) and value.purpose != "floor":
            return
        motion = "look" if isinstance(value, Look) else _name_motion(value)
        needless = motion != "go" and self._at is not None and self.lacking.is_needless(*self._at)
        self.motions.append(motion)
        self.needless.append(motion if needless else "go")


def _name_motion(command: MotorCommand) -> str:
    speed_m_per_s = getattr(command, "speed_m_per_s", None)
    is_slow = command.move_m > 0.0 and speed_m_per_s is not None and 0.0 < speed_m_per_s < MAX_CREEP_M_PER_S
    return "creep" if is_slow else "go"


def run_trial(trial: Trial) -> TrialEnd:
    """Drive a mission on a floor that is made for it."""
    with tempfile.TemporaryDirectory() as folder:
        return drive(trial, write_mission(trial, Path(folder)))


def drive(trial: Trial, path: Path, out: Path | None = None) -> TrialEnd:
    """Drive a mission's file and judge it; ``out`` keeps the run."""
    task = Task(str(path), trial.settings, trial.seed, out)
    stage = task.stage()
    witness = Witness(stage.world, Lacking.of_stage(stage))
    result = run_task(task, sinks=(witness,))
    shortest_m = find_shortest_m(stage.building.obstacles, stage.start_world, stage.goal_world)
    speeds = [math.nan if c.speed_m_per_s is None else c.speed_m_per_s for c in result.contacts]
    return TrialEnd(
        trial.row, trial.seed, trial.floor, judge(result.outcome, shortest_m), result.reason, result.error_m,
        result.path_length_m, shortest_m, result.sim_time_s, speeds, len(witness.answered), len(witness.obstacles),
        list(witness.false.values()), count_stops(witness.motions), count_stops(witness.needless),
        result.false_accepts, result.wall_time_s)


def write_mission(trial: Trial, folder: Path) -> Path:
    """Write the mission's file, and its floor; an empty one is the cluttered one without its things."""
    for seed in (trial.seed + k * NEXT_DRAW for k in range(MAX_DRAWS)):
        try:
            path = write_cluttered_mission(folder, seed, leaves_way=trial.floor != BARRED)
        except ValueError:
            continue
        if trial.floor == EMPTY:
            text = path.read_text("utf-8").replace("on a cluttered floor; a way is left", "on an empty floor")
            path.write_text(text.split(EXTRA)[0], "utf-8")
        return path
    raise ValueError(f"expected a mission for {trial}, got none in {MAX_DRAWS} draws")




def make_trials(row: str, first: int, number: int, *, settings: Pairs = (), empty: bool = False) -> Iterator[Trial]:
    """So many missions from a seed on; in each tenth no way is left, or all floors are empty."""
    for seed in range(first, first + number):
        yield Trial(row, seed, EMPTY if empty else BARRED if seed % 10 == 9 else CLUTTERED, settings)
