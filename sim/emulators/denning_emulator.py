"""An emulated base that speaks the Denning-style line protocol, written from docs/protocol-denning.md.

It carries a command out at once on a simulated body, or rolling on the ground.
"""

from __future__ import annotations

import binascii
import math
from abc import ABC, abstractmethod
from dataclasses import replace
from typing import NamedTuple

from sim.body.collision import ROBOT_RADIUS_M
from sim.body.senses import Bumper, RangeRing
from sim.body.simulated_body import SimulatedBody
from sim.emulators.emulator import EmulatorKind, Ground
from world_models.entries import Contact, MotionReport, MotorCommand, Ranges
from world_models.frames import Pose2

RING = RangeRing(sensors=24)
"""Of the platform: sonars that face outward at equal angles."""


STANDS = MotionReport(0.0, 0.0, 0.0, 0.0)


class BaseMotors(ABC):
    """The motors of a base.

    Attributes:
        turn_rate, speed: of every motion [rad/s, m/s].
        ended: "" while it moves, else "ok", "stalled" or "halted".
        claim: what the encoders report of the last command; contact: what it touched.
    """

    turn_rate, speed = math.radians(45.0), 0.4
    ended, claim = "ok", STANDS
    contact: Contact | None = None

    @abstractmethod
    def begin(self, command: MotorCommand) -> None:
        """Begin a command: TURN, then MOVE."""

    def advance(self, _duration_s: float) -> None:
        """Let time pass."""
        return

    def halt(self) -> None:
        """Break the command off."""
        return

    @abstractmethod
    def ranges(self) -> Ranges | None:
        """What its sonars measure now."""


class InstantMotion(BaseMotors):
    """A simulated body's: a command is over at once, in the time of the body."""

    def __init__(self, body: SimulatedBody) -> None:
        self._body, self.speed = body, body.speed_m_per_s

    def begin(self, command: MotorCommand) -> None:
        self.claim = self._body.execute(command)
        self.contact = self._body.take_contact()

    def ranges(self) -> Ranges | None:
        return self._body.ranges()


class ConstantSpeedMotion(BaseMotors):
    """Turns and moves at constant speeds, and ends exactly where it was commanded to.

    Wheels that are held for half a second are stalled.
    """

    max_held_s = 0.5

    def __init__(self, ground: Ground) -> None:
        self._ground = ground
        self._command, self._held_s = MotorCommand(0.0, 0.0), 0.0
        self.claim = replace(STANDS, sim_time_s=ground.time_s)
        self._began_s = ground.time_s

    def begin(self, command: MotorCommand) -> None:
        self._command, self._began_s = command, self._ground.time_s
        self.claim = replace(STANDS, sim_time_s=self._began_s)
        self.ended, self._held_s, self.contact = "", 0.0, None

    def advance(self, duration_s: float) -> None:
        left_s = duration_s
        while left_s > 0.0 and not self.ended:
            left_s -= self._step(left_s)
        if left_s > 0.0:
            self._ground.roll(0.0, 0.0, left_s)

    def halt(self) -> None:
        self.ended = self.ended or "halted"

    def ranges(self) -> Ranges | None:
        axes = [math.remainder(math.tau * number / RING.sensors, math.tau) for number in range(RING.sensors)]
        heard = [self._ground.echo(Pose2(0.0, 0.0, axis) @ Pose2(ROBOT_RADIUS_M, 0.0, 0.0)) for axis in axes]
        distances = tuple(None if away_m is None else ROBOT_RADIUS_M + away_m for away_m in heard)
        return Ranges(tuple(axes), distances, RING.sigma_m, RING.half_beam_rad, ROBOT_RADIUS_M + RING.reach_m,
                      self._ground.time_s)

    def _step(self, max_s: float) -> float:
        """Roll for at most this time, or to the end of the turn or move; returns the time that it took [s]."""
        command, claim = self._command, self.claim
        turning = claim.turn_rad != command.turn_rad
        to_go = command.turn_rad - claim.turn_rad if turning else command.move_m - claim.move_m
        if to_go == 0.0:
            self.ended = "ok"
            return 0.0
        rate = self.turn_rate if turning else min(self.speed, command.speed_m_per_s or math.inf)
        step_s = min(max_s, abs(to_go) / rate)
        step = to_go if step_s < max_s or abs(to_go) <= rate * max_s else math.copysign(rate * step_s, to_go)
        turned, moved = self._ground.roll(step if turning else 0.0, 0.0 if turning else step, step_s)
        is_held, now_s = turned == moved == 0.0, self._ground.time_s
        self._held_s = self._held_s + step_s if is_held else 0.0
        if self._held_s > self.max_held_s:
            self.ended = "stalled"
            touching_rad = self._ground.touching_rad
            self.contact = (Contact.of_stall(now_s, turning=turning) if touching_rad is None
                            else Bumper().feel(touching_rad, now_s))
        turn, move = claim.turn_rad + turned, claim.move_m + moved
        if step == to_go and not is_held:  # what is finished claims exactly what was commanded
            turn, move = (command.turn_rad, move) if turning else (turn, command.move_m)
        self.claim = MotionReport(turn, move, now_s - self._began_s, now_s)
        return max(step_s, 1e-9)


