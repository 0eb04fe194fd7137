"""An iRobot Create 2, or a Roomba of the 600 series, over its Open Interface.

The base has no watchdog, its commands have no checksum, and its encoders wrap every 29 m. So the driver closes the loop
itself: every 15 ms the base says which wheel speeds it believes it was told, and how far its wheels have counted; what
does not agree is said again at once, and what does not come to agree is stopped.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from harvey.hardware.drivers.bases.base import BaseKind, FaultKind
from harvey.hardware.drivers.bases.counters import step
from harvey.hardware.drivers.bases.create2_senses import build_ranges, find_contact
from harvey.hardware.drivers.bases.create2_wire import (
    SAFE_MODE,
    Decoder,
    Report,
    drive,
    is_permitted,
    safe,
    stream,
    wake,
)
from harvey.hardware.drivers.bases.driver import LOOK_S, Driver
from harvey.hardware.drivers.bases.guard import Guard
from harvey.hardware.drivers.bases.link import Link
from world_models.entries.body import MotionReport, MotorCommand, Odometry
from world_models.entries.touch import Contact, Ranges
from world_models.frames import Pose2, wrap_angle

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


class Create2Base(Driver):
    """A base over the Open Interface."""

    def __init__(self, link: Link, *, guarded: bool = False) -> None:
        """``guarded``: a thread stops the base when the driving thread hangs."""
        super().__init__(link)
        self._decoder = Decoder()
        self._last: Report | None = None
        self._doubts = 0
        self._heard_s = self._said_s = -math.inf
        self._wanted = (0, 0)
        self._lights_wanted = False
        self._right_m = self._left_m = 0.0
        self._pose = Pose2(0.0, 0.0, 0.0)
        self.guard = Guard(lambda: link.write(drive(0, 0)), link.now, WATCHDOG_S)
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
        way = _Way(self)
        half_axle = AXLE_M / 2.0
        sign = math.copysign(1.0, command.turn_rad)
        self._go(way, abs(command.turn_rad) * half_axle, sign, (FAST_TURN, SLOW_TURN), turning=True)
        fast = find_speed(FAST, command.speed_m_per_s)
        self._go(way, command.move_m, 1.0, (fast, min(fast, SLOW)), turning=False)
        return way.report()

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

    def _go(self, way: _Way, goal_m: float, sign: float, speeds: tuple[int, int], *, turning: bool) -> None:
        """The wheels go this far, against each other or together, fast and at last slowly, and stand."""
        fast, slow = speeds
        ends_s = self._link.now() + 2.0 * goal_m / (slow / 1000.0) + 2.0
        way.begin(sign, turning)
        if goal_m < M_PER_COUNT:
            return
        self._drive(way.to_go_m(goal_m), fast, slow, sign, turning)
        for report in self._reports(ends_s):
            self._check(way, report, goal_m)
            to_go_m = way.to_go_m(goal_m)
            if to_go_m <= slow / 1000.0 * 0.015:
                self._halt()
                way.note()
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

    def _check(self, way: _Way, report: Report, goal_m: float) -> None:
        """See that the base does what it was told to, and can."""
        way.note()
        if report.mode != SAFE_MODE:
            dropped = ": a wheel hangs in the air" if report.bumps & 12 else ""
            self._give_up("refused", f"it left the safe mode (mode {report.mode}){dropped}")
        if report.bumps & 3:
            self._contact = find_contact(report.bumps, self._link.now())
            self._give_up("stalled", "its bumper is pressed")
        if way.stands_for_s > STALLED_S:
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
        have begun to count anew.
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
                self._right_m, self._left_m = self._right_m + right, self._left_m + left
                turn, move = (right - left) / AXLE_M, (right + left) / 2.0
                self._pose = self._pose @ Pose2(move, 0.0, 0.0) @ Pose2(0.0, 0.0, turn)
        self._doubts, self._last, self._heard_s = 0, report, now_s
        return True

    def _noise(self) -> str:
        return f", only noise ({self._decoder.rejected} frames so far)" if self._decoder.rejected else ""


class _Way:
    """What has been done of a command, by the wheels' counts."""

    def __init__(self, base: Create2Base) -> None:
        self._base, self._began_s = base, base._link.now()
        self._from = self._part = (base._right_m, base._left_m)
        self._sign, self._turning, self._moved_m = 1.0, False, 0.0
        self._best_m, self._best_s = 0.0, self._began_s
        self.note()

    def begin(self, sign: float, turning: bool) -> None:
        """A turn or a move begins."""
        self._part = (self._base._right_m, self._base._left_m)
        self._sign, self._turning = sign, turning
        self._best_m, self._best_s = 0.0, self._base._link.now()

    def to_go_m(self, goal_m: float) -> float:
        """How far each wheel has to go still."""
        return goal_m - self._progress()[0]

    def is_astray(self, goal_m: float) -> bool:
        """Whether the wheels have gone too far, backwards, together in a turn, or apart in a move."""
        gone_m, askew_m = self._progress()
        return not -STRAY_M <= gone_m <= goal_m + STRAY_M or abs(askew_m) > ASKEW_M

    @property
    def is_turning(self) -> bool:
        return self._turning

    @property
    def stands_for_s(self) -> float:
        """How long the wheels have not got on."""
        return self._base._link.now() - self._best_s

    def note(self) -> None:
        """Keep what has been done so far."""
        base, gone_m = self._base, self._progress()[0]
        if gone_m > self._best_m:
            self._best_m, self._best_s = gone_m, base._link.now()
        right, left = base._right_m - self._from[0], base._left_m - self._from[1]
        now_s = base._link.now()
        move = 0.0 if self._turning else gone_m
        base._so_far = MotionReport((right - left) / AXLE_M, move, now_s - self._began_s, now_s)

    def report(self) -> MotionReport:
        """What was done."""
        self.note()
        done = self._base._so_far
        return done if done is not None else MotionReport(0.0, 0.0, 0.0, self._base._link.now())

    def _progress(self) -> tuple[float, float]:
        """As asked for, and otherwise, since this part began [m of each wheel]."""
        right, left = self._base._right_m - self._part[0], self._base._left_m - self._part[1]
        apart, together = (right - left) / 2.0, (right + left) / 2.0
        return (self._sign * apart, together) if self._turning else (self._sign * together, apart)


KIND = BaseKind(
    "create2", BAUD, lambda link: Create2Base(link, guarded=True),
    "ours, 0.5 s; it has none of its own: a cable that comes off does not stop it", Create2Base)
"""An emulated one needs no guard: no real time passes."""
