"""A Pioneer, or another base that speaks P2OS, AROS or ARCOS.

P2OS numbers no command, so what is said twice is done twice if it is relative. Turns are therefore asked for as
absolute headings (HEAD, not DHEAD), which may be repeated freely; a move (MOVE, which unlike VEL ends by itself) is
asked for once, watched on the base's own odometry, and asked for again, by what is left of it, only when the base
stands and has not got on. A base that does not hear from us for two seconds stops by itself, but takes its motion up
again with the next packet: so after any doubt the first thing said is to stop.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from harvey.hardware.drivers.bases.base import BaseKind
from harvey.hardware.drivers.bases.counters import step
from harvey.hardware.drivers.bases.driver import LOOK_S, Driver
from harvey.hardware.drivers.bases.link import Link
from harvey.hardware.drivers.bases.p2os_senses import build_ranges, find_contact
from harvey.hardware.drivers.bases.p2os_wire import (
    CLOSE,
    ENABLE,
    ESTOP,
    HEAD,
    MOVE,
    OPEN,
    PULSE,
    SETRV,
    SETV,
    SONAR,
    SYNC0,
    SYNC1,
    SYNC2,
    Decoder,
    Echo,
    Status,
    encode,
)
from world_models.entries.body import MotionReport, MotorCommand, Odometry
from world_models.entries.touch import Ranges
from world_models.frames import wrap_angle

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


class P2osBase(Driver):
    """A base over P2OS."""

    def __init__(
        self, link: Link, *, mm_per_unit: float | None = None, speed_m_per_s: float = 0.3,
        turn_speed_rad_per_s: float = math.radians(40.0),
    ) -> None:
        """``mm_per_unit`` is what the base's odometry counts in; by default what is known of its subclass."""
        super().__init__(link)
        self._decoder = Decoder()
        self._mm = mm_per_unit
        self._speed, self._turn_speed = speed_m_per_s, turn_speed_rad_per_s
        self._names: tuple[str, ...] = ()
        self._last: Status | None = None
        self._doubts = 0
        self._sonars_wanted = False
        self._heard_s = self._said_s = -math.inf
        self._x_m = self._y_m = self._heading_rad = 0.0

    def _carried_out(self, command: MotorCommand) -> MotionReport:
        if self._stop_asked.is_set():
            raise self._fault("stopped", "a stop was asked for", stopped=True)
        self._halt()
        speed = self._speed if command.speed_m_per_s is None else min(self._speed, command.speed_m_per_s)
        self._prepare(speed)
        began_s = self._link.now()
        way = _Way(self, began_s)
        for part in _parts(command.turn_rad, TURN_PART_RAD):
            self._turn_by(way, part)
        way.end_turn()
        for part in _parts(command.move_m, MOVE_PART_M):
            self._move_by(way, part, speed)
        return way.report()

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
        return Odometry(self._x_m, self._y_m, wrap_angle(self._heading_rad), self._link.now())

    def _prepare(self, speed_m_per_s: float) -> None:
        """Settings, said again before each command, since one may have been lost; that the motors run is seen."""
        settings = (encode(SETV, max(1, round(1000 * speed_m_per_s))),
                    encode(SETRV, round(math.degrees(self._turn_speed))), encode(SONAR, int(self._sonars_wanted)))
        self._link.write(b"".join(settings))
        for status in self._statuses(encode(ENABLE, 1), 0.1, self._link.now() + 2.0):
            if status.enabled:
                return
        raise self._fault("refused", "its motors cannot be enabled; is the emergency button pressed?", stopped=True)

    def _turn_by(self, way: _Way, turn_rad: float) -> None:
        """To an absolute heading, said again and again until it is there."""
        last = self._last
        offset_rad = self._heading_rad - (UNIT_RAD * last.heading if last is not None else 0.0)
        degrees = round(math.degrees(way.heading_rad + turn_rad - offset_rad))
        goal_rad = math.radians(degrees) + offset_rad
        if abs(turn_rad) < math.radians(0.5):
            return
        way.heading_rad = goal_rad
        idle, ends_s = 0, self._link.now() + 2.0 * abs(turn_rad) / self._turn_speed + 4.0
        for status in self._statuses(encode(HEAD, degrees % 360), PULSE_S, ends_s):
            way.watch(status, turning=turn_rad)
            there = abs(goal_rad - self._heading_rad) <= MAX_OFF_RAD
            idle = idle + 1 if there and not status.moving else 0
            if idle >= 2:
                return
        self._gave_up("turn")

    def _move_by(self, way: _Way, move_m: float, speed_m_per_s: float) -> None:
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
                way.watch(status, moving=goal_m)
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

    def _stray(self, what: str) -> None:
        self._halt()
        raise self._fault("nonsense", what, stopped=True)

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
        """Nothing is heard: say stop, in case that we still are, and greet it anew the next time."""
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
        offset_rad = self._heading_rad - UNIT_RAD * last.heading  # its count may have begun at another heading
        c, s = math.cos(offset_rad), math.sin(offset_rad)
        self._x_m, self._y_m = self._x_m + c * dx - s * dy, self._y_m + s * dx + c * dy
        self._heading_rad += turn
        self._last, self._heard_s, self._doubts = status, now_s, 0
        return True


class _Way:
    """What has been done of a command, by the base's odometry.

    Attributes:
        heading_rad: that it should have by now.
        gone_m: how far it has gone along that heading.
    """

    def __init__(self, base: P2osBase, began_s: float) -> None:
        self._base, self._began_s = base, began_s
        self._from_rad = self.heading_rad = base._heading_rad
        self._from_m = (base._x_m, base._y_m)
        self.gone_m, self._held = 0.0, 0
        self._note()

    def end_turn(self) -> None:
        """The turn is over; moves go along the heading that it came to."""
        self.heading_rad = self._base._heading_rad
        self._from_m = (self._base._x_m, self._base._y_m)

    def watch(self, status: Status, *, turning: float = 0.0, moving: float = 0.0) -> None:
        """Take note of a status, and see that the motion is the one that was asked for."""
        base = self._base
        dx, dy = base._x_m - self._from_m[0], base._y_m - self._from_m[1]
        self._held = self._held + 1 if status.stalled or status.front or status.rear else 0
        if self._held >= 5:
            base._gave_up("turn" if turning else "move")
        along = dx * math.cos(self.heading_rad) + dy * math.sin(self.heading_rad)
        self.gone_m = along if moving else 0.0
        self._note()
        off = base._heading_rad - self.heading_rad
        if turning and math.hypot(dx, dy) > STRAY_M:
            base._stray("it moved while it was to turn")
        if turning and not -abs(turning) - STRAY_RAD < math.copysign(1.0, turning) * off < STRAY_RAD:
            base._stray("it turned beyond what it was told to")
        if moving and abs(off) > STRAY_RAD:
            base._stray("it turned while it was to move")
        if moving and not -STRAY_M < along < moving + STRAY_M:
            base._stray("it moved beyond what it was told to")

    def report(self) -> MotionReport:
        """What was done."""
        self._note()
        done = self._base._so_far
        return done if done is not None else MotionReport(0.0, 0.0, 0.0, self._base._link.now())

    def _note(self) -> None:
        base, now_s = self._base, self._base._link.now()
        base._so_far = MotionReport(base._heading_rad - self._from_rad, self.gone_m, now_s - self._began_s, now_s)


def _parts(whole: float, most: float) -> list[float]:
    count = math.ceil(abs(whole) / most)
    return [whole / count] * count if count else []


KIND = BaseKind("p2os", BAUD, P2osBase, "its own, 2 s")
