"""Solids, shells and doors: which faces and model lines come of them."""

import numpy as np
import pytest

from world_models.building.geometry.faces import Finish, area_vector, area_vectors
from world_models.building.geometry.outlines import convex_pieces, subtract_intervals
from world_models.building.geometry.solids import Box, Solid, Surface
from world_models.building.world import World
from world_models.files.world_files import WORLDS, load_world
from world_models.frames import Pose

GREY, DARK = Finish((0.5, 0.5, 0.5)), Finish((0.1, 0.1, 0.1))
DETAILS = WORLDS.parent.parent / "sim" / "buildings" / "research_center_details.toml"


@pytest.fixture(scope="module")
def building() -> World:
    return load_world(WORLDS / "research_center.toml", details=[DETAILS])


def solid(*boxes: Box, surfaces: tuple[Surface, ...] = ()) -> Solid:
    return Solid("solid", boxes, Pose.identity(), surfaces)


def test_a_free_box_has_six_outward_faces_and_twelve_edges() -> None:
    box = solid(Box((0, 1), (0, 2), (0, 3), GREY))
    faces = box.faces("room")
    normals = np.array([area_vector(face.polygon_world) for face in faces])
    assert len(faces) == 6 and np.allclose(normals.sum(axis=0), 0)
    for face, normal in zip(faces, normals, strict=True):
        assert (face.polygon_world.mean(axis=0) - (0.5, 1.0, 1.5)) @ normal > 0
    assert len(box.edges()) == 12
    assert len(np.unique(np.round(box.edges().lines_world.reshape(-1, 3), 6), axis=0)) == 8


def test_a_box_on_the_floor_hides_its_underside_and_keeps_its_foot_line() -> None:
    floor = Surface(np.array([0.0, 0.0, 1.0]), 0.0, 0.2)
    box = solid(Box((0, 1), (0, 1), (0, 1), GREY), surfaces=(floor,))
    assert len(box.faces("room")) == 5
    edges = box.edges()
    feet = np.all(edges.lines_world[..., 2] == 0, axis=1)
    assert np.count_nonzero(feet) == 4 and len(edges) == 12
    assert np.allclose(edges.brightness[feet, 1], 0.2)


def test_two_flush_boxes_of_one_finish_show_no_seam() -> None:
    pair = solid(Box((0, 1), (0, 1), (0, 1), GREY), Box((1, 2), (0, 1), (0, 1), GREY))
    assert len(pair.faces("room")) == 10
    assert not np.any(np.all(pair.edges().lines_world[..., 0] == 1.0, axis=1))


def test_two_flush_boxes_of_different_finish_show_one_seam_all_round() -> None:
    pair = solid(Box((0, 1), (0, 1), (0, 1), GREY), Box((1, 2), (0, 1), (0, 1), DARK))
    seam = pair.edges().lines_world[np.all(pair.edges().lines_world[..., 0] == 1.0, axis=1)]
    assert len(seam) == 4


def test_edges_are_cut_where_another_box_stands_against_them() -> None:
    table = solid(Box((0, 2), (0, 1), (1, 1.1), GREY), Box((0.5, 1.0), (0, 1), (0, 1), GREY))
    below = table.edges().lines_world[np.all(np.isclose(table.edges().lines_world[..., 2], 1.0), axis=1)]
    front = below[np.all(np.isclose(below[..., 1], 0.0), axis=1)]
    assert sorted(np.round(sorted(line[:, 0]), 3).tolist() for line in front) == [[0.0, 0.5], [1.0, 2.0]]


def test_a_line_shows_when_the_side_that_stands_out_does() -> None:
    edges = solid(Box((0, 1), (0, 1), (0, 1), GREY)).edges()
    assert np.count_nonzero(edges.contrasts((0.5, -5.0, 0.5))) == 4
    assert np.count_nonzero(edges.contrasts((5.0, -5.0, 5.0)) > 0) == 9
    assert not np.any(edges.contrasts((0.5, 0.5, 0.5)))


