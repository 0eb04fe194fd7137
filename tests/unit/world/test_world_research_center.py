"""The shipped floor keeps the promises that the mission of Figure 17 rests on."""

import math

import networkx as nx
import numpy as np
import pytest
from numpy.typing import NDArray

from world_models.building.geometry.outlines import distance_to_border, inside_polygon
from world_models.building.plan_view import LEGEND, build_drawing, plan_svg
from world_models.building.world import World
from world_models.camera import Camera, CameraMount
from world_models.files.world_files import WORLDS, load_world
from world_models.frames import Pose2
from world_models.visibility.lines_and_points import visible_lines, visible_points

FT = 0.3048
ROBOT_M = 0.35
CAMERA = Camera.from_field_of_view(math.radians(65.0))
MOUNT = CameraMount(1.0, 0.1)


@pytest.fixture(scope="module")
def world() -> World:
    return load_world(WORLDS / "research_center.toml")


def place(world: World, locale: str, x_ft: float, y_ft: float) -> NDArray[np.float64]:
    return np.asarray(world.world_from_locale(locale).apply([x_ft * FT, y_ft * FT, 0.0])[:2])


def clearance_m(world: World, locale: str, point: NDArray[np.float64]) -> float:
    """Distance [m] from walls and obstacles."""
    return min([distance_to_border(point, world.outline(locale))]
               + [distance_to_border(point, footprint) for footprint in world.obstacles(locale)])


def is_reachable(world: World, locale: str, start: NDArray[np.float64], end: NDArray[np.float64]) -> bool:
    """Whether a robot with 10 cm to spare gets from one place in a room to another, on a grid of 15 cm."""
    outline, step = world.outline(locale), 0.15
    low, high = outline.min(axis=0), outline.max(axis=0)
    columns, rows = np.ceil((high - low) / step).astype(int)
    graph = nx.grid_2d_graph(int(rows), int(columns))

    def bad(cell: tuple[int, int]) -> bool:
        p = low + step * np.array([cell[1], cell[0]])
        return not inside_polygon(p, outline) or clearance_m(world, locale, p) < ROBOT_M + 0.1

    def cell_of(point: NDArray[np.float64]) -> tuple[int, int]:
        column, row = np.round((point - low) / step).astype(int)
        return int(row), int(column)

    graph.remove_nodes_from([cell for cell in graph if bad(cell)])
    return nx.has_path(graph, cell_of(start), cell_of(end))


def before_door(world: World, name: str, locale: str) -> NDArray[np.float64]:
    """Where a robot stands before it goes out through a door."""
    doorway = next(d for d in world.doorways if d.name == name)
    return doorway.threshold_of(locale).mean(axis=0) - 0.7 * doorway.outward_from(locale)


def test_there_are_enough_rooms_in_the_hierarchy(world: World) -> None:
    assert len(world.rooms) >= 7
    assert world.path_of("allens-office") == ("research-center", "second-floor", "allens-office")
    assert world.walk("robot-laboratory", "allens-office") == ["robot-laboratory", "hallway", "allens-office"]


def test_start_and_goal_are_free(world: World) -> None:
    start, goal = place(world, "robot-laboratory", 16, 2), place(world, "allens-office", 13, 12)
    assert world.locale_at(start) == "robot-laboratory" and world.locale_at(goal) == "allens-office"
    assert clearance_m(world, "robot-laboratory", start) >= 1.6 * FT
    assert min(distance_to_border(goal, f) for f in world.obstacles("allens-office")) >= 2 * FT
    assert clearance_m(world, "allens-office", goal) >= 2 * FT - 1e-9


def test_the_straight_way_out_of_the_laboratory_is_blocked_but_another_is_free(world: World) -> None:
    start, out = place(world, "robot-laboratory", 16, 2), before_door(world, "laboratory-door", "robot-laboratory")
    on_line = [start + t * (out - start) for t in np.linspace(0, 1, 200)]
    assert any(inside_polygon(p, f) for p in on_line for f in world.obstacles("robot-laboratory"))
    assert is_reachable(world, "robot-laboratory", start, out)


