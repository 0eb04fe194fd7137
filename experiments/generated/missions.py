"""Missions as files for campaigns, the same for the same arguments; and scenario texts of missions that take seconds.

On generated floors, from room to room: with a model that is wrong by centimetres, with a camera mounted differently, on
floors of identical rooms, and with clutter on or beside the way.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from experiments.generated.clutter import KEPT_FREE_M, ClutterMaker
from experiments.generated.floors import Floor, generated_floor
from experiments.generated.free_floor import find_free_floor, has_way
from sim.body.collision import Obstacles
from sim.ground_truth.inexact import TrueInexact
from sim.scenario import parse_scenario
from sim.stage import build_stage
from world_models.frames import Pose2
from world_models.units import FOOT_M

OFFICE = """
description = "Across Allen's office."
world = "research_center"
details = ["research_center_details"]
goal = "(ptrans (allens-office (7,4,0)) (allens-office (13,12,0)))"

[start]
heading_deg = 60.0
put_down_sigma_m = 0.02
put_down_sigma_deg = 1.0

[limits]
max_cycles = 600
"""
"""About 45 decisions."""

HALLWAY = """
description = "Along the hallway."
world = "research_center"
details = ["research_center_details"]
goal = "(ptrans (hallway (4,4,0)) (hallway (24,4,0)))"

