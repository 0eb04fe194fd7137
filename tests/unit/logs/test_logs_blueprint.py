"""What a user sees: every view finds what it is to show, and in the viewer none of them complains."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

import docs.tools.look as looking
from docs.tools.look import look
from headless_viewer import look_or_skip, views
from logs.recording.logger import Subject, blueprint
from logs.recording.paths import BELIEVED_BODY, FAULTS, IMAGE
from logs.recording.writer import RecordingWriter, logger_classes
from logs.run_errors import RecordingError
from scripted_mission import CAMERA, MOUNT, house, play
from world_models.frames import Pose2

NEEDED: Mapping[str, tuple[str, ...]] = {
    "TextDocument": ("TextDocument:text",), "TextLog": ("TextLog:text",), "3D": ("Mesh3D:vertex_positions",),
    "2D": ("EncodedImage:blob",), "TimeSeries": ("Scalars:scalars", "Measurements:values"),
    "StateTimeline": ("StateChange:state",), "Graph": ("GraphNodes:node_ids",), "Dataframe": ("TextLog:text",),
}
"""A view of a kind shows nothing unless some entity of its contents has one of these."""

ONCE_SOMETHING_AILS = (f"/{FAULTS}",)

Logged = Mapping[str, set[str]]


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("blueprint") / "recording.rrd"
    recorder = RecordingWriter(path, world=house(), camera=CAMERA, mount=MOUNT, title="house", recording_id="house")
    play([recorder], lambda n: recorder.truth(Pose2(1.0 + 0.1 * n, 1.0, 0.0), 0.3 * n))
    recorder.close()
    return path


@pytest.fixture(scope="module")
def logged(recording: Path) -> Logged:
    """Entities and the components that they have."""
    known: dict[str, set[str]] = {}
    for chunk in RrdReader(recording).stream():
        known.setdefault(chunk.entity_path, set()).update(chunk.to_record_batch().schema.names)
    return known


def window() -> Any:
    """The blueprint of a whole recording."""
    subject = Subject("house", house(), CAMERA, MOUNT)
    return blueprint([logger(subject) for logger in logger_classes()]).root_container


def rules(view: Any) -> list[str]:
    """What a view includes (+) and leaves out (-), from the root."""
    given = [view.contents] if isinstance(view.contents, str) else list(view.contents)
    origin = "/" + view.origin.strip("/")
    return [rule if rule[0] in "+-" else f"+ {rule}" for rule in (r.replace("$origin", origin) for r in given)]


def matching(rule: str, logged: Logged) -> list[str]:
    path = rule[2:]
    if path.endswith("/**"):
        root = path.removesuffix("/**")
        return [entity for entity in logged if entity == root or entity.startswith(f"{root}/")]
    return [entity for entity in logged if entity == path]


def faults(view: Any, logged: Logged) -> list[str]:
    """What a view asks for and does not get."""
    found = [f"{view.name}: nothing at {rule}" for rule in rules(view)
             if not matching(rule, logged) and rule[2:] not in ONCE_SOMETHING_AILS]
    shown = {entity for rule in rules(view) if rule[0] == "+" for entity in matching(rule, logged)}
    shown -= {entity for rule in rules(view) if rule[0] == "-" for entity in matching(rule, logged)}
    needed = NEEDED[view.class_identifier]
    if not any(component in logged[entity] for entity in shown for component in needed):
        found.append(f"{view.name}: nothing there has {' or '.join(needed)}")
    overridden = [f"/{path}" for path in view.visualizer_overrides]
    return found + [f"{view.name}: overrides {path}" for path in overridden if path not in logged]


def test_every_view_finds_what_it_is_to_show(logged: Logged) -> None:
    shown = list(views(window()))
    assert {view.class_identifier for view in shown} == set(NEEDED)
    assert [fault for view in shown for fault in faults(view, logged)] == []


@pytest.mark.parametrize("view", [
    rrb.TextLogView(origin="decisions", name="v"), rrb.TimeSeriesView(origin="world", name="v"),
    rrb.Spatial2DView(origin="camera", contents=["+ /camera/picture/**"], name="v"),
])
def test_a_view_that_asks_in_vain_is_caught(view: Any, logged: Logged) -> None:
    assert faults(view, logged)


def test_the_table_selects_columns_that_there_are(logged: Logged) -> None:
    (table,) = (v for v in views(window()) if v.class_identifier == "Dataframe")
    query = table.properties["DataframeQuery"]
    selected = query.select.as_arrow_array().to_pylist()[0]["component_columns"]
    assert selected
    for column in selected:
        assert column["component"] in logged["/" + column["entity_path"].strip("/")]


def test_what_the_eyes_rest_on_is_logged(logged: Logged) -> None:
    assert "Cylinders3D:lengths" in logged[f"/{BELIEVED_BODY}"]
    assert "EncodedImage:blob" in logged[f"/{IMAGE}"]


def test_no_view_reports_anything(recording: Path, tmp_path: Path) -> None:
    last = max(cycle for chunk in RrdReader(recording).stream().filter(content="/decision/records", is_static=False)
               for cycle in chunk.to_record_batch().column("cycle").to_pylist())
    assert look_or_skip(recording, tmp_path / "pictures", [7, last]) == []
    pictures = sorted((tmp_path / "pictures").iterdir())
    assert sorted(p.name for p in pictures) == sorted([f"cycle-{last}.png", "cycle-7.png"])
    assert all(p.stat().st_size > 20_000 for p in pictures)


def test_a_recording_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"none\.rrd: expected a recording, got no such file"):
        look(tmp_path / "none.rrd", tmp_path, [1])


def test_a_viewer_that_draws_nothing_is_told_and_ends_with_what_it_started(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As one without a graphics driver, which answers at first. Only this machine could have reached it."""
    launcher = tmp_path / "rerun"
    launcher.write_text(f"#!/bin/sh\ncd {tmp_path}\nsleep 60 &\necho $! > started\necho $@ > told\nwait\n")
    launcher.chmod(0o755)

    class Client:
        def __init__(self, url: str) -> None:
            while not (tmp_path / "told").is_file() or not (tmp_path / "told").read_text():
                REAL_SLEEP(0.01)

        def save_screenshot(self, path: str) -> None:
            raise ConnectionError("transport error")

    monkeypatch.setattr(looking, "_executable", lambda: str(launcher))
    monkeypatch.setattr(looking, "ViewerClient", Client)
    monkeypatch.setattr(looking.time, "sleep", lambda _: None)
    with pytest.raises(RecordingError, match=r"draws nothing \(transport error\); a headless viewer needs a graphics"):
        look(recording, tmp_path / "pictures", [7])
    assert "--bind 127.0.0.1" in (tmp_path / "told").read_text()
    started = int((tmp_path / "started").read_text())
    for _ in range(500):
        if not is_running(started):
            break
        REAL_SLEEP(0.01)
    assert not is_running(started)


REAL_SLEEP = time.sleep


def is_running(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True
