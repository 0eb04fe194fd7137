"""The map of the floor by sights of it, against a geometry of polygons; what senses tell together; and what of a way is
not seen."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.floor import FloorMap, Sweep, sample_sweep
from knowledge_sources.methods.floor.floor_map import (
    CELL_M,
    ECHO_APART_M,
    HIDDEN_M,
    P_CAMOUFLAGED,
    TAKEN,
    find_blind,
    measure_blind_m,
)
from perfect_eye import scan_floor
from world_models.entries import FreeFloor
from world_models.frames import Pose2

ROOM = shapely.box(-3.0, -2.0, 3.0, 2.0)
SKIN_M = 1e-6
NO_DISCS = np.zeros((0, 3))
CELLS = (np.stack(np.meshgrid(np.arange(-60, 60), np.arange(-40, 40)), axis=-1).reshape(-1, 2) + 0.5) * CELL_M
"""The middles of the room's cells."""

places = st.builds(Pose2, st.floats(-2.5, 2.5), st.floats(-1.5, 1.5), st.floats(-math.pi, math.pi))
boxes = st.builds(lambda x, y, a, b: shapely.box(x, y, x + a, y + b), st.floats(-2.5, 2.0), st.floats(-1.5, 1.0),
                  st.floats(0.1, 0.6), st.floats(0.1, 0.6))


@st.composite
def sights(draw: st.DrawFn) -> list[FreeFloor]:
    """Sights of one room with things; each may see other things than the one before."""
    found = []
    for number in range(draw(st.integers(1, 4))):
        things = draw(st.lists(boxes, max_size=2))
        one = scan_floor(ROOM, draw(places), seen_s=float(number), things=things, count=draw(st.integers(2, 24)),
                         near_m=draw(st.floats(0.3, 1.6)), half_rad=draw(st.floats(0.1, 1.5)))
        part, sense = draw(st.floats(0.0, 1.0)), draw(st.sampled_from(("camera", "ranges")))
        found.append(replace(one, sense=sense, confirmed_m=tuple(part * far for far in one.far_m)))
    return found


def draw_polygons(sight: FreeFloor, part: float = 1.0) -> tuple[shapely.Geometry, shapely.Geometry]:
    """What one sight shows free, up to that part of it, and taken, wedge by wedge: rings between two arcs."""
    free, taken = [shapely.Polygon()], [shapely.Polygon()]
    for i in range(len(sight.bearings_rad) - 1):
        arc = np.linspace(sight.bearings_rad[i], sight.bearings_rad[i + 1], 24)

        def ring(near: float, far: float, out: Floats) -> shapely.Polygon:
            eye = np.array([sight.x_m, sight.y_m])
            return shapely.Polygon(np.concatenate([eye + near * out, eye + (far * out)[::-1]]))

        out = np.column_stack([np.cos(arc), np.sin(arc)])
        near, far = max(sight.near_m[i : i + 2]), part * min(sight.far_m[i : i + 2])
        free += [ring(near, far, out)] if far > near else []
        taken += [ring(sight.far_m[k], sight.far_m[k] + HIDDEN_M, out) for k in (i, i + 1) if sight.ends[k] == "thing"]
    return shapely.union_all(free), shapely.difference(shapely.union_all(taken), shapely.union_all(free))


def tell(seen: list[FreeFloor], points: Floats, discs: Floats = NO_DISCS) -> Floats:
    return FloorMap(seen, discs).ask(points).p


@settings(max_examples=40, deadline=None)
@given(sights(), st.integers(0, 2**32 - 1))
def test_what_one_sight_shows_is_on_the_map(seen: list[FreeFloor], seed: int) -> None:
    one = replace(seen[0], sense="camera")
    points = np.random.default_rng(seed).choice(CELLS, 80)
    shown, taken = draw_polygons(one)
    sure, _ = draw_polygons(one, one.confirmed_m[0] / max(one.far_m[0], 1e-9))
    for point, p in zip(points, tell([one], points), strict=True):
        spot = shapely.Point(point)
        if min(shape.boundary.distance(spot) if not shape.is_empty else 1.0 for shape in (shown, taken, sure)) > 0.03:
            assert p == pytest.approx(0.01 if sure.covers(spot) else P_CAMOUFLAGED if shown.covers(spot) else 1.0)


@settings(max_examples=25, deadline=None)
@given(sights(), st.randoms(), places)
def test_the_order_of_the_evidence_and_where_the_world_begins_do_not_matter(
    seen: list[FreeFloor], random: np.random.Generator, by: Pose2
) -> None:
    """A correction of the belief moves the map with what was seen, and its inverse moves it back."""
    plain, shuffled = tell(seen, CELLS), list(seen)
    random.shuffle(shuffled)
    assert (tell(shuffled, CELLS) == plain).all()
    cells = np.round(np.array(by.position) / CELL_M) * CELL_M

    def move(one: FreeFloor, sign: float) -> FreeFloor:
        return replace(one, x_m=one.x_m + sign * cells[0], y_m=one.y_m + sign * cells[1])

    moved = [move(one, 1.0) for one in seen]
    assert np.mean(tell(moved, CELLS + cells) != plain) < 2e-3  # the border of a sight may run through a middle
    assert np.mean(tell([move(one, -1.0) for one in moved], CELLS) != plain) < 2e-3
    mirror = [replace(one, y_m=-one.y_m, bearings_rad=tuple(-b for b in reversed(one.bearings_rad)), **{
        name: tuple(reversed(getattr(one, name))) for name in ("near_m", "far_m", "ends", "sigma_m", "confirmed_m")})
        for one in seen]
    assert np.mean(tell(mirror, CELLS * (1.0, -1.0)) != plain) < 2e-3


