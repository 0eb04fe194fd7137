"""The numbers of the published protocols, byte by byte, and where the sensors sit; no code is shared with either end.

Sources: ActivMedia's Pioneer 2 manual and ARIA's parameter file p3dx-sh; iRobot's Create 2 Open Interface (2018).
"""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from harvey_bases import create2, p2os
from world_models.entries import AROUND_SIGMA_RAD
from world_models.entries.obstacle import AHEAD_SIGMA_RAD

P2OS_COMMANDS = {
    "SYNC0": 0, "SYNC1": 1, "SYNC2": 2, "PULSE": 0, "OPEN": 1, "CLOSE": 2, "ENABLE": 4, "SETA": 5, "SETV": 6,
    "SETO": 7, "MOVE": 8, "SETRV": 10, "VEL": 11, "HEAD": 12, "DHEAD": 13, "ENCODER": 19, "RVEL": 21, "SETRA": 23,
    "SONAR": 28, "STOP": 29, "ESTOP": 55, "HEADER": b"\xfa\xfb", "MAX_LENGTH": 200,
}
CREATE_NUMBERS = {
    "START": 128, "SAFE": 131, "DRIVE_DIRECT": 145, "STREAM": 148, "STREAM_RESUME": 150, "HEADER": 19, "SAFE_MODE": 2,
    "BUMPS_AND_DROPS": 7, "MODE": 35, "RIGHT_WANTED": 41, "LEFT_WANTED": 42, "LEFT_COUNT": 43, "RIGHT_COUNT": 44,
    "PACKETS": (35, 7, 41, 42, 43, 44), "LIGHT_PACKETS": (46, 47, 48, 49, 50, 51), "MAX_SIGNAL": 4095, "LENGTH": 16,
    "LENGTH_WITH_LIGHTS": 34, "PAD": b"\0\0\0\0", "OPCODES": frozenset({7}) | frozenset(range(128, 174)),
}


def test_the_numbers_of_the_protocols() -> None:
    for module, numbers in ((p2os, P2OS_COMMANDS), (create2, CREATE_NUMBERS)):
        for name, number in numbers.items():
            assert getattr(module, name) == number, name
    assert (p2os.BAUD, create2.BAUD) == (9600, 115200)
    assert pytest.approx(4096 * p2os.UNIT_RAD) == math.tau
    assert pytest.approx(508.8 * create2.M_PER_COUNT) == math.pi * 0.072 and create2.AXLE_M == 0.235
    assert dict(p2os.MM_PER_UNIT) == {"p3dx": 0.485}


@pytest.mark.parametrize(("command", "argument", "said"), [
    (0, None, "fafb03000000"), (55, None, "fafb03370037"), (4, 1, "fafb06043b0100053b"),
    (8, -300, "fafb06081b2c01341c"), (12, 359, "fafb060c3b6701733c"), (8, 65535, "fafb06083bffff083a"),
    (8, -65535, "fafb06081bffff081a"),
])
def test_a_pioneers_packets_by_hand(command: int, argument: int | None, said: str) -> None:
    """Header, count, command, type, amount low byte first, checksum of byte pairs high byte first."""
    assert p2os.encode(command, argument).hex() == said


@pytest.mark.parametrize("argument", [65536, -65536])
def test_an_argument_has_sixteen_bits(argument: int) -> None:
    with pytest.raises(ValueError, match="16 bits"):
        p2os.encode(8, argument)


def packet(content: bytes) -> bytes:
    pairs = content + b"\0" * (len(content) % 2)
    total = sum(pairs[i] << 8 | pairs[i + 1] for i in range(0, len(content) - 1, 2)) & 0xFFFF
    total ^= content[-1] if len(content) % 2 else 0
    return b"\xfa\xfb" + bytes([len(content) + 2]) + content + bytes([total >> 8, total & 0xFF])


