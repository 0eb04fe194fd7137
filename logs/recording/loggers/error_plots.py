"""Error plots: belief minus truth with the belief's own bands, and discrepancies against their bounds.

Where nobody knows the truth, the bands lie round zero.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import rerun as rr
import rerun.blueprint as rrb

from logs.recording.logger import NEAR, Logger, Moment, Panel
from logs.recording.palette import BELIEVED, LEVELS, PLANNED, faint
from logs.recording.paths import DEVIATION, HEADING, POSITION
from logs.recording.stream import RecordingStream
from world_models.entries import Discrepancy, Hypothesis
from world_models.frames import Pose2

MM = 1e3
WHEN: Mapping[str, str] = {"action": "on the move", "plan": "at a milestone"}
OFF_SCALE = 2.0
"""What could not be measured at all is drawn so many times its bound high."""
MAX_SHOWN_MM, MAX_SHOWN_DEG, MAX_SHOWN_PX = 25.0, 2.0, 40.0
"""Reach of the plots; what is beyond it is off the scale, and meant to look so."""


class Errors(Logger):
    """Logs how far the belief is from the truth, where that is known, and what differs from what was expected.

    One standard deviation of the belief lies to either side of an error: a band far from zero is too sure of itself. No
    error lies beyond the protection level.
    """

    def panels(self) -> Sequence[Panel]:
        """Place and, behind it, heading to the left, where a scale has room; discrepancies to the right."""
        place = _plot(POSITION, "Position error [mm]: ahead orange, left blue", -MAX_SHOWN_MM, MAX_SHOWN_MM)
        heading = _plot(HEADING, "Heading error [degrees]", -MAX_SHOWN_DEG, MAX_SHOWN_DEG)
        surprise = _plot(DEVIATION, "Surprise, and what is allowed [px]", 0.0, MAX_SHOWN_PX)
        return Panel(place, "words", 3, 6), Panel(heading, "words", 3, 6), Panel(surprise, order=2, share=6)

    def begin(self, stream: RecordingStream) -> None:
        stream.fix(POSITION, _style(["ahead ±1 sigma", "left ±1 sigma"], "mm"))
        stream.fix(f"{POSITION}/protection", rr.SeriesLines(
            names=["protection level", ""], colors=[faint(BELIEVED, 110)] * 2, widths=[1.0] * 2))
        stream.fix(HEADING, _style(["turned left ±1 sigma"], "deg"))
        for level, when in WHEN.items():
            stream.fix(f"{DEVIATION}/{level}", rr.SeriesLines(
                names=[when, "allowed there"], colors=[LEVELS[level], faint(LEVELS[level], 110)], widths=[2.0, 1.0]))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        if moment.touched(Hypothesis) and (held := moment.held) is not None:
            error = moment.off or Pose2(0.0, 0.0, 0.0)
            stream.log(POSITION, rr.Measurements, values=[MM * error.x_m, MM * error.y_m],
                       variances=[(MM * held.sigma_m) ** 2] * 2)
            level_mm = MM * held.value.protection_m
            stream.log(f"{POSITION}/protection", rr.Scalars, scalars=[level_mm, -level_mm])
            stream.log(HEADING, rr.Measurements, values=[math.degrees(error.heading_rad)],
                       variances=[math.degrees(held.value.sigma_rad) ** 2])
        for entry in moment.changed(Discrepancy):
            found = entry.value
            if found.magnitude is not None and found.unit == "px" and math.isfinite(found.bound):
                seen = found.magnitude if math.isfinite(found.magnitude) else OFF_SCALE * found.bound
                stream.log(f"{DEVIATION}/{found.level}", rr.Scalars, scalars=[seen, found.bound])


def _style(names: list[str], unit: str) -> rr.Measurements:
    count = len(names)
    return rr.Measurements.from_fields(
        units=[unit] * count, names=names, colors=[PLANNED, BELIEVED][:count], widths=[1.5] * count)


def _plot(origin: str, name: str, low: float, high: float) -> rrb.TimeSeriesView:
    legend = rrb.PlotLegend(rrb.Corner2D.LeftTop, visible=low >= 0.0)
    return rrb.TimeSeriesView(
        origin=origin, name=name, plot_legend=legend, axis_x=NEAR, axis_y=rrb.ScalarAxis(range=(low, high)))


LOGGERS = (Errors,)
