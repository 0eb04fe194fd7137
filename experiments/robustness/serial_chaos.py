"""Drivers of all bases over serial lines that garble, lose, repeat, delay and break, in virtual time."""

from __future__ import annotations

import math
import sys

import numpy as np
from tqdm import tqdm

from experiments.report import Cell, Report
from experiments.robustness.serial.findings import BOUNDS, PROTOCOLS, Findings
from experiments.robustness.serial.trial import Trial
from harvey.errors import BadInput
from harvey.hardware.base import base_kinds, say_what_to_install

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
    rows = (
        _row("messages, both ways", [f.frames for f in each]),
        _row("of them with errors", [sum(f.noise.values()) for f in each]),
        _row("line broken; host died; base lost power", [f"{f.cuts}; {f.deaths}; {f.blackouts}" for f in each]),
        _row("different states in which the line broke", [len(f.states) for f in each]),
        _row("motions commanded; reported done", [f"{f.asked}; {f.done}" for f in each]),
        _row("faults raised", [sum(f.faults.values()) for f in each]),
        _row("commands accepted but never sent", [f.forged for f in each]),
        _row("motions more than 2 cm or 2 degrees beyond the command", [f.strays for f in each]),
        _row("largest excess over a command [m]", [f.beyond_m for f in each]),
        _row("largest excess over a command [degrees]", [math.degrees(f.beyond_rad) for f in each]),
        _row("reports overtaken by a late command", [f.overtaken for f in each]),
        _row("restarted by noise after a stop", [f.restarted for f in each]),
        _row("stops required; not in time", [f"{f.stops}; {f.late}" for f in each]),
        _row("of them, base unreachable", [f.unreachable for f in each]),
        _row("largest distance it ran on then, in 1 s and until reached [m]", [f.ran_on_m for f in each]),
        _row("set to another baud rate by noise", [f.deafened for f in each]),
        _row("longest call [s]", [f.longest_s for f in each]),
        _row("recovered when the line was good again", [f"{f.resumed} of {f.ended}" for f in each]),
    )
    return Report("Drivers of bases over bad serial lines", ("what", *PROTOCOLS), rows, _notes(seed),
                  _claims(findings) + tuple((violation, False) for f in each for violation in f.violations[:5]))


def _row(what: str, cells: list[int] | list[str] | list[float]) -> tuple[Cell, ...]:
    return (what, *cells)


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
