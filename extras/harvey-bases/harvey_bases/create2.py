"""An iRobot Create 2, or a Roomba of the 600 series, over its Open Interface: the bytes, the senses, the driver.

The base has no watchdog, its commands have no checksum, and its encoders wrap every 29 m. So the driver closes the loop
itself: every 15 ms the base says which wheel speeds it believes it was told, and how far its wheels have counted; what
does not agree is said again at once, and what does not come to agree is stopped.

Bytes: an opcode says how many bytes follow it. So we put zeros, which are no opcode, before each command, to complete
whatever a lost byte left open; and only use speeds of which no byte is an opcode, so that nothing we say can be taken
for a command that we did not give. The stream back has a checksum of eight bits. Source: iRobot Create 2 Open Interface
Specification (2018): Drive Direct 145, Stream 148, packets 7, 35, 41-44.

Senses: the manual gives no law of the light bumper's signals: they fall with distance, and with how well a thing
reflects. We take them to fall exponentially, and count a factor of two in reflection as uncertainty of the distance.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from harvey.hardware.drivers.base_driver import LOOK_S, BaseKind, BytePipe, Driver, FaultKind
from harvey_bases.counters import step
from world_models.entries import Contact, MotionReport, MotorCommand, Odometry, Ranges
from world_models.frames import Pose2, wrap_angle

START, SAFE, DRIVE_DIRECT, STREAM, STREAM_RESUME = 128, 131, 145, 148, 150
PAD = bytes(4)
OPCODES = frozenset({7, *range(128, 174)})

BUMPS_AND_DROPS, MODE, RIGHT_WANTED, LEFT_WANTED, LEFT_COUNT, RIGHT_COUNT = 7, 35, 41, 42, 43, 44
PACKETS = (MODE, BUMPS_AND_DROPS, RIGHT_WANTED, LEFT_WANTED, LEFT_COUNT, RIGHT_COUNT)
"""What we ask the stream to hold, in this order."""

LIGHT_PACKETS = (46, 47, 48, 49, 50, 51)
"""Packets of the light bumper, from the left; the stream holds them behind the others where they are wanted."""

MAX_SIGNAL = 4095
SAFE_MODE = 2
HEADER = 19
LENGTH = 16
LENGTH_WITH_LIGHTS = LENGTH + 3 * len(LIGHT_PACKETS)
"""Of what stands between the length byte and the checksum, for these packets."""


@dataclass(frozen=True, slots=True)
class Report:
    """One frame of the stream.

    Attributes:
        mode: 0 off, 1 passive, 2 safe, 3 full.
        bumps: bit 0 right bumper, 1 left bumper, 2 right wheel dropped, 3 left wheel dropped.
        right_wanted, left_wanted: velocities [mm/s] as the base understood them.
        left_count, right_count: 16 bits that wrap.
        lights: signals of the light bumper, 0 to 4095, from the left; empty where they are not streamed.
    """

    mode: int
    bumps: int
    right_wanted: int
    left_wanted: int
    left_count: int
    right_count: int
    lights: tuple[int, ...] = ()


def drive(right_mm_per_s: int, left_mm_per_s: int) -> bytes:
    """Drive Direct.

    Raises:
        ValueError: a speed is beyond 500 mm/s, or a byte of it could be taken for an opcode.
    """
    for speed in (right_mm_per_s, left_mm_per_s):
        if not is_permitted(speed):
            raise ValueError(f"expected a speed within 500 mm/s without a byte that is an opcode, got {speed}")
    speeds = b"".join(speed.to_bytes(2, "big", signed=True) for speed in (right_mm_per_s, left_mm_per_s))
    return PAD + bytes([DRIVE_DIRECT]) + speeds


def is_permitted(speed: int) -> bool:
    """Whether a speed [mm/s] may be sent."""
    return abs(speed) <= 500 and OPCODES.isdisjoint(speed.to_bytes(2, "big", signed=True))


def wake(*, with_lights: bool = False) -> bytes:
    """Start, and stream to us what we want to know."""
    return PAD + bytes([START]) + stream(with_lights=with_lights)


def stream(*, with_lights: bool = False) -> bytes:
    """Ask for the stream."""
    packets = PACKETS + LIGHT_PACKETS if with_lights else PACKETS
    return PAD + bytes([STREAM, len(packets), *packets]) + bytes([STREAM_RESUME, 1])


def safe() -> bytes:
    """Safe mode: it obeys, but stops by itself at a cliff, a dropped wheel or a charger."""
    return PAD + bytes([SAFE])


class CreateDecoder:
    """Reports out of whatever bytes come; what is none is passed over, byte by byte, and counted.

    Attributes:
        rejected: headers that no report followed.
    """

    def __init__(self) -> None:
        self._rest = b""
        self.rejected = 0

    def feed(self, data: bytes) -> Iterator[Report]:
        """The reports that are complete with these bytes."""
        self._rest += data
        while (start := self._rest.find(HEADER)) >= 0:
            self._rest = self._rest[start:]
            size = 3 + (LENGTH_WITH_LIGHTS if self._rest[1:2] == bytes([LENGTH_WITH_LIGHTS]) else LENGTH)
            if len(self._rest) < size and _may_become(self._rest):
                return
            report = decode(self._rest[:size])
            self._rest = self._rest[1 if report is None else size:]
            if report is None:
                self.rejected += 1
            else:
                yield report
        self._rest = b""

    def clear(self) -> None:
        """Forget a report that was begun."""
        self._rest = b""


def decode(frame: bytes) -> Report | None:
    """The report of one whole frame; None where it is none, or was garbled."""
    sizes = (LENGTH + 3, LENGTH_WITH_LIGHTS + 3)
    if len(frame) not in sizes or frame[1] != len(frame) - 3 or not _may_become(frame):
        return None
    if sum(int(byte) for byte in frame) % 256 != 0:
        return None
    lights = tuple(int.from_bytes(frame[i:i + 2], "big") for i in range(LENGTH + 3, len(frame) - 1, 3))
    if any(signal > MAX_SIGNAL for signal in lights):
        return None
    words = [int.from_bytes(frame[i:i + 2], "big", signed=True) for i in (7, 10, 13, 16)]
    mode, bumps = frame[3], frame[5]
    if mode > 3:
        return None
    return Report(mode, bumps, words[0], words[1], words[2] & 0xFFFF, words[3] & 0xFFFF, lights)


def _may_become(frame: bytes) -> bool:
    """Whether header, length and packet numbers are where they belong, as far as they have come."""
    fixed = {0: HEADER, 2: MODE, 4: BUMPS_AND_DROPS, 6: RIGHT_WANTED, 9: LEFT_WANTED, 12: LEFT_COUNT, 15: RIGHT_COUNT}
    if len(frame) > 1 and frame[1] == LENGTH_WITH_LIGHTS:
        fixed |= {LENGTH + 2 + 3 * at: number for at, number in enumerate(LIGHT_PACKETS)}
    elif len(frame) > 1 and frame[1] != LENGTH:
        return False
    return all(frame[at] == value for at, value in fixed.items() if at < len(frame))


RIGHT, LEFT = 1, 2
HALF_SIGMA_RAD = math.pi / 2.0 / math.sqrt(12.0)
"""A touch of one half is anywhere on its 90 degrees."""

BOTH_SIGMA_RAD = math.radians(30.0) / math.sqrt(12.0)
"""Both halves are pressed by a touch near the middle."""

LIGHT_ANGLES = (65, 38, 13, -13, -38, -65)
"""Directions of the light bumper's sensors [degrees], from the left; they are on the rim."""

