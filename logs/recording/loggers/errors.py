"""Error plots: belief minus truth with the belief's own bands, and discrepancies against their bounds.

Where nobody knows the truth, the bands lie round zero.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import rerun as rr
import rerun.blueprint as rrb

from blackboard.servoing import Discrepancy
from logs.recording.board_mirror import Held, Moment
from logs.recording.logger import NEAR, Logger, Panel, Subject
from logs.recording.palette import BELIEVED, LEVELS, PLANNED, faint
from logs.recording.paths import DEVIATION, HEADING, POSITION
from logs.recording.stream import RecordingStream
from world_models.entries.location import Hypothesis
from world_models.frames import Pose2

MM = 1e3

WHEN: Mapping[str, str] = {"action": "on the move", "plan": "at a milestone"}

OFF_SCALE = 2.0
"""What could not be measured at all is drawn so many times its bound high."""


MAX_SHOWN_MM, MAX_SHOWN_DEG, MAX_SHOWN_PX = 25.0, 2.0, 40.0
"""Reach of the plots; what is beyond it is off the scale, and meant to look so."""


class Errors(Logger):
    """Logs how far the belief is from the truth, where that is known, and what differs from what was expected.

    One standard deviation of the belief lies to either side of an error: a band far from zero is too sure of itself.
    """

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._belief = subject.belief
        self._truth: Pose2 | None = None

    def panels(self) -> Sequence[Panel]:
        """Place and, behind it, heading to the left, where a scale has room; discrepancies to the right."""
        place = _plot(POSITION, "Position error [mm]: ahead orange, left blue", -MAX_SHOWN_MM, MAX_SHOWN_MM)
        heading = _plot(HEADING, "Heading error [degrees]", -MAX_SHOWN_DEG, MAX_SHOWN_DEG)
        surprise = _plot(DEVIATION, "Surprise, and what is allowed [px]", 0.0, MAX_SHOWN_PX)
        return Panel(place, "words", 3, 6), Panel(heading, "words", 3, 6), Panel(surprise, order=2, share=6)

    def begin(self, stream: RecordingStream) -> None:
        stream.fix(POSITION, _style(["ahead ±1 sigma", "left ±1 sigma"], "mm"))
        stream.fix(HEADING, _style(["turned left ±1 sigma"], "deg"))
        for level in ("action", "plan"):
            colours = [LEVELS[level], faint(LEVELS[level], 110)]
            names = [WHEN[level], "allowed there"]
            stream.fix(f"{DEVIATION}/{level}", rr.SeriesLines(names=names, colors=colours, widths=[2.0, 1.0]))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        for pose in moment.truth[-1:]:
            self._truth = pose
        if moment.touched(Hypothesis):
            self._log(stream, self._belief.now(moment.mirror))
        for entry in moment.changed(Discrepancy):
            _deviation(stream, entry.value)

    def _log(self, stream: RecordingStream, held: Held | None) -> None:
        if held is None:
            return
        sigma_mm, sigma_deg = MM * held.sigma_m, math.degrees(held.sigma_rad)
        error = Pose2(0.0, 0.0, 0.0)
        if self._truth is not None:
            error = self._truth.inverse() @ held.world_from_robot
        stream.log(POSITION, rr.Measurements, values=[MM * error.x_m, MM * error.y_m], variances=[sigma_mm**2] * 2)
        stream.log(HEADING, rr.Measurements, values=[math.degrees(error.heading_rad)], variances=[sigma_deg**2])


def _style(names: list[str], unit: str) -> rr.Measurements:
    count = len(names)
    return rr.Measurements.from_fields(
        units=[unit] * count, names=names, colors=[PLANNED, BELIEVED][:count], widths=[1.5] * count)


def _deviation(stream: RecordingStream, found: Discrepancy) -> None:
    if found.magnitude is None or found.unit != "px" or not math.isfinite(found.bound):
        return
    seen = found.magnitude if math.isfinite(found.magnitude) else OFF_SCALE * found.bound
    stream.log(f"{DEVIATION}/{found.level}", rr.Scalars, scalars=[seen, found.bound])


def _plot(origin: str, name: str, low: float, high: float) -> rrb.TimeSeriesView:
    legend = rrb.PlotLegend(rrb.Corner2D.LeftTop, visible=low >= 0.0)
    return rrb.TimeSeriesView(
        origin=origin, name=name, plot_legend=legend, axis_x=NEAR, axis_y=rrb.ScalarAxis(range=(low, high)))


LOGGERS = (Errors,)
