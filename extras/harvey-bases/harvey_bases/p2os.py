"""A Pioneer, or another base that speaks P2OS, AROS or ARCOS: the packets, the senses, the driver.

P2OS numbers no command, so what is said twice is done twice if it is relative. Turns are therefore asked for as
absolute headings (HEAD, not DHEAD), which may be repeated freely; a move (MOVE, which unlike VEL ends by itself) is
asked for once, watched on the base's own odometry, and asked for again, by what is left of it, only when the base
stands and has not got on. A base that does not hear from us for two seconds stops by itself, but takes its motion up
again with the next packet: so after any doubt the first thing said is to stop.

Packets: ``FA FB COUNT COMMAND [TYPE ARGUMENT] CHECKSUM``: COUNT is of the bytes behind it; an argument is two bytes,
low byte first, of type 3B, or of type 1B with the amount of a negative number; the checksum is two bytes, high byte
first. From the base come echoes of SYNC and server information packets. Source: ActivMedia's Pioneer 2 / PeopleBot
manual (2001), "Client commands" and "Server information packets", and the Pioneer 3 manual's tables of them.

Senses: the sonars' places are those of the parameter files that come with ARIA (p3dx-sh). The bumper's segments are
taken to be numbered from the left, as the front sonars are.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from harvey.hardware.drivers.base_driver import LOOK_S, BaseKind, BytePipe, Driver
from harvey_bases.counters import step
from world_models.entries import Contact, MotionReport, MotorCommand, Odometry, Ranges
from world_models.frames import Pose2, wrap_angle

HEADER = b"\xfa\xfb"
MAX_LENGTH = 200
"""The largest COUNT that either side may send."""

SYNC0, SYNC1, SYNC2 = 0, 1, 2
PULSE, OPEN, CLOSE, ENABLE, SETA, SETV, SETO, MOVE = 0, 1, 2, 4, 5, 6, 7, 8
SETRV, VEL, HEAD, DHEAD, ENCODER, RVEL, SETRA, SONAR, STOP, ESTOP = 10, 11, 12, 13, 19, 21, 23, 28, 29, 55


@dataclass(frozen=True, slots=True)
class Status:
    """A standard server information packet, in the base's own units; bumpers as ARIA and Player read them.

    Attributes:
        moving: whether the motors run.
        x, y: 15 bits each, which wrap.
        heading: 4096 to the turn, 16 bits.
        left, right: wheel velocities.
        stalled: whether a motor is.
        enabled: whether the motors may run.
        front, rear: pressed segments of the bumpers, a bit each, from the left.
        sonars: (number, range) of those that have heard since the last packet.
    """

    moving: bool
    x: int
    y: int
    heading: int
    left: int
    right: int
    stalled: bool
    enabled: bool
    front: int = 0
    rear: int = 0
    sonars: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True, slots=True)
class Counts:
    """An encoder packet: the counts of both wheels, 32 bits signed."""

    left: int
    right: int


@dataclass(frozen=True, slots=True)
class Echo:
    """The base's answer to SYNC0, SYNC1 or SYNC2; the last one tells who it is.

    Attributes:
        number: 0, 1 or 2.
        names: name, class and subclass, with SYNC2.
    """

    number: int
    names: tuple[str, ...] = ()


def encode(command: int, argument: int | None = None) -> bytes:
    """The packet of a command.

    Raises:
        ValueError: the argument is not within 16 bits.
    """
    if argument is None:
        return _packet(bytes([command]))
    if not -65535 <= argument <= 65535:
        raise ValueError(f"expected an argument of 16 bits, got {argument}")
    return _packet(bytes([command, 0x3B if argument >= 0 else 0x1B]) + abs(argument).to_bytes(2, "little"))


def checksum(content: bytes) -> int:
    """Of the bytes between COUNT and checksum: the sum of their pairs, high byte first; a single last one is xored."""
    total = sum(int(byte) for byte in content[0:len(content) - 1:2]) * 256 + sum(int(byte) for byte in content[1::2])
    return (total & 0xFFFF) ^ content[-1] if len(content) % 2 else total & 0xFFFF


def _packet(content: bytes) -> bytes:
    return HEADER + bytes([len(content) + 2]) + content + checksum(content).to_bytes(2, "big")


class P2osDecoder:
    """Packets out of whatever bytes come; what is none is passed over, byte by byte, and counted.

    Attributes:
        rejected: headers that no packet followed.
    """

    def __init__(self) -> None:
        self._rest = b""
        self.rejected = 0

    def feed(self, data: bytes) -> Iterator[Status | Counts | Echo]:
        """What is complete with these bytes; packets of other kinds are passed over."""
        self._rest += data
        while (content := self._next()) is not None:
            meaning = understood(content)
            if meaning is not None:
                yield meaning

    def clear(self) -> None:
        """Forget a packet that was begun."""
        self._rest = b""

    def _next(self) -> bytes | None:
        """The content of the next packet that is one."""
        while (start := self._rest.find(HEADER)) >= 0:
            rest = self._rest = self._rest[start:]
            if len(rest) < 3:
                return None
            end = 3 + rest[2]
            if 3 <= rest[2] <= MAX_LENGTH:
                if len(rest) < end:
                    return None
                if checksum(rest[3:end - 2]) == int.from_bytes(rest[end - 2:end], "big"):
                    self._rest = rest[end:]
                    return rest[3:end - 2]
            self.rejected += 1
            self._rest = rest[1:]
        self._rest = self._rest[-1:] if self._rest.endswith(HEADER[:1]) else b""
        return None


def understood(content: bytes) -> Status | Counts | Echo | None:
    """What the content of a packet from the base says; None where it is of another kind."""
    kind = content[0]
    if kind in (SYNC0, SYNC1) and len(content) == 1:
        return Echo(kind)
    if kind == SYNC2:
        names = content[1:].split(b"\0")
        return Echo(kind, tuple(name.decode("ascii", "replace") for name in names[:3]))
    if kind in (0x32, 0x33) and len(content) >= 20:
        return _status(content)
    if kind == 0x90 and len(content) >= 9:
        left, right = (int.from_bytes(content[i:i + 4], "little", signed=True) for i in (1, 5))
        return Counts(left, right)
    return None


def _status(content: bytes) -> Status:
    ends = min(20 + 3 * content[19], len(content) - 2)
    x, y, heading, left, right = (content[i] | content[i + 1] << 8 for i in range(1, 11, 2))
    return Status(
        moving=content[0] == 0x33, x=x & 0x7FFF, y=y & 0x7FFF, heading=heading,
        left=left - (left >> 15 << 16), right=right - (right >> 15 << 16),
        stalled=bool((content[12] | content[13]) & 1), enabled=bool(content[16] & 1),
        front=content[13] >> 1, rear=content[12] >> 1,
        sonars=tuple((content[i], content[i + 1] | content[i + 2] << 8) for i in range(20, ends, 3)),
    )


SONARS = (
    (69, 136, 90), (114, 119, 50), (148, 78, 30), (166, 27, 10), (166, -27, -10), (148, -78, -30), (114, -119, -50),
    (69, -136, -90), (-157, -136, -90), (-203, -119, -130), (-237, -78, -150), (-255, -27, -170), (-255, 27, 170),
    (-237, 78, 150), (-203, 119, 130), (-157, 136, 90))
"""Where each sonar is [mm] and faces [degrees], in the robot's frame."""

