"""1,000 missions with one to six things on or beside the way that the robot's model lacks, judged by the truth.

In each second mission the floor's finish is drawn and most things have the floor's colour. In each tenth the things
leave no way, and the right end is ``blocked``. Some are driven with a ring of range
sensors, some on empty floors, and some with a part of the robot's sight of the floor switched off.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import shapely
from numpy.typing import NDArray

from blackboard import Change, Decision, Ref
from experiments import drives
from experiments.drives import Driven, End, Trial
from experiments.generated.free_floor import find_free_floor, find_shortest_way
from experiments.generated.missions import write_cluttered_mission
from experiments.report import OURS, PAPER, PEER, Cell, Claim, Report, chart
from experiments.trials import RESULTS, at_least, at_most
from harvey.campaign.mission_task import Task
from sim.body.collision import Obstacles
from sim.ground_truth.table import NO_DIFFERENCES
from sim.stage import Stage, build_stage
from world_models.actuator import ActuatorModel
from world_models.building.locale_frame import LocaleFrame
from world_models.building.world import World
from world_models.entries import Contact, Hypothesis, MotorCommand, Obstacle, PictureRequest
from world_models.frames import Pose2

Segments = NDArray[np.float64]
Corners = Sequence[tuple[float, float]]
Pairs = tuple[tuple[str, str], ...]

SAME_M = 0.02
"""What is this near to something of the model, the model has: a poster on a wall."""
MAX_OFF_M = 0.15
"""An obstacle is false where nothing that the model lacks is as near as this to its footprint."""
CERTAIN = 0.9
"""Something so certain is not to be forgotten while it stands there."""
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
        as_filed = replace(stage.scenario, details=(), truth=NO_DIFFERENCES, told=(), moved=(), faults=())
        model = build_stage(as_filed).building.obstacles
        return Lacking.of_segments(stage.building.obstacles.segments_world, model.segments_world)

    def distance_m(self, corners: Corners) -> float:
        """From the hull of corners, or a point, to the nearest of it; infinite where the model lacks nothing."""
        distance = float(shapely.distance(shapely.MultiPoint(np.asarray(corners, float)).convex_hull, self.lines))
        return math.inf if math.isnan(distance) else distance

    def is_false(self, footprint: Corners) -> bool:
        """Whether an obstacle is where nothing is that the model lacks."""
        return self.distance_m(footprint) > MAX_OFF_M

    def is_needless(self, x_m: float, y_m: float) -> bool:
        """Whether a stop here has no reason in the truth."""
        return self.distance_m([(x_m, y_m)]) > NEAR_M


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
EXTRA = "\n[[truth.extra]]"

MISSIONS, QUICK_MISSIONS = 1_000, 2
CAMERA, WITH_RING, EMPTY, EMPTY_UNSEEN = "camera", "and ranges", "empty", "empty, unseen"
RING: Pairs = (("ranges.sensors", "24"),)
NO_APPEARANCE: Pairs = (("floor.use_appearance", "false"),)
NO_PARALLAX: Pairs = (("floor.use_parallax", "false"),)
NO_RANGES: Pairs = (("floor.use_ranges", "false"),)
UNSEEN: Pairs = (*NO_APPEARANCE, *NO_PARALLAX, *NO_RANGES, ("action.keeps_to_seen_floor", "false"),
                 ("plan.approaches_seeing", "false"))
"""The floor is not looked at, and the robot drives without having seen it, the shortest way."""


@dataclass(frozen=True, slots=True)
class Row:
    """A row of the table: one in ``part`` of the missions, with settings, on cluttered or on empty floors.

    On a floor that is not empty no way is left where the seed ends in 9.
    """

    name: str
    part: int
    settings: Pairs = ()
    empty: bool = False
    is_quick: bool = True


ROWS: Mapping[str, Row] = {row.name: row for row in (
    Row(CAMERA, 1),
    Row(WITH_RING, 5, RING),
    Row("no appearance", 10, NO_APPEARANCE, is_quick=False),
    Row("no parallax", 10, NO_PARALLAX, is_quick=False),
    Row("ranges alone", 10, (*RING, *NO_APPEARANCE, *NO_PARALLAX), is_quick=False),
    Row("unseen", 10, UNSEEN, is_quick=False),
    Row(EMPTY, 5, empty=True),
    Row(EMPTY_UNSEEN, 5, UNSEEN, empty=True),
)}


@dataclass(frozen=True, slots=True)
class ObstacleEnd(End):
    """How a mission ended.

    Attributes:
        verdict: reached, blocked rightly, blocked wrongly, lost or failed.
        shortest_m: the shortest way that truth allows, None where there is none.
        contact_speeds: of each contact [m/s]; answered: of how many contacts something was concluded.
        false_obstacles: what was held to be in the way where nothing was.
        forgotten: what was certain, and was said to be gone while it stood there.
        stops: for the floor; needless: those with nothing near that the model lacks.
    """

    verdict: str
    shortest_m: float | None
    contact_speeds: list[float]
    answered: int
    false_obstacles: list[str]
    forgotten: list[str]
    stops: int
    needless: int

    @property
    def is_good(self) -> bool:
        """Whether it reached its goal, or rightly said that no way leads there."""
        return self.verdict in ("reached", "blocked rightly")

    @property
    def is_flawed(self) -> bool:
        """Whether it is to be looked at."""
        flaws = self.contact_speeds, self.false_obstacles, self.forgotten, self.false_accepts, self.believed_shut
        return not self.is_good or any(flaws)


@dataclass
class Witness:
    """A sink that keeps what the robot concluded of things in its way.

    Attributes:
        world: the robot's.
        lacking: what its model lacks, by the truth.
        contacts, answered: the contacts, and those of them on which a conclusion rests.
        false: by its name, what was held to be there where nothing was, by the truth.
        certain, forgotten: what was certain once; and what of it was said to be gone while something stood there.
        motions, needless: go, look or creep, in order; of those with no reason in the truth.
    """

    world: World
    lacking: Lacking
    contacts: list[Ref] = field(default_factory=list)
    answered: set[Ref] = field(default_factory=set)
    false: dict[str, str] = field(default_factory=dict)
    certain: set[str] = field(default_factory=set)
    forgotten: dict[str, str] = field(default_factory=dict)
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
        if isinstance(value, Obstacle):
            self._note_certainty(value, cycle)
        if isinstance(value, Obstacle) and value.is_there:
            if self.lacking.is_false(value.footprint) and value.name not in self.false:
                off_m = self.lacking.distance_m(value.footprint)
                self.false[value.name] = f"{value.words()}, {off_m:.2f} m off, cycle {cycle}"
        elif isinstance(value, Hypothesis) and value.is_held:
            pose = value.world_from_robot(self.world)
            self._at = pose.x_m, pose.y_m
        elif isinstance(value, PictureRequest | MotorCommand):
            self._note_motion(value)

    def _note_certainty(self, value: Obstacle, cycle: int) -> None:
        if value.status != "gone":
            self.certain |= {value.name} if value.certainty >= CERTAIN else set()
        elif value.name in self.certain and not self.lacking.is_false(value.footprint):
            self.forgotten[value.name] = f"{value.words()}, cycle {cycle}"

    def _note_motion(self, value: PictureRequest | MotorCommand) -> None:
        if isinstance(value, PictureRequest) and value.purpose != "floor":
            return
        motion = "look" if isinstance(value, PictureRequest) else "creep" if value.is_creeping else "go"
        needless = motion != "go" and self._at is not None and self.lacking.is_needless(*self._at)
        self.motions.append(motion)
        self.needless.append(motion if needless else "go")


def drive(trial: Trial) -> ObstacleEnd:
    """Drive the mission of a trial on a floor that is made for it, and judge it."""
    with TemporaryDirectory() as folder:
        task = Task(str(write_mission(trial, Path(folder))), ROWS[trial.row].settings, trial.seed)
        stage = task.stage()
        witness = Witness(stage.world, Lacking.of_stage(stage))
        driven = drives.drive_task(task, witness)
    result = driven.result
    shortest_m = find_shortest_m(stage.building.obstacles, stage.start_world, stage.goal_world)
    speeds = [math.nan if c.speed_m_per_s is None else c.speed_m_per_s for c in result.contacts]
    return ObstacleEnd.of(
        trial, driven, verdict=judge(result.outcome, shortest_m), shortest_m=shortest_m, contact_speeds=speeds,
        answered=len(witness.answered), false_obstacles=list(witness.false.values()),
        forgotten=list(witness.forgotten.values()),
        stops=count_stops(witness.motions), needless=count_stops(witness.needless))


def write_mission(trial: Trial, folder: Path) -> Path:
    """Write the mission's file, and its floor; an empty one is the cluttered one without its things."""
    is_empty = ROWS[trial.row].empty
    for seed in (trial.seed + k * NEXT_DRAW for k in range(MAX_DRAWS)):
        try:
            path = write_cluttered_mission(folder, seed, leaves_way=is_empty or trial.seed % 10 != 9,
                                           is_camouflaged=trial.seed % 2 == 1)
        except ValueError:
            continue
        if is_empty:
            text = path.read_text("utf-8").replace("on a cluttered floor; a way is left", "on an empty floor")
            path.write_text(text.split(EXTRA)[0], "utf-8")
        return path
    raise ValueError(f"expected a mission for {trial}, got none in {MAX_DRAWS} draws")


