"""Laws of the serial protocols' bytes: what is said is understood at the other end, and noise is only noise."""

from __future__ import annotations

import binascii
import math
import zlib

from hypothesis import given
from hypothesis import strategies as st

from harvey.hardware.drivers.bases import create2_wire, denning_wire, p2os_wire
from harvey.hardware.drivers.bases.counters import step, to_signed
from sim.emulators import p2os_packets
from sim.emulators.create2 import Create2Emulator
from sim.emulators.denning import DenningEmulator
from sim.emulators.denning_motion import ConstantSpeedMotion
from sim.emulators.ground import IdealGround
from sim.emulators.p2os import P2osEmulator

NOISE = st.binary(max_size=300)
WORDS = st.lists(st.text("abcdefghijklmnopqrstuvwxyz0123456789.-+", min_size=1, max_size=12), max_size=5).map(tuple)
FRAMES = st.builds(
    denning_wire.Frame, st.integers(0, 2**32 - 1).map(lambda n: f"{n:08X}"), st.integers(0, 999_999_999),
    st.sampled_from(("GO", "STOP", "BEAT", "HELLO", "DONE")), WORDS,
)
SPEEDS = st.integers(-500, 500).filter(create2_wire.is_permitted)
ARGUMENTS = st.none() | st.integers(-32767, 32767)


@given(FRAMES)
def test_a_denning_frame_comes_back_as_it_was_said(frame: denning_wire.Frame) -> None:
    assert denning_wire.decode(denning_wire.encode(frame).rstrip(b"\n")) == frame


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_number_on_the_denning_line_is_the_same_number_again(value: float) -> None:
    frame = denning_wire.Frame("00000000", 1, "GO", (denning_wire.number(value),))
    heard = denning_wire.decode(denning_wire.encode(frame).rstrip(b"\n"))
    assert heard is not None
    (again,) = heard.numbers(0, 1) or (math.nan,)
    assert again == value and math.copysign(1, again) == math.copysign(1, value)


