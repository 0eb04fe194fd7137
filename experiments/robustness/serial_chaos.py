"""Drivers of all bases over serial lines that garble, lose, repeat, delay and break, in virtual time."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from tqdm import tqdm

from experiments.report import Cell, Report
from experiments.robustness.serial_line import BOUNDS, PROTOCOLS, Findings, Killed, Noise, NoisyLine
from harvey.errors import BadInput
from harvey.hardware.bases import base_kinds, say_what_to_install
from harvey.hardware.drivers.base_driver import Base, BaseFault
from harvey.hardware.drivers.denning import DenningBase
from harvey.simulation.serial_body import emulator_kinds
from sim.emulators.emulator import IdealGround
from world_models.entries import MotionReport, MotorCommand


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


FRAMES, QUICK_FRAMES = 1_000_000, 15_000
NOISES = (0.0, 0.02, 0.05, 0.1, 0.2)
"""Probabilities of an error per message; a trial has one of them."""
COMMANDS = 8


def run(quick: bool = False, seed: int = 0) -> Report:
    """Send at least a million messages (quick: 15,000), a third of them over each protocol."""
    if absent := next((kind for kind in PROTOCOLS if kind not in base_kinds()), ""):
        raise BadInput(f"serial-chaos: expected drivers of {', '.join(PROTOCOLS)}{say_what_to_install(absent)}")
    total = QUICK_FRAMES if quick else FRAMES
    findings = {protocol: Findings() for protocol in PROTOCOLS}
    with tqdm(total=total, file=sys.stderr, disable=not sys.stderr.isatty(), unit="message", leave=False) as bar:
        for number, protocol in enumerate(PROTOCOLS):
            trials = 0
            while findings[protocol].frames < total / 3:
                before = findings[protocol].frames
                run_trial(protocol, np.random.default_rng([seed, number, trials]), findings[protocol], COMMANDS)
                bar.update(findings[protocol].frames - before)
                trials += 1
    return _report(findings, seed)


def run_trial(protocol: str, rng: np.random.Generator, findings: Findings, commands: int) -> None:
    """Run one trial with a random noise level."""
    Trial(protocol, rng, findings, float(rng.choice(NOISES))).run(commands)


def _report(findings: dict[str, Findings], seed: int) -> Report:
    each = [findings[protocol] for protocol in PROTOCOLS]
    rows: tuple[tuple[Cell, ...], ...] = (
        ("messages, both ways", *[f.frames for f in each]),
        ("of them with errors", *[sum(f.noise.values()) for f in each]),
        ("line broken; host died; base lost power", *[f"{f.cuts}; {f.deaths}; {f.blackouts}" for f in each]),
        ("different states in which the line broke", *[len(f.states) for f in each]),
        ("motions commanded; reported done", *[f"{f.asked}; {f.done}" for f in each]),
        ("faults raised", *[sum(f.faults.values()) for f in each]),
        ("commands accepted but never sent", *[f.forged for f in each]),
        ("motions more than 2 cm or 2 degrees beyond the command", *[f.strays for f in each]),
        ("largest excess over a command [m]", *[f.beyond_m for f in each]),
        ("largest excess over a command [degrees]", *[math.degrees(f.beyond_rad) for f in each]),
        ("reports overtaken by a late command", *[f.overtaken for f in each]),
        ("restarted by noise after a stop", *[f.restarted for f in each]),
        ("stops required; not in time", *[f"{f.stops}; {f.late}" for f in each]),
        ("of them, base unreachable", *[f.unreachable for f in each]),
        ("largest distance it ran on then, in 1 s and until reached [m]", *[f.ran_on_m for f in each]),
        ("set to another baud rate by noise", *[f.deafened for f in each]),
        ("longest call [s]", *[f.longest_s for f in each]),
        ("recovered when the line was good again", *[f"{f.resumed} of {f.ended}" for f in each]),
    )
    return Report("Drivers of bases over bad serial lines", ("what", *PROTOCOLS), rows, _notes(seed),
                  _claims(findings) + tuple((violation, False) for f in each for violation in f.violations[:5]))


def _notes(seed: int) -> tuple[str, ...]:
    return (
        f"Seed {seed}. Drivers as on hardware, emulated bases, lines in memory, virtual time. A trial is {COMMANDS}"
        f" motions with an error probability of {', '.join(f'{p:g}' for p in NOISES)} per message; half of them are"
        " interrupted by a cut of 0.05 to 4 s, or in a quarter of these by the death of the host; then one on a good"
        " line.",
        "Denning: CRC-32, sequence numbers and a watchdog of 0.5 s: the bounds are those of rounding.",
        "P2OS: 16 bit checksum, no sequence numbers, a watchdog of 2 s and 1.3 s of braking: the base cannot tell a"
        " repeated MOVE from a second one; the driver sees it in the odometry and stops it.",
        "Create 2: no checksum towards the base, no watchdog: a garbled speed is driven until the driver sees the wrong"
        " speed in the sensor stream. If the cable is cut, the host dies, or noise sets another baud rate, no driver"
        " can stop it; these cases are counted separately.",
        "The excess figures leave out motions during which a Create 2 could not be reached.",
    )


def _claims(findings: dict[str, Findings]) -> tuple[tuple[str, bool], ...]:
    denning, late = findings["denning"], sum(f.late for f in findings.values())
    bounds = [(findings[p], BOUNDS[p]) for p in PROTOCOLS[1:]]
    limits = " or ".join(f"{protocol} {BOUNDS[protocol].beyond_m:g} m and"
                         f" {math.degrees(BOUNDS[protocol].beyond_rad):.0f} degrees" for protocol in PROTOCOLS[1:])
    return (
        ("Denning: no command was executed twice, altered or unsent", not denning.strays + len(denning.violations)),
        (f"no motion exceeded its command by more than {limits}, while the base could be reached",
         all(f.beyond_m <= most.beyond_m and f.beyond_rad <= most.beyond_rad for f, most in bounds)),
        ("every base with a watchdog stopped in time, a Create 2 as soon as it could be reached", late == 0),
        ("no call hung", not any(" took " in v for f in findings.values() for v in f.violations)),
        ("every trial recovered when the line was good again", all(f.resumed == f.ended for f in findings.values())),
    )
