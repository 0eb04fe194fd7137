"""Error plots: belief minus truth with the belief's own bands, and discrepancies against their bounds.

Where nobody knows the truth, the bands lie round nought.
"""

from __future__ import annotations

import math

import rerun as rr

from blackboard.servoing import Discrepancy
from logs.loggers.robots import believed
from logs.mirror import Moment
from logs.palette import BELIEVED, LEVELS, PLANNED, faint
from logs.paths import DEVIATION, HEADING, POSITION
from logs.tape import Tape
from world_models.frames import Pose2
from world_models.location import Hypothesis
from world_models.world import World

MM = 1e3

OFF_SCALE = 2.0
"""What could not be measured at all is drawn so many times its bound high."""


class Errors:
    """Logs how far the belief is from the truth, where that is known, and what differs from what was expected."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._truth: Pose2 | None = None

    def begin(self, tape: Tape) -> None:
        tape.fix(POSITION, _style(["ahead, ±1 sigma", "to the left, ±1 sigma"], "mm"))
        tape.fix(HEADING, _style(["heading, ±1 sigma"], "deg"))
        for level in ("action", "plan"):
            colours = [LEVELS[level], faint(LEVELS[level], 110)]
            names = [f"{level}: seen", f"{level}: bound"]
            tape.fix(f"{DEVIATION}/{level}", rr.SeriesLines(names=names, colors=colours, widths=[2.0, 1.0]))

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
        sigma_mm, sigma_deg = MM * held.sigma_m, math.degrees(held.sigma_rad)
        error = Pose2(0.0, 0.0, 0.0)
        if self._truth is not None:
            error = self._truth.inverse() @ held.world_from_robot(self._world)
        tape.log(POSITION, _band([MM * error.x_m, MM * error.y_m], sigma_mm))
        tape.log(HEADING, _band([math.degrees(error.heading_rad)], sigma_deg))


def _style(names: list[str], unit: str) -> rr.Measurements:
    count = len(names)
    return rr.Measurements.from_fields(
        units=[unit] * count, names=names, colors=[PLANNED, BELIEVED][:count], widths=[1.5] * count)


def _band(values: list[float], sigma: float) -> rr.Measurements:
    """Errors with one standard deviation of the belief to either side: a band far from nought is too sure of itself."""
    return rr.Measurements(values, variances=[sigma**2] * len(values))


def _deviation(tape: Tape, found: Discrepancy) -> None:
    if found.magnitude is None or found.unit != "px" or not math.isfinite(found.bound):
        return
    seen = found.magnitude if math.isfinite(found.magnitude) else OFF_SCALE * found.bound
    tape.log(f"{DEVIATION}/{found.level}", rr.Scalars([seen, found.bound]))
