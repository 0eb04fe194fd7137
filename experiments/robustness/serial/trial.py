"""One trial of a driver over a bad line: commands, noise, broken cables, dead hosts; and its findings."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from experiments.robustness.serial.findings import BOUNDS, Findings
from experiments.robustness.serial.line_noise import Noise
from experiments.robustness.serial.noisy_line import Killed, NoisyLine
from harvey.hardware.base import base_kinds
from harvey.hardware.drivers.base import Base, BaseFault
from harvey.hardware.drivers.denning import DenningBase
from sim.emulators.emulator import IdealGround
from sim.emulators.registry import emulator_kinds
from world_models.entries.body import MotionReport, MotorCommand


class Trial:
    """A host, a base and the line between them."""

    def __init__(self, protocol: str, rng: np.random.Generator, findings: Findings, noise: float) -> None:
        """``noise``: probability of an error per message, both ways."""
        self._protocol, self._rng, self._found, self._bounds = protocol, rng, findings, BOUNDS[protocol]
        self._floor = IdealGround()
        self._accepted: list[bytes] = []
        self._base_end: Any = self._emulator()
        self._noises = (Noise(rng, noise), Noise(rng, noise))
        self.line = NoisyLine(self._base_end, *self._noises, tick_s=0.05 if protocol == "denning" else 0.015)
        self._host = self._driver()
        self._asked: list[MotorCommand] = []
        self._from = (0.0, 0.0)
        self._out_of_reach = False

    def run(self, commands: int, breaks: float = 0.5) -> None:
        """Command motions on the bad line, then one on a good line.

        Args:
            breaks: probability that the line breaks, or the host dies, during a motion.
        """
        for _ in range(commands):
            if self._rng.random() < breaks:
                dies = self._rng.random() < 0.25
                pause_s = math.inf if dies else float(self._rng.uniform(0.05, 4.0))
                self.line.break_after(int(self._rng.integers(1, self._bounds.operations)), pause_s)
            self._ask(MotorCommand(float(self._rng.uniform(-2.5, 2.5)), float(self._rng.uniform(0.0, 1.2))))
            self._idle(int(self._rng.integers(0, 4)))
            if self._rng.random() < 0.03:
                self._found.blackouts += 1
                self._base_end.power_cycle()
        self._end()

    def _ask(self, command: MotorCommand) -> bool:
        self._record_excess()
        self._asked.append(command)
        self._from = (self._floor.turned_rad, self._floor.moved_m)
        self._found.asked += 1
        reports: list[MotionReport] = []
        if not self._try(lambda: reports.append(self._host.execute(command)), command):
            return False
        self._found.done += 1
        report, (turn, move), bounds = reports[0], self._since(), self._bounds
        off = (abs(report.turn_rad - turn), abs(report.move_m - move))
        short = (_short(report.turn_rad, command.turn_rad), _short(report.move_m, command.move_m))
        if short[0] > bounds.done_rad or short[1] > bounds.done_m:
            self._add_violation(f"{command} was reported done, as {report}")
        self._found.overtaken += off[0] > bounds.done_rad or off[1] > bounds.done_m
        if off[0] > max(bounds.done_rad, bounds.beyond_rad) or off[1] > max(bounds.done_m, bounds.beyond_m):
            self._add_violation(f"{report} was reported, but it was {turn} rad, {move} m")
        return True

    def _idle(self, beats: int) -> None:
        for _ in range(beats):
            self.line.wait(0.2)
            self._try(self._host.heartbeat, MotorCommand(0.0, 0.0))

    def _try(self, call: Callable[[], object], command: MotorCommand) -> bool:
        """Call a driver; if it fails, check that the base stops, and wait until it can be reached again."""
        began_s = self.line.now()
        try:
            call()
            return True
        except BaseFault as fault:
            self._found.faults[fault.kind] += 1
            self._stands(fault.stopped)
        except Killed:
            self._found.deaths += 1
            self._stands(False, dead=True)
            self._host = self._driver()
        finally:
            took_s = self.line.now() - began_s
            self._found.longest_s = max(self._found.longest_s, took_s)
            if took_s > 60.0 + 8.0 * (abs(command.turn_rad) + command.move_m / 0.05):
                self._add_violation(f"{command} took {took_s:.0f} s")
        return False

    def _stands(self, known: bool, *, dead: bool = False) -> None:
        """Check that the base stands: now, if that is known; else after the watchdog's time."""
        self._found.stops += 1
        if known:
            if self._base_end.moving and self._protocol == "create2":
                self._found.restarted += 1
                self._stop_by_hand(False)
            self._late_if(self._base_end.moving, "a fault said that it stands")
        elif self._protocol == "create2":
            self._stop_by_hand(dead)
        else:
            self.line.wait(self.line.settled_s - self.line.now() + self._base_end.standing_within_s + 0.02)
            self._late_if(self._base_end.moving, "the watchdog time was over")

    def _stop_by_hand(self, dead: bool) -> None:
        """Stop a base without watchdog; if it cannot be reached, it runs on."""
        gone = self._since()[1]
        unreachable = dead or self.line.is_down or self._base_end.deaf
        if unreachable:
            self._found.unreachable += 1
            self._out_of_reach = True
            self.line.wait(1.0)
        for _ in range(20):
            self.line.wait(0.1)
            if self._base_end.deaf:
                self._power_cycle()
            self._host = self._driver() if dead else self._host
            try:
                self._host.stop()
                if not self._base_end.moving:
                    break
                self._found.restarted += 1
            except (BaseFault, Killed):
                self.line.wait(0.3)
        if unreachable:
            self._found.ran_on_m = max(self._found.ran_on_m, abs(self._since()[1] - gone))
        self._late_if(self._base_end.moving, "it was sent stop repeatedly")

    def _power_cycle(self) -> None:
        """Power-cycle the base by hand."""
        self._found.deafened += 1
        self._out_of_reach = True
        self._base_end.power_cycle()

    def _end(self) -> None:
        """On a good line, one more motion must succeed, at the second try at the latest."""
        self.line.wait(4.0)
        self.line.quieten()
        self.line.wait(1.0)
        if self._protocol == "create2" and self._base_end.deaf:
            self._power_cycle()
        last = MotorCommand(0.5, 0.25)
        self._found.ended += 1
        if self._ask(last) or self._ask(last):
            self._found.resumed += 1
        else:
            self._add_violation("it did not recover when the line was good again")
        self._record_excess()
        self._record_line()

    def _record_excess(self) -> None:
        """Record the excess of the last command, and of what followed it."""
        asked = self._asked[-1] if self._asked else MotorCommand(0.0, 0.0)
        turn, move = self._since()
        beyond = (_beyond(turn, asked.turn_rad), _beyond(move, asked.move_m))
        if self._out_of_reach:
            self._out_of_reach = False
            return
        found, bounds = self._found, self._bounds
        found.beyond_rad, found.beyond_m = max(found.beyond_rad, beyond[0]), max(found.beyond_m, beyond[1])
        found.strays += beyond[0] > math.radians(2.0) or beyond[1] > 0.02
        if beyond[0] > bounds.beyond_rad or beyond[1] > bounds.beyond_m:
            self._add_violation(f"{asked} became {turn} rad, {move} m")

    def _record_line(self) -> None:
        found = self._found
        found.frames += self.line.frames
        found.cuts += len(self.line.cuts)
        found.states |= {(_describe_message(self._protocol, said), moving) for said, moving in self.line.cuts}
        for noise in self._noises:
            found.noise.update(noise.done)
        found.forged += sum(1 for raw in self._accepted if not any(raw in said for said in self.line.ever_said))
        if self._protocol == "denning":
            self._check_executed()

    def _check_executed(self) -> None:
        """Check that each command was executed at most once, in order, and unaltered."""
        done = self._base_end.executed
        if len({(e.token, e.seq) for e in done}) != len(done):
            self._add_violation("a command was executed twice")
        asked = iter((c.turn_rad, c.move_m) for c in self._asked)
        if not all(any(a == (e.turn_rad, e.move_m) for a in asked) for e in done):
            self._add_violation("a command was executed that was never sent, or twice")

    def _since(self) -> tuple[float, float]:
        return self._floor.turned_rad - self._from[0], self._floor.moved_m - self._from[1]

    def _late_if(self, moving: bool, when: str) -> None:
        if moving:
            self._found.late += 1
            self._add_violation(f"it moves, though {when}")

    def _add_violation(self, how: str) -> None:
        self._found.violations.append(f"{self._protocol}: {how}")

    def _emulator(self) -> Any:
        end: Any = emulator_kinds()[self._protocol].on_ground(self._floor)
        if self._protocol == "p2os":
            end.on_command = lambda request: self._accepted.append(request.raw)
        elif self._protocol == "create2":
            end.on_command, end.first_count = self._accepted.append, int(self._rng.integers(0, 65536))
            end.power_cycle()
        return end

    def _driver(self) -> Base:
        if self._protocol == "denning":
            return DenningBase(self.line, nonce=f"{int(self._rng.integers(1 << 32)):08X}")
        return base_kinds()[self._protocol].connect_to_emulator(self.line)


def _beyond(done: float, asked: float) -> float:
    """Distance outside of [0, asked]."""
    along = done if asked >= 0 else -done
    return max(0.0, -along, along - abs(asked))


def _short(done: float, asked: float) -> float:
    """Shortfall."""
    return abs(asked) - (done if asked >= 0 else -done)


def _describe_message(protocol: str, said: bytes) -> str:
    """Describe the host's last message in a word."""
    if protocol == "denning":
        return said.split(b" ")[2].split(b"*")[0].decode() if said.count(b" ") >= 2 else "nothing"
    if protocol == "p2os":
        return f"command {said[-3] if len(said) == 6 else said[3]}" if len(said) > 3 else "nothing"
    opcodes = [byte for byte in said if 128 <= byte <= 173]
    if opcodes[-1:] == [145]:
        return "drive" if any(said[-4:]) else "stand"
    return f"opcode {opcodes[-1]}" if opcodes else "nothing"

