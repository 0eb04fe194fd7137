"""Laws of hidden-line removal: against rays cast one by one at every surface, and against plain projection."""

import math
from typing import Any

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from box_rooms import find_hidden
from world_models.building.geometry.faces import Region
from world_models.building.geometry.outlines import inside_polygon
from world_models.building.geometry.scene import stack_regions
from world_models.camera import Camera, CameraMount
from world_models.files.world_files import WORLDS, load_world
from world_models.frames import Pose, Pose2
from world_models.visibility.culling import CONTACT_M
from world_models.visibility.lines_and_points import VisibleLines, visible_lines, visible_points

WORLD = load_world(WORLDS / "research_center.toml", details=[])
CAMERA = Camera.from_field_of_view(math.radians(65.0))
MOUNT = CameraMount(1.0, 0.1)
REGIONS = [region.polygon_world for face in WORLD.faces for region in (*face.front, *face.back)]
SOME = {"min_length_px": 0.0, "min_contrast": 0.0, "min_separation_px": 0.0, "max_distance_m": 1e3}


def triangles() -> NDArray[np.float64]:
    return np.array([[p[0], p[i], p[i + 1]] for p in REGIONS for i in range(1, len(p) - 1)])


TRIANGLES = triangles()


@st.composite
def views(draw: st.DrawFn) -> Pose:
    """The camera of a robot that stands somewhere in a room, or in a doorway."""
    heading = draw(st.floats(-math.pi, math.pi))
    if draw(st.integers(0, 4)) == 0:
        doorway = draw(st.sampled_from(WORLD.doorways))
        x, y = doorway.centre_world + 0.4 * np.array([draw(st.floats(-1, 1)), draw(st.floats(-1, 1))])
    else:
        outline = WORLD.outline(draw(st.sampled_from(WORLD.rooms)))
        u, v = draw(st.floats(0.15, 0.85)), draw(st.floats(0.15, 0.85))
        x, y = outline[0] + u * (outline[1] - outline[0]) + v * (outline[3] - outline[0])
    assume(not any(inside_polygon(np.array([x, y]), thing.footprint_world, 0.02) for thing in WORLD.things))
    mount = CameraMount(draw(st.floats(0.8, 1.5)), 0.0, draw(st.floats(-0.3, 0.3)))
    return mount.camera_from_robot @ Pose2(x, y, heading).lifted().inverse()


def is_hidden(centre: NDArray[np.float64], point: NDArray[np.float64]) -> tuple[bool, bool]:
    """(surely hidden, hidden or nearly so) by the front of any triangle: Moeller and Trumbore's test."""
    a, b, c = TRIANGLES[:, 0], TRIANGLES[:, 1], TRIANGLES[:, 2]
    ray, e1, e2 = point - centre, b - a, c - a
    normal = np.cross(e1, e2)
    facing = normal @ ray < 0
    p = np.cross(ray, e2)
    det = np.sum(e1 * p, axis=1)
    det = np.where(np.abs(det) < 1e-12, np.nan, det)
    s = centre - a
    u = np.sum(s * p, axis=1) / det
    q = np.cross(s, e1)
    v = (q @ ray) / det
    t = np.sum(e2 * q, axis=1) / det
    depth = -(np.sum(normal * (point - a), axis=1)) / np.linalg.norm(normal, axis=1)

    def any_hit(slack: float, deeper_m: float) -> bool:
        inside = (u > -slack) & (v > -slack) & (u + v < 1 + slack) & (t > 0)
        return bool(np.any(facing & inside & (depth > deeper_m)))

    return any_hit(-1e-6, CONTACT_M + 1e-6), any_hit(1e-6, CONTACT_M - 1e-6)


def is_covered(found: VisibleLines, landmark: int, line: int, point: NDArray[np.float64]) -> bool:
    """Whether one of the visible pieces of a model line holds this point."""
    mine = np.flatnonzero((found.landmark == landmark) & (found.line == line))
    for a, b in found.lines_world[mine]:
        along = (point - a) @ (b - a) / max(float((b - a) @ (b - a)), 1e-12)
        if -1e-6 <= along <= 1 + 1e-6:
            return True
    return False


