"""``harvey demo``: it tells of being kidnapped, lost and found, and leaves a page that needs nothing else."""

from __future__ import annotations

import webbrowser
from pathlib import Path

import pytest

from harvey.cli import main


@pytest.mark.parametrize("opens", [True, False])
def test_it_is_carried_off_refuted_lost_and_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], opens: bool
) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    assert main(["demo", "--out", str(tmp_path / "demo"), *([] if opens else ["--no-page"])]) == 0
    told = capsys.readouterr().out
    for words in ("kidnaps the robot", "refuted", "lost", "found", "harvey why", "harvey view"):
        assert words in told
    page = tmp_path / "demo" / "report.html"
    assert page.read_text(encoding="utf-8").startswith("<!DOCTYPE html>") and opened == [page.as_uri()] * opens
