"""Laws of shut doors: a camera sees nothing through them, and everything else as before."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from box_rooms import generate_house
from knowledge_sources.methods.verification import predict_face_colors
from world_models.actuator import ActuatorModel
from world_models.building.changes import build_shut_faces, shut_door
from world_models.building.geometry.outlines import inside_polygon
from world_models.building.locales import Doorway
from world_models.building.world import World
from world_models.camera import Camera, CameraMount
from world_models.files.toml.source import Source
from world_models.files.world_files import WORLDS, load_world, read_world
from world_models.frames import Pose2
from world_models.robot import RobotModel
from world_models.visibility.culling import CONTACT_M
from world_models.visibility.lines_and_points import VisibleLines, visible_lines, visible_points

CAMERA = Camera.from_field_of_view(math.radians(65.0))
MOUNT = CameraMount(1.2, 0.05)
BUILT = [load_world(WORLDS / "research_center.toml", details=[]),
         *(read_world(Source.parse(generate_house(np.random.default_rng(seed)))) for seed in range(4))]
WORLDS_WITH_DOORS = [world for world in BUILT if world.doorways]
ALL = {"min_length_px": 0.0, "min_contrast": 0.0, "min_separation_px": 0.0, "max_distance_m": 1e3}
SLACK_M = 1e-3

Floats = NDArray[np.float64]


def shut(world: World, doorway: Doorway, *, portal: bool) -> World:
    """The world with a door shut; ``portal``: its doorway is still there, so that one looks for what is behind it."""
    floor_m = world.floor_m(doorway.between[0])
    frames = dict(world.frames)
    for name in doorway.between:
        frame = frames[name]
        doorways = tuple(d for d in frame.doorways if portal or d is not doorway)
        frames[name] = replace(frame, doorways=doorways, parts=shut_door(frame.parts, doorway, floor_m), memo={})
    return World(frames)


@st.composite
def views(draw: st.DrawFn) -> tuple[World, Doorway, Pose2]:
    """A door, and a robot in one of its two rooms, mostly facing the door."""
    world = draw(st.sampled_from(WORLDS_WITH_DOORS))
    doorway = draw(st.sampled_from(world.doorways))
    outline = world.outline(draw(st.sampled_from(doorway.between)))
    low, high = outline.min(axis=0), outline.max(axis=0)
    x, y = low + np.array([draw(st.floats(0.05, 0.95)), draw(st.floats(0.05, 0.95))]) * (high - low)
    assume(inside_polygon(np.array([x, y]), outline))
    assume(not any(inside_polygon(np.array([x, y]), thing.footprint_world, 0.02) for thing in world.things))
    ahead = doorway.centre_world - (x, y)
    return world, doorway, Pose2(x, y, math.atan2(ahead[1], ahead[0]) + draw(st.floats(-0.7, 0.7)))


def see(world: World, pose: Pose2) -> tuple[VisibleLines, Floats]:
    """All visible lines, and the camera's place."""
    camera_from_world = MOUNT.camera_from_robot @ pose.lifted().inverse()
    return visible_lines(world, CAMERA, camera_from_world, **ALL), camera_from_world.inverse().translation


def pass_through(doorway: Doorway, floor_m: float, centre: Floats, points: Floats, slack_m: float) -> NDArray[np.bool_]:
    """(n,) whether the rays to points (n, 3) reach the front of a shut face, grown by a slack, before the point."""
    stopped = np.zeros(len(points), bool)
    for face in build_shut_faces(doorway, floor_m):
        left, right, _, head = face.polygon_world
        across, up = right - left, head - left
        normal = np.cross(across, up) / np.linalg.norm(np.cross(across, up))
        if normal @ (centre - left) <= 0:
            continue
        before, after = normal @ (centre - left), (points - left) @ normal
        with np.errstate(divide="ignore", invalid="ignore"):
            at = centre + (before / (before - after))[:, None] * (points - centre) - left
        grown = np.array([slack_m / np.linalg.norm(side) for side in (across, up)])
        u, v = at @ across / (across @ across), at @ up / (up @ up)
        inside = (u > -grown[0]) & (u < 1 + grown[0]) & (v > -grown[1]) & (v < 1 + grown[1])
        stopped |= inside & (after < -CONTACT_M + slack_m)
    return stopped