BUMPERS = (52, 19, 0, -19, -52)
"""Directions of the front segments [degrees]; those of the rear are opposite."""

SEGMENT_SIGMA_RAD = math.radians(40.0) / math.sqrt(12.0)
"""A touch may be anywhere on a segment, of at most this angle."""

REACH_MM = 5000
"""A sonar that tells as much or more has heard no echo."""

SONAR_SIGMA_M, HALF_BEAM_RAD = 0.02, math.radians(12.5)


def find_contact(status: Status, when_s: float, *, turning: bool) -> Contact | None:
    """What a status tells of a touch: the pressed segments, or else held wheels; None where neither is told."""
    pressed = [math.radians(angle) for at, angle in enumerate(BUMPERS) if status.front >> at & 1]
    pressed += [math.radians(angle) + math.pi for at, angle in enumerate(BUMPERS) if status.rear >> at & 1]
    if not pressed:
        return Contact.of_stall(when_s, turning=turning) if status.stalled else None
    ahead, left = math.fsum(map(math.cos, pressed)), math.fsum(map(math.sin, pressed))
    middle = math.atan2(left, ahead)
    widest = max(abs(math.remainder(angle - middle, math.tau)) for angle in pressed)
    return Contact("bumper", middle, SEGMENT_SIGMA_RAD + widest, when_s)


