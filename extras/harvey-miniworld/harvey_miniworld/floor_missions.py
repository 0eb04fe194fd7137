"""Missions on generated floors: where from and where to, put down a little off, kidnapped, or with things in the way.

``python -m harvey_miniworld.floor_missions SEED [--row plain|kidnap|things] [--out RUN]`` drives one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import shapely

from blackboard import Decision, Sink
from harvey.agent_settings import Pairs
from harvey.hardware.hardware_mission import HardwareMission, load_mission
from harvey.hardware.own_body import build_robot, drive_body
from harvey.runner.result import MissionResult
from harvey_miniworld.drawn_floor import picture_aspects
from harvey_miniworld.miniworld_body import MiniworldBody
from harvey_miniworld.textured_floor import CHAIR_M, FloorRoom, StandingThing, TexturedFloor, generate_floor
from world_models.building.world import World
from world_models.camera import Camera, CameraMount
from world_models.entries import Certificate, Hypothesis, Milestone, PoseFix
from world_models.files.toml.camera_file import camera_text
from world_models.frames import Pose2, wrap_angle

ROWS = ("plain", "kidnap", "things")
CAMERA = Camera.from_field_of_view(math.radians(75.0), 640, 480)
MOUNT = CameraMount(1.2, 0.05, math.radians(5.0), 0.0)
RADIUS_M, ROOM_M, FOOT_M = 0.3, 0.35, 0.3048
OFF_M, OFF_RAD = 0.03, math.radians(2.0)
"""How far off it is put down, and turned."""
MAX_FALSE_M, MAX_FALSE_RAD = 0.15, 0.06
"""A milestone that is verified farther from where the robot truly is was accepted falsely, as in the simulator."""
THINGS = {"box": (0.4, 0.4, 0.5), "barrel": (0.6, 0.6, 0.9), "office_chair": CHAIR_M}
MISSION = """world = "{world}"
goal = "{goal}"

[start]
heading_deg = {heading}
put_down_sigma_in = {sigma_in}
put_down_sigma_deg = {sigma_deg}

[base]
radius_m = {radius}

[camera]
calibration = "camera.toml"

[actuator]
reach = 1.0

[limits]
max_time_s = 1500.0
max_cycles = 6000
"""


@dataclass(frozen=True)
class FloorMission:
    """A mission as it was drawn.

    Attributes:
        start: where it is said to stand; stands: where it truly does; goal: (x, y) [m].
        kidnap: after how many metres it is carried where.
    """

    floor: TexturedFloor
    start: Pose2
    stands: Pose2
    goal: tuple[float, float]
    rooms: tuple[str, str]
    kidnap: tuple[float, Pose2] | None = None


def draw_mission(seed: int, row: str, floor: int | None = None) -> FloorMission:
    """A mission, the same for the same arguments; ``floor``: the floor's seed, else the mission's own."""
    if row not in ROWS:
        raise ValueError(f"expected one of {', '.join(ROWS)}, got {row!r}")
    rng = np.random.default_rng([seed, ROWS.index(row), 7])
    plan = generate_floor(seed if floor is None else floor, aspects=picture_aspects())
    names = [room.name for room in plan.rooms[1:]]
    first, last = (plan.room(str(name)) for name in rng.choice(names, 2, replace=False))
    start, goal = _stand(plan, first, rng), _stand(plan, last, rng)
    if row == "things":
        plan = replace(plan, added=tuple(_put_things(plan, first, last, rng)))
    aside = rng.uniform(-math.pi, math.pi)
    off = Pose2(OFF_M * math.cos(aside), OFF_M * math.sin(aside), OFF_RAD * float(rng.choice((-1.0, 1.0))))
    kidnap = None
    if row == "kidnap":
        kidnap = float(rng.uniform(1.0, 5.0)), _stand(plan, plan.room(str(rng.choice(names))), rng)
    return FloorMission(plan, start, start @ off, (goal.x_m, goal.y_m), (first.name, last.name), kidnap)


def _stand(floor: TexturedFloor, room: FloorRoom, rng: np.random.Generator) -> Pose2:
    """A pose with room round it, that looks along the longer free view of some."""
    roomy = room.shape.intersection(floor.free).buffer(-RADIUS_M - ROOM_M)
    x0, y0, x1, y1 = roomy.bounds
    while True:
        x, y = rng.uniform((x0, y0), (x1, y1))
        if roomy.contains(shapely.Point(x, y)):
            break
    headings = rng.uniform(-math.pi, math.pi, 6)
    return Pose2(float(x), float(y), float(max(headings, key=lambda h: _view_m(room, float(x), float(y), float(h)))))


def _view_m(room: FloorRoom, x: float, y: float, heading: float) -> float:
    ray = shapely.LineString([(x, y), (x + 50.0 * math.cos(heading), y + 50.0 * math.sin(heading))])
    return float(ray.intersection(room.shape).length)


def _put_things(
    floor: TexturedFloor, first: FloorRoom, last: FloorRoom, rng: np.random.Generator
) -> Iterator[StandingThing]:
    """One thing in the corridor between the two doors, beside which there is room, and one in the last room."""
    ends, corridor = {("corridor", first.name), ("corridor", last.name)}, floor.room("corridor")
    doors = [door for door in floor.doorways if door.between in ends]
    low, high = min(door.along_m for door in doors), max(door.along_m for door in doors)
    kind = str(rng.choice(list(THINGS)))
    middle = rng.uniform(low + 1.0, high - 1.0) if high - low > 2.0 else 0.5 * (low + high)
    y = 0.5 * sum(corridor.y) + 0.3 * float(rng.choice((-1.0, 1.0))) * (corridor.y[1] - corridor.y[0])
    yield StandingThing(kind, float(middle), y, float(rng.uniform(-3.0, 3.0)), THINGS[kind])
    kind = str(rng.choice(list(THINGS)))
    place = _stand(floor, last, rng)
    yield StandingThing(kind, place.x_m, place.y_m, place.heading_rad, THINGS[kind])


def write_mission(drawn: FloorMission, folder: Path) -> HardwareMission:
    """The mission's files, and the mission that they give."""
    world = drawn.floor.write(folder)
    (folder / "camera.toml").write_text(camera_text(CAMERA, MOUNT), "utf-8")
    ends = []
    for room, (x, y) in zip(drawn.rooms, ((drawn.start.x_m, drawn.start.y_m), drawn.goal), strict=True):
        origin = drawn.floor.room(room)
        ends.append(f"({room} ({(x - origin.x[0]) / FOOT_M:.4f},{(y - origin.y[0]) / FOOT_M:.4f},0))")
    text = MISSION.format(world=world.name, goal=f"(ptrans {ends[0]} {ends[1]})", radius=RADIUS_M,
                          heading=math.degrees(drawn.start.heading_rad), sigma_in=OFF_M / 0.0254,
                          sigma_deg=math.degrees(OFF_RAD))
    path = folder / "mission.toml"
    path.write_text(text, "utf-8")
    return load_mission(path, {})