RADIUS_M, FADING_M, FAINTEST = 0.17, 0.05, 20
"""Of the rim; over which distance the signal falls to a third; what is fainter is noise."""

LIGHT_SIGMA_M = FADING_M * math.log(2.0)
LIGHT_HALF_BEAM_RAD = math.radians(12.5)
"""About half of the angle between two of them."""

LIGHT_REACH_M = RADIUS_M + FADING_M * math.log(MAX_SIGNAL / FAINTEST)


def find_contact(bumps: int, when_s: float) -> Contact:
    """What the pressed halves of the bumper tell."""
    if bumps & LEFT and bumps & RIGHT:
        return Contact("bumper", 0.0, BOTH_SIGMA_RAD, when_s)
    return Contact("bumper", math.pi / 4.0 if bumps & LEFT else -math.pi / 4.0, HALF_SIGMA_RAD, when_s)


def build_ranges(lights: Sequence[int], when_s: float) -> Ranges:
    """The ranges of the light bumper's signals, from the left."""
    directions = tuple(math.radians(angle) for angle in LIGHT_ANGLES)
    distances = tuple(
        None if signal < FAINTEST else RADIUS_M - FADING_M * math.log(signal / MAX_SIGNAL) for signal in lights)
    return Ranges(directions, distances, LIGHT_SIGMA_M, LIGHT_HALF_BEAM_RAD, LIGHT_REACH_M, when_s)