def build_ranges(heard: Mapping[int, int], when_s: float) -> Ranges | None:
    """The ranges of the sonars that have heard, by number [mm]; None where none has."""
    numbers = sorted(number for number in heard if number < len(SONARS))
    if not numbers:
        return None
    directions, distances = zip(*(_echo(*SONARS[number], heard[number]) for number in numbers), strict=True)
    return Ranges(directions, distances, SONAR_SIGMA_M, HALF_BEAM_RAD, REACH_MM / 1000.0, when_s)


def _echo(x_mm: int, y_mm: int, axis_deg: int, range_mm: int) -> tuple[float, float | None]:
    """Direction and distance from the robot's axis; without an echo the sonar's own direction."""
    axis_rad = math.radians(axis_deg)
    if range_mm >= REACH_MM:
        return axis_rad, None
    x, y = x_mm + range_mm * math.cos(axis_rad), y_mm + range_mm * math.sin(axis_rad)
    return math.atan2(y, x), math.hypot(x, y) / 1000.0


BAUD = 9600
MM_PER_UNIT: Mapping[str, float] = {"p3dx": 0.485}
"""Of subclasses whose odometry does not count millimetres. Source: the parameter files that come with ARIA."""

UNIT_RAD = 2.0 * math.pi / 4096.0
"""Of headings in the base's status."""

PULSE_S = 0.4
"""A base that moves hears from us at least this often; its watchdog waits for two seconds."""

PATIENCE_S = 0.7
"""Silence of the base that is taken for a fault; it tells of itself every 0.1 s."""

TURN_PART_RAD = 2.0
"""A turn of more goes in parts, because the base turns to a heading the short way."""

RING_S = 1.5
"""So long the sonars are waited for, until each has heard."""

MOVE_PART_M = 4.0
STRAY_M, STRAY_RAD = 0.04, math.radians(6.0)
"""A motion that leaves what was asked for by more is none of ours."""

MAX_OFF_M, MAX_OFF_RAD = 0.01, math.radians(0.9)
"""Good enough: what was really done is reported anyway. Headings are whole degrees."""


class _MotionProgress:
    """What has been done of a command, by the base's odometry.

    Attributes:
        heading_rad: that it should have by now.
        gone_m: how far it has gone along that heading.
    """

    def __init__(self, here: Pose2, now_s: float) -> None:
        """``here``: where the command begins, its heading counted on beyond a turn, as all that follow."""
        self._began_s, self._from_rad = now_s, here.heading_rad
        self._from, self.heading_rad = here, here.heading_rad
        self.gone_m, self._held = 0.0, 0

    def end_turn(self, here: Pose2) -> None:
        """The turn is over; moves go along the heading that it came to."""
        self._from, self.heading_rad = here, here.heading_rad

    def is_held(self, status: Status) -> bool:
        """Whether this status too, the fifth in a row, tells of something that holds it."""
        self._held = self._held + 1 if status.stalled or status.front or status.rear else 0
        return self._held >= 5

    def done(self, here: Pose2, now_s: float) -> MotionReport:
        """What has been done by now."""
        return MotionReport(here.heading_rad - self._from_rad, self.gone_m, now_s - self._began_s, now_s)

    def go_on(self, here: Pose2, *, moving: float) -> None:
        """It has come this far."""
        self.gone_m = self._along(here) if moving else 0.0

    def find_stray(self, here: Pose2, *, turning: float, moving: float) -> str:
        """What it does that was not asked for; "" where nothing."""
        off = here.heading_rad - self.heading_rad
        if turning and math.hypot(here.x_m - self._from.x_m, here.y_m - self._from.y_m) > STRAY_M:
            return "it moved while it was to turn"
        if turning and not -abs(turning) - STRAY_RAD < math.copysign(1.0, turning) * off < STRAY_RAD:
            return "it turned beyond what it was told to"
        if moving and abs(off) > STRAY_RAD:
            return "it turned while it was to move"
        if moving and not -STRAY_M < self._along(here) < moving + STRAY_M:
            return "it moved beyond what it was told to"
        return ""

    def _along(self, here: Pose2) -> float:
        dx, dy = here.x_m - self._from.x_m, here.y_m - self._from.y_m
        return dx * math.cos(self.heading_rad) + dy * math.sin(self.heading_rad)


