"""1,000 kidnaps to anywhere on floors of forty rooms: does the robot find where it is?

Each time it stands at a random pose and believes to be at another. Line finder, dead reckoner, the sources of a lost
robot and mission monitor share a board with a simulated body; the goal level is in doubt, and they act until it is
not, or until they give up. In addition there are corridors that look the same from both ends, where the only right
answer is that the place is ambiguous.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import shapely

from blackboard import Blackboard, Level, Post, Scheduler
from experiments.generated.floors import Floor, generated_floor
from experiments.report import Cell, Claim, Report
from experiments.trials import RESULTS, campaign_folder, judge_rare, judge_share, run_trials
from harvey.runner.ports import BodyPort, build_scheduler
from harvey.runner.run import run_to_outcome
from knowledge_sources.action.dead_reckoner import DeadReckoner
from knowledge_sources.goal.goal_renewer import goal_renewer
from knowledge_sources.goal.mission_monitor import mission_monitor
from knowledge_sources.methods.localization import get_visibility_map
from knowledge_sources.methods.motion import compute_free_space
from knowledge_sources.milestone.line_finder import LineFinder
from knowledge_sources.relocalizer.localizer import Localizer
from knowledge_sources.relocalizer.panorama_builder import PanoramaBuilder
from knowledge_sources.relocalizer.pose_adopter import pose_adopter
from knowledge_sources.relocalizer.probe_photographer import ProbePhotographer
from knowledge_sources.relocalizer.prober import Prober
from knowledge_sources.settings import DEFAULT
from sim.body.faulty_body import FaultyBody
from sim.body.simulated_body import SimulatedBody
from sim.body.simulated_building import SimulatedBuilding
from world_models.actuator import ActuatorModel
from world_models.building.world import World
from world_models.camera import Camera, CameraMount
from world_models.entries import BodyFault, CameraPicture, Discrepancy, Hypothesis, Panorama, Place, diagonal
from world_models.frame_building import FrameBuilding
from world_models.frame_store import FrameStore
from world_models.frames import Pose2
from world_models.robot import RobotModel
from world_models.units import FOOT_M

MIN_CLEARANCE_M = 0.45
"""Smallest distance of the robot's centre from walls and furniture."""


@dataclass(frozen=True, slots=True)
class Kidnap:
    """A kidnap.

    Attributes:
        floor: seed of the floor; rooms: number of its rooms.
        symmetric: its corridors look the same from both ends, and the robot is put into one of them.
        number: of the kidnap on that floor; with the floor's seed it determines all random numbers.
    """

    floor: int
    rooms: int
    symmetric: bool
    number: int


@dataclass(frozen=True, slots=True)
class KidnapResult:
    """Result of a kidnap.

    Attributes:
        room: where it truly is.
        verdict: found, ambiguous or lost.
        believed: reported locale; error_m: distance from the reported pose; infinite if there is none.
        probes: number of looks; places: number of pose candidates at the end.
        cpu_s: processor time, without rendering and what is computed once per floor.
    """

    floor: int
    rooms: int
    number: int
    room: str
    verdict: str
    believed: str
    error_m: float
    probes: int
    places: int
    cpu_s: float


@dataclass(frozen=True, eq=False)
class Scene:
    """A floor with its building, and a robot that has its model."""

    floor: Floor
    robot: RobotModel
    building: SimulatedBuilding


@lru_cache(maxsize=2)
def _floor(seed: int, rooms: int, symmetric: bool) -> Floor:
    return generated_floor(seed, rooms, symmetric=symmetric)


def get_floor(trial: Kidnap) -> Floor:
    """Get the floor of a kidnap."""
    return _floor(trial.floor, trial.rooms, trial.symmetric)


@lru_cache(maxsize=2)
def _scene(floor: Floor) -> Scene:
    camera = Camera.from_field_of_view(math.radians(65.0), 512, 512)
    robot = RobotModel(floor.world, camera, CameraMount(1.0, 0.1, 0.0), ActuatorModel())
    real = floor.building
    building = SimulatedBuilding.of_faces(real.faces, lambda pose: real.locale_at(pose.position) or "", 8)
    frames = _frames_of(floor.world)
    for room in floor.world.rooms:
        get_visibility_map(frames, room, robot.mount.height_m)
    return Scene(floor, robot, building)


