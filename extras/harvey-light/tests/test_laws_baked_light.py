"""Laws of baked light, against integrals and pictures computed here by other means."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from box_rooms import box_faces, box_room
from experiments.generated.scenes import Patch, PatchFace
from harvey_light.baked import BAKED, find_panes
from harvey_light.hung_lamps import Lamp, hang_lamps
from harvey_light.irradiance import SUN_COLOUR, compute_irradiance
from harvey_light.light_map import lay_light_map
from harvey_light.lit_renderer import mirror_camera
from harvey_light.rays import build_ray_tree, first_hits
from harvey_light.sun_patches import find_sun_patches
from sim.render.lighting import GAMMA, Lighting
from sim.render.lights import Room
from sim.render.mesh import Pinhole, build_mesh
from sim.render.renderer import Renderer
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose, Pose2

CAMERA = Camera.from_field_of_view(math.radians(65.0), 192, 160)
ROOM = Room(np.array([(0.0, 0.0), (6.0, 0.0), (6.0, 4.0), (0.0, 4.0)]), 0.0, 2.6)
places_of_robot = st.tuples(st.floats(0.5, 3.2), st.floats(1.2, 3.0), st.floats(-3.2, 3.2))


def pane(x: float = 0.02) -> PatchFace:
    """A window pane before the wall at x = 0, that looks into the room."""
    corners = [(x, 1.0, 0.8), (x, 2.2, 0.8), (x, 2.2, 2.0), (x, 1.0, 2.0)]
    return PatchFace((Patch("room/window/0", corners, (0.72, 0.84, 0.93), "plain", 1e6),))


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10**6))
def test_rays_meet_what_trying_all_patches_meets(seed: int) -> None:
    rng = np.random.default_rng(seed)
    lows = rng.uniform((0.5, 0.5, 0.0), (5.0, 3.0, 1.5), (6, 3))
    clutter = [f for i, low in enumerate(lows) for f in box_faces(low, low + rng.uniform(0.1, 0.9, 3), f"box{i}")]
    mesh = build_mesh([*box_room(), *clutter])
    origins, directions = rng.uniform((0.2, 0.2, 0.2), (5.8, 3.8, 2.4), (200, 3)), rng.standard_normal((200, 3))
    _, lengths = first_hits(build_ray_tree(mesh), origins, directions, np.full(200, 1e9))
    normals, offsets = mesh.planes_world[:, :3], mesh.planes_world[:, 3]
    nearest = np.full(200, np.inf)
    for p in range(len(mesh)):
        reach = (offsets[p] - origins @ normals[p]) / (directions @ normals[p])
        flat = (origins + reach[:, None] * directions) @ mesh.axes_world[p].T
        outline = shapely.Polygon(mesh.vertices_world[mesh.first[p] : mesh.first[p + 1]] @ mesh.axes_world[p].T)
        hit = (reach > 1e-4) & shapely.contains_xy(outline, flat[:, 0], flat[:, 1])
        nearest = np.where(hit, np.minimum(nearest, reach), nearest)
    np.testing.assert_allclose(lengths, nearest, rtol=1e-9)


def bake(lighting: Lighting, lamps: tuple[Lamp, ...], room: float = 0.5) -> tuple[float, float, NDArray[np.float64]]:
    """Light that a closed room of reflectance ``room`` receives, light that its lamps give, and the irradiance."""
    grey = room ** (1.0 / GAMMA)
    mesh = build_mesh(box_faces((0, 0, 0), (6, 4, 2.6), "room", inside=True, texture="plain", texture_scale_m=1e6,
                                colour=(grey, grey, grey)))
    places = lay_light_map(mesh, 0.2)
    no = np.zeros(len(mesh), bool)
    irradiance = compute_irradiance(mesh, places, lighting, lamps, no, no)
    given = sum(float(lamp.radiosity.mean()) * 1.2 * 0.3 for lamp in lamps)
    return float((irradiance.mean(axis=1) * places.areas_m2).sum()), given, irradiance


@settings(deadline=None, max_examples=10)
@given(st.floats(0.0, 0.8), st.integers(0, 6), st.floats(0.0, 1.0), st.integers(0, 99))
def test_light_is_not_negative_and_no_more_than_the_lamps_give(
    albedo: float, bounces: int, off: float, seed: int
) -> None:
    lighting = Lighting(lamps=1.0, lamps_off=off, bounces=bounces, seed=seed)
    received, given, irradiance = bake(lighting, hang_lamps((ROOM,), lighting), albedo)
    assert irradiance.min() >= 0.0
    bound = given * (1.0 - albedo ** (bounces + 1)) / (1.0 - albedo)
    assert received <= 1.1 * bound + 1e-9, "the light is reflected no more often than it may be"
    assert received >= 0.8 * bound, "none of it leaves a closed room"


def test_a_small_lamp_gives_what_the_law_of_cosines_says() -> None:
    square = np.array([(-1, -1, 0), (-1, 1, 0), (1, 1, 0), (1, -1, 0)])
    corners = 0.02 * square + np.array([3.0, 2.0, 2.4])
    lamp = Lamp(corners, np.full(3, 1000.0))
    mesh = build_mesh(box_faces((0, 0, 0), (6, 4, 2.6), "room", inside=True, texture="plain", texture_scale_m=1e6))
    places, no = lay_light_map(mesh, 0.2), np.zeros(len(mesh), bool)
    found = compute_irradiance(mesh, places, Lighting(bounces=0), (lamp,), no, no)[:, 0]
    way = lamp.polygon_world.mean(axis=0) - places.points_world
    r2 = np.sum(way**2, axis=1)
    expected = 1000.0 * 0.04**2 * np.maximum(0, np.sum(places.normals_world * way, axis=1)) * np.maximum(0, way[:, 2])
    far = r2 > 1.0
    np.testing.assert_allclose(found[far], (expected / (math.pi * r2**2))[far], rtol=0.025, atol=1e-6)


@settings(deadline=None, max_examples=12)
@given(places_of_robot, st.floats(-0.15, 0.15), st.floats(-0.2, 0.1))
def test_a_mirror_image_is_the_mirrored_building(place: tuple[float, float, float], tilt: float, level: float) -> None:
    room = [face for face in box_room() if face.front[0].name not in ("carpet", "bricks")]
    sheet = replace(room[0].front[0], name="sheet", polygon_world=[(0, 0, 0), (6, 0, 0), (6, 4, 0), (0, 4, 0)])
    faces = [*room, PatchFace((sheet,))]
    plain = [PatchFace(tuple(replace(r, texture="plain", texture_scale_m=1e6) for r in f.front)) for f in faces]
    turned = [PatchFace(tuple(replace(r, polygon_world=_mirrored(r.polygon_world, level)) for r in f.front))
              for f in plain]
    pose = CameraMount(1.0, 0.1, tilt).camera_from_robot @ Pose2(*place).lifted().inverse()
    rotation, translation = np.array(pose.rotation), np.array(pose.translation)
    lens, turn, move = mirror_camera(Pinhole.of(CAMERA), rotation, translation, np.array([0.0, 0.0, 1.0, level]))
    seen = Camera(lens.fx, lens.fy, lens.cx, lens.cy, lens.width, lens.height)
    as_mirrored = _shadeless(plain).radiance(seen, Pose(turn, move))[::-1]
    expected = _shadeless(turned).radiance(CAMERA, pose)
    differs = np.abs(as_mirrored - expected).max(axis=2)
    assert np.median(differs) < 1e-5
    assert (differs > 0.02).mean() < 0.03, "only borders differ, by the places of their samples"


def _mirrored(polygon: object, level: float) -> NDArray[np.float64]:
    return (np.array(polygon, float) * (1, 1, -1) + (0, 0, 2 * level))[::-1]


def _shadeless(faces: list[PatchFace]) -> Renderer:
    """Without shading by direction, which a mirror turns round."""
    renderer = Renderer.of_faces(faces, 16)
    return replace(renderer, light=renderer.mesh.colours)


@settings(deadline=None, max_examples=25)
@given(st.floats(-0.9, 0.9), st.floats(0.25, 1.1), st.integers(0, 10**6))
def test_sun_patches_are_the_places_that_see_the_sun_through_the_pane(
    azimuth: float, elevation: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    faces = [*box_room(), pane(), *box_faces((1.0, 1.4, 0.0), (1.5, 2.0, rng.uniform(0.3, 1.2)), "box")]
    mesh, panes = build_mesh(faces), find_panes(faces)
    lighting = Lighting(sun=5.0, sun_azimuth_rad=math.pi + azimuth, sun_elevation_rad=elevation)
    towards = np.array(lighting.towards_sun)
    patches = find_sun_patches(mesh, panes, towards)
    tree = build_ray_tree(mesh)
    for p in range(len(mesh)):
        if mesh.planes_world[p, :3] @ towards <= 0.02:
            continue
        polygon = mesh.vertices_world[mesh.first[p] : mesh.first[p + 1]]
        own = shapely.union_all([shapely.Polygon(s.polygon_world @ mesh.axes_world[p].T) for s in patches
                                 if s.patch == p] or [shapely.Polygon()])
        outline = shapely.Polygon(polygon @ mesh.axes_world[p].T)
        low, high = np.reshape(outline.bounds, (2, 2))
        spots = rng.uniform(low, high, (300, 2))
        spots = spots[shapely.contains_xy(outline, spots[:, 0], spots[:, 1])]
        certain = shapely.distance(own.boundary, shapely.points(spots)) > 0.05
        points = spots @ mesh.axes_world[p] + (mesh.planes_world[p, 3] + 1e-3) * mesh.planes_world[p, :3]
        met, _ = first_hits(tree, points, np.tile(towards, (len(points), 1)), np.full(len(points), 1e9))
        lit = (met >= 0) & panes[met]
        inside = shapely.contains_xy(own, spots[:, 0], spots[:, 1])
        np.testing.assert_array_equal(inside[certain], lit[certain])


def test_the_sun_through_a_pane_adds_its_light_where_it_falls() -> None:
    faces = [f for f in box_room() if not f.front[0].name.startswith(("desk", "cabinet"))] + [pane()]
    sunny, plain = (BAKED.build(faces, Lighting(flat=0.3, lamps=0.0, sun=sun, bounces=0, sun_azimuth_rad=math.pi,
                                                sun_elevation_rad=0.5), ()) for sun in (0.5, 0.0))
    above = len(plain.baked.seen_light)
    added = sunny.baked.seen_light[above:].astype(float) ** GAMMA
    np.testing.assert_array_equal(sunny.baked.seen_light[:above], plain.baked.seen_light)
    assert len(added) and np.all(added.max(axis=0) <= 0.3 + 0.5 * SUN_COLOUR + 1e-3)


@settings(deadline=None, max_examples=40)
@given(st.floats(1.0, 9.0), st.floats(1.0, 9.0), st.floats(0.8, 4.0), st.integers(0, 9))
def test_lamps_hang_in_their_rooms_and_give_the_irradiance_asked_for(
    length: float, width: float, spacing: float, seed: int
) -> None:
    outline = np.array([(0, 0), (length, 0), (length, width), (0, width)]) + np.array([3.0, -2.0])
    lighting = Lighting(lamps=0.8, lamp_spacing_m=spacing, seed=seed)
    lamps = hang_lamps((Room(outline, 0.0, 2.5),), lighting)
    for lamp in lamps:
        assert shapely.Polygon(outline).contains(shapely.Polygon(lamp.polygon_world[:, :2]))
        assert np.all(lamp.polygon_world[:, 2] < 2.5)
    if lamps:
        assert sum(lamp.radiosity[0] * 0.36 for lamp in lamps) == pytest.approx(0.8 * length * width)