class P2osBase(Driver):
    """A base over P2OS."""

    def __init__(
        self, link: BytePipe, *, mm_per_unit: float | None = None, speed_m_per_s: float = 0.3,
        turn_speed_rad_per_s: float = math.radians(40.0),
    ) -> None:
        """``mm_per_unit`` is what the base's odometry counts in; by default what is known of its subclass."""
        super().__init__(link)
        self._decoder = P2osDecoder()
        self._mm = mm_per_unit
        self._speed, self._turn_speed = speed_m_per_s, turn_speed_rad_per_s
        self._names: tuple[str, ...] = ()
        self._last: Status | None = None
        self._doubts = 0
        self._sonars_wanted = False
        self._heard_s = self._said_s = -math.inf
        self._pose = Pose2(0.0, 0.0, 0.0)

    def _carried_out(self, command: MotorCommand) -> MotionReport:
        if self._stop_asked.is_set():
            raise self._fault("stopped", "a stop was asked for", stopped=True)
        self._halt()
        speed = self._speed if command.speed_m_per_s is None else min(self._speed, command.speed_m_per_s)
        self._prepare(speed)
        way = _MotionProgress(self._pose, self._link.now())
        self._so_far = way.done(self._pose, self._link.now())
        for part in _parts(command.turn_rad, TURN_PART_RAD):
            self._turn_by(way, part)
        way.end_turn(self._pose)
        for part in _parts(command.move_m, MOVE_PART_M):
            self._move_by(way, part, speed)
        return way.done(self._pose, self._link.now())

    def _halt(self) -> None:
        """ESTOP until it is seen to stand: it forgets what it was told, and does not take it up again."""
        self._open()
        quiet = 0
        for status in self._statuses(encode(ESTOP), 0.1, self._link.now() + 4.0):
            quiet = quiet + 1 if not (status.moving or status.left or status.right) else 0
            if quiet >= 2:
                return
        raise self._fault("nonsense", "told to stop, it goes on")

    def _read_odometry(self) -> Odometry:
        self._open()
        for status in self._statuses(encode(PULSE), PULSE_S, self._link.now() + 2.0 * PATIENCE_S):
            if status.moving:
                self._halt()
                raise self._fault("nonsense", "it was moving, and nobody had asked for that", stopped=True)
            return self._place()
        raise self._fault("silent", "no status")

    def _read_ranges(self) -> Ranges | None:
        """Each sonar's next range; the base fires them in turn."""
        self._open()
        self._sonars_wanted = True
        heard: dict[int, int] = {}
        for status in self._statuses(encode(SONAR, 1), PULSE_S, self._link.now() + RING_S):
            if any(number in heard for number, _ in status.sonars):
                break
            heard.update(status.sonars)
        return build_ranges(heard, self._link.now())

    def _after_reopening(self) -> None:
        self._decoder.clear()
        self._heard_s = -math.inf

    def _place(self) -> Odometry:
        return Odometry(self._pose.x_m, self._pose.y_m, wrap_angle(self._pose.heading_rad), self._link.now())

    def _prepare(self, speed_m_per_s: float) -> None:
        """Settings, said again before each command, since one may have been lost; that the motors run is seen."""
        settings = (encode(SETV, max(1, round(1000 * speed_m_per_s))),
                    encode(SETRV, round(math.degrees(self._turn_speed))), encode(SONAR, int(self._sonars_wanted)))
        self._link.write(b"".join(settings))
        for status in self._statuses(encode(ENABLE, 1), 0.1, self._link.now() + 2.0):
            if status.enabled:
                return
        raise self._fault("refused", "its motors cannot be enabled; is the emergency button pressed?", stopped=True)

    def _turn_by(self, way: _MotionProgress, turn_rad: float) -> None:
        """To an absolute heading, said again and again until it is there."""
        last = self._last
        offset_rad = self._pose.heading_rad - (UNIT_RAD * last.heading if last is not None else 0.0)
        degrees = round(math.degrees(way.heading_rad + turn_rad - offset_rad))
        goal_rad = math.radians(degrees) + offset_rad
        if abs(turn_rad) < math.radians(0.5):
            return
        way.heading_rad = goal_rad
        idle, ends_s = 0, self._link.now() + 2.0 * abs(turn_rad) / self._turn_speed + 4.0
        for status in self._statuses(encode(HEAD, degrees % 360), PULSE_S, ends_s):
            self._watch(way, status, turning=turn_rad)
            there = abs(goal_rad - self._pose.heading_rad) <= MAX_OFF_RAD
            idle = idle + 1 if there and not status.moving else 0
            if idle >= 2:
                return
        self._gave_up("turn")

    def _move_by(self, way: _MotionProgress, move_m: float, speed_m_per_s: float) -> None:
        """What is left of the move is asked for again whenever the base stands short of its end."""
        goal_m, before_m, tries = way.gone_m + move_m, way.gone_m, 0
        ends_s = self._link.now() + 2.0 * move_m / speed_m_per_s + 6.0
        while (left_m := goal_m - way.gone_m) > MAX_OFF_M or tries == 0:
            tries = tries + 1 if way.gone_m - before_m < 0.005 else 1
            if tries > 5 or self._link.now() > ends_s:
                self._gave_up("move")
            before_m = way.gone_m
            if round(1000 * left_m) == 0:
                return
            self._link.write(encode(MOVE, round(1000 * left_m)))
            idle = 0
            for status in self._statuses(encode(PULSE), PULSE_S, ends_s):
                self._watch(way, status, moving=goal_m)
                idle = idle + 1 if not status.moving else 0
                if idle >= (2 if goal_m - way.gone_m <= MAX_OFF_M else 4):
                    break

    def _gave_up(self, what: str) -> None:
        stalled = self._last is not None and self._last.stalled
        if self._last is not None:
            self._contact = find_contact(self._last, self._link.now(), turning=what == "turn")
        self._halt()
        raise self._fault("stalled", f"the {what} came to nothing" + (": a motor is held" if stalled else ""),
                          stopped=True)

    def _watch(self, way: _MotionProgress, status: Status, *, turning: float = 0.0, moving: float = 0.0) -> None:
        """Take note of a status, and see that the motion is the one that was asked for."""
        if way.is_held(status):
            self._gave_up("turn" if turning else "move")
        way.go_on(self._pose, moving=moving)
        self._so_far = way.done(self._pose, self._link.now())
        if stray := way.find_stray(self._pose, turning=turning, moving=moving):
            self._halt()
            raise self._fault("nonsense", stray, stopped=True)

    def _open(self) -> None:
        """Make sure of the connection. A base that already talks is in one, but may not have told who it is."""
        if self._names and self._link.now() - self._heard_s < 30.0:
            return
        ends_s = self._link.now() + 8.0
        expected = SYNC0
        while self._link.now() < ends_s:
            self._link.write(encode(ESTOP) + encode(expected))  # the first packet may wake a motion: SYNC0 is PULSE too
            answer = self._first_answer(0.25)
            if isinstance(answer, Status) and self._names:
                return
            if isinstance(answer, Status):
                self._link.write(encode(ESTOP) + encode(CLOSE))
                expected = SYNC0
            elif answer is None or answer.number != expected:
                expected = SYNC0
            elif expected == SYNC2:
                self._know(answer.names)
                self._link.write(encode(OPEN) + encode(ESTOP))
                return
            else:
                expected = SYNC1 if expected == SYNC0 else SYNC2
        rejected = self._decoder.rejected
        noise = f", only noise ({rejected} packets so far)" if rejected else ""
        raise self._fault("silent", "no answer to SYNC" + noise)

    def _first_answer(self, within_s: float) -> Status | Echo | None:
        ends_s = self._link.now() + within_s
        while (left_s := ends_s - self._link.now()) > 0:
            for packet in self._decoder.feed(self._link.read(left_s)):
                if isinstance(packet, Status):
                    self._take(packet)
                    return packet
                if isinstance(packet, Echo):
                    return packet
        return None

    def _know(self, names: tuple[str, ...]) -> None:
        subclass = names[2] if len(names) > 2 else ""
        if self._mm is None and not subclass.endswith("-sh") and subclass not in MM_PER_UNIT:
            raise self._fault("refused", f"its subclass is {subclass!r}, whose odometry is not known; say mm_per_unit",
                              stopped=True)
        self._mm = self._mm or MM_PER_UNIT.get(subclass, 1.0)
        self._names, self._last = names, None
        self._heard_s = self._link.now()

    def _statuses(self, saying: bytes, every_s: float, ends_s: float) -> Iterator[Status]:
        """What the base tells from now on, while something is said to it at once and then every so often."""
        self._heard_s, self._said_s = self._link.now(), -math.inf
        for _ in self._decoder.feed(self._link.read(0.0)):
            pass  # what it told before now is old
        while (now_s := self._link.now()) < ends_s:
            if now_s - self._said_s >= every_s:
                self._link.write(saying)
                self._said_s = now_s
            for packet in self._decoder.feed(self._link.read(LOOK_S)):
                if isinstance(packet, Status) and self._take(packet):
                    yield packet
            if self._stop_asked.is_set() and saying != encode(ESTOP):
                self._halt()
                raise self._fault("stopped", "a stop was asked for", stopped=True)
            if self._link.now() - self._heard_s > PATIENCE_S:
                self._give_up()

    def _give_up(self) -> None:
        """Nothing is heard: say stop, in case that we still are, and greet it again the next time."""
        self._link.write(3 * encode(ESTOP))
        self._heard_s = -math.inf
        raise self._fault("silent", f"nothing heard for {PATIENCE_S:g} s")

    def _take(self, status: Status) -> bool:
        """Count on from the last status.

        A jump that no wheel makes is doubted until it is told three times; then the status before it was the wrong one,
        which the weak checksum had let through, and going back there counts too.
        """
        last, self._last = self._last, self._last if self._last is not None else status
        now_s = self._link.now()
        if last is None:
            self._heard_s = now_s
            return True
        mm = self._mm or 1.0
        dx, dy = (mm / 1000.0 * step(a, b, 15) for a, b in ((last.x, status.x), (last.y, status.y)))
        turn = UNIT_RAD * step(last.heading, status.heading, 12)
        since_s = now_s - self._heard_s
        doubtful = math.hypot(dx, dy) > 0.1 + since_s or abs(turn) > 0.3 + 2.0 * since_s
        self._doubts = self._doubts + 1 if doubtful else 0
        if 0 < self._doubts < 3:
            return False
        here = self._pose
        offset_rad = here.heading_rad - UNIT_RAD * last.heading  # its count may have begun at another heading
        c, s = math.cos(offset_rad), math.sin(offset_rad)
        self._pose = Pose2(here.x_m + c * dx - s * dy, here.y_m + s * dx + c * dy, here.heading_rad + turn)
        self._last, self._heard_s, self._doubts = status, now_s, 0
        return True


def _parts(whole: float, most: float) -> list[float]:
    count = math.ceil(abs(whole) / most)
    return [whole / count] * count if count else []


KIND = BaseKind("p2os", BAUD, P2osBase, "its own, 2 s")