@settings(deadline=None, max_examples=25)
@given(views(), st.integers(0, 2**32 - 1))
def test_lines_are_seen_where_no_single_ray_is_stopped(camera_from_world: Pose, seed: int) -> None:
    rng = np.random.default_rng(seed)
    found = visible_lines(WORLD, CAMERA, camera_from_world, **SOME)
    centre = camera_from_world.inverse().translation
    scene = WORLD.scene
    near = np.linalg.norm(scene.edges.lines_world.mean(axis=1) - centre, axis=1) < rng.choice([4.0, 10.0, 40.0])
    ahead = np.all(camera_from_world.apply(scene.edges.lines_world)[..., 2] > 0.0, axis=1)
    shows = np.flatnonzero((scene.edges.contrasts(centre) > 0) & near & ahead)
    if not len(shows):
        return
    for _ in range(40):
        number = int(rng.choice(shows))
        a, b = scene.edges.lines_world[number]
        point = a + rng.uniform(0.02, 0.98) * (b - a)
        in_camera = camera_from_world.apply(point)
        if in_camera[2] < 0.1 or not CAMERA.inside(CAMERA.project(in_camera), 0.01):
            continue
        surely, nearly = is_hidden(centre, point)
        if surely == nearly:
            where = (int(scene.line_landmark[number]), int(scene.line_index[number]))
            assert is_covered(found, *where, point) != surely