class Watchdog:
    """A watchdog for a base that has none: says stop when it is armed and no sign of life came for a while.

    It lives in our process and speaks over our line. It helps when the driving thread hangs; where the whole process
    dies or the cable is cut, nothing of ours can stop a base without a watchdog of its own.

    Attributes:
        struck: how often it did.
    """

    def __init__(self, stop: Callable[[], None], now: Callable[[], float], watchdog_s: float) -> None:
        """``stop`` says it to the base and may raise OSError; it is called from the thread of :meth:`start`."""
        self._stop, self._now, self._watchdog_s = stop, now, watchdog_s
        self._alive_s = math.inf
        self._over = threading.Event()
        self.struck = 0

    def arm(self) -> None:
        """The wheels turn from now on; also the sign of life."""
        self._alive_s = self._now()

    def disarm(self) -> None:
        """The wheels stand."""
        self._alive_s = math.inf

    def check(self) -> None:
        """Strike, if it is time to."""
        if self._now() - self._alive_s > self._watchdog_s:
            self.struck += 1
            try:
                self._stop()
            except OSError:
                return  # the line is gone; the program meets the same fault

    def start(self) -> None:
        """Check from a thread of its own, until :meth:`close`."""
        threading.Thread(target=self._watch, name="guard of the base", daemon=True).start()

    def close(self) -> None:
        """Watch no more."""
        self._over.set()

    def _watch(self) -> None:
        while not self._over.wait(self._watchdog_s / 4.0):
            self.check()


BAUD = 115200
M_PER_COUNT = math.pi * 0.072 / 508.8
AXLE_M = 0.235
WATCHDOG_S = 0.5
"""Ours, for the thread that drives."""

PATIENCE_S = 0.35
"""Silence of the base that is taken for a fault; it reports every 0.015 s."""

REPEAT_S = 0.03
DISAGREES_S = 0.3
"""For so long its idea of the wheel speeds may differ from ours, while we repeat them, until the motion is given up."""

FAST, SLOW, FAST_TURN, SLOW_TURN = 200, 57, 79, 29
"""Wheel speeds [mm/s]; no byte of them, or of their negatives, is an opcode."""

SLOWLY_M = 0.03
"""The last part of a way of the wheels is gone slowly."""

STRAY_M = 0.05
"""Wheels that have gone further than they should by this are not doing what they were told."""

ASKEW_M = 0.02
"""So much may the wheels differ in a move, or agree in a turn."""

ANEW_M = 1.0
"""A jump by so much is a base that was switched off and on."""

STALLED_S = 0.8
ASTRAY = "its wheels did not go as they were told to"


def find_speed(fast: int, most_m_per_s: float | None) -> int:
    """The fastest wheel speed [mm/s] up to ``fast`` that may be sent and is no faster than asked for."""
    if most_m_per_s is None:
        return fast
    most = max(1, min(fast, int(1000.0 * most_m_per_s)))
    return next((speed for speed in range(most, 0, -1) if is_permitted(speed) and is_permitted(-speed)), 1)