@given(st.binary(min_size=23, max_size=23), st.integers(0, 4), st.binary(min_size=12, max_size=12), st.booleans())
def test_each_field_of_a_pioneers_status_is_where_the_manual_says(
    rest: bytes, count: int, sonars: bytes, moving: bool
) -> None:
    """Bytes: 0 kind, 1 x, 3 y, 5 heading, 7 left, 9 right, 11 battery, 12 rear, 13 front, 16 flags, 19 sonar count."""
    content = bytearray([0x33 if moving else 0x32]) + rest[:18] + bytes([count]) + sonars[:3 * count] + rest[-4:]
    (heard,) = p2os.P2osDecoder().feed(packet(bytes(content)))
    assert isinstance(heard, p2os.Status)
    words = np.frombuffer(bytes(content[1:11]), "<u2")
    assert (heard.moving, heard.x, heard.y) == (moving, words[0] % 32768, words[1] % 32768)
    assert heard.heading == words[2] and (heard.left, heard.right) == tuple(words[3:].view("<i2"))
    assert heard.stalled == bool(content[12] % 2 or content[13] % 2) and heard.enabled == bool(content[16] % 2)
    assert (heard.front, heard.rear) == (content[13] // 2, content[12] // 2)
    assert heard.sonars == tuple(
        (sonars[3 * i], sonars[3 * i + 1] + 256 * sonars[3 * i + 2]) for i in range(count))


@pytest.mark.parametrize(("size", "heard"), [(1, 1), (197, 1), (198, 1), (199, 0), (200, 0)])
def test_a_packet_has_at_most_200_bytes(size: int, heard: int) -> None:
    """COUNT is of the content and its checksum; here an answer to SYNC2 with a long name."""
    decoder = p2os.P2osDecoder()
    found = list(decoder.feed(packet(b"\2" + b"a" * (size - 1)) + packet(b"\0")))
    assert len(found) == heard + 1 and decoder.rejected == 1 - heard


def test_packets_too_short_or_of_other_kinds_mean_nothing() -> None:
    assert p2os.understood(b"\x32" + bytes(18)) is None and p2os.understood(b"\x32" + bytes(19)) is not None
    assert p2os.understood(b"\x90" + bytes(7)) is None and p2os.understood(b"\x34" + bytes(30)) is None
    assert p2os.understood(b"\x90" + bytes(8)) == p2os.Counts(0, 0)
    assert p2os.understood(b"\0\0") is None and p2os.understood(b"\1") == p2os.Echo(1)
    assert p2os.understood(b"\2R\0P\0p3dx\0more") == p2os.Echo(2, ("R", "P", "p3dx"))
    assert p2os.P2osDecoder().rejected == 0


def test_garbage_is_counted_once_for_each_header() -> None:
    decoder = p2os.P2osDecoder()
    bad = bytearray(packet(b"\0"))
    bad[-1] ^= 1
    assert list(decoder.feed(b"noise" + bytes(bad) + b"\xfa\xfb\x02" + packet(b"\1"))) == [p2os.Echo(1)]
    assert decoder.rejected == 2
    assert list(decoder.feed(packet(b"\1")[:3])) == []
    decoder.clear()
    assert list(decoder.feed(packet(b"\1")[3:] + packet(b"\0"))) == [p2os.Echo(0)]


QUARTER = ((69, 136, 90), (114, 119, 50), (148, 78, 30), (166, 27, 10))


def test_the_sonars_sit_as_the_maker_says() -> None:
    """The front left ones from the file; the others mirror them: to the right exactly, to the rear about x = -44 mm."""
    assert p2os.SONARS[:4] == QUARTER
    for at, (x, y, angle) in enumerate(p2os.SONARS):
        assert p2os.SONARS[(7 - at) % 16] == (x, -y, -angle)
        rear = p2os.SONARS[15 - at]
        assert abs(rear[0] + x + 88.5) <= 0.5 and rear[1] == y and (rear[2] + angle) % 360 == 180


@given(st.integers(0, 15), st.integers(0, 4999))
def test_an_echo_lies_where_the_sonar_sits_and_faces(number: int, range_mm: int) -> None:
    x, y, angle = p2os.SONARS[number]
    at = complex(x, y) + range_mm * cmath.exp(1j * math.radians(angle))
    ranges = p2os.build_ranges({number: range_mm, 16: 5, 31: 7}, 4.5)
    assert ranges is not None and ranges.when_s == 4.5
    assert ranges.directions_rad == pytest.approx((cmath.phase(at),))
    assert ranges.distances_m == pytest.approx((abs(at) / 1000.0,))


def test_what_the_sonars_state_of_themselves() -> None:
    ranges = p2os.build_ranges({0: 5000, 3: 65535}, 0.0)
    assert ranges is not None and ranges.distances_m == (None, None)
    assert ranges.directions_rad == pytest.approx((math.pi / 2, math.radians(10.0)))
    assert (ranges.sigma_m, ranges.max_range_m) == (0.02, 5.0)
    assert ranges.half_beam_rad == pytest.approx(math.radians(12.5))
    assert p2os.build_ranges({16: 100}, 0.0) is None


SEGMENTS = (52.0, 19.0, 0.0, -19.0, -52.0)


@given(st.integers(0, 31), st.integers(0, 31), st.booleans(), st.booleans())
def test_a_touch_is_in_the_middle_of_the_pressed_segments(front: int, rear: int, stalled: bool, turning: bool) -> None:
    """And as uncertain as a segment, of 40 degrees, and the way to the outermost pressed one."""
    status = p2os.Status(False, 0, 0, 0, 0, 0, stalled, True, front, rear)
    contact = p2os.find_contact(status, 7.0, turning=turning)
    pressed = [angle + back for back, bits in ((0.0, front), (180.0, rear)) for at, angle in enumerate(SEGMENTS)
               if bits & 1 << at]
    if not pressed:
        assert (contact is None) == (not stalled)
        if contact is not None:
            assert (contact.by, contact.direction_rad, contact.when_s) == ("stall", 0.0, 7.0)
            assert contact.sigma_rad == (AROUND_SIGMA_RAD if turning else AHEAD_SIGMA_RAD)
        return
    assert contact is not None and (contact.by, contact.when_s) == ("bumper", 7.0)
    middle = sum(cmath.exp(1j * math.radians(angle)) for angle in pressed)
    if abs(middle) > 1e-9:
        assert cmath.phase(middle * cmath.exp(-1j * contact.direction_rad)) == pytest.approx(0.0, abs=1e-6)
    apart = [abs(cmath.phase(cmath.exp(1j * (math.radians(angle) - contact.direction_rad)))) for angle in pressed]
    assert contact.sigma_rad == pytest.approx(math.radians(40.0) / math.sqrt(12.0) + max(apart), abs=1e-6)


@pytest.mark.parametrize(("bumps", "direction_deg", "width_deg"), [(1, -45.0, 90.0), (2, 45.0, 90.0), (3, 0.0, 30.0),
                                                                   (5, -45.0, 90.0), (14, 45.0, 90.0)])
def test_the_creates_bumper_has_two_halves(bumps: int, direction_deg: float, width_deg: float) -> None:
    contact = create2.find_contact(bumps, 3.0)
    assert (contact.by, contact.when_s) == ("bumper", 3.0)
    assert math.degrees(contact.direction_rad) == pytest.approx(direction_deg)
    assert math.degrees(contact.sigma_rad) == pytest.approx(width_deg / math.sqrt(12.0))


@given(st.lists(st.integers(0, 4095), min_size=6, max_size=6))
def test_the_light_bumpers_signals_fade_to_a_third_in_five_centimetres(signals: list[int]) -> None:
    """From the rim, at 0.17 m, on; exponentially; below 20 they are noise."""
    ranges = create2.build_ranges(signals, 2.0)
    assert ranges.when_s == 2.0 and np.degrees(ranges.directions_rad) == pytest.approx([65, 38, 13, -13, -38, -65])
    for signal, distance in zip(signals, ranges.distances_m, strict=True):
        assert (distance is None) == (signal < 20)
        assert distance is None or 4095.0 * math.exp(-(distance - 0.17) / 0.05) == pytest.approx(signal)
        assert distance is None or distance <= ranges.max_range_m + 1e-12
    assert ranges.sigma_m == pytest.approx(0.05 * math.log(2.0))
    assert ranges.half_beam_rad == pytest.approx(math.radians(12.5))
    assert create2.build_ranges([20] * 6, 0.0).distances_m[0] == pytest.approx(ranges.max_range_m)


def stream(words: tuple[int, int, int, int], mode: int, bumps: int, lights: tuple[int, ...]) -> bytes:
    """A frame of the stream by the manual: packet number and value, one after the other, so that all sums to zero."""
    body = bytes([35, mode, 7, bumps])
    body += b"".join(bytes([41 + at]) + (word % 65536).to_bytes(2, "big") for at, word in enumerate(words))
    body += b"".join(bytes([46 + at]) + light.to_bytes(2, "big") for at, light in enumerate(lights))
    frame = bytes([19, len(body)]) + body
    return frame + bytes([-sum(frame) % 256])


@given(
    st.tuples(st.integers(-500, 500), st.integers(-500, 500), st.integers(0, 65535), st.integers(0, 65535)),
    st.integers(0, 255), st.integers(0, 255), st.lists(st.integers(0, 4200), min_size=6, max_size=6), st.booleans(),
)
def test_each_field_of_the_creates_stream(
    words: tuple[int, int, int, int], mode: int, bumps: int, lights: list[int], with_lights: bool
) -> None:
    told = tuple(lights) if with_lights else ()
    report = create2.decode(stream(words, mode, bumps, told))
    possible = mode <= 3 and all(light <= 4095 for light in told)
    assert report == (create2.Report(mode, bumps, *words, told) if possible else None)


@given(st.integers(0, 36), st.integers(1, 255), st.booleans())
def test_a_changed_byte_of_the_stream_is_noticed(at: int, change: int, with_lights: bool) -> None:
    frame = bytearray(stream((1, 2, 3, 4), 2, 0, (5, 6, 7, 8, 9, 10) if with_lights else ()))
    frame[at % len(frame)] ^= change
    assert create2.decode(bytes(frame)) is None


def test_the_creates_decoder_goes_on_behind_each_frame_and_counts_what_is_none() -> None:
    good, lit = stream((1, 2, 3, 4), 2, 0, ()), stream((5, 6, 7, 8), 2, 0, (9,) * 6)
    decoder = create2.CreateDecoder()
    bad = good[:-1] + bytes([good[-1] ^ 1])
    pieces = (good[:7], good[7:] + lit + b"\x13\x05", bad, lit[:3])
    heard = [report.right_wanted for piece in pieces for report in decoder.feed(piece)]
    assert heard == [1, 5] and decoder.rejected == 2 + bad[1:].count(19)
    decoder.clear()
    assert list(decoder.feed(lit[3:])) == [] and [r.right_wanted for r in decoder.feed(good)] == [1]


@pytest.mark.parametrize(("said", "expected"), [
    (create2.drive(200, -200), "0000000091 00c8 ff38"), (create2.safe(), "0000000083"),
    (create2.stream(), "0000000094 06 23 07 29 2a 2b 2c 96 01"),
    (create2.wake(), "0000000080 0000000094 06 23 07 29 2a 2b 2c 96 01"),
    (create2.wake(with_lights=True), "0000000080 0000000094 0c 23 07 29 2a 2b 2c 2e 2f 30 31 32 33 96 01"),
])
def test_the_creates_commands_by_hand(said: bytes, expected: str) -> None:
    assert said == bytes.fromhex(expected)


@given(st.integers(-600, 600))
def test_which_speeds_may_be_sent(speed: int) -> None:
    """None of whose two bytes could be taken for an opcode, and within 500 mm/s."""
    high, low = speed % 65536 >> 8, speed % 256
    allowed = abs(speed) <= 500 and not any(byte == 7 or 128 <= byte <= 173 for byte in (high, low))
    assert create2.is_permitted(speed) == allowed
    if not allowed:
        with pytest.raises(ValueError, match="500 mm/s"):
            create2.drive(0, speed)


@given(st.integers(1, 500), st.none() | st.floats(0.001, 0.6))
def test_the_fastest_speed_that_may_be_sent_is_taken(fast: int, most: float | None) -> None:
    speed = create2.find_speed(fast, most)
    if most is None:
        assert speed == fast
        return
    able = [s for s in range(1, fast + 1) if s <= max(1.0, 1000.0 * most)
            and create2.is_permitted(s) and create2.is_permitted(-s)]
    assert speed == max(able)


def test_the_speeds_of_a_create_may_be_sent() -> None:
    speeds = (create2.FAST, create2.SLOW, create2.FAST_TURN, create2.SLOW_TURN)
    assert speeds == (200, 57, 79, 29)
    assert all(create2.is_permitted(sign * speed) for speed in speeds for sign in (1, -1))