def _frames_of(world: World) -> FrameBuilding:
    """Put all frames of a world on a board; what is computed from them is kept with them."""
    board, store = Blackboard(), FrameStore(world)
    board.apply([Post(store.frame(name)) for name in world.locales], author="world", cycle=0)
    return FrameBuilding(board.view)


def run_kidnap(trial: Kidnap) -> KidnapResult:
    """Kidnap the robot, and let it relocalize."""
    scene = _scene(get_floor(trial))
    room, there, belief = _draw_poses(trial, scene.floor)
    body = SimulatedBody(scene.building, there, scene.robot.camera, scene.robot.mount, seed=trial.number)
    timed = _TimedBody(body)
    scheduler = _build_lost_agent(scene, timed, belief)
    began = time.process_time()
    run_to_outcome(scheduler, over=lambda s: "found" if _is_found(s) else None)
    cpu_s = time.process_time() - began - timed.cpu_s
    view = scheduler.view
    held = view.latest(Hypothesis, lambda h: h.is_held)
    candidates = view.where(Hypothesis, lambda h: h.status == "candidate")
    panorama = view.latest(Panorama)
    is_found = _is_found(scheduler)
    pose = body.truth.world_from_robot
    error_m = held.value.world_from_robot(scene.robot.world).distance_to(pose) if held and is_found else math.inf
    verdict = "found" if is_found else "ambiguous" if len(candidates) > 1 else "lost"
    return KidnapResult(
        trial.floor, trial.rooms, trial.number, room, verdict,
        held.value.locale if held and is_found else "", error_m, len(panorama.value.glimpses) if panorama else 0,
        len(candidates), cpu_s,
    )


class _TimedBody(FaultyBody):
    """The body, with the time of its rendering."""

    def __init__(self, body: SimulatedBody) -> None:
        super().__init__(body)
        self.cpu_s = 0.0

    def look(self, purpose: str) -> CameraPicture | BodyFault:
        began = time.process_time()
        try:
            return super().look(purpose)
        finally:
            self.cpu_s += time.process_time() - began


def _build_lost_agent(scene: Scene, body: FaultyBody, belief: Place) -> Scheduler:
    """Build a scheduler whose goal level is in doubt."""
    finders = (LineFinder, DeadReckoner, ProbePhotographer, PanoramaBuilder, Localizer, Prober)
    sources = [*(source(DEFAULT) for source in finders), pose_adopter, goal_renewer, mission_monitor]
    scheduler = build_scheduler(sources, scene.floor.world, scene.robot, ports=(BodyPort(body),))
    held = Hypothesis(belief.locale, Pose2(belief.x_m, belief.y_m, belief.heading_rad or 0.0), diagonal(0.05, 0.02),
                      "milestone")
    bound_px = DEFAULT.plan.max_deviation_px
    doubt = Discrepancy(Level.GOAL, "the robot was kidnapped", None, (bound_px, bound_px), "px")
    scheduler.post([Post(held), Post(doubt)], "user")
    return scheduler


def _is_found(scheduler: Scheduler) -> bool:
    held = scheduler.view.latest(Hypothesis, lambda h: h.is_held)
    return held is not None and held.value.basis == "relocalization"


def _draw_poses(trial: Kidnap, floor: Floor) -> tuple[str, Pose2, Place]:
    """Draw the true room and pose [world], and the believed place."""
    rng = np.random.default_rng([trial.floor, trial.number])
    rooms = floor.corridors if trial.symmetric else (*floor.corridors, *floor.rooms)
    room, there = _draw_pose(floor.building, rooms, rng)
    believed, pose = _draw_pose(floor.world, (*floor.corridors, *floor.rooms), rng)
    return room, there, Place.of_world(floor.world, believed, pose.x_m, pose.y_m, pose.heading_rad)