[start]
heading_deg = 0.0
put_down_sigma_in = 0.5
"""
"""About 120 decisions."""


def fault(kind: str, in_locale: str, after_ft: float, **more: float) -> str:
    """The text of one ``[[faults]]``, to be appended to a scenario: ``fault("bump", "hallway", 7.0, left_m=0.3)``.

    ``in_locale`` "" is anywhere; ``more`` are the fault's own keys.
    """
    where = [f'in_locale = "{in_locale}"'] if in_locale else []
    lines = [f'kind = "{kind}"', *where, f"after_ft = {after_ft}"]
    return "\n".join(["", "[[faults]]", *lines, *(f"{name} = {value}" for name, value in more.items()), ""])


ROOMS = 6
MARGIN_FT, TWIN_MARGIN_FT = 2.5, 3.0
"""Start and goal are as far from the walls of their rooms."""
MAX_DRAWS, MAX_TWIN_DRAWS = 100, 200
ROOM_M, WAY_MARGIN_M = 0.3, 0.06
"""Free floor round start and goal, and beside the robot on a way that counts as one."""


@dataclass(frozen=True, slots=True)
class End:
    """A place of a room where a mission begins or ends [m, in the room's frame]."""

    room: str
    x_m: float
    y_m: float

    def __str__(self) -> str:
        """As a command names it, in feet: ``(room-0-north-1 (7.00,4.00,0))``."""
        return f"({self.room} ({self.x_m / FOOT_M:.2f},{self.y_m / FOOT_M:.2f},0))"


def draw_ends(floor: Floor, rooms: Sequence[str], rng: np.random.Generator, margin_ft: float = MARGIN_FT) -> list[End]:
    """A random place in each of these rooms."""
    ends, margin_m = [], margin_ft * FOOT_M
    for room in rooms:
        outline = floor.world.locale(room).outline
        x, y = rng.uniform(outline.min(axis=0) + margin_m, outline.max(axis=0) - margin_m)
        ends.append(End(room, float(x), float(y)))
    return ends


def draw_rooms(floor: Floor, rng: np.random.Generator) -> list[str]:
    """Two rooms of a floor: from where to where."""
    return [str(room) for room in rng.choice(floor.rooms, 2, replace=False)]


def format_mission(description: str, files: tuple[Path, Path], ends: Sequence[End], heading_deg: float) -> str:
    """The text of a scenario on a floor whose two files were written, without what differs there."""
    world, details = files
    return (f'description = "{description}"\nworld = "{world.name}"\ndetails = ["{details.name}"]\n'
            f'goal = "(ptrans {" ".join(map(str, ends))})"\n\n[start]\nheading_deg = {heading_deg:.1f}\n'
            "put_down_sigma_m = 0.02\nput_down_sigma_deg = 1.0\n")


def draw_heading_deg(rng: np.random.Generator) -> float:
    """Any heading."""
    return math.degrees(rng.uniform(-math.pi, math.pi))


def is_drivable(obstacles: Obstacles, start: Pose2, goal: Pose2) -> bool:
    """Whether the robot has room at start and goal [world], and a way from one to the other."""
    has_room = min(obstacles.clearance_m(start), obstacles.clearance_m(goal)) >= ROOM_M
    return has_room and has_way(find_free_floor(obstacles, WAY_MARGIN_M), start, goal)


# -- models wrong by centimetres ---------------------------------------------------------------------------------------

WHEELS_WORSE = (
    "[actuator]\nturn_scale_sigma = 0.06\nturn_sigma_deg = 0.3\nskitter_sigma_m = 0.009\n"
    "curvature_low_per_m = 0.0135\ncurvature_high_per_m = 0.0435\ncurvature_sigma_per_m = 0.0045\n"
    "shortfall_low = 0.12\nshortfall_high = 0.18\ndistance_sigma = 0.009\n")
"""Three times the errors of the wheels that the robot believes in."""


def write_inexact_mission(
    folder: Path, seed: int, truth: TrueInexact, *, stated_m: float = 0.0, more: str = "", rooms: int = ROOMS,
    draw: Sequence[int] = (5,), name: str = "inexact",
) -> Path:
    """Write a scenario from one room of a generated floor to another, with the floor's files; returns its path.

    Start and goal do not depend on how far the walls are displaced as long as there is a way, in truth and by the
    model: nobody sends a robot to where a table stands on the plan.

    Args:
        truth: how inexact the model is; its seed is replaced by ``seed``.
        stated_m: the standard deviation that the world file states.
        more: further tables of the scenario.
        draw: by which the mission is drawn, on the same floor in the same building. name: of its file.

    Raises:
        ValueError: nothing that fits was found.
    """
    floor, rng = generated_floor(seed, rooms, open_share=1.0), np.random.default_rng([seed, *draw])
    world, details = floor.write(folder)
    if stated_m:
        world.write_text(f"sigma_cm = {100.0 * stated_m:g}\n{world.read_text('utf-8')}", "utf-8")
    told = {key: value for key, value in asdict(truth).items() if key != "seed" and value}
    table = "\n".join(["\n[truth.inexact]", *(f"{key} = {value:g}" for key, value in told.items()), f"seed = {seed}\n"]
                      ) if told else ""
    for _ in range(MAX_DRAWS):
        ends = draw_ends(floor, draw_rooms(floor, rng), rng)
        text = format_mission(f"A generated floor, inexact by {100.0 * truth.sigma_m:g} cm.", (world, details), ends,
                              draw_heading_deg(rng))
        try:
            stages = [build_stage(parse_scenario(text + of, "inexact", folder)) for of in dict.fromkeys(("", table))]
        except ValueError:
            continue
        if all(is_drivable(s.building.obstacles, s.start_world, s.goal_world) for s in stages):
            path = folder / f"{name}-{seed}.toml"
            path.write_text(text + table + more, "utf-8")
            return path
    raise ValueError(f"expected a mission on floor {seed}, got none in {MAX_DRAWS} draws")


# -- cameras mounted differently ---------------------------------------------------------------------------------------

CAMERA_CASES = ("as told", "miscalibrated", "knocked")
MAX_TURN_RAD, MAX_HEIGHT_M, MAX_FOCAL = math.radians(3.0), 0.08, 0.04
"""Largest errors of tilt, roll and yaw; of the height; and of the focal length, as a part of it."""
FOCAL_PX = 401.84
"""Focal length of a scenario's camera."""
KNOCK_M = (1.0, 5.0)
"""Between which lengths of the way a camera is knocked."""


def write_camera_mission(folder: Path, seed: int, case: str) -> Path:
    """Write a scenario with a camera that is not mounted as told, or that is knocked on the way; returns its path."""
    rng = np.random.default_rng([seed, 7])
    tilt, roll, yaw, height, focal, after = rng.uniform(-1.0, 1.0, 6)
    turn = "".join(f"{name}_deg = {math.degrees(MAX_TURN_RAD) * part:.4f}\n" for name, part in (
        ("tilt", tilt), ("roll", roll), ("yaw", yaw)))
    low, high = KNOCK_M
    more = {
        "as told": "",
        "miscalibrated": f"\n[truth.camera]\n{turn}height_m = {MAX_HEIGHT_M * height:.4f}\n"
                         f"focal_px = {MAX_FOCAL * FOCAL_PX * focal:.3f}\n",
        "knocked": f'\n[[faults]]\nkind = "camera_knocked"\nafter_m = {low + (high - low) * abs(after):.2f}\n{turn}',
    }[case]
    return write_inexact_mission(folder, seed, TrueInexact(), more=more)


# -- identical rooms ---------------------------------------------------------------------------------------------------

MIN_TWINS, MAX_TWINS = 5, 40


@dataclass(frozen=True, slots=True)
class TwinMission:
    """A mission: its file, the room that is told, the room where the robot is put down, and the number of rooms."""

    path: Path
    told: str
    true: str
    rooms: int


def write_twin_mission(folder: Path, seed: int, *, is_told_right: bool, rooms: int | None = None) -> TwinMission:
    """Write a scenario from one of identical rooms to another, with the floor's files.

    Where it is told wrong the robot is put down in a twin of the told room: at the same place of it, so that both look
    alike from there. Start and goal do not depend on ``is_told_right``.

    Args:
        rooms: number of rooms; drawn from 5 to 40 where it is not given.

    Raises:
        ValueError: nothing that fits was found.
    """
    rng = np.random.default_rng([seed, 7])
    drawn = round(math.exp(rng.uniform(math.log(MIN_TWINS), math.log(MAX_TWINS))))
    floor = generated_floor(seed, rooms or drawn, open_share=1.0, identical=True)
    files = floor.write(folder)
    for _ in range(MAX_TWIN_DRAWS):
        told, goal = draw_rooms(floor, rng)
        twin = str(rng.choice([r for r in floor.rooms if r != told and _side(r) == _side(told)]))
        ends, heading_deg = draw_ends(floor, (told, goal), rng, TWIN_MARGIN_FT), draw_heading_deg(rng)
        text = format_mission(f"A floor of {rooms or drawn} identical rooms.", files, ends, heading_deg)
        if not is_told_right:
            text += (f'\n[truth.start]\nlocale = "{twin}"\nx_m = {ends[0].x_m:.4f}\ny_m = {ends[0].y_m:.4f}\n'
                     f"heading_deg = {heading_deg:.1f}\n")
        try:
            stage = build_stage(parse_scenario(text, "twins", folder))
        except ValueError:
            continue
        if is_drivable(stage.building.obstacles, stage.put_down_world, stage.goal_world):
            path = folder / f"twins-{seed}.toml"
            path.write_text(text, "utf-8")
            return TwinMission(path, told, told if is_told_right else twin, rooms or drawn)
    raise ValueError(f"expected a mission on floor {seed}, got none in {MAX_TWIN_DRAWS} draws")


def write_large_mission(folder: Path, seed: int, rooms: int) -> Path:
    """Write a scenario from one of many like rooms to another, put down in a third; returns its path.

    All rooms are as wide and all doors alike; what stands in the rooms differs.

    Raises:
        ValueError: nothing that fits was found.
    """
    floor, rng = generated_floor(seed, rooms, open_share=1.0, repeated=True), np.random.default_rng([seed, 9])
    files = floor.write(folder)
    for _ in range(MAX_TWIN_DRAWS):
        told, goal, true = (str(room) for room in rng.choice(floor.rooms, 3, replace=False))
        *ends, there = draw_ends(floor, (told, goal, true), rng)
        text = format_mission(f"A floor of {rooms} rooms.", files, ends, draw_heading_deg(rng))
        text += (f'\n[truth.start]\nlocale = "{true}"\nx_m = {there.x_m:.4f}\ny_m = {there.y_m:.4f}\n'
                 f"heading_deg = {draw_heading_deg(rng):.1f}\n")
        try:
            stage = build_stage(parse_scenario(text, "large", folder))
        except ValueError:
            continue
        if is_drivable(stage.building.obstacles, stage.put_down_world, stage.goal_world):
            path = folder / f"large-{seed}.toml"
            path.write_text(text, "utf-8")
            return path
    raise ValueError(f"expected a mission on floor {seed}, got none in {MAX_TWIN_DRAWS} draws")


def _side(room: str) -> str:
    """The side of the corridor on which a room lies: those on the same side are alike without being turned."""
    return room.split("-")[2]


# -- clutter -----------------------------------------------------------------------------------------------------------


def write_cluttered_mission(
    folder: Path, seed: int, *, leaves_way: bool = True, rooms: int = ROOMS, count: int | None = None,
    is_camouflaged: bool = False,
) -> Path:
    """Write a scenario from one room of a generated floor to another, with the floor's files; returns its path.

    Where it ``is_camouflaged`` the floors' finish is drawn, and most things have the floor's colour. ``leaves_way``
    and ``count`` are those of :meth:`~experiments.generated.clutter.ClutterMaker.draw`; all doors of the
    floor are open.

    Raises:
        ValueError: nothing that fits was found.
    """
    floor, rng = generated_floor(seed, rooms, open_share=1.0), np.random.default_rng([seed, 2])
    if is_camouflaged:
        floor = floor.refloored(np.random.default_rng([seed, 3]))
    files = floor.write(folder)
    for _ in range(MAX_DRAWS):
        ends = draw_ends(floor, draw_rooms(floor, rng), rng)
        text = format_mission(f"From room to room on a cluttered floor; {'a' if leaves_way else 'no'} way is left.",
                              files, ends, draw_heading_deg(rng))
        try:
            stage = build_stage(parse_scenario(text, "cluttered", folder))
            if stage.building.obstacles.clearance_m(stage.goal_world) < KEPT_FREE_M / 2.0:
                continue
            clutter = ClutterMaker(stage).draw(seed, leaves_way=leaves_way, count=count)
            if is_camouflaged:
                clutter = clutter.painted(floor.floor_colour, np.random.default_rng([seed, 4]))
        except ValueError:
            continue
        path = folder / f"cluttered-{seed}.toml"
        path.write_text(text + clutter.text, "utf-8")
        return path
    raise ValueError(f"expected a mission on floor {seed}, got none in {MAX_DRAWS} draws")