TOUCHED = "missions with contact"
PEER_CONTACTS = "25%; 48%"
"""Of the runs of a ROS stack on monocular depth, at 0.5 and at 1 m/s, as it is reported."""
MAX_CONTACT_M_PER_S = 0.1
MIN_GOOD_SHARE, MAX_CONTACTS_OF_1000, MAX_WAY_RATIO = 0.98, 2, 1.2
MAX_FALSE_OF_100, MAX_NEEDLESS_OF_100_M, MAX_TIME_RATIO = 1, 1.0, 1.05
REQUIRED: Mapping[str, str] = {
    "good": ">= 98%", "contacts": "<= 2", "fastest contact [m/s]": "< 0.1", "way / shortest": "<= 1.2",
    "false accepts": "0", "false obstacles": "<= 1 of 100", "forgotten while there": "0",
    "needless stops / 100 m": "<= 1",
    "open held shut": "0",
}


def run(quick: bool, seed: int, missions: int | None = None) -> Report:
    """Drive each row's part of so many missions."""
    number, first = missions or (QUICK_MISSIONS if quick else MISSIONS), drives.first_seed(seed)
    rows = [row for row in ROWS.values() if row.is_quick or not quick]
    trials = [trial for row in rows for trial in make_trials(row, first, number)]
    driven = drives.drive_all("obstacles", drive, trials, ObstacleEnd, quick=quick, seed=seed, missions=missions)
    picture = driven.folder / "ways.png"
    _draw(driven, picture)
    return driven.keep(Report(
        "Missions among things that the model lacks", ("what", "required", "peer", *driven.rows),
        tuple(_table(driven)),
        notes=(
            f"{driven.seeds}, fewer in the columns to the right; no constant was chosen on them."
            f" The robot moves at up to {ActuatorModel().speed_m_per_s} m/s."
            " In each tenth cluttered mission no way is left; good: reached,"
            " or blocked where a planner that knows the truth finds no way either. Bounds are one-sided, of 95 %, by"
            " Clopper and Pearson.",
            "Columns: the camera; and a ring of 24 range sensors; without what tells floor by its appearance, or by"
            " parallax; with ranges only; with the floor unseen; empty floors with the camera, and with the floor"
            " unseen.",
            "contacts: by the truth; answered: something was concluded from it. way / shortest: mean over the missions"
            " that reached, against the shortest way by the truth, touching allowed. false obstacles: nothing that the"
            " model lacks is within 0.15 m of their footprint. stops: for the floor, looks and creeps; needless: with"
            " nothing that the model lacks within 2 m.",
            drives.HELD_SHUT,
            "The peer's figures are reported for a ROS stack on monocular depth, at 0.5 and 1 m/s and in other"
            " surroundings: nothing of this was measured here. The paper names these missions as its next stage and"
            " gives no figures.",
            *driven.name_flawed(lambda e: e.is_flawed, lambda e: f"{e.verdict}, {len(e.contact_speeds)} contacts,"
                                f" {len(e.false_obstacles)} false",
                                lambda e: (e.is_good, -len(e.contact_speeds), -len(e.false_obstacles))),
            f"Ways as a picture: {picture}; one line per mission: {driven.folder / RESULTS}",
        ),
        claims=tuple(_claims(driven)),
    ))