WATCHDOG_S = 0.5
MAX_TURN_RAD, MAX_MOVE_M = 2.0 * math.pi, 20.0


class Executed(NamedTuple):
    """A command that was begun: its session, its number, and what the base understood [rad, m]."""

    token: str
    seq: int
    turn_rad: float
    move_m: float


class DenningEmulator:
    """The base's side of the protocol.

    Attributes:
        executed: every command that was begun, in order.
        rejected: number of lines that were not understood.
        stops: how often the watchdog stopped it.
        standing_within_s: longest time from the last line that it understood until it stands [s].
    """

    def __init__(self, motion: BaseMotors, *, watchdog_s: float = WATCHDOG_S) -> None:
        self._motion, self.standing_within_s = motion, watchdog_s
        self._boot = 1
        self.executed: list[Executed] = []
        self.rejected = self.stops = 0
        self._time_s = 0.0
        self._reset()

    def _reset(self) -> None:
        self._line, self._out = bytearray(), bytearray()
        self._token = self._nonce = ""
        self._waiting: tuple[str, str] | None = None
        self._sessions = self._seq = 0
        self._status, self._claim = "ok", STANDS
        self._pose = Pose2(0.0, 0.0, 0.0)
        self._heard_s = self._time_s

    def power_cycle(self) -> None:
        """Off and on again: it stands, and all state is lost."""
        self._motion.halt()
        self._boot += 1
        self._reset()

    @property
    def moving(self) -> bool:
        """Whether the motors run."""
        return self._status == "run"

    def receive(self, data: bytes) -> None:
        """Take bytes from the line."""
        for byte in data:
            if byte == 0x0A:
                self._read_line(bytes(self._line))
                self._line.clear()
            elif byte == 0x23 or len(self._line) > 200:
                self._line[:] = bytes([byte])
            else:
                self._line.append(byte)

    def take(self) -> bytes:
        """Return the bytes for the line since the last call."""
        out = bytes(self._out)
        self._out.clear()
        return out

    def advance(self, duration_s: float) -> None:
        """Let time pass; a watchdog that is due within it acts at its exact time."""
        left_s, due_s = duration_s, self._heard_s + self.standing_within_s - self._time_s
        if self.moving and due_s < duration_s:
            self._roll(max(0.0, due_s))
            left_s -= max(0.0, due_s)
            if self.moving:
                self.stops += 1
                self._end("watchdog")
        self._roll(left_s)

    def _roll(self, duration_s: float) -> None:
        self._time_s += duration_s
        self._motion.advance(duration_s)
        self._follow()

    def _follow(self) -> None:
        """Update the claim from the motors."""
        if self.moving:
            self._claim = self._motion.claim
            if self._motion.ended:
                self._finish(self._motion.ended)

    def _end(self, how: str) -> None:
        self._motion.halt()
        self._claim = self._motion.claim
        self._finish(how)

    def _finish(self, how: str) -> None:
        """End the command; its claim is added to the odometry."""
        self._status = how
        self._pose = self._pose @ Pose2(0.0, 0.0, self._claim.turn_rad) @ Pose2(self._claim.move_m, 0.0, 0.0)

    def _read_line(self, line: bytes) -> None:
        body, star, check = line[1:].rpartition(b"*")
        if line[:1] != b"#" or not star or check != b"%08X" % binascii.crc32(body):
            self.rejected += 1
            return
        try:
            token, seq, verb, *words = body.decode("ascii").split(" ")
            self._obey(token, int(seq), verb, words)
        except ValueError:
            self.rejected += 1

    def _obey(self, token: str, seq: int, verb: str, words: list[str]) -> None:
        if verb == "HELLO" and len(words) == 1:
            self._greet(words[0])
            return
        if self._waiting is not None and token == self._waiting[0]:
            self._begin_session(*self._waiting)
        if not self._token or token != self._token:
            self._send(token, seq, "NO", "session")
            return
        self._heard_s = self._time_s
        match verb, words:
            case "GO", [turn, move, *speed] if len(speed) < 2:
                self._go(seq, float(turn), float(move), *map(float, speed))
            case "STOP", []:
                self._stop(seq)
            case "BEAT", [question]:
                self._send_odometry(seq, question)
            case "TOUCH", []:
                self._send_contact(seq)
            case "RANGES", [question]:
                self._send_ranges(seq, question)
            case _:
                self._send(token, seq, "NO", "verb")

    def _greet(self, nonce: str) -> None:
        """Answer a greeting. The session begins only with the first frame that carries its token."""
        if nonce == self._nonce:
            token = self._token
        elif self._waiting is not None and nonce == self._waiting[1]:
            token = self._waiting[0]
        else:
            self._sessions += 1
            token = f"{binascii.crc32(f'{self._boot} {self._sessions} {nonce}'.encode()):08X}"
            self._waiting = (token, nonce)
        limits = (self.standing_within_s, self._motion.turn_rate, self._motion.speed)
        self._send(token, 0, "HI", nonce, *(repr(value) for value in limits))

    def _begin_session(self, token: str, nonce: str) -> None:
        if self.moving:
            self._end("stopped")
        self._token, self._nonce, self._waiting = token, nonce, None
        self._seq, self._status, self._claim = 0, "ok", replace(STANDS, sim_time_s=self._motion.claim.sim_time_s)

    def _go(self, seq: int, turn_rad: float, move_m: float, speed_m_per_s: float | None = None) -> None:
        if seq == self._seq:
            self._send_status()
        elif seq != self._seq + 1:
            self._send(self._token, seq, "NO", "number")
        elif self.moving:
            self._send(self._token, seq, "NO", "busy")
        elif not (abs(turn_rad) <= MAX_TURN_RAD and 0.0 <= move_m <= MAX_MOVE_M
                  and (speed_m_per_s is None or 0.0 < speed_m_per_s < math.inf)):
            self._send(self._token, seq, "NO", "range")
        else:
            self._seq, self._status = seq, "run"
            self.executed.append(Executed(self._token, seq, turn_rad, move_m))
            self._motion.begin(MotorCommand(turn_rad, move_m, speed_m_per_s))
            self._follow()
            self._send_status()

    def _stop(self, seq: int) -> None:
        """End the command of this number; one that has not arrived yet will never begin."""
        if self.moving:
            self._end("stopped")
        if seq == self._seq + 1:
            self._seq, self._status, self._claim = seq, "stopped", replace(STANDS, sim_time_s=self._claim.sim_time_s)
        if seq == self._seq:
            self._send_status()
        else:
            self._send(self._token, seq, "NO", "number")

    def _send_status(self) -> None:
        self._follow()
        claim = self._claim
        numbers = [repr(v) for v in (claim.turn_rad, claim.move_m, claim.duration_s, claim.sim_time_s)]
        if self.moving:
            self._send(self._token, self._seq, "RUN", *numbers)
        else:
            self._send(self._token, self._seq, "DONE", self._status, *numbers)

    def _send_odometry(self, seq: int, question: str) -> None:
        self._follow()
        pose = self._pose
        if self.moving:
            pose = pose @ Pose2(0.0, 0.0, self._claim.turn_rad) @ Pose2(self._claim.move_m, 0.0, 0.0)
        where = (pose.x_m, pose.y_m, pose.heading_rad, self._motion.claim.sim_time_s)
        self._send(self._token, seq, "HERE", question, *(repr(v) for v in where))

    def _send_contact(self, seq: int) -> None:
        """What the present command touched; nothing of any other."""
        contact = self._motion.contact if seq == self._seq and not self.moving else None
        if contact is None:
            self._send(self._token, seq, "FELT", "none")
        else:
            numbers = (contact.direction_rad, contact.sigma_rad, contact.when_s)
            self._send(self._token, seq, "FELT", contact.by, *(repr(v) for v in numbers))

    def _send_ranges(self, seq: int, question: str) -> None:
        found = self._motion.ranges()
        if found is None:
            self._send(self._token, seq, "ECHOES", question)
            return
        limits = (round(1000.0 * v) for v in (found.sigma_m, found.half_beam_rad, found.max_range_m))
        echoes = ("-" if distance is None else str(round(1000.0 * distance)) for distance in found.distances_m)
        self._send(self._token, seq, "ECHOES", question, *map(str, limits), *echoes)

    def _send(self, token: str, seq: int, verb: str, *words: str) -> None:
        body = " ".join((token, str(seq), verb, *words)).encode("ascii")
        self._out += b"#%b*%08X\n" % (body, binascii.crc32(body))


KIND = EmulatorKind("denning", lambda ground: DenningEmulator(ConstantSpeedMotion(ground)),
                    lambda body: DenningEmulator(InstantMotion(body)))