def test_left_over_pieces() -> None:
    assert subtract_intervals((0.0, 10.0), [(4.0, 5.0), (2.0, 4.5)], 0.1) == [(0.0, 2.0), (5.0, 10.0)]
    assert subtract_intervals((0.0, 1.0), [(-1.0, 2.0)], 0.1) == []
    assert subtract_intervals((0.0, 1.0), [(0.05, 1.0)], 0.1) == []


def test_an_l_shaped_floor_is_cut_into_convex_pieces_of_the_same_area() -> None:
    outline = np.array([[0, 0], [5, 0], [5, 2], [3, 2], [3, 3], [0, 3]], float)
    pieces = [np.pad(outline[piece], ((0, 0), (0, 1))) for piece in convex_pieces(outline)]
    areas = area_vectors(pieces)[:, 2]
    assert np.array_equal(areas, [area_vector(piece)[2] for piece in pieces])
    assert len(pieces) == 4 and min(areas) > 0
    assert np.isclose(np.sum(areas), 13.0)


def test_every_region_is_flat_convex_and_named_once(building: World) -> None:
    regions = [region for face in building.faces for region in (*face.front, *face.back)]
    assert len({region.name for region in regions}) == len(regions)
    for region in regions:
        p, normal = region.polygon_world, area_vector(region.polygon_world)
        normal = normal / np.linalg.norm(normal)
        assert np.abs((p - p[0]) @ normal).max() < 1e-9, region.name
        d = np.roll(p, -1, axis=0) - p
        assert np.all(np.cross(d, np.roll(d, -1, axis=0)) @ normal > 0), region.name


def test_walls_floors_and_ceilings_are_seen_from_inside(building: World) -> None:
    for room in building.rooms:
        centre = np.array([*building.outline(room).mean(axis=0), 1.0])
        shell = [f for f in building.faces if f.locale == room and f.parent is None and f.name.count("/") == 1]
        assert len(shell) == len(building.locales[room].outline) + 2
        for face in shell:
            for region in face.front:
                assert area_vector(region.polygon_world) @ (centre - region.polygon_world[0]) > 0, region.name


def test_a_wall_is_painted_except_for_its_openings(building: World) -> None:
    wall = next(f for f in building.faces if f.name == "allens-office/south-wall")
    door = next(f for f in building.faces if f.kind == "doorway" and f.locale == "allens-office")
    sizes_m2 = [float(np.linalg.norm(area_vector(flat.polygon_world))) for flat in (wall, door, *wall.front)]
    assert door.parent == wall.name and door.neighbour == "hallway" and not door.front
    assert np.isclose(np.sum(sizes_m2[2:]), sizes_m2[0] - sizes_m2[1])


def test_nothing_fights_for_the_same_depth(building: World) -> None:
    """Regions that face the same way and overlap lie in one plane only within one face, else 4 mm apart."""
    regions = [(face.name, region) for face in building.faces for region in face.front]
    polygons = [region.polygon_world for _, region in regions]
    normals = np.array([vector / np.linalg.norm(vector) for vector in area_vectors(polygons)])
    low, high = (np.array([getattr(p, end)(axis=0) for p in polygons]) for end in ("min", "max"))
    fights = []
    for i in range(len(regions)):
        other = np.arange(i + 1, len(regions))
        same_way = normals[other] @ normals[i] > 0.999
        near = np.abs((low[other] + high[other] - low[i] - high[i]) @ normals[i]) / 2 < 0.0039
        shared = np.minimum(high[other], high[i]) - np.maximum(low[other], low[i])
        overlap = np.sort(shared, axis=1)[:, 1] > 2e-3
        touching = np.sort(shared, axis=1)[:, 0] > -0.0039
        fights += [(regions[i][1].name, regions[j][1].name) for j in other[same_way & near & overlap & touching]
                   if regions[i][0] != regions[j][0]]
    assert not fights


def test_no_model_line_is_given_twice(building: World) -> None:
    for mark in building.landmarks:
        lines = mark.lines_world
        keys = np.round(np.concatenate([lines.min(axis=1), lines.max(axis=1)], axis=1), 3)
        assert len(np.unique(keys, axis=0)) == len(keys), mark.name