def make_trials(row: Row, first: int, number: int) -> list[Trial]:
    """A row's part of so many missions; a barred floor is among those of a small campaign, too."""
    begin = first if number >= 10 or row.empty else first + 10 - number
    return [Trial(row.name, begin + k) for k in range(max(1, math.ceil(number / row.part)))]


def _table(driven: Driven[ObstacleEnd]) -> Iterator[tuple[Cell, ...]]:
    """A line for each quantity: what is required, the peer's figure, and each row's."""
    lines = [_figures(ends) for ends in driven.rows.values()]
    for what in lines[0]:
        yield what, REQUIRED.get(what), PEER_CONTACTS if what == TOUCHED else None, *(line[what] for line in lines)


def _figures(ends: Sequence[ObstacleEnd]) -> Mapping[str, Cell]:
    """What was found in the missions of a row."""
    good, touched = sum(e.is_good for e in ends), sum(bool(e.contact_speeds) for e in ends)
    speeds = [speed for e in ends for speed in e.contact_speeds]
    return {
        "missions": len(ends),
        "reached": sum(e.verdict == "reached" for e in ends),
        "blocked rightly": sum(e.verdict == "blocked rightly" for e in ends),
        **{verdict: sum(e.verdict == verdict for e in ends) for verdict in ("blocked wrongly", "lost", "failed")},
        "good": f"{good / len(ends):.1%}",
        "  proves at least": f"{at_least(good, len(ends)):.1%}",
        "contacts": len(speeds),
        "  answered": sum(e.answered for e in ends),
        "fastest contact [m/s]": max(speeds, default=None),
        TOUCHED: f"{touched / len(ends):.1%}",
        "  proves at most": f"{at_most(touched, len(ends)):.1%}",
        "way / shortest": _way_ratio(ends),
        "false obstacles": sum(len(e.false_obstacles) for e in ends),
        "forgotten while there": sum(len(e.forgotten) for e in ends),
        "stops / 100 m": _per_100_m(ends, [e.stops for e in ends]),
        "needless stops / 100 m": _per_100_m(ends, [e.needless for e in ends]),
        "false accepts": sum(e.false_accepts for e in ends),
        "open held shut": drives.OPEN_HELD_SHUT(ends),
        "robot's time, mean [s]": math.fsum(e.robot_s for e in ends) / len(ends),
        "time to simulate, mean [s]": math.fsum(e.wall_s for e in ends) / len(ends),
    }