def _draw_pose(world: World, rooms: tuple[str, ...], rng: np.random.Generator) -> tuple[str, Pose2]:
    """Draw a free pose, uniformly over the area and the headings."""
    free = [compute_free_space(world.outline(name), world.obstacles(name), MIN_CLEARANCE_M) for name in rooms]
    areas = np.array([space.area for space in free])
    number = int(rng.choice(len(rooms), p=areas / areas.sum()))
    x0, y0, x1, y1 = (float(v) for v in free[number].bounds)
    while True:
        x, y, heading = rng.uniform(x0, x1), rng.uniform(y0, y1), rng.uniform(-math.pi, math.pi)
        if shapely.intersects_xy(free[number], x, y):
            return rooms[number], Pose2(float(x), float(y), float(heading))


def format_scenario(trial: Kidnap) -> str:
    """Format a scenario in which it happens: the robot starts at the believed place and is kidnapped at once."""
    floor = get_floor(trial)
    room, there, belief = _draw_poses(trial, floor)
    place = Place.of_world(floor.world, room, there.x_m, there.y_m, there.heading_rad)
    goal, spot = _draw_pose(floor.world, (belief.locale,), np.random.default_rng([trial.floor, trial.number, 1]))
    end = Place.of_world(floor.world, goal, spot.x_m, spot.y_m)
    return f'''description = "Kidnapped to {room} at once. Written by harvey experiment kidnap."
world = "floor-{floor.seed}.toml"
details = ["floor-{floor.seed}-details.toml"]
goal = "(ptrans ({belief.locale} ({_ft(belief.x_m)},{_ft(belief.y_m)},0)) ({goal} ({_ft(end.x_m)},{_ft(end.y_m)},0)))"

[start]
heading_deg = {math.degrees(belief.heading_rad or 0.0):.3f}

[[faults]]
kind = "kidnap"
to_locale = "{room}"
to_x_m = {place.x_m:.4f}
to_y_m = {place.y_m:.4f}
to_heading_deg = {math.degrees(place.heading_rad or 0.0):.3f}
'''


def _ft(metres: float) -> str:
    return f"{metres / FOOT_M:.4f}"


ROOMS, FLOORS, EACH = 40, 25, 40
SYMMETRIC_ROOMS, SYMMETRIC_FLOORS, SYMMETRIC_EACH = 12, 10, 20
QUICK = (8, 1, 3, 4, 1, 2)
"""Rooms, floors and kidnaps on each, and the same of the symmetric ones, with --quick."""
MAX_ERROR_M = 0.1
MAX_PROBES, MAX_MEDIAN_PROBES = 5, 2
MIN_RIGHT_SHARE = 0.99
WORST_SHOWN = 5
COLUMNS = ("floors", "kidnaps", "right", "ambiguous", "undecided", "wrong", "median probes", "<= 5 probes", "mean mm",
           "99 % mm", "mean CPU s", "max CPU s")


def run(quick: bool, seed: int) -> Report:
    """Kidnap on floors with seeds 1000 ``seed`` + 0, 1, ...; symmetric ones with 1000 ``seed`` + 500, ...."""
    rooms, floors, each, symmetric_rooms, symmetric_floors, symmetric_each = (
        QUICK if quick else (ROOMS, FLOORS, EACH, SYMMETRIC_ROOMS, SYMMETRIC_FLOORS, SYMMETRIC_EACH))
    anywhere = [Kidnap(1000 * seed + f, rooms, False, k) for f in range(floors) for k in range(each)]
    symmetric = [Kidnap(1000 * seed + 500 + f, symmetric_rooms, True, k)
                 for f in range(symmetric_floors) for k in range(symmetric_each)]
    folder = campaign_folder("kidnap", seed, quick=quick)
    trials = [*anywhere, *symmetric]
    found = run_trials(run_kidnap, trials, KidnapResult, folder, "kidnap")
    split = len(anywhere)
    groups = ((f"{floors} of {rooms} rooms", found[:split]), (f"{symmetric_floors} symmetric corridors", found[split:]))
    report = Report(
        "Kidnaps to anywhere on a floor", COLUMNS, tuple(_row(name, group) for name, group in groups),
        notes=(
            f"Floors of seeds {trials[0].floor} to {trials[split - 1].floor}, symmetric ones of"
            f" {trials[split].floor} to {trials[-1].floor}; the robot is anywhere, with any heading.",
            f"right: it reports a pose in the right locale and within {MAX_ERROR_M} m; wrong: it reports another one;"
            " undecided: it stays lost, with one pose candidate or none. A probe is a look, the first one included.",
            "The paper gives no figures for lost robots.",
            *_worst(trials, found, folder),
            f"One line per kidnap: {folder / RESULTS}",
        ),
        claims=_claims(found[:split], found[split:]),
    )
    (folder / "table.txt").write_text(report.text() + "\n", encoding="utf-8")
    return report