Wheels = tuple[float, float]
"""How far the right and the left wheel have gone [m]."""


class _MotionProgress:
    """What has been done of a command, by the wheels' counts.

    Attributes:
        is_turning: whether the part under way is a turn.
    """

    def __init__(self, wheels: Wheels, now_s: float) -> None:
        self._began_s = now_s
        self._from = self._part = self._now = wheels
        self._sign, self.is_turning = 1.0, False
        self._best_m, self._best_s = 0.0, now_s

    def begin(self, wheels: Wheels, now_s: float, sign: float, turning: bool) -> None:
        """A turn or a move begins."""
        self._part = self._now = wheels
        self._sign, self.is_turning = sign, turning
        self._best_m, self._best_s = 0.0, now_s

    def go_on(self, wheels: Wheels, now_s: float) -> MotionReport:
        """The wheels have come this far; what has been done by now."""
        self._now = wheels
        gone_m = self._progress()[0]
        if gone_m > self._best_m:
            self._best_m, self._best_s = gone_m, now_s
        right, left = wheels[0] - self._from[0], wheels[1] - self._from[1]
        move_m = 0.0 if self.is_turning else gone_m
        return MotionReport((right - left) / AXLE_M, move_m, now_s - self._began_s, now_s)

    def to_go_m(self, goal_m: float) -> float:
        """How far each wheel has to go still."""
        return goal_m - self._progress()[0]

    def is_astray(self, goal_m: float) -> bool:
        """Whether the wheels have gone too far, backwards, together in a turn, or apart in a move."""
        gone_m, askew_m = self._progress()
        return not -STRAY_M <= gone_m <= goal_m + STRAY_M or abs(askew_m) > ASKEW_M

    def is_stalled(self, now_s: float) -> bool:
        """Whether the wheels have not got on for too long."""
        return now_s - self._best_s > STALLED_S

    def _progress(self) -> tuple[float, float]:
        """As asked for, and otherwise, since this part began [m of each wheel]."""
        right, left = self._now[0] - self._part[0], self._now[1] - self._part[1]
        apart, together = (right - left) / 2.0, (right + left) / 2.0
        return (self._sign * apart, together) if self.is_turning else (self._sign * together, apart)


