"""Laws of the bytes of P2OS and of the Open Interface: what is said is understood at the other end."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from harvey_bases import create2, p2os, p2os_emulator
from harvey_bases.counters import step, to_signed
from harvey_bases.create2_emulator import Create2Emulator
from harvey_bases.p2os_emulator import P2osEmulator
from sim.emulators.emulator import IdealGround

NOISE = st.binary(max_size=300)
SPEEDS = st.integers(-500, 500).filter(create2.is_permitted)
ARGUMENTS = st.none() | st.integers(-32767, 32767)


@given(st.integers(0, 255), ARGUMENTS)
def test_the_pioneer_reads_what_the_driver_says(command: int, argument: int | None) -> None:
    (request,) = p2os_emulator.PacketReader().feed(p2os.encode(command, argument))
    assert (request.number, request.argument) == (command, argument or 0)


@given(st.binary(min_size=1, max_size=100))
def test_both_ends_compute_the_pioneer_checksum_alike(content: bytes) -> None:
    total = 0
    for i in range(0, len(content) - 1, 2):
        total = (total + int.from_bytes(content[i:i + 2], "big")) % 65536
    total ^= content[-1] if len(content) % 2 else 0
    assert p2os.checksum(content) == p2os_emulator.compute_checksum(content) == total


STATUSES = st.fixed_dictionaries({
    "moving": st.booleans(), "x": st.integers(0, 0x7FFF), "y": st.integers(0, 0x7FFF), "heading": st.integers(0, 4095),
    "left": st.integers(-1000, 1000), "right": st.integers(-1000, 1000), "stalled": st.booleans(),
    "enabled": st.booleans(),
})


@given(STATUSES)
def test_the_driver_reads_what_the_pioneer_tells(told: dict[str, int]) -> None:
    (heard,) = p2os.P2osDecoder().feed(p2os_emulator.build_status(**told))
    assert heard == p2os.Status(**told)


@given(st.integers(-2**31, 2**31 - 1), st.integers(-2**31, 2**31 - 1))
def test_the_driver_reads_encoder_packets(left: int, right: int) -> None:
    packet = p2os_emulator.build_encoder_counts(left, right)
    assert list(p2os.P2osDecoder().feed(packet)) == [p2os.Counts(left, right)]


@given(NOISE, STATUSES)
def test_the_pioneer_decoder_goes_on_after_noise(noise: bytes, told: dict[str, int]) -> None:
    decoder = p2os.P2osDecoder()
    list(decoder.feed(noise))
    heard = [m for _ in range(12) for m in decoder.feed(p2os_emulator.build_status(**told))]
    assert p2os.Status(**told) in heard


@given(SPEEDS, SPEEDS, st.binary(max_size=4).filter(lambda b: not create2.OPCODES & set(b)))
def test_a_create_obeys_a_speed_whatever_was_left_open_before_it(right: int, left: int, cut: bytes) -> None:
    robot = Create2Emulator(IdealGround())
    robot.receive(create2.wake() + create2.safe())
    robot.receive(bytes([create2.DRIVE_DIRECT]) + cut)
    robot.receive(create2.drive(right, left))
    robot.advance(0.016)
    (*_, report) = create2.CreateDecoder().feed(robot.take())
    assert (report.right_wanted, report.left_wanted, report.mode) == (right, left, create2.SAFE_MODE)


@given(SPEEDS, SPEEDS)
def test_no_byte_of_a_speed_is_an_opcode(right: int, left: int) -> None:
    assert not create2.OPCODES & set(create2.drive(right, left)[5:])


@given(NOISE, st.integers(0, 0xFFFF))
def test_the_stream_decoder_goes_on_after_noise(noise: bytes, count: int) -> None:
    robot = Create2Emulator(IdealGround(), count=count)
    robot.receive(create2.wake())
    robot.advance(0.1)
    decoder = create2.CreateDecoder()
    list(decoder.feed(noise))
    (*_, report) = decoder.feed(robot.take())
    assert (report.left_count, report.right_count) == (count, count)


@given(NOISE, st.integers(1, 8))
def test_bytes_of_any_kind_raise_nothing_at_either_end(noise: bytes, size: int) -> None:
    pieces = [noise[i:i + size] for i in range(0, len(noise), size)]
    for decoder in (p2os.P2osDecoder(), create2.CreateDecoder()):
        for piece in pieces:
            list(decoder.feed(piece))
    for base in (P2osEmulator(IdealGround()), Create2Emulator(IdealGround())):
        for piece in pieces:
            base.receive(piece)
            base.advance(0.01)
            base.take()


@given(st.integers(0, 2**16 - 1), st.integers(-2**14 + 1, 2**14 - 1), st.sampled_from((12, 15, 16)))
def test_a_wrapping_counter_tells_every_step_below_half_its_range(start: int, change: int, bits: int) -> None:
    change %= 2 ** (bits - 1)
    for by in (change, -change):
        assert step(start % 2**bits, (start + by) % 2**bits, bits) == by


@given(st.integers(), st.integers(2, 40))
def test_signed_is_the_number_in_range_that_agrees_modulo(value: int, bits: int) -> None:
    result = to_signed(value, bits)
    assert (result - value) % 2**bits == 0 and -(2 ** (bits - 1)) <= result < 2 ** (bits - 1)


WITH_SENSES = st.fixed_dictionaries({
    "moving": st.booleans(), "x": st.integers(0, 0x7FFF), "y": st.integers(0, 0x7FFF), "heading": st.integers(0, 4095),
    "left": st.integers(-1000, 1000), "right": st.integers(-1000, 1000), "stalled": st.booleans(),
    "enabled": st.booleans(), "front": st.integers(0, 31), "rear": st.integers(0, 31),
    "sonars": st.lists(st.tuples(st.integers(0, 31), st.integers(0, 65535)), max_size=32).map(tuple),
})


@given(WITH_SENSES)
def test_the_driver_reads_the_pioneers_bumpers_and_sonars(told: dict[str, Any]) -> None:
    (heard,) = p2os.P2osDecoder().feed(p2os_emulator.build_status(**told))
    assert heard == p2os.Status(**told)
    contact = p2os.find_contact(heard, 1.0, turning=True)
    assert (contact is None) == (not (told["front"] or told["rear"] or told["stalled"]))
    ranges = p2os.build_ranges(dict(heard.sonars), 1.0)
    known = {number for number, _ in heard.sonars if number < len(p2os.SONARS)}
    assert (ranges is None) == (not known) and (ranges is None or len(ranges.distances_m) == len(known))


@given(st.binary(min_size=20, max_size=60))
def test_a_status_of_any_bytes_raises_nothing(content: bytes) -> None:
    status = p2os.understood(b"\x32" + content)
    assert isinstance(status, p2os.Status)
    p2os.build_ranges(dict(status.sonars), 0.0)
    p2os.find_contact(status, 0.0, turning=False)


@given(st.floats(0.17, 0.6), st.booleans())
def test_the_light_bumper_tells_how_near_a_wall_is(wall_m: float, with_lights: bool) -> None:
    floor = IdealGround()
    floor.wall_m = wall_m
    robot = Create2Emulator(floor)
    robot.receive(create2.wake(with_lights=with_lights))
    robot.advance(0.016)
    (*_, report) = create2.CreateDecoder().feed(robot.take())
    assert len(report.lights) == (6 if with_lights else 0)
    for distance in create2.build_ranges(report.lights, 0.0).distances_m if with_lights else ():
        near = wall_m < create2.LIGHT_REACH_M - 0.002
        assert distance == pytest.approx(wall_m, abs=0.002) if near else distance is None or distance >= wall_m - 0.01


@given(st.binary(max_size=300), st.booleans())
def test_both_streams_are_found_again_after_noise(noise: bytes, with_lights: bool) -> None:
    robot = Create2Emulator(IdealGround(), count=7)
    robot.receive(create2.wake(with_lights=with_lights))
    robot.advance(0.15)
    decoder = create2.CreateDecoder()
    list(decoder.feed(noise))
    (*_, report) = decoder.feed(robot.take())
    assert (report.left_count, len(report.lights)) == (7, 6 if with_lights else 0)