def is_right(result: KidnapResult) -> bool:
    """Whether it reports a pose, and the right one."""
    return result.verdict == "found" and result.room == result.believed and result.error_m <= MAX_ERROR_M


def is_wrong(result: KidnapResult) -> bool:
    """Whether it reports a pose, and a wrong one."""
    return result.verdict == "found" and not is_right(result)


def _row(name: str, found: Sequence[KidnapResult]) -> tuple[Cell, ...]:
    right = [f for f in found if is_right(f)]
    errors_mm = np.array([1000.0 * f.error_m for f in right])
    return (
        name, len(found), len(right), sum(f.verdict == "ambiguous" for f in found),
        sum(f.verdict == "lost" for f in found), sum(is_wrong(f) for f in found),
        float(np.median([f.probes for f in found])), sum(f.probes <= MAX_PROBES for f in found),
        float(errors_mm.mean()) if len(right) else None,
        float(np.percentile(errors_mm, 99.0)) if len(right) else None,
        math.fsum(f.cpu_s for f in found) / len(found), max(f.cpu_s for f in found),
    )


def _claims(anywhere: Sequence[KidnapResult], symmetric: Sequence[KidnapResult]) -> tuple[Claim, ...]:
    good = sum(is_right(f) and f.probes <= MAX_PROBES for f in anywhere)
    wrong, of = sum(is_wrong(f) for f in (*anywhere, *symmetric)), len(anywhere) + len(symmetric)
    return (
        (f"right locale and within {MAX_ERROR_M} m after at most {MAX_PROBES} probes in at least"
         f" {MIN_RIGHT_SHARE:.0%}: {good} of {len(anywhere)}", judge_share(good, len(anywhere), MIN_RIGHT_SHARE)),
        (f"median number of probes at most {MAX_MEDIAN_PROBES}",
         float(np.median([f.probes for f in anywhere])) <= MAX_MEDIAN_PROBES),
        (f"never wrong: {wrong} of {of}", judge_rare(wrong, of, 0.0)),
        ("every symmetric corridor is reported as ambiguous", all(f.verdict == "ambiguous" for f in symmetric)),
    )


def _badness(trial: Kidnap, result: KidnapResult) -> tuple[bool, bool, int, float]:
    good = result.verdict == "ambiguous" if trial.symmetric else is_right(result)
    return is_wrong(result), not good, result.probes, 0.0 if trial.symmetric else result.error_m


def _worst(trials: Sequence[Kidnap], found: Sequence[KidnapResult], folder: Path) -> Iterator[str]:
    """Describe the worst cases, each with a scenario file that shows it."""
    order = sorted(range(len(trials)), key=lambda i: _badness(trials[i], found[i]), reverse=True)[:WORST_SHOWN]
    for i in order:
        trial, f = trials[i], found[i]
        get_floor(trial).write(folder)
        path = folder / f"kidnap-{trial.floor}-{trial.number}.toml"
        path.write_text(format_scenario(trial), encoding="utf-8")
        error = "" if math.isinf(f.error_m) else f", {1000.0 * f.error_m:.0f} mm off"
        yield (f"among the worst: floor {trial.floor}, kidnap {trial.number} to {f.room}: {f.verdict} after {f.probes}"
               f" probes{error}. See it: harvey run {path} --seed {trial.number}")
