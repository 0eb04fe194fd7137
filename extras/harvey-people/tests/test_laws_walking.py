"""Laws of people who walk: what is drawn is solid, feet stay on the floor, nobody walks through anything."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from people_here import body_among, figure, people_of, person

from harvey_people.simulated.figure import outline
from harvey_people.simulated.walking import WIDTH_M
from sim.body.collision import Obstacles
from world_models.frames import Pose2

PLACES = st.floats(-3.0, 3.0)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 50), x=PLACES, y=PLACES, heading=st.floats(-3.1, 3.1), walked=st.floats(0.0, 5.0),
       speed=st.floats(0.0, 1.6))
def test_what_is_drawn_is_solid_and_stands_on_the_floor(
    seed: int, x: float, y: float, heading: float, walked: float, speed: float,
) -> None:
    """What the core would find solid of the faces lies within the outline, which is no more than 8 cm larger."""
    one, pose = figure(seed), Pose2(x, y, heading)
    corners = one.corners(pose, walked, speed)
    assert corners[..., 2].min() == pytest.approx(0.0, abs=1e-9)
    solid = Obstacles(outline(corners, heading))
    drawn = Obstacles.of_faces(one.faces(corners, 0.0)).segments_world.reshape(-1, 2)
    turned = (drawn - pose.position) @ np.array([[math.cos(heading), -math.sin(heading)],
                                                 [math.sin(heading), math.cos(heading)]])
    own = (solid.segments_world.reshape(-1, 2) - pose.position) @ np.array(
        [[math.cos(heading), -math.sin(heading)], [math.sin(heading), math.cos(heading)]])
    assert np.all(turned.min(axis=0) >= own.min(axis=0) - 1e-6)
    assert np.all(turned.max(axis=0) <= own.max(axis=0) + 1e-6)
    assert np.all(np.abs(turned.min(axis=0) - own.min(axis=0)) < 0.08)


def test_the_foot_on_the_floor_stays_where_it_is() -> None:
    """Over half a stride (1.22 m at 1.2 m/s) one foot moves back in the body as fast as the body goes ahead."""
    one, speed = figure(), 1.2
    feet = [walked + one.pivots_m[0] * math.sin(one.swing_rad(walked, speed)) for walked in np.linspace(0.31, 0.91, 9)]
    assert feet == pytest.approx([feet[0]] * 9, abs=1e-9)
    assert one.swing_rad(0.7, 0.0) == 0.0


@pytest.mark.parametrize("speed", [0.3, 1.0, 1.6])
def test_a_person_alone_walks_as_fast_as_he_wants(speed: float) -> None:
    body = body_among(person([(-4.0, 3.0), (4.0, 3.0)], speed), at=Pose2(0.0, -4.0, 0.0))
    body.wait(2.0)
    before = people_of(body)["people/0"].mean(axis=0)
    body.wait(2.0)
    way = people_of(body)["people/0"].mean(axis=0) - before
    assert math.hypot(way[0], way[1]) == pytest.approx(2.0 * speed, rel=0.12)


@settings(max_examples=15, deadline=None)
@given(speeds=st.lists(st.floats(0.3, 1.6), min_size=3, max_size=3), makes_way=st.booleans(), x=st.floats(-1.0, 1.0))
def test_nobody_walks_through_the_robot_or_a_wall(speeds: list[float], makes_way: bool, x: float) -> None:
    body = body_among(*(person(way, speed, makes_way, i) for i, (way, speed) in enumerate(zip(
        ([(-4.0, 0.0), (4.0, 0.0)], [(0.0, 4.0), (0.0, -4.0)], [(3.0, 3.0), (-7.5, 0.0)]), speeds, strict=True))),
        at=Pose2(x, 0.2, 0.0))
    for _ in range(40):
        body.wait(0.25)
        assert body.building.obstacles.clearance_m(body.truth.world_from_robot) >= 0.0
        for corners in people_of(body).values():
            assert np.abs(corners[..., :2]).max() < 6.0 + WIDTH_M / 2.0
    told = [line for line in body.happened if "walked into it" in line]
    assert not told or all(line.startswith("people/") for line in told)


def test_the_same_calls_give_the_same_moments_and_time_may_be_cut() -> None:
    """The same building twice is the same; ten short waits are one long one."""
    way = [(-4.0, 0.0), (4.0, 0.5)]
    one, again, cut = (body_among(person(way), at=Pose2(0.0, -3.0, 0.0)) for _ in range(3))
    one.wait(3.0)
    again.wait(3.0)
    for _ in range(60):
        cut.wait(0.05)
    assert np.array_equal(people_of(one)["people/0"], people_of(again)["people/0"])
    assert np.allclose(people_of(one)["people/0"], people_of(cut)["people/0"], atol=0.02)


def test_who_moves_towards_whom_is_told() -> None:
    """One who makes no way walks into a robot that stands; a robot that drives into one who stands counts a contact."""
    stands = body_among(person([(-3.0, 0.0), (3.0, 0.0)], makes_way=False))
    stands.wait(6.0)
    assert any(line.startswith("people/0 walked into it at") for line in stands.happened)
    assert stands.truth.collisions == 0
    drives = body_among(person([(1.5, 0.0)]))
    drives.move(2.0)
    assert drives.truth.collisions == 1 and not drives.happened
    assert drives.take_contact() is not None
    passes = body_among(person([(-3.0, 0.3), (3.0, 0.3)]))
    passes.wait(8.0)
    assert not passes.happened, "one who makes way goes round"


def test_a_person_is_seen_and_heard() -> None:
    body = body_among(person([(2.0, 0.0)]))
    alone = body_among()
    assert body.picture() != alone.picture()
    assert body.echo(Pose2(0.35, 0.0, 0.0)) == pytest.approx(2.0 - 0.35 - 0.12, abs=0.12)
    assert (alone.echo(Pose2(0.35, 0.0, 0.0)) or 9.0) > 4.0