def test_the_way_through_hallway_and_office_is_free(world: World) -> None:
    enter, leave = before_door(world, "laboratory-door", "hallway"), before_door(world, "allens-door", "hallway")
    assert 38 * FT < abs(leave[0] - enter[0]) < 42 * FT
    assert is_reachable(world, "hallway", enter, leave)
    assert is_reachable(world, "allens-office", before_door(world, "allens-door", "allens-office"),
                     place(world, "allens-office", 13, 12))


def test_the_two_doors_are_wide(world: World) -> None:
    widths = {d.name: d.width_m for d in world.doorways}
    assert math.isclose(widths["laboratory-door"], 3.3 * FT) and math.isclose(widths["allens-door"], 3.3 * FT)


@pytest.mark.parametrize(
    ("locale", "x_ft", "y_ft", "heading_deg", "lines", "points"),
    [
        ("robot-laboratory", 16, 2, 0, 40, 20),
        ("robot-laboratory", 16, 2, 90, 30, 15),
        ("robot-laboratory", 29, 12, 90, 15, 8),
        ("robot-laboratory", 26, 21, 90, 15, 8),
        ("hallway", 32, 4, 0, 60, 40),
        ("hallway", 32, 4, 90, 12, 8),
        ("hallway", 52, 4, 0, 60, 40),
        ("hallway", 72, 4, 90, 30, 15),
        ("hallway", 72, 4, 270, 12, 8),
        ("allens-office", 6, 2, 60, 30, 15),
        ("allens-office", 13, 12, 60, 12, 6),
        ("allens-office", 13, 12, 180, 20, 10),
    ],
)
def test_there_is_enough_to_see_on_the_way(
    world: World, locale: str, x_ft: float, y_ft: float, heading_deg: float, lines: int, points: int
) -> None:
    robot = Pose2(x_ft * FT, y_ft * FT, math.radians(heading_deg))
    view = MOUNT.camera_from_robot @ (world.world_from_locale(locale) @ robot.lifted()).inverse()
    found = visible_lines(world, CAMERA, view, min_contrast=0.04, min_length_px=12)
    d = np.abs(found.segments_px[:, 1] - found.segments_px[:, 0])
    assert len(found) >= lines and len(visible_points(world, CAMERA, view, min_contrast=0.04)) >= points
    assert np.count_nonzero(d[:, 1] > 4 * d[:, 0]) >= 4 and np.count_nonzero(d[:, 0] > d[:, 1]) >= 4


def test_the_hallway_does_not_repeat_itself(world: World) -> None:
    doors = sorted(mark.lines_world[..., 0].mean() for mark in world.landmarks
                   if mark.kind in ("door", "doorway") and "hallway" in (mark.locale, mark.neighbour))
    gaps = np.diff(doors)
    assert len(doors) >= 12 and len(np.unique(np.round(gaps, 1))) >= 9


def test_flat_boards_are_no_obstacles_but_furniture_is(world: World) -> None:
    assert not next(t for t in world.things if t.kind == "notice-board").is_obstacle
    assert not next(t for t in world.things if t.kind == "exit-sign").is_obstacle
    assert next(t for t in world.things if t.kind == "pillar").is_obstacle
    assert next(t for t in world.things if t.name == "allens-office/desk").is_obstacle


def test_a_plan_shows_every_room_and_thing(world: World) -> None:
    plan = plan_svg(world)
    assert plan.startswith("<svg") and plan.count('<text class="name"') == len(world.rooms)
    drawn = build_drawing(world).shapes
    doorways = {doorway.name for room in world.rooms for doorway in world.doorways_of(room)}
    assert {shape.text for shape in drawn if shape.kind == "door-name"} == doorways
    notes = {shape.text for shape in drawn if shape.kind == "note"}
    assert {"N", "5 m"} | {LEGEND[kind] for kind in {shape.kind for shape in drawn} & LEGEND.keys()} == notes
    assert all(f">{room}</text>" in plan for room in world.rooms)
    assert all(f"<title>{thing.name}</title>" in plan for thing in world.things)
