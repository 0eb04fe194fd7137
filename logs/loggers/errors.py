"""Error plots: belief minus truth with the belief's own bands, and discrepancies against their bounds."""

from __future__ import annotations

import math

import rerun as rr

from blackboard.servoing import Discrepancy
from logs.loggers.robots import believed
from logs.mirror import Moment
from logs.palette import BELIEVED, LEVELS, PLANNED, Colour, faint
from logs.paths import DEVIATION, HEADING, POSITION
from logs.tape import Tape
from world_models.frames import Pose2
from world_models.location import Hypothesis
from world_models.world import World

MM = 1e3


class Errors:
    """Logs how far the belief is from the truth, where that is known, and what differs from what was expected."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._truth: Pose2 | None = None

    def begin(self, tape: Tape) -> None:
        _line(tape, f"{POSITION}/ahead", "ahead", PLANNED)
        _line(tape, f"{POSITION}/left", "to the left", BELIEVED)
        _line(tape, f"{HEADING}/error", "error", PLANNED)
        for level in ("action", "plan"):
            _line(tape, f"{DEVIATION}/{level}", f"{level}: seen", LEVELS[level])
            _line(tape, f"{DEVIATION}/{level}_bound", f"{level}: bound", faint(LEVELS[level], 110))

    def log(self, tape: Tape, moment: Moment) -> None:
        for pose in moment.truth[-1:]:
            self._truth = pose
        if moment.touched(Hypothesis):
            self._belief(tape, believed(moment.mirror))
        for entry in moment.changed(Discrepancy):
            _deviation(tape, entry.value)

    def _belief(self, tape: Tape, held: Hypothesis | None) -> None:
        if held is None:
            return
        _band(tape, f"{POSITION}/sigma", MM * held.sigma_m, "mm")
        _band(tape, f"{HEADING}/sigma", math.degrees(held.sigma_rad), "deg")
        if self._truth is not None:
            error = self._truth.inverse() @ held.world_from_robot(self._world)
            tape.log(f"{POSITION}/ahead", rr.Scalars(MM * error.x_m))
            tape.log(f"{POSITION}/left", rr.Scalars(MM * error.y_m))
            tape.log(f"{HEADING}/error", rr.Scalars(math.degrees(error.heading_rad)))


def _deviation(tape: Tape, found: Discrepancy) -> None:
    if found.magnitude is None or found.unit != "px" or not math.isfinite(found.bound):
        return
    tape.log(f"{DEVIATION}/{found.level}_bound", rr.Scalars(found.bound))
    if math.isfinite(found.magnitude):
        tape.log(f"{DEVIATION}/{found.level}", rr.Scalars(found.magnitude))


def _line(tape: Tape, path: str, name: str, colour: Colour) -> None:
    tape.fix(path, rr.SeriesLines(names=[name], colors=[colour], widths=[2.0]))


def _band(tape: Tape, path: str, sigma: float, unit: str) -> None:
    """One standard deviation to either side of nought."""
    tape.log(path, rr.Measurements(0.0, variances=sigma**2, units=[unit], names=["belief: ±1 sigma"], colors=[BELIEVED],
                                   widths=[0.5]))
