"""Laser scans as ranges: where the echoes are, what is no echo, and what is no scan."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ros2_bench import Bench

from harvey_ros2.messages.messages import message_types
from harvey_ros2.robot.laser_scan import MOST_M, SECTORS, read_scan
from harvey_ros2.robot.robot_file import SCAN, ScanMount

TYPES = message_types("jazzy")
AHEAD = ScanMount()


def scan(ranges: Any, **fields: Any) -> Any:
    """All round, from behind to behind."""
    given = np.asarray(ranges, np.float32)
    return TYPES.build(SCAN, **{
        "angle_min": -math.pi, "angle_increment": math.tau / max(len(given), 1), "range_min": 0.1, "range_max": 8.0,
        "ranges": given, **fields})


@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-3.0, 3.0), st.floats(1.0, 5.0))
def test_the_walls_of_a_round_room_are_equally_far_from_the_robots_axis_wherever_the_scanner_is(
    forward: float, left: float, heading: float, wall: float
) -> None:
    mount = ScanMount(forward, left, heading)
    beams = heading - math.pi + math.tau / 720 * np.arange(720)
    along = forward * np.cos(beams) + left * np.sin(beams)
    ranges = -along + np.sqrt(along**2 + wall**2 - forward**2 - left**2)
    found = read_scan(scan(ranges), mount, 3.0)
    assert found is not None and found.when_s == 3.0 and len(found.directions_rad) == SECTORS
    assert all(away is not None and abs(away - wall) < 1e-5 for away in found.distances_m)


def test_one_thing_is_where_it_is() -> None:
    ranges = np.full(360, np.inf)
    ranges[225] = 2.0  # 45 degrees to the left of where the scanner faces
    found = read_scan(scan(ranges), ScanMount(heading_rad=math.radians(-90.0)), 0.0)
    assert found is not None
    (direction, distance), = found.echoes
    assert abs(direction - math.radians(-45.0)) <= found.half_beam_rad + 1e-6 and abs(distance - 2.0) < 1e-9
    assert len(found.distances_m) == SECTORS


def test_what_is_no_echo_says_that_nothing_is_there_and_what_is_no_reading_says_nothing() -> None:
    def read(value: float) -> Any:
        return read_scan(scan([value] * 360), AHEAD, 0.0)

    assert set(read(math.inf).distances_m) == set(read(MOST_M + 1.0).distances_m) == {None}
    assert read(-math.inf).distances_m == pytest.approx([0.1] * SECTORS)  # too near to be measured
    assert read(math.nan) is read(0.0) is read(0.05) is read(9.0) is None
    assert read_scan(scan([]), AHEAD, 0.0) is None
    for wrong in ({"range_max": 0.05}, {"angle_min": math.nan}, {"range_min": math.inf}, {"angle_increment": math.inf}):
        assert read_scan(scan([2.0] * 360, **wrong), AHEAD, 0.0) is None


def test_a_driver_reads_the_next_whole_scan_and_waits_for_none_where_there_is_no_scanner() -> None:
    bench = Bench()
    assert bench.driver().ranges() is None and bench.time_s == 0.0
    driver = bench.driver(AHEAD)
    assert driver.ranges() is None and 0.4 < bench.time_s < 0.7
    whole = TYPES.encode(scan([2.0] * 360))

    def say() -> None:
        bench.say("scan", whole[:100], "robot")
        bench.say("scan", whole, "robot")
        bench.before_tick = lambda: None

    bench.before_tick = say
    found = driver.ranges()
    assert found is not None and found.distances_m == pytest.approx([2.0] * SECTORS)


@given(st.binary(max_size=200), st.integers(0, 199))
def test_a_garbled_scan_is_none(noise: bytes, at: int) -> None:
    whole = TYPES.encode(scan(np.linspace(0.5, 3.0, 30)))
    data = whole[:at] + noise + whole[at + len(noise):]
    bench = Bench()
    driver = bench.driver(AHEAD)
    bench.say("scan", data, "robot")
    found = driver.ranges()
    assert found is None or all(away is None or 0.0 <= away <= MOST_M for away in found.distances_m)