def cast_rays(centre: NDArray[np.float64], points: NDArray[np.float64]) -> tuple[Any, Any]:
    """(n,) as :func:`is_hidden`, of points (n, 3), each by its own ray at the front of every triangle, all at once.

    The plane's equation and the signs of the sub-triangles' areas: another test than Moeller's and Trumbore's.
    """
    corners = [TRIANGLES[:, k] for k in range(3)]
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    size = np.linalg.norm(normal, axis=1)
    normal = normal[size > 1e-9] / size[size > 1e-9, None]
    corners = [corner[size > 1e-9] for corner in corners]
    above = np.sum(normal * (centre - corners[0]), axis=1)
    below = points @ normal.T - np.sum(normal * corners[0], axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        part = above / (above - below)
    hit = centre + part[..., None] * (points[:, None] - centre)
    least = np.full(part.shape, np.inf)
    for k in range(3):
        edge = corners[(k + 1) % 3] - corners[k]
        inward = np.cross(normal, edge) / np.linalg.norm(edge, axis=1)[:, None]
        least = np.minimum(least, np.sum(inward * (hit - corners[k]), axis=2))
    stops = (above > 1e-6) & (part > 0.0)
    surely = stops & (least > 1e-6) & (-below > CONTACT_M + 1e-6)
    nearly = stops & (least > -1e-6) & (-below > CONTACT_M - 1e-6)
    return surely.any(axis=1), nearly.any(axis=1)


def test_what_is_hidden_is_what_a_ray_does_not_reach_in_every_room() -> None:
    """Points on the edges of each room, from places all over it: a surface hides by its front only."""
    rng, checked, hidden = np.random.default_rng(5), 0, 0
    for room in WORLD.rooms:
        lines = np.array([line for mark in WORLD.landmarks if mark.locale == room for line in mark.lines_world])
        outline = WORLD.outline(room)
        for _ in range(6):
            u, v = rng.uniform(0.05, 0.95, 2)
            x, y = outline[0] + u * (outline[1] - outline[0]) + v * (outline[3] - outline[0])
            mount = CameraMount(rng.uniform(0.5, 1.5), 0.0, rng.uniform(-0.3, 0.3))
            view = mount.camera_from_robot @ Pose2(x, y, rng.uniform(-math.pi, math.pi)).lifted().inverse()
            along = rng.uniform(0.0, 1.0, (120, 1))
            chosen = lines[rng.integers(len(lines), size=120)]
            points = chosen[:, 0] + along * (chosen[:, 1] - chosen[:, 0])
            in_camera = view.apply(points)
            seen = in_camera[:, 2] > 0.1
            seen[seen] = CAMERA.inside(CAMERA.project(in_camera[seen]), 0.01)
            if not seen.any():
                continue
            surely, nearly = cast_rays(view.inverse().translation, points[seen])
            clear = surely == nearly
            found = find_hidden(WORLD, CAMERA, view, points[seen])
            assert np.array_equal(found[clear], surely[clear]), f"{room} from ({x:.2f}, {y:.2f})"
            checked, hidden = checked + int(clear.sum()), hidden + int(surely[clear].sum())
    assert checked > 500 and 0.02 * checked < hidden < 0.8 * checked


@settings(deadline=None, max_examples=25)
@given(views())
def test_corners_are_seen_where_no_single_ray_is_stopped(camera_from_world: Pose) -> None:
    centre = camera_from_world.inverse().translation
    found = visible_points(WORLD, CAMERA, camera_from_world)
    for point in found.points_world[:: max(1, len(found) // 20)]:
        surely, _ = is_hidden(centre, point)
        assert not surely
    assert CAMERA.inside(found.points_px).all()


@settings(deadline=None, max_examples=25)
@given(views())
def test_pieces_lie_in_the_image_on_their_projected_model_lines(camera_from_world: Pose) -> None:
    found = visible_lines(WORLD, CAMERA, camera_from_world)
    assert CAMERA.inside(found.segments_px, -1e-6).all()
    assert np.allclose(CAMERA.project(camera_from_world.apply(found.lines_world)), found.segments_px, atol=1e-6)
    whole = np.array([WORLD.landmarks[m].lines_world[k] for m, k in zip(found.landmark, found.line, strict=True)])
    whole = whole.reshape(-1, 2, 3)
    d = whole[:, 1:] - whole[:, :1]
    t = np.sum((found.lines_world - whole[:, :1]) * d, axis=2, keepdims=True) / np.sum(d * d, axis=2, keepdims=True)
    assert np.all((t > -1e-9) & (t < 1 + 1e-9))
    assert np.allclose(whole[:, :1] + t * d, found.lines_world, atol=1e-9)


@settings(deadline=None, max_examples=15)
@given(views(), st.floats(0.5, 4.0))
def test_lines_that_are_kept_are_apart_in_the_image(camera_from_world: Pose, apart_px: float) -> None:
    everything = visible_lines(WORLD, CAMERA, camera_from_world, min_separation_px=0.0)
    kept = visible_lines(WORLD, CAMERA, camera_from_world, min_separation_px=apart_px)
    assert len(kept) <= len(everything)
    for i in range(len(kept)):
        (ax, ay), (bx, by) = kept.segments_px[i]
        length = math.hypot(bx - ax, by - ay)
        off = np.abs((kept.segments_px[..., 0] - ax) * (by - ay) - (kept.segments_px[..., 1] - ay) * (bx - ax)) / length
        along = ((kept.segments_px[..., 0] - ax) * (bx - ax) + (kept.segments_px[..., 1] - ay) * (by - ay)) / length
        inside = (off.max(axis=1) < apart_px) & (along.min(axis=1) >= 0) & (along.max(axis=1) <= length)
        inside[i] = False
        assert not np.any(inside & (kept.contrast < kept.contrast[i]))


@settings(deadline=None, max_examples=15)
@given(views(), st.sampled_from(WORLD.rooms))
def test_asking_for_one_locale_selects_from_all(camera_from_world: Pose, room: str) -> None:
    every = visible_lines(WORLD, CAMERA, camera_from_world, min_separation_px=0.0)
    some = visible_lines(WORLD, CAMERA, camera_from_world, locales=[room], min_separation_px=0.0)
    mine = [room in (WORLD.landmarks[m].locale, WORLD.landmarks[m].neighbour) for m in every.landmark]
    assert np.array_equal(some.segments_px, every.segments_px[np.array(mine, bool)])


def test_a_distorting_lens_sees_pieces_within_its_image() -> None:
    lens = Camera(400.0, 400.0, 255.5, 255.5, 512, 512, (-0.2, 0.05, 0.0, 0.0))
    view = MOUNT.camera_from_robot @ Pose2(10.0, 1.2, 0.0).lifted().inverse()
    found = visible_lines(WORLD, lens, view)
    assert len(found) > 50 and lens.inside(found.segments_px).all()


def test_stacked_regions_are_the_scenes() -> None:
    polygons, normals = stack_regions([region for face in WORLD.faces for region in (*face.front, *face.back)])
    assert np.array_equal(polygons, WORLD.scene.polygons_world)
    assert np.array_equal(normals, WORLD.scene.planes_world[:, :3])


@given(st.lists(st.integers(3, 9), min_size=1, max_size=8))
def test_stacked_regions_are_padded_with_their_last_corners(corners: list[int]) -> None:
    around = [np.linspace(0.0, 2.0 * math.pi, count, endpoint=False) for count in corners]
    rounds = [np.stack([np.cos(a), np.sin(a), 0.0 * a], axis=1) for a in around]
    regions = [Region("round", corners_world, (0.5, 0.5, 0.5), "plain", 1.0, 0) for corners_world in rounds]
    polygons, normals = stack_regions(regions)
    for polygon, region in zip(polygons, regions, strict=True):
        spare = max(corners) - len(region.polygon_world)
        assert np.array_equal(polygon, np.pad(region.polygon_world, ((0, spare), (0, 0)), "edge"))
    assert np.allclose(normals, (0.0, 0.0, 1.0))