@settings(max_examples=25, deadline=None)
@given(sights())
def test_more_sights_of_an_empty_floor_show_no_less_and_the_rest_is_not_known(seen: list[FreeFloor]) -> None:
    empty = [sight for sight in seen if "thing" not in sight.ends]
    told, shown = tell(empty, CELLS), shapely.union_all([draw_polygons(sight)[0] for sight in empty]).buffer(0.03)
    assert (told <= tell(empty[:-1], CELLS)).all() and (told[~shapely.contains_xy(shown, *CELLS.T)] == 1.0).all()


BOX, SPOT = shapely.box(0.0, -0.4, 0.2, 0.4), np.array([[0.125, 0.025]])
EYE = Pose2(-2.6, 0.0, 0.0)


def see(pose: Pose2, seen_s: float, *things: shapely.Geometry) -> FreeFloor:
    return scan_floor(ROOM, pose, near_m=0.1, seen_s=seen_s, things=things)


def test_what_was_seen_free_from_near_outweighs_what_was_suspected_from_far_and_a_newer_sight_an_older_one() -> None:
    """A sight of a thing counts until a newer one shows its floor free; what only looks free does not outweigh it."""
    far, near = see(EYE, 2.0, BOX), see(Pose2(-0.6, 0.0, 0.0), 1.0)
    assert tell([far], SPOT)[0] == 1.0
    assert P_CAMOUFLAGED < tell([near, far], SPOT)[0] < 0.5
    assert tell([replace(near, seen_s=3.0), far], SPOT)[0] == pytest.approx(0.01)
    assert tell([replace(near, confirmed_m=()), far], SPOT)[0] == 1.0


@pytest.mark.parametrize("apart_m", [0.0, ECHO_APART_M])
def test_an_echo_denies_no_floor_that_pictures_have_confirmed_unless_it_is_heard_again_from_elsewhere(
    apart_m: float
) -> None:
    """What stands anywhere on its arc may be heard. Where that is as short as a cell it counts as a picture does."""
    free = see(Pose2(-0.6, 0.0, 0.0), 0.0)

    def hear(k: int, x_m: float = -0.9) -> FreeFloor:
        return replace(see(Pose2(x_m + k * apart_m, 0.0, 0.0), 1.0 + k, BOX), sense="ranges")

    heard = [hear(k) for k in range(8)]
    told = [tell([free, *heard[:number]], SPOT)[0] for number in range(9)]
    assert told[0] == pytest.approx(0.01) and told[1] < P_CAMOUFLAGED
    assert (told[2] > told[1]) == (apart_m > 0.0) == (told[-1] == 1.0) and (np.diff(told) >= 0.0).all()
    assert tell([free, hear(0, -0.17)], SPOT)[0] == pytest.approx(1.0 / (1.0 + 99.0 * math.exp(-TAKEN)))
    silent = replace(see(Pose2(-0.9, 0.0, 0.0), 20.0), sense="ranges")
    assert tell([free, *heard, silent], SPOT)[0] == pytest.approx(0.01)


def test_where_the_robot_has_been_is_free_unless_something_is_seen_there() -> None:
    been = np.array([[SPOT[0, 0], SPOT[0, 1], 0.3]])
    told = FloorMap([], been).ask(SPOT)
    assert told.p[0] == pytest.approx(0.01) and told.discs.tolist() == [True]
    assert tell([see(EYE, 1.0, BOX)], SPOT, been)[0] == 1.0
    assert FloorMap([see(EYE, 1.0)], been).ask(SPOT).sights.tolist() == [True]


@settings(max_examples=40)
@given(st.lists(st.tuples(st.floats(-3.0, 3.0), st.floats(-2.0, 2.0)), min_size=1, max_size=4), st.floats(0.1, 0.5),
       st.floats(0.0, 3.0))
def test_a_sweep_is_what_a_disc_covers(way: list[tuple[float, float]], radius_m: float, most_m: float) -> None:
    sweep = sample_sweep(way, radius_m, most_m)
    line = shapely.LineString(way if len(way) > 1 else [way[0], way[0]])
    line = shapely.MultiPoint([line.interpolate(a) for a in np.linspace(0.0, min(most_m, line.length), 400)])
    away = shapely.distance(line, shapely.points(sweep.points))
    assert (away <= radius_m + 0.02).all() and (sweep.at_m <= most_m + SKIN_M).all()
    beyond_m = np.linalg.norm(sweep.points - np.array(way[0]), axis=1) - radius_m
    assert (sweep.at_m[beyond_m < -SKIN_M] == 0.0).all()
    assert (sweep.at_m[beyond_m > SKIN_M] > 0.0).all()
    middle = shapely.line_interpolate_point(shapely.LineString([way[0], *way]), sweep.at_m)
    first = np.array([shapely.Point(*point).distance(at) for point, at in zip(sweep.points, middle, strict=True)])
    assert (np.abs(first[sweep.at_m > 0.0] - radius_m) < SKIN_M).all()


@given(st.lists(st.floats(0.0, 3.0), max_size=30))
def test_free_way_ends_where_three_unseen_cells_are_together(at: list[float]) -> None:
    unseen = Sweep(np.zeros((len(at), 2)), np.array(at))
    ordered = sorted(at)
    together = [a for a, b in zip(ordered, ordered[2:], strict=False) if b - a <= 0.15]
    assert find_blind(unseen).tolist() == together and (measure_blind_m(unseen) > 0.0) == bool(together)
