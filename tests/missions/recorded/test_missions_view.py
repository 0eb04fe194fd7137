"""``harvey view`` of a run: one of its pictures as a file, and the viewer in a browser, on this machine only."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from urllib.request import urlopen

import numpy as np
import pytest
from PIL import Image

import harvey
from elsewhere import ROOT
from harvey.cli import main
from recorded_runs import Recorded

HOSTING = re.compile(r"http://127\.0\.0\.1:(\d+)\?url=rerun%2Bhttp%3A%2F%2Flocalhost%3A(\d+)%2Fproxy")


@pytest.fixture(scope="module")
def run(recorded: Recorded) -> harvey.RecordedRun:
    return harvey.open_run(recorded("office").path)


def test_the_picture_of_a_cycle_is_the_newest_that_was_seen(
    run: harvey.RecordedRun, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pictures, out = list(run.pictures()), tmp_path / "seen.png"
    assert len(pictures) > 1
    for cycle in range(pictures[0].cycle, 1 + max(decision.cycle for decision in run.decisions())):
        expected = [picture for picture in pictures if picture.cycle <= cycle][-1]
        assert main(["view", str(run.path), "--picture", str(cycle), "--plain", "--save", str(out)]) == 0
        assert f"{expected.entry}, seen in cycle {expected.cycle}" in capsys.readouterr().out
        with Image.open(out) as written, Image.open(BytesIO(expected.jpeg)) as taken:
            assert written.format == "PNG"
            assert np.array_equal(np.asarray(written), np.asarray(taken))


def test_the_picture_of_a_milestone_shows_what_was_expected_and_what_was_found(
    run: harvey.RecordedRun, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    judged = next(decision.cycle for decision in run.decisions()
                  if any(change.type == "PoseFix" for change in decision.made))
    drawn, plain = tmp_path / "lines.png", tmp_path / "plain.png"
    assert main(["view", str(run.path), "--picture", str(judged), "--save", str(drawn)]) == 0
    assert re.search(r"lines: \d+ expected \(yellow\), \d+ found \(blue\), \d+ agreed \(green\)",
                     capsys.readouterr().out)
    assert main(["view", str(run.path), "--picture", str(judged), "--plain", "--save", str(plain)]) == 0
    with Image.open(drawn) as one, Image.open(plain) as other:
        changed = (np.asarray(one) != np.asarray(other)).any(axis=2)
        colours = {tuple(colour) for colour in np.asarray(one)[changed].tolist()}
    assert {(0xFF, 0xD8, 0x4A), (0x54, 0xF0, 0x8F)} <= colours and 0.0 < changed.mean() < 0.3


@pytest.mark.parametrize(("given", "said"), [
    (["--picture", "0"], "expected a cycle from the first picture to the end"),
    (["--picture", "99999"], "expected a cycle from the first picture to the end"),
    (["--picture", "20", "--save", "seen.jpg"], "expected a name that ends in .png, got 'seen.jpg'"),
    (["--picture", "20", "--save", "nowhere/seen.png"], "expected a file to write to"),
    (["--picture", "-1"], "expected a whole number from 0, got '-1'"),
    (["--picture", "20", "--web"], "not allowed with argument"),
    (["--plain"], "expected it with --picture"),
])
def test_what_cannot_be_shown_is_refused(
    run: harvey.RecordedRun, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    given: list[str], said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["view", str(run.path), *given]) == 2
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def listening() -> Iterator[tuple[str, int]]:
    """Address, as the kernel writes it, and port of every socket that waits for connections."""
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{table}").read_text(encoding="ascii").splitlines()[1:]:
            local, state = line.split()[1], line.split()[3]
            if state == "0A":
                address, _, port = local.rpartition(":")
                yield address, int(port, 16)


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="expected Linux's /proc, got none")
def test_the_viewer_in_a_browser_listens_on_this_machine_only(run: harvey.RecordedRun) -> None:
    without_screen = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    with subprocess.Popen([sys.executable, "-m", "harvey.cli", "view", str(run.path), "--web"], cwd=ROOT,
                          env=without_screen, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as viewer:
        assert viewer.stdout is not None
        try:
            said = next(found for line in viewer.stdout if (found := HOSTING.search(line)))
            page, data = map(int, said.groups())
            with urlopen(f"http://127.0.0.1:{page}") as answer:
                assert b"<html" in answer.read()
            assert {address for address, port in listening() if port in (page, data)} == {"0100007F"}
        finally:
            viewer.terminate()
            viewer.communicate()
    assert viewer.returncode == 143
