"""Laws of touch and range over the serial protocols: what a base feels is what its driver tells, also on a bad line."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.robustness.serial.line_noise import Noise
from experiments.robustness.serial.noisy_line import NoisyLine
from harvey.hardware.drivers.bases import create2_senses, create2_wire, denning_wire, p2os_senses, p2os_wire
from harvey.hardware.drivers.bases.base import Base, BaseFault
from harvey.hardware.drivers.bases.create2 import Create2Base
from harvey.hardware.drivers.bases.denning import DenningBase
from harvey.hardware.drivers.bases.p2os import P2osBase
from sim.emulators import p2os_packets
from sim.emulators.create2 import Create2Emulator
from sim.emulators.denning import DenningEmulator
from sim.emulators.denning_motion import ConstantSpeedMotion, InstantMotion
from sim.emulators.ground import IdealGround
from sim.emulators.p2os import P2osEmulator
from world_models.entries.body import MotionReport, MotorCommand
from world_models.entries.touch import AHEAD_SIGMA_RAD, AROUND_SIGMA_RAD, Contact, Ranges

KINDS = st.sampled_from(("denning", "p2os", "create2"))
ANGLES = st.floats(-math.pi, math.pi)
WORDS = st.lists(st.text("0123456789.-e", min_size=1, max_size=7) | st.sampled_from(("bumper", "stall", "none")),
                 max_size=8).map(tuple)
CONTACTS = st.none() | st.builds(
    Contact, st.sampled_from(("bumper", "stall")), ANGLES, st.floats(0.001, 3.0), st.floats(0.0, 1e6))
DISTANCES = st.lists(st.none() | st.floats(0.0, 60.0), min_size=1, max_size=24)


def wired(kind: str, floor: IdealGround, noise: float = 0.0, seed: int = 0) -> Base:
    """A driver of an emulated base, over a line in memory."""
    end: Any = (DenningEmulator(ConstantSpeedMotion(floor)) if kind == "denning"
                else P2osEmulator(floor) if kind == "p2os" else Create2Emulator(floor))
    rng = np.random.default_rng(seed)
    line = NoisyLine(end, Noise(rng, noise), Noise(rng, noise), tick_s=0.01)
    return DenningBase(line) if kind == "denning" else P2osBase(line) if kind == "p2os" else Create2Base(line)


class StubBody:
    """Stops half way of every move, and feels what it is told to."""

    def __init__(self, contact: Contact | None, ranges: Ranges | None) -> None:
        self._contact, self._ranges = contact, ranges

    def execute(self, command: MotorCommand, /) -> MotionReport:
        return MotionReport(command.turn_rad, command.move_m / 2.0, 1.0, 2.0)

    def take_contact(self) -> Contact | None:
        return self._contact

    def ranges(self) -> Ranges | None:
        return self._ranges


class OldBase(DenningEmulator):
    """A base that was written before there were senses in the protocol."""

    asked = 0

    def _obey(self, token: str, seq: int, verb: str, words: list[str]) -> None:
        self.asked += verb in ("TOUCH", "RANGES")
        super()._obey(token, seq, "WHAT" if verb in ("TOUCH", "RANGES") else verb, words)


def ring(distances: list[float | None]) -> Ranges:
    axes = tuple(math.remainder(math.tau * at / len(distances), math.tau) for at in range(len(distances)))
    return Ranges(axes, tuple(distances), 0.02, 0.218, 99.0, 0.0)


def over_denning(body: StubBody) -> DenningBase:
    quiet = Noise(np.random.default_rng(0), 0.0)
    return DenningBase(NoisyLine(DenningEmulator(InstantMotion(body)), quiet, quiet, tick_s=0.01))


@settings(deadline=None, max_examples=40)
@given(CONTACTS)
def test_a_contact_comes_over_the_denning_line_as_it_was_felt(contact: Contact | None) -> None:
    base = over_denning(StubBody(contact, None))
    assert base.move(0.4).move_m == 0.2
    assert base.take_contact() == contact and base.take_contact() is None


@settings(deadline=None, max_examples=40)
@given(DISTANCES)
def test_ranges_come_over_the_denning_line_to_the_millimetre(distances: list[float | None]) -> None:
    found = over_denning(StubBody(None, ring(distances))).ranges()
    assert found is not None and found.directions_rad == ring(distances).directions_rad
    assert [d is None for d in found.distances_m] == [d is None for d in distances]
    for heard, told in zip(found.distances_m, distances, strict=True):
        assert heard is None or told is None or abs(heard - told) <= 0.000501
    assert (found.sigma_m, found.half_beam_rad, found.max_range_m) == (0.02, 0.218, 99.0)


def test_a_base_without_sensors_measures_nothing() -> None:
    assert over_denning(StubBody(None, None)).ranges() is None


@given(st.integers(0, 999_999_999), DISTANCES)
def test_the_longest_ring_fits_on_a_line(seq: int, distances: list[float | None]) -> None:
    words = ("999999999", "999", "999", "99999", *("-" if d is None else str(round(1000 * d)) for d in distances))
    frame = denning_wire.Frame("FFFFFFFF", seq, "ECHOES", words)
    line = denning_wire.encode(frame)
    assert len(line) <= denning_wire.LONGEST and denning_wire.decode(line.rstrip(b"\n")) == frame


@given(WORDS)
def test_what_is_no_contact_and_no_reading_is_none(words: tuple[str, ...]) -> None:
    contact = denning_wire.parse_contact(denning_wire.Frame("00000000", 1, "FELT", words))
    assert contact is None or contact.by == words[0]
    ranges = denning_wire.parse_ranges(words, 1.0)
    assert ranges is None or len(ranges.distances_m) == len(words) - 3


def test_an_old_base_is_asked_once_and_drives_on() -> None:
    floor, quiet = IdealGround(), Noise(np.random.default_rng(0), 0.0)
    end = OldBase(ConstantSpeedMotion(floor))
    base = DenningBase(NoisyLine(end, quiet, quiet, tick_s=0.01))
    assert base.ranges() is None and base.ranges() is None and end.asked == 1
    floor.held = True
    with pytest.raises(BaseFault, match="stalled"):
        base.move(0.5)
    contact = base.take_contact()
    assert contact is not None and (contact.by, contact.sigma_rad) == ("stall", AHEAD_SIGMA_RAD) and end.asked == 1
    floor.held = False
    assert base.move(0.2).move_m == 0.2


STATUSES = st.fixed_dictionaries({
    "moving": st.booleans(), "x": st.integers(0, 0x7FFF), "y": st.integers(0, 0x7FFF), "heading": st.integers(0, 4095),
    "left": st.integers(-1000, 1000), "right": st.integers(-1000, 1000), "stalled": st.booleans(),
    "enabled": st.booleans(), "front": st.integers(0, 31), "rear": st.integers(0, 31),
    "sonars": st.lists(st.tuples(st.integers(0, 31), st.integers(0, 65535)), max_size=32).map(tuple),
})


@given(STATUSES)
def test_the_driver_reads_the_pioneers_bumpers_and_sonars(told: dict[str, Any]) -> None:
    (heard,) = p2os_wire.Decoder().feed(p2os_packets.build_status(**told))
    assert heard == p2os_wire.Status(**told)
    contact = p2os_senses.find_contact(heard, 1.0, turning=True)
    assert (contact is None) == (not (told["front"] or told["rear"] or told["stalled"]))
    ranges = p2os_senses.build_ranges(dict(heard.sonars), 1.0)
    known = {number for number, _ in heard.sonars if number < len(p2os_senses.SONARS)}
    assert (ranges is None) == (not known) and (ranges is None or len(ranges.distances_m) == len(known))


@given(st.binary(min_size=20, max_size=60))
def test_a_status_of_any_bytes_raises_nothing(content: bytes) -> None:
    status = p2os_wire.understood(b"\x32" + content)
    assert isinstance(status, p2os_wire.Status)
    p2os_senses.build_ranges(dict(status.sonars), 0.0)
    p2os_senses.find_contact(status, 0.0, turning=False)


@given(st.floats(0.17, 0.6), st.booleans())
def test_the_light_bumper_tells_how_near_a_wall_is(wall_m: float, with_lights: bool) -> None:
    floor = IdealGround()
    floor.wall_m = wall_m
    robot = Create2Emulator(floor)
    robot.receive(create2_wire.wake(with_lights=with_lights))
    robot.advance(0.016)
    (*_, report) = create2_wire.Decoder().feed(robot.take())
    assert len(report.lights) == (6 if with_lights else 0)
    for distance in create2_senses.build_ranges(report.lights, 0.0).distances_m if with_lights else ():
        near = wall_m < create2_senses.LIGHT_REACH_M - 0.002
        assert distance == pytest.approx(wall_m, abs=0.002) if near else distance is None or distance >= wall_m - 0.01


@given(st.binary(max_size=300), st.booleans())
def test_both_streams_are_found_again_after_noise(noise: bytes, with_lights: bool) -> None:
    robot = Create2Emulator(IdealGround(), count=7)
    robot.receive(create2_wire.wake(with_lights=with_lights))
    robot.advance(0.15)
    decoder = create2_wire.Decoder()
    list(decoder.feed(noise))
    (*_, report) = decoder.feed(robot.take())
    assert (report.left_count, len(report.lights)) == (7, 6 if with_lights else 0)


@settings(deadline=None, max_examples=30)
@given(KINDS, st.floats(-0.9, 0.9))
def test_a_bumper_tells_which_side_was_touched(kind: str, direction_rad: float) -> None:
    floor = IdealGround()
    base = wired(kind, floor)
    floor.held, floor.touching_rad = True, direction_rad
    with pytest.raises(BaseFault) as caught:
        base.move(0.5)
    contact = base.take_contact()
    assert caught.value.kind == "stalled" and contact is not None and contact.by == "bumper"
    assert abs(contact.direction_rad - direction_rad) <= math.sqrt(3.0) * contact.sigma_rad + 1e-9
    assert base.take_contact() is None


@settings(deadline=None, max_examples=12)
@given(KINDS, st.booleans())
def test_held_wheels_tell_no_direction(kind: str, turning: bool) -> None:
    floor = IdealGround()
    base = wired(kind, floor)
    floor.held = True
    with pytest.raises(BaseFault):
        base.execute(MotorCommand(1.0 if turning else 0.0, 0.5))
    contact = base.take_contact()
    assert contact is not None
    if kind != "create2":  # its bumper is said to be pressed where nothing says what holds it
        assert (contact.by, contact.sigma_rad) == ("stall", AROUND_SIGMA_RAD if turning else AHEAD_SIGMA_RAD)


@settings(deadline=None, max_examples=20)
@given(KINDS, st.none() | st.floats(0.4, 3.0))
def test_each_ring_hears_a_wall_all_round_and_the_base_drives_on(kind: str, wall_m: float | None) -> None:
    floor = IdealGround()
    floor.wall_m = wall_m
    base = wired(kind, floor)
    for _ in range(2):
        ranges = base.ranges()
        assert ranges is not None and len(ranges.distances_m) == {"denning": 24, "p2os": 16, "create2": 6}[kind]
        if wall_m is None or kind == "create2":
            assert not ranges.echoes
        else:
            assert len(ranges.echoes) == len(ranges.distances_m)
            most_m = max(distance for _, distance in ranges.echoes)
            assert most_m == pytest.approx(wall_m, abs=0.05 if kind == "p2os" else 0.001)
        assert base.move(0.1).move_m == pytest.approx(0.1, abs=0.011)


@settings(deadline=None, max_examples=25)
@given(KINDS, st.integers(0, 10**6), st.sampled_from((0.05, 0.2)))
def test_on_a_bad_line_ranges_are_right_or_missing(kind: str, seed: int, noise: float) -> None:
    """Denning's are exact or none; those with a weak checksum may be wrong once in a while, but nothing else fails."""
    floor = IdealGround()
    floor.wall_m = 1.5
    base = wired(kind, floor, noise, seed)
    for _ in range(6):
        try:
            ranges = base.ranges()
        except BaseFault:
            continue
        if kind == "denning" and ranges is not None:
            assert ranges.distances_m == (1.5,) * 24
