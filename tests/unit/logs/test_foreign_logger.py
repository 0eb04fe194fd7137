"""A logger of another installed package: found by its entry point, its panel is in the window, its data in the file."""

from __future__ import annotations

from pathlib import Path

import pytest

from blackboard import Blackboard, Decision, Level, Post
from headless_viewer import views
from logs.reader import read_series
from logs.recording.logger import Subject, blueprint
from logs.recording.paths import TABLE
from logs.recording.writer import RecordingWriter, logger_classes
from logs.run_errors import RecordingError
from scripted_mission import CAMERA, MOUNT, house, play
from seams import install

MODULE = '''
from dataclasses import dataclass

import rerun as rr
import rerun.blueprint as rrb

from blackboard.kinds import inference
from logs.recording.logger import Logger
from logs.recording.logger import Panel


@inference()
@dataclass(frozen=True)
class BatteryRunsShort:
    left_s: float

    def sentence(self):
        return f"the battery lasts for {self.left_s:.0f} s; then the robot stands"


class Changes(Logger):
    """How much changes on the board in a cycle."""

    def panels(self):
        return (Panel(rrb.TimeSeriesView(origin="changes", name="Changes a cycle")),)

    def log(self, stream, moment):
        stream.log("changes", rr.Scalars, scalars=[float(len(moment.changes))])


class NoLogger:
    """Not a logger."""
'''


def install_logger(folder: Path, monkeypatch: pytest.MonkeyPatch, entry_point: str) -> None:
    install(folder, monkeypatch, "accounts", MODULE, f"[harvey.loggers]\n{entry_point}\n")


def test_its_panel_is_in_the_window_and_its_data_in_the_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install_logger(tmp_path, monkeypatch, "changes = accounts:Changes")
    subject = Subject("house", house(), CAMERA, MOUNT)
    window = blueprint([logger(subject) for logger in logger_classes()]).root_container
    assert "Changes a cycle" in [view.name for view in views(window)]
    decisions: list[Decision] = []
    path = tmp_path / "recording.rrd"
    recorder = RecordingWriter(path, world=house(), camera=CAMERA, mount=MOUNT, title="house", recording_id="foreign")
    play([recorder, decisions.append])
    recorder.close()
    assert read_series(path, "changes", "Scalars:scalars") == [
        (d.cycle, float(len(d.observed) + len(d.made))) for d in decisions]


def test_a_kind_of_another_package_shows_in_the_decisions_by_its_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install_logger(tmp_path, monkeypatch, "changes = accounts:Changes")
    from accounts import BatteryRunsShort  # type: ignore[import-not-found]

    path = tmp_path / "recording.rrd"
    recorder = RecordingWriter(path, world=house(), camera=CAMERA, mount=MOUNT, title="house", recording_id="kind")
    made = Blackboard().apply([Post(BatteryRunsShort(90.0))], author="timekeeper", cycle=1)
    recorder(Decision(1, (), made, Level.ACTION, (), (), None, None, 0, (), ""))
    recorder.close()
    (_, text), = read_series(path, TABLE, "TextLog:text")
    assert text == "nobody had anything to do [the battery lasts for 90 s]"


@pytest.mark.parametrize("entry_point", ["changes = accounts:NoLogger", "changes = accounts:Missing"])
def test_what_is_no_logger_is_told_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, entry_point: str
) -> None:
    install_logger(tmp_path, monkeypatch, entry_point)
    with pytest.raises(RecordingError, match=r"accounts 1\.0: entry point harvey\.loggers, changes = accounts:"):
        logger_classes()