def sample(lines: Floats) -> Floats:
    """(n, 9, 3) points on lines (n, 2, 3), without their ends."""
    t = np.linspace(0.05, 0.95, 9)[:, None]
    return np.asarray(lines[:, None, 0] + t * (lines[:, None, 1] - lines[:, None, 0]))


def pieces(found: VisibleLines) -> dict[tuple[int, int], list[Floats]]:
    """The visible pieces of each line."""
    out: dict[tuple[int, int], list[Floats]] = {}
    for landmark, line, piece in zip(found.landmark.tolist(), found.line.tolist(), found.lines_world, strict=True):
        out.setdefault((landmark, line), []).append(piece)
    return out


def covers(piece: Floats, point: Floats) -> bool:
    a, b = piece
    along = (point - a) @ (b - a) / max(float((b - a) @ (b - a)), 1e-12)
    return -1e-6 <= along <= 1 + 1e-6


@pytest.mark.parametrize("portal", [True, False])
@settings(deadline=None, max_examples=40)
@given(views())
def test_nothing_is_seen_through_a_shut_door_and_all_else_as_before(
    portal: bool, seen: tuple[World, Doorway, Pose2]
) -> None:
    world, doorway, pose = seen
    floor_m = world.floor_m(doorway.between[0])
    (before, centre), (after, _) = see(world, pose), see(shut(world, doorway, portal=portal), pose)
    through = pass_through(doorway, floor_m, centre, sample(after.lines_world).reshape(-1, 3), -SLACK_M)
    assert not through.any()
    kept = pieces(after)
    points = sample(before.lines_world)
    beside = ~pass_through(doorway, floor_m, centre, points.reshape(-1, 3), SLACK_M).reshape(points.shape[:2])
    for number in np.flatnonzero(beside.any(axis=1)):
        mine = kept.get((int(before.landmark[number]), int(before.line[number])), [])
        for point in points[number][beside[number]]:
            assert any(covers(piece, point) for piece in mine)


@settings(deadline=None, max_examples=40)
@given(views())
def test_no_corner_and_no_colour_is_expected_through_a_shut_door(seen: tuple[World, Doorway, Pose2]) -> None:
    world, doorway, pose = seen
    floor_m, closed = world.floor_m(doorway.between[0]), shut(world, doorway, portal=True)
    robot = RobotModel(closed, CAMERA, MOUNT, ActuatorModel())
    camera_from_world = robot.camera_from_world(pose)
    centre = camera_from_world.inverse().translation
    corners = visible_points(closed, robot.camera, camera_from_world).points_world
    assert not pass_through(doorway, floor_m, centre, corners, -SLACK_M).any()
    faces = predict_face_colors(robot, pose)
    assert not np.isnan([color for color, _ in faces]).any()
    points = np.array([point for _, some in faces for point in some]).reshape(-1, 3)
    assert not pass_through(doorway, floor_m, centre, points, -2 * SLACK_M).any()
    for face in build_shut_faces(doorway, floor_m):
        normal = np.cross(*(face.polygon_world[[1, 3]] - face.polygon_world[0]))
        on_it = np.abs((points - face.polygon_world[0]) @ normal) / np.linalg.norm(normal) < SLACK_M
        assert not np.any(on_it & inside_door(face.polygon_world, points))


def inside_door(corners: Floats, points: Floats) -> NDArray[np.bool_]:
    """(n,) whether points (n, 3) in the plane of a rectangle (4, 3) are within it."""
    across, up = corners[1] - corners[0], corners[3] - corners[0]
    u, v = (points - corners[0]) @ across / (across @ across), (points - corners[0]) @ up / (up @ up)
    return np.asarray((u > 0.01) & (u < 0.99) & (v > 0.01) & (v < 0.99))


def test_the_casing_of_its_own_side_is_still_seen() -> None:
    world = BUILT[0]
    (doorway,) = world.doorways_of("allens-office")
    closed = shut(world, doorway, portal=False)
    number = next(n for n, mark in enumerate(world.landmarks) if mark.name == doorway.name)
    for room in doorway.between:
        at = doorway.pose_from(room)
        x, y = np.array([at.x_m, at.y_m]) - 2.0 * doorway.outward_from(room)
        found, _ = see(closed, Pose2(x, y, at.heading_rad))
        own = found.lines_world[found.landmark == number]
        assert len(own) >= 8
        inward_m = (own[..., :2] - doorway.threshold_of(room)[0]) @ -doorway.outward_from(room)
        assert inward_m.min() > -CONTACT_M - SLACK_M