@dataclass
class FloorReferee:
    """Compares what is believed with the truth; the board never hears of it.

    Attributes:
        false_accepts: milestones verified while the robot was elsewhere.
        off_m: of each fix at a milestone, how far it was off.
    """

    body: MiniworldBody
    goal: tuple[float, float]
    world: World
    false_accepts: int = 0
    off_m: list[float] = field(default_factory=list)
    _fix: Pose2 | None = None

    def __call__(self, decision: Decision) -> None:
        for change in decision.made:
            value = change.entry.value
            if isinstance(value, PoseFix):
                self._fix = value.world_from_robot
            elif isinstance(value, Certificate) and value.verdict == "verified" and self._fix is not None:
                true = self.body.pose
                off, turned = self._fix.distance_to(true), abs(wrap_angle(self._fix.heading_rad - true.heading_rad))
                self.off_m.append(off)
                self.false_accepts += off > MAX_FALSE_M or turned > MAX_FALSE_RAD

    def over(self) -> str | None:
        return f"{len(self.body.contacts)} contacts" if len(self.body.contacts) > 20 else None

    def complete(self, result: MissionResult, belief: Hypothesis | None, /) -> MissionResult:
        pose = self.body.pose
        believed = None if belief is None else belief.world_from_robot(self.world).distance_to(pose)
        return replace(
            result, final_error_m=math.hypot(pose.x_m - self.goal[0], pose.y_m - self.goal[1]),
            path_length_m=self.body.path_m, collisions=len(self.body.contacts), belief_off_m=believed,
            milestones={**result.milestones, "false_accepts": self.false_accepts})


def drive(drawn: FloorMission, seed: int, folder: Path, *, out: Path | None = None, sinks: tuple[Sink, ...] = (),
          settings: Pairs = ()) -> tuple[MissionResult, MiniworldBody]:
    """Drive a mission; its files are written into ``folder``."""
    mission = write_mission(drawn, folder)
    robot = build_robot(mission)
    body = MiniworldBody(drawn.floor, robot, drawn.stands, seed, drawn.kidnap)
    try:
        referee = FloorReferee(body, drawn.goal, robot.world)  # type: ignore[arg-type]
        return drive_body(mission, body, seed=seed, out=out, sinks=sinks, settings=settings, referee=referee), body
    finally:
        body.close()


def tell(decision: Decision) -> None:
    """A line for each verdict."""
    for change in decision.made:
        value = change.entry.value
        if isinstance(value, Certificate):
            print(f"cycle {decision.cycle}: {value.sentence()}", flush=True)
        elif isinstance(value, Milestone) and not value.is_open:
            print(f"cycle {decision.cycle}: {value.what}: {value.status}", flush=True)


def main() -> None:
    """One mission from the command line."""
    from argparse import ArgumentParser
    from tempfile import TemporaryDirectory

    parser = ArgumentParser(description=__doc__)
    parser.add_argument("seed", type=int)
    parser.add_argument("--row", choices=ROWS, default="plain")
    parser.add_argument("--floor", type=int, help="seed of the floor, where it is not the mission's")
    parser.add_argument("--out", type=Path, help="keep the run there")
    parser.add_argument("--set", action="append", default=[], help="NAME=VALUE of harvey settings")
    args = parser.parse_args()
    drawn = draw_mission(args.seed, args.row, args.floor)
    print(f"{len(drawn.floor.rooms)} rooms; from {drawn.rooms[0]} to {drawn.rooms[1]}")
    with TemporaryDirectory() as temporary:
        folder = args.out or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        pairs = tuple((name, value) for name, _, value in (pair.partition("=") for pair in args.set))
        result, body = drive(drawn, args.seed, folder, out=args.out and args.out / "run", sinks=(tell,), settings=pairs)
    m = result.milestones
    print(f"{result.outcome}: {result.reason}\n"
          f"  {1000 * result.error_m:.0f} mm from the goal, {result.path_length_m:.1f} m, {result.sim_time_s:.0f} s, "
          f"{result.wall_time_s:.0f} s of the processor\n"
          f"  {m['verified']} verified, {m['refuted']} refuted, {m['not_testable']} not testable, "
          f"{result.false_accepts} falsely; {result.relocalizations} relocalizations; "
          f"contacts at {[round(speed, 2) for speed in body.contacts]} m/s")


if __name__ == "__main__":
    main()