@given(FRAMES, st.data())
def test_up_to_three_flipped_bits_never_make_another_denning_frame(
    frame: denning_wire.Frame, data: st.DataObject
) -> None:
    line = bytearray(denning_wire.encode(frame))
    places = data.draw(st.lists(st.integers(0, 8 * len(line) - 1), min_size=1, max_size=3, unique=True))
    for place in places:
        line[place // 8] ^= 1 << place % 8
    heard = list(denning_wire.Decoder().feed(bytes(line) + b"\n"))
    assert heard in ([], [frame])


@given(NOISE, FRAMES, NOISE)
def test_the_denning_decoder_finds_a_frame_in_noise(before: bytes, frame: denning_wire.Frame, after: bytes) -> None:
    decoder = denning_wire.Decoder()
    heard = list(decoder.feed(before))
    heard += decoder.feed(denning_wire.encode(frame))
    heard += decoder.feed(after + b"\n")
    assert frame in heard


@given(st.lists(FRAMES, max_size=4), st.integers(1, 7))
def test_frames_may_come_in_pieces(frames: list[denning_wire.Frame], size: int) -> None:
    said = b"".join(denning_wire.encode(frame) for frame in frames)
    decoder = denning_wire.Decoder()
    heard = [f for i in range(0, len(said), size) for f in decoder.feed(said[i:i + size])]
    assert heard == frames


@given(st.binary(max_size=60))
def test_both_ends_of_the_denning_line_use_the_same_crc(data: bytes) -> None:
    bits = 0xFFFFFFFF
    for byte in data:
        bits ^= byte
        for _ in range(8):
            bits = bits >> 1 ^ (0xEDB88320 if bits & 1 else 0)
    assert zlib.crc32(data) == binascii.crc32(data) == bits ^ 0xFFFFFFFF


@given(st.integers(0, 255), ARGUMENTS)
def test_the_pioneer_reads_what_the_driver_says(command: int, argument: int | None) -> None:
    (request,) = p2os_packets.PacketReader().feed(p2os_wire.encode(command, argument))
    assert (request.number, request.argument) == (command, argument or 0)


@given(st.binary(min_size=1, max_size=100))
def test_both_ends_compute_the_pioneer_checksum_alike(content: bytes) -> None:
    total = 0
    for i in range(0, len(content) - 1, 2):
        total = (total + int.from_bytes(content[i:i + 2], "big")) % 65536
    total ^= content[-1] if len(content) % 2 else 0
    assert p2os_wire.checksum(content) == p2os_packets.compute_checksum(content) == total


STATUSES = st.fixed_dictionaries({
    "moving": st.booleans(), "x": st.integers(0, 0x7FFF), "y": st.integers(0, 0x7FFF), "heading": st.integers(0, 4095),
    "left": st.integers(-1000, 1000), "right": st.integers(-1000, 1000), "stalled": st.booleans(),
    "enabled": st.booleans(),
})


@given(STATUSES)
def test_the_driver_reads_what_the_pioneer_tells(told: dict[str, int]) -> None:
    (heard,) = p2os_wire.Decoder().feed(p2os_packets.build_status(**told))
    assert heard == p2os_wire.Status(**told)


@given(st.integers(-2**31, 2**31 - 1), st.integers(-2**31, 2**31 - 1))
def test_the_driver_reads_encoder_packets(left: int, right: int) -> None:
    packet = p2os_packets.build_encoder_counts(left, right)
    assert list(p2os_wire.Decoder().feed(packet)) == [p2os_wire.Counts(left, right)]


@given(NOISE, STATUSES)
def test_the_pioneer_decoder_goes_on_after_noise(noise: bytes, told: dict[str, int]) -> None:
    decoder = p2os_wire.Decoder()
    list(decoder.feed(noise))
    heard = [m for _ in range(12) for m in decoder.feed(p2os_packets.build_status(**told))]
    assert p2os_wire.Status(**told) in heard


@given(SPEEDS, SPEEDS, st.binary(max_size=4).filter(lambda b: not create2_wire.OPCODES & set(b)))
def test_a_create_obeys_a_speed_whatever_was_left_open_before_it(right: int, left: int, cut: bytes) -> None:
    robot = Create2Emulator(IdealGround())
    robot.receive(create2_wire.wake() + create2_wire.safe())
    robot.receive(bytes([create2_wire.DRIVE_DIRECT]) + cut)
    robot.receive(create2_wire.drive(right, left))
    robot.advance(0.016)
    (*_, report) = create2_wire.Decoder().feed(robot.take())
    assert (report.right_wanted, report.left_wanted, report.mode) == (right, left, create2_wire.SAFE_MODE)


@given(SPEEDS, SPEEDS)
def test_no_byte_of_a_speed_is_an_opcode(right: int, left: int) -> None:
    assert not create2_wire.OPCODES & set(create2_wire.drive(right, left)[5:])


@given(NOISE, st.integers(0, 0xFFFF))
def test_the_stream_decoder_goes_on_after_noise(noise: bytes, count: int) -> None:
    robot = Create2Emulator(IdealGround(), count=count)
    robot.receive(create2_wire.wake())
    robot.advance(0.1)
    decoder = create2_wire.Decoder()
    list(decoder.feed(noise))
    (*_, report) = decoder.feed(robot.take())
    assert (report.left_count, report.right_count) == (count, count)


@given(NOISE, st.integers(1, 8))
def test_bytes_of_any_kind_raise_nothing_at_either_end(noise: bytes, size: int) -> None:
    pieces = [noise[i:i + size] for i in range(0, len(noise), size)]
    for decoder in (denning_wire.Decoder(), p2os_wire.Decoder(), create2_wire.Decoder()):
        for piece in pieces:
            list(decoder.feed(piece))
    ground = IdealGround
    for base in (DenningEmulator(ConstantSpeedMotion(ground())), P2osEmulator(ground()), Create2Emulator(ground())):
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
