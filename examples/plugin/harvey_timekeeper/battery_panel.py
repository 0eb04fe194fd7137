"""A panel of one's own in the recording: what is left of the battery, as a plot."""

from __future__ import annotations

from collections.abc import Sequence

import rerun as rr
import rerun.blueprint as rrb

from harvey_timekeeper.timekeeper import BATTERY_S
from logs.recording.logger import Logger, Moment, Panel
from logs.recording.stream import RecordingStream
from world_models.entries import MotionReport

BATTERY = "battery"


class BatteryPanel(Logger):
    """Logs what is left of the battery after each motion."""

    def panels(self) -> Sequence[Panel]:
        return (Panel(rrb.TimeSeriesView(origin=f"/{BATTERY}", name="Battery left [s]")),)

    def begin(self, stream: RecordingStream) -> None:
        stream.fix(BATTERY, rr.SeriesLines(names=["left"]))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        for report in moment.changed(MotionReport):
            stream.log(BATTERY, rr.Scalars, scalars=[BATTERY_S - report.value.sim_time_s])