def _ratios(ends: Sequence[ObstacleEnd]) -> list[float]:
    return [e.path_m / e.shortest_m for e in ends if e.verdict == "reached" and e.shortest_m]


def _way_ratio(ends: Sequence[ObstacleEnd]) -> float | None:
    ratios = _ratios(ends)
    return float(np.mean(ratios)) if ratios else None


def _per_100_m(ends: Sequence[ObstacleEnd], counts: Sequence[int]) -> float | None:
    driven_m = math.fsum(e.path_m for e in ends)
    return 100.0 * sum(counts) / driven_m if driven_m else None


def _claims(driven: Driven[ObstacleEnd]) -> list[Claim]:
    camera, ring, empty, unseen = (driven.rows[name] for name in (CAMERA, WITH_RING, EMPTY, EMPTY_UNSEEN))
    contacts = [speed for e in camera for speed in e.contact_speeds]
    most = MAX_CONTACTS_OF_1000 * max(1, len(camera) // 1_000)
    answered, ring_contacts = sum(e.answered for e in camera), sum(len(e.contact_speeds) for e in ring)
    ratio, false = _way_ratio(camera), sum(len(e.false_obstacles) for e in empty)
    needless = _per_100_m(empty, [e.needless for e in empty])
    time_ratio = math.fsum(e.robot_s for e in empty) / math.fsum(e.robot_s for e in unseen)
    return [
        drives.claim_share(f"{CAMERA}: at least {MIN_GOOD_SHARE:.0%} reach, or are blocked where there is no way",
                           lambda e: e.is_good, camera, MIN_GOOD_SHARE),
        (f"{CAMERA}: at most {most} contacts: {len(contacts)}", len(contacts) <= most),
        (f"{CAMERA}: each contact below {MAX_CONTACT_M_PER_S} m/s", all(s < MAX_CONTACT_M_PER_S for s in contacts)),
        (f"{CAMERA}: each contact is answered: {answered} of {len(contacts)}", answered >= len(contacts)),
        (f"{CAMERA}: the way is at most {MAX_WAY_RATIO} times the shortest, on the mean: {_figure(ratio)}",
         ratio is None or ratio <= MAX_WAY_RATIO),
        drives.claim_none(f"{CAMERA}: nothing certain is forgotten while it stands there", camera,
                          lambda e: bool(e.forgotten)),
        (f"{WITH_RING}: no contact: {ring_contacts} in {len(ring)} missions", not ring_contacts),
        (f"{EMPTY}: at most {MAX_FALSE_OF_100} false obstacle in 100 missions: {false} in {len(empty)}",
         false <= MAX_FALSE_OF_100 * len(empty) / 100.0),
        (f"{EMPTY}: at most {MAX_NEEDLESS_OF_100_M:g} needless stop in 100 m: {_figure(needless)}",
         needless is not None and needless <= MAX_NEEDLESS_OF_100_M),
        (f"{EMPTY}: the robot's time is at most {MAX_TIME_RATIO} times that with the floor unseen: {time_ratio:.3f}",
         time_ratio <= MAX_TIME_RATIO),
        drives.claim_none("no milestone is accepted at a wrong place", driven.ends),
        drives.claim_open_doors(driven.ends),
        drives.claim_not_lost_in_place(driven.ends),
    ]


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def _draw(driven: Driven[ObstacleEnd], path: Path) -> None:
    with chart(path, "Ways round things", "way driven / shortest way", "share of the missions below it") as axes:
        for name, colour in ((CAMERA, OURS), (WITH_RING, PEER)):
            ratios = np.sort(_ratios(driven.rows[name]))
            if len(ratios):
                axes.step(ratios, np.arange(1, len(ratios) + 1) / len(ratios), where="post", color=colour, label=name)
        axes.axvline(MAX_WAY_RATIO, color=PAPER, linestyle="--", label="required of the mean")
