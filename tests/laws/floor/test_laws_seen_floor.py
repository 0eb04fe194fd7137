"""What scans show free, against a geometry of polygons; and what of a way is not seen."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from ideal_floor_watcher import scan_floor
from knowledge_sources.methods.floor import SeenFloor, Sweep, sample_sweep
from knowledge_sources.methods.floor.seen_floor import find_blind, measure_blind_m
from world_models.entries import FreeFloor
from world_models.frames import Pose2

ROOM = shapely.box(-3.0, -2.0, 3.0, 2.0)
SKIN_M = 1e-6

places = st.builds(Pose2, st.floats(-2.5, 2.5), st.floats(-1.5, 1.5), st.floats(-math.pi, math.pi))
boxes = st.builds(lambda x, y, a, b: shapely.box(x, y, x + a, y + b), st.floats(-2.5, 2.0), st.floats(-1.5, 1.0),
                  st.floats(0.1, 0.6), st.floats(0.1, 0.6))


@st.composite
def scans(draw: st.DrawFn) -> list[FreeFloor]:
    """Scans of one room with things; each scan may see other things than the one before."""
    found = []
    for number in range(draw(st.integers(1, 4))):
        things = draw(st.lists(boxes, max_size=2))
        pose = draw(places)
        found.append(scan_floor(ROOM, pose, seen_s=float(number), things=things, count=draw(st.integers(2, 24)),
                                near_m=draw(st.floats(0.3, 1.6)), half_rad=draw(st.floats(0.1, 1.5))))
    return found


def draw_polygons(scan: FreeFloor) -> shapely.Geometry:
    """What one scan shows free, wedge by wedge: rings between two arcs, by many corners."""
    parts = []
    for i in range(len(scan.bearings_rad) - 1):
        near, far = max(scan.near_m[i : i + 2]), min(scan.far_m[i : i + 2])
        if far <= near:
            continue
        arc = np.linspace(scan.bearings_rad[i], scan.bearings_rad[i + 1], 24)
        out = np.column_stack([np.cos(arc), np.sin(arc)])
        ring = np.concatenate([near * out, (far * out)[::-1]])
        parts.append(shapely.Polygon(ring + np.array([scan.x_m, scan.y_m])))
    return shapely.union_all(parts) if parts else shapely.Polygon()


def draw_taken(scan: FreeFloor) -> shapely.Geometry:
    """What one scan shows taken: a strip behind each end that is a thing, in both wedges beside it."""
    parts = []
    for i in range(len(scan.bearings_rad) - 1):
        arc = np.linspace(scan.bearings_rad[i], scan.bearings_rad[i + 1], 24)
        out = np.column_stack([np.cos(arc), np.sin(arc)])
        for k in (i, i + 1):
            if scan.ends[k] == "thing":
                ring = np.concatenate([scan.far_m[k] * out, ((scan.far_m[k] + 0.3) * out)[::-1]])
                parts.append(shapely.Polygon(ring + np.array([scan.x_m, scan.y_m])))
    return shapely.union_all(parts).difference(draw_polygons(scan)) if parts else shapely.Polygon()


@settings(max_examples=60)
@given(scans(), st.integers(0, 2**32 - 1))
def test_the_newest_scan_that_tells_of_a_point_holds(seen: list[FreeFloor], seed: int) -> None:
    points = np.random.default_rng(seed).uniform((-3.2, -2.2), (3.2, 2.2), (80, 2))
    free = SeenFloor(tuple(seen), np.zeros((0, 3))).ask(points)[0]
    for point, is_free in zip(points, free, strict=True):
        expected, is_clear = False, True
        for scan in reversed(seen):
            spot = shapely.Point(point)
            shown, taken = draw_polygons(scan), draw_taken(scan)
            is_clear &= min(shown.boundary.distance(spot) if not shown.is_empty else 1.0,
                            taken.boundary.distance(spot) if not taken.is_empty else 1.0) > 0.02
            if shown.covers(spot) or taken.covers(spot):
                expected = bool(shown.covers(spot))
                break
        assert is_free == expected or not is_clear


@settings(max_examples=40)
@given(scans(), st.integers(0, 2**32 - 1))
def test_more_scans_of_an_empty_floor_show_no_less(seen: list[FreeFloor], seed: int) -> None:
    points = np.random.default_rng(seed).uniform((-3.0, -2.0), (3.0, 2.0), (60, 2))
    empty = [scan for scan in seen if "thing" not in scan.ends]
    fewer = SeenFloor(tuple(empty[:-1]), np.zeros((0, 3))).ask(points)[0]
    more = SeenFloor(tuple(empty), np.zeros((0, 3))).ask(points)[0]
    assert not (fewer & ~more).any()


@settings(max_examples=40)
@given(scans(), st.floats(0.0, 1.0), st.integers(0, 2**32 - 1))
def test_told_is_what_a_scan_shows_free_up_to_where_it_tells(seen: list[FreeFloor], part: float, seed: int) -> None:
    points = np.random.default_rng(seed).uniform((-3.0, -2.0), (3.0, 2.0), (60, 2))
    disc = np.array([[0.0, 0.0, 0.4]])
    told = np.linalg.norm(points, axis=1) <= 0.4
    by_discs = SeenFloor(tuple(replace(scan, confirmed_m=()) for scan in seen), disc).ask_confirmed(points)
    assert (by_discs == told).all()
    shorter = [replace(scan, confirmed_m=tuple(part * far for far in scan.far_m)) for scan in seen]
    for scan in shorter:
        told |= SeenFloor((replace(scan, far_m=scan.confirmed_m),), np.zeros((0, 3))).ask(points)[0]
    assert (SeenFloor(tuple(shorter), disc).ask_confirmed(points) == told).all()
    ranged = replace(seen[-1], sense="ranges", confirmed_m=())
    free = SeenFloor((ranged,), np.zeros((0, 3)))
    assert (free.ask_confirmed(points) == free.ask(points)[0]).all()


@settings(max_examples=40)
@given(st.lists(st.tuples(st.floats(-3.0, 3.0), st.floats(-2.0, 2.0)), min_size=1, max_size=4), st.floats(0.1, 0.5),
       st.floats(0.0, 3.0))
def test_a_sweep_is_what_a_disc_covers(way: list[tuple[float, float]], radius_m: float, most_m: float) -> None:
    sweep = sample_sweep(way, radius_m, most_m)
    line = shapely.LineString(way if len(way) > 1 else [way[0], way[0]])
    line = shapely.MultiPoint([line.interpolate(a) for a in np.linspace(0.0, min(most_m, line.length), 400)])
    away = shapely.distance(line, shapely.points(sweep.points))
    assert (away <= radius_m + 0.02).all()
    assert (sweep.at_m <= most_m + SKIN_M).all()
    beyond_m = np.linalg.norm(sweep.points - np.array(way[0]), axis=1) - radius_m
    assert (sweep.at_m[beyond_m < -SKIN_M] == 0.0).all()
    assert (sweep.at_m[beyond_m > SKIN_M] > 0.0).all()


@given(st.lists(st.floats(0.0, 3.0), max_size=30))
def test_free_way_ends_where_three_unseen_points_are_together(at: list[float]) -> None:
    unseen = Sweep(np.zeros((len(at), 2)), np.array(at))
    ordered = sorted(at)
    together = [a for a, b in zip(ordered, ordered[2:], strict=False) if b - a <= 0.15]
    assert find_blind(unseen).tolist() == together and (measure_blind_m(unseen) > 0.0) == bool(together)


def test_what_stands_on_the_floor_is_not_free() -> None:
    scan = scan_floor(ROOM, Pose2(-2.5, 0.0, 0.0), near_m=0.3)
    points = np.array([[-0.5, 0.0], [0.5, 0.0]])
    assert SeenFloor((scan,), np.zeros((0, 3))).ask(points)[0].all()
    box = np.array([[0.3, -0.2], [0.7, -0.2], [0.7, 0.2], [0.3, 0.2]])
    assert SeenFloor((scan,), np.zeros((0, 3)), (box,)).ask(points)[0].tolist() == [True, False]


def test_a_newer_scan_that_sees_a_thing_overrules_an_older_one() -> None:
    older = scan_floor(ROOM, Pose2(-2.5, 0.0, 0.0), near_m=0.3)
    newer = scan_floor(ROOM, Pose2(-2.5, 0.0, 0.0), near_m=0.3, seen_s=1.0, things=[shapely.box(0.0, -0.3, 0.2, 0.3)])
    before, behind = np.array([[-0.2, 0.0]]), np.array([[0.1, 0.0]])
    assert SeenFloor((older, newer), np.zeros((0, 3))).ask(before)[0].all()
    assert not SeenFloor((older, newer), np.zeros((0, 3))).ask(behind)[0].any()
    assert SeenFloor((newer, older), np.zeros((0, 3))).ask(behind)[0].all()