class Create2Base(Driver):
    """A base over the Open Interface."""

    def __init__(self, link: BytePipe, *, guarded: bool = False) -> None:
        """``guarded``: a thread stops the base when the driving thread hangs."""
        super().__init__(link)
        self._decoder = CreateDecoder()
        self._last: Report | None = None
        self._doubts = 0
        self._heard_s = self._said_s = -math.inf
        self._wanted = (0, 0)
        self._lights_wanted = False
        self._wheels: Wheels = (0.0, 0.0)
        self._pose = Pose2(0.0, 0.0, 0.0)
        self.guard = Watchdog(lambda: link.write(drive(0, 0)), link.now, WATCHDOG_S)
        if guarded:
            self.guard.start()

    def close(self) -> None:
        """Stop, and let the line go."""
        super().close()
        self.guard.close()

    def _carried_out(self, command: MotorCommand) -> MotionReport:
        if self._stop_asked.is_set():
            raise self._fault("stopped", "a stop was asked for", stopped=True)
        self._halt()
        way = _MotionProgress(self._wheels, self._link.now())
        self._so_far = way.go_on(self._wheels, self._link.now())
        half_axle = AXLE_M / 2.0
        sign = math.copysign(1.0, command.turn_rad)
        self._go(way, abs(command.turn_rad) * half_axle, sign, (FAST_TURN, SLOW_TURN), turning=True)
        fast = find_speed(FAST, command.speed_m_per_s)
        self._go(way, command.move_m, 1.0, (fast, min(fast, SLOW)), turning=False)
        return way.go_on(self._wheels, self._link.now())

    def _halt(self) -> None:
        """Safe mode and no speed, until it is seen to stand, and agrees that it should.

        A base that stands but cannot be safe, as while a wheel hangs in the air, stands too.
        """
        self._wanted = (0, 0)
        still, safe_mode, since_s, ends_s = 0, False, self._link.now(), self._link.now() + 2.5
        self._heard_s = since_s
        while self._link.now() < ends_s:
            if not (still and safe_mode) and self._link.now() - self._said_s >= REPEAT_S:
                self._send(safe() + drive(0, 0))  # not to a base that stands: a garbled one could set it going
            for report in self._read(REPEAT_S):
                before = self._last
                if self._take(report):
                    same = before is not None and (before.left_count, before.right_count) == (
                        report.left_count, report.right_count)
                    still = still + 1 if same and report.right_wanted == report.left_wanted == 0 else 0
                    safe_mode = report.mode == SAFE_MODE
            if still >= 3 and (safe_mode or self._link.now() - since_s > 0.6):
                self.guard.disarm()
                return
            if self._link.now() - self._heard_s > 0.2:
                ask = wake if self._link.now() - since_s > 0.5 or self._last is None else stream
                self._send(ask(with_lights=self._lights_wanted))
        if self._link.now() - self._heard_s > PATIENCE_S:
            raise self._fault("silent", "no stream" + self._noise())
        raise self._fault("nonsense", "told to stop, it goes on")

    def _read_odometry(self) -> Odometry:
        if self._last is None:
            self._halt()
        for report in self._reports(self._link.now() + 2.0 * PATIENCE_S):
            moved = report.right_wanted or report.left_wanted
            if moved or report.mode != SAFE_MODE:
                self._halt()
            if moved:
                raise self._fault("nonsense", "it was moving, and nobody had asked for that", stopped=True)
            return Odometry(self._pose.x_m, self._pose.y_m, wrap_angle(self._pose.heading_rad), self._link.now())
        raise self._fault("silent", "no stream" + self._noise())

    def _read_ranges(self) -> Ranges | None:
        """The light bumper; the base streams it from the first time that it is asked for."""
        self._lights_wanted = True
        if self._last is None:
            self._halt()
        ends_s = self._link.now() + 2.0 * PATIENCE_S
        for report in self._reports(ends_s):
            if report.lights:
                return build_ranges(report.lights, self._link.now())
            if self._link.now() - self._said_s > REPEAT_S:
                self._send(stream(with_lights=True))
        return None

    def _after_reopening(self) -> None:
        self._decoder.clear()

    def _go(self, way: _MotionProgress, goal_m: float, sign: float, speeds: tuple[int, int], *, turning: bool) -> None:
        """The wheels go this far, against each other or together, fast and at last slowly, and stand."""
        fast, slow = speeds
        ends_s = self._link.now() + 2.0 * goal_m / (slow / 1000.0) + 2.0
        way.begin(self._wheels, self._link.now(), sign, turning)
        if goal_m < M_PER_COUNT:
            return
        self._drive(way.to_go_m(goal_m), fast, slow, sign, turning)
        for report in self._reports(ends_s):
            self._check(way, report, goal_m)
            to_go_m = way.to_go_m(goal_m)
            if to_go_m <= slow / 1000.0 * 0.015:
                self._halt()
                self._so_far = way.go_on(self._wheels, self._link.now())
                if way.is_astray(goal_m):  # a garbled command may have moved it while it was told to stop
                    raise self._fault("nonsense", ASTRAY, stopped=True)
                return
            self._drive(to_go_m, fast, slow, sign, turning)
        self._give_up("stalled", "not done in time")

    def _drive(self, to_go_m: float, fast: int, slow: int, sign: float, turning: bool) -> None:
        """Say the wheel speeds for what is to go, if they are others than before."""
        speed = round(sign) * (fast if to_go_m > SLOWLY_M else slow)
        wanted = (speed, -speed if turning else speed)
        if wanted != self._wanted:
            self._wanted = wanted
            self._send(drive(*wanted))

    def _check(self, way: _MotionProgress, report: Report, goal_m: float) -> None:
        """See that the base does what it was told to, and can."""
        self._so_far = way.go_on(self._wheels, self._link.now())
        if report.mode != SAFE_MODE:
            dropped = ": a wheel hangs in the air" if report.bumps & 12 else ""
            self._give_up("refused", f"it left the safe mode (mode {report.mode}){dropped}")
        if report.bumps & 3:
            self._contact = find_contact(report.bumps, self._link.now())
            self._give_up("stalled", "its bumper is pressed")
        if way.is_stalled(self._link.now()):
            self._contact = Contact.of_stall(self._link.now(), turning=way.is_turning)
            self._give_up("stalled", "its wheels are held")
        if way.is_astray(goal_m):
            self._give_up("nonsense", ASTRAY)

    def _give_up(self, kind: FaultKind, detail: str) -> None:
        self._halt()
        raise self._fault(kind, detail, stopped=True)

    def _reports(self, ends_s: float) -> Iterator[Report]:
        """What the base reports from now on; wheel speeds that it did not understand are said again."""
        for _ in self._read(0.0):
            pass  # what it told before now is old
        self._heard_s = agreed_s = self._link.now()
        while self._link.now() < ends_s:
            for report in self._read(LOOK_S):
                if not self._take(report):
                    continue
                now_s = self._link.now()
                if any(self._wanted):
                    self.guard.arm()
                if (report.right_wanted, report.left_wanted) == self._wanted:
                    agreed_s = now_s
                elif now_s - self._said_s > REPEAT_S:
                    self._send(drive(*self._wanted))
                yield report
            self._check_still_wanted(agreed_s)

    def _check_still_wanted(self, agreed_s: float) -> None:
        now_s = self._link.now()
        if self._stop_asked.is_set():
            self._halt()
            raise self._fault("stopped", "a stop was asked for", stopped=True)
        if now_s - self._heard_s > PATIENCE_S:
            self._halt()
            raise self._fault("silent", f"nothing heard for {PATIENCE_S:g} s" + self._noise(), stopped=True)
        if self._heard_s - agreed_s > DISAGREES_S:  # by what it reports; that it reports nothing is another fault
            self._give_up("nonsense", "it does not take over the wheel speeds that it is told")

    def _read(self, timeout_s: float) -> Iterator[Report]:
        return self._decoder.feed(self._link.read(timeout_s))

    def _send(self, data: bytes) -> None:
        self._link.write(data)
        self._said_s = self._link.now()

    def _take(self, report: Report) -> bool:
        """Count on from the last report.

        A jump that no wheel makes is doubted until it is told three times; then the report before it was the wrong one,
        which the weak checksum had let through, and going back there counts too, unless it is so far that the base must
        have begun to count again.
        """
        last, now_s = self._last, self._link.now()
        if last is not None:
            left, right = (M_PER_COUNT * step(a, b, 16) for a, b in (
                (last.left_count, report.left_count), (last.right_count, report.right_count)))
            doubtful = max(abs(left), abs(right)) > 0.03 + 0.6 * (now_s - self._heard_s)
            self._doubts = self._doubts + 1 if doubtful else 0
            if 0 < self._doubts < 3:
                return False
            if max(abs(left), abs(right)) < ANEW_M:
                self._wheels = self._wheels[0] + right, self._wheels[1] + left
                turn, move = (right - left) / AXLE_M, (right + left) / 2.0
                self._pose = self._pose @ Pose2(move, 0.0, 0.0) @ Pose2(0.0, 0.0, turn)
        self._doubts, self._last, self._heard_s = 0, report, now_s
        return True

    def _noise(self) -> str:
        return f", only noise ({self._decoder.rejected} frames so far)" if self._decoder.rejected else ""


KIND = BaseKind(
    "create2", BAUD, lambda link: Create2Base(link, guarded=True),
    "ours, 0.5 s; it has none of its own: a cable that comes off does not stop it", Create2Base)
"""An emulated one needs no guard: no real time passes."""
