"""Serial chaos: the drivers of all bases over lines that garble, lose, repeat, delay and break, in virtual time."""

from __future__ import annotations

import math
import sys

import numpy as np
from tqdm import tqdm

from experiments.report import Cell, Report
from experiments.robustness.serial.findings import BOUNDS, PROTOCOLS, Findings
from experiments.robustness.serial.trial import Trial

FRAMES, QUICK_FRAMES = 1_000_000, 15_000
NOISES = (0.0, 0.02, 0.05, 0.1, 0.2)
"""Probabilities that something happens to a piece that is said; a trial has one of them."""
COMMANDS = 8


def run(quick: bool = False, seed: int = 0) -> Report:
    """At least a million frames (quick: 15 000), a third of them over each protocol."""
    total = QUICK_FRAMES if quick else FRAMES
    found = {protocol: Findings() for protocol in PROTOCOLS}
    with tqdm(total=total, file=sys.stderr, disable=not sys.stderr.isatty(), unit="frame", leave=False) as bar:
        for number, protocol in enumerate(PROTOCOLS):
            trials = 0
            while found[protocol].frames < total / 3:
                before = found[protocol].frames
                one(protocol, np.random.default_rng([seed, number, trials]), found[protocol], COMMANDS)
                bar.update(found[protocol].frames - before)
                trials += 1
    return _report(found, seed)


def one(protocol: str, rng: np.random.Generator, found: Findings, commands: int) -> None:
    """One trial."""
    Trial(protocol, rng, found, float(rng.choice(NOISES))).run(commands)


def _report(found: dict[str, Findings], seed: int) -> Report:
    each = [found[protocol] for protocol in PROTOCOLS]
    rows = (
        _row("frames, both ways", [f.frames for f in each]),
        _row("of them garbled, lost, repeated or delayed", [sum(f.noise.values()) for f in each]),
        _row("line broken; host died; base lost power", [f"{f.cuts}; {f.deaths}; {f.blackouts}" for f in each]),
        _row("different moments at which the line broke", [len(f.states) for f in each]),
        _row("motions asked for; reported done", [f"{f.asked}; {f.done}" for f in each]),
        _row("faults raised", [sum(f.faults.values()) for f in each]),
        _row("commands accepted that nobody had given", [f.forged for f in each]),
        _row("motions more than 2 cm or 2 degrees beyond what was asked", [f.strays for f in each]),
        _row("furthest beyond what was asked [m]", [f.beyond_m for f in each]),
        _row("furthest beyond what was asked [degrees]", [math.degrees(f.beyond_rad) for f in each]),
        _row("reports overtaken by a late command", [f.overtaken for f in each]),
        _row("set going again by noise after it had stood", [f.restarted for f in each]),
        _row("times that it had to stand; did not in time", [f"{f.stops}; {f.late}" for f in each]),
        _row("of them, nothing could have stopped it", [f.unreachable for f in each]),
        _row("furthest that it ran on then, in 1 s and until reached [m]", [f.ran_on_m for f in each]),
        _row("told another baud rate by noise", [f.deafened for f in each]),
        _row("longest call [s]", [f.longest_s for f in each]),
        _row("went on when the line was good again", [f"{f.resumed} of {f.ended}" for f in each]),
    )
    return Report("Drivers of bases over bad serial lines", ("what", *PROTOCOLS), rows, _notes(seed),
                  _claims(found) + tuple((violation, False) for f in each for violation in f.violations[:5]))


def _row(what: str, cells: list[int] | list[str] | list[float]) -> tuple[Cell, ...]:
    return (what, *cells)


def _notes(seed: int) -> tuple[str, ...]:
    return (
        f"Seed {seed}. Drivers as they run on hardware, emulated bases, lines in memory, virtual time. A trial is "
        f"{COMMANDS} motions with noise of {', '.join(f'{p:g}' for p in NOISES)} a piece, one half of them broken off "
        "by a cut of 0.05 to 4 s, or in a quarter of these by the death of the host; then one on a good line.",
        "Denning: CRC-32, numbers and a watchdog of 0.5 s: bounds are those of rounding.",
        "P2OS: checksum of 16 bits, no numbers, a watchdog of 2 s and 1.3 s of braking: a repeated MOVE cannot be told "
        "from a second one by the base; the driver sees it in the odometry and stops it.",
        "Create 2: no checksum towards the base, no watchdog: a garbled speed is driven until the driver sees in the "
        "stream that the base believes it was told something else. Where the cable is cut, the host dies, or noise "
        "tells the base another baud rate, nothing of ours can stop it; these are counted apart.",
        "The figures beyond what was asked leave out those motions during which a Create 2 could not be reached.",
    )


def _claims(found: dict[str, Findings]) -> tuple[tuple[str, bool], ...]:
    denning, late = found["denning"], sum(f.late for f in found.values())
    bounds = [(p, BOUNDS[p].beyond_m, math.degrees(BOUNDS[p].beyond_rad)) for p in PROTOCOLS[1:]]
    told = " or ".join(f"{protocol} {metres:g} m and {degrees:.0f} degrees" for protocol, metres, degrees in bounds)
    within = [found[p].beyond_m <= most_m and math.degrees(found[p].beyond_rad) <= most for p, most_m, most in bounds]
    return (
        ("Denning: no command was carried out twice, altered or unasked", not denning.strays + len(denning.violations)),
        (f"no motion went beyond what was asked by more than {told}, while the base could be reached", all(within)),
        ("every base with a watchdog stood within its time, and a Create 2 as soon as it could be told to", late == 0),
        ("no call hung", not any(" took " in v for f in found.values() for v in f.violations)),
        ("every trial went on when the line was good again", all(f.resumed == f.ended for f in found.values())),
    )
