"""What a user sees: the recording opens in the viewer and no view complains."""

from pathlib import Path

import pytest

from logs.errors import RecordingError
from logs.look import look
from logs.sink import Recorder
from rehearsal import CAMERA, MOUNT, house, play
from world_models.frames import Pose2


def test_no_view_reports_anything(tmp_path: Path) -> None:
    recording = tmp_path / "recording.rrd"
    recorder = Recorder(recording, world=house(), camera=CAMERA, mount=MOUNT, title="house", recording_id="house")
    scheduler = play([recorder], lambda n: recorder.truth(Pose2(1.0 + 0.1 * n, 1.0, 0.0), 0.3 * n))
    recorder.close()
    try:
        complaints = look(recording, tmp_path / "pictures", [7, scheduler.cycle])
    except RecordingError as error:
        pytest.skip(f"no headless viewer here: {error}")
    assert complaints == []
    pictures = sorted((tmp_path / "pictures").iterdir())
    assert [p.name for p in pictures] == [f"cycle-{scheduler.cycle}.png", "cycle-7.png"]
    assert all(p.stat().st_size > 20_000 for p in pictures)


def test_a_recording_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"none\.rrd: expected a recording, got no such file"):
        look(tmp_path / "none.rrd", tmp_path, [1])
