"""harvey world edit: each save is checked and drawn; the last plan stays while the file cannot be read."""

from __future__ import annotations

import re
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from harvey.cli import main
from harvey.commands.world_editor import BuildingViewer, WorldEditor
from world_models.building.plan_view import plan_svg
from world_models.building.world import World
from world_models.files.first_world import first_world_text
from world_models.files.world_files import load_world

TEXT = first_world_text("attic", ["office", "library"])
PATIENCE_S = 30.0


class Desk:
    """A world file, its page, and what was said and shown."""

    def __init__(self, folder: Path) -> None:
        self.file, self.page = folder / "attic.toml", folder / "attic-plan.html"
        self.said: list[str] = []
        self.shown: list[World] = []
        self.save(TEXT)
        self.editor = WorldEditor(self.file, self.page, self.said.append, self.shown.append)

    def save(self, text: str) -> None:
        self.file.write_text(text, encoding="utf-8")

    def shows(self) -> str:
        return self.page.read_text(encoding="utf-8")


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    return Desk(tmp_path)


def test_the_page_has_the_plan_and_what_was_found(desk: Desk) -> None:
    assert desk.editor.look()
    assert plan_svg(load_world(desk.file)) in desk.shows() and "no faults in 3 rooms" in desk.shows()
    assert "http-equiv=\"refresh\"" in desk.shows() and [world.name for world in desk.shown] == ["attic"]
    assert sorted(path.name for path in desk.file.parent.iterdir()) == ["attic-plan.html", "attic.toml"]


@pytest.mark.parametrize(("broken", "line"), [
    (TEXT.replace('units = "metres"', 'units = metres"'), 4),
    (TEXT.replace('kind = "hallway"', 'kind = "hallway"\nsise = [3, 4]'), None),
    ("", None), ("name = \x00", 1),
])
def test_what_cannot_be_read_is_told_with_its_line_and_the_last_plan_stays(desk: Desk, broken: str, line: int | None,
                                                                           ) -> None:
    desk.editor.look()
    good = plan_svg(load_world(desk.file))
    desk.said.clear()
    desk.save(broken)
    assert not desk.editor.look()
    assert re.match(re.escape(str(desk.file)) + (f":{line}: " if line else ":"), desk.said[0])
    assert "the last that could be drawn" in desk.said[-1]
    assert good in desk.shows() and len(desk.shown) == 1
    desk.save(TEXT)
    assert desk.editor.look()


def test_a_fault_is_told_with_its_line_and_drawn(desk: Desk) -> None:
    desk.save(TEXT.replace('library-door = { between = ["library", "corridor"], wall = "south", along = 2',
                           'library-door = { between = ["library", "corridor"], wall = "south", along = 9'))
    assert not desk.editor.look()
    line = next(n for n, text in enumerate(desk.file.read_text().splitlines(), 1) if text.startswith("library-door"))
    assert any(said.startswith(f"{desk.file}:{line}: ") for said in desk.said)
    assert "<svg" in desk.shows() and "fault" in desk.said[-1]


def test_it_looks_again_only_at_what_has_changed_and_rests(desk: Desk) -> None:
    desk.editor.look()
    assert [desk.editor.look_again() for _ in range(3)] == [None] * 3
    desk.save(TEXT[:100])  # an editor in the middle of writing
    assert desk.editor.look_again() is None
    desk.save(TEXT + "# done\n")
    assert [desk.editor.look_again() for _ in range(3)] == [None, True, None]
    desk.file.unlink()
    assert [desk.editor.look_again() for _ in range(3)] == [None, False, None]


def test_it_follows_files_that_are_included(desk: Desk) -> None:
    finishes = desk.file.with_name("paints.toml")
    begin, end = TEXT.index("[finishes]"), TEXT.index("# What each room has")
    units = 'units = "metres"\n'
    finishes.write_text(units + TEXT[begin:end], encoding="utf-8")
    desk.save(TEXT[:begin].replace('units =', 'include = ["paints.toml"]\nunits =') + TEXT[end:])
    assert desk.editor.look(), desk.said
    finishes.write_text(units + TEXT[begin:end].replace("plaster", "plaister"), encoding="utf-8")
    assert [desk.editor.look_again() for _ in range(3)] == [None, False, None]


def test_it_watches_until_it_is_told_to_end(desk: Desk) -> None:
    ended = threading.Event()
    watching = threading.Thread(target=lambda: desk.editor.watch(ended.is_set))
    watching.start()
    try:
        wait_until(lambda: any("no faults" in said for said in desk.said))
        desk.save(TEXT.replace("[doors]", "[dors]"))
        wait_until(lambda: any("dors" in said for said in desk.said))
    finally:
        ended.set()
        watching.join()


def wait_until(holds: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE_S
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_the_viewer_gets_each_world_as_a_recording_of_its_own(desk: Desk, tmp_path: Path) -> None:
    stand_in = tmp_path / "viewer"  # keeps what it was asked to open
    stand_in.write_text(f"#!{sys.executable}\nimport shutil, sys, time\n"
                        f"shutil.copy(sys.argv[1], '{tmp_path}/' + str(time.time_ns()) + '.seen')\ntime.sleep(600)\n")
    stand_in.chmod(0o755)
    viewer = BuildingViewer(str(stand_in), tmp_path / "attic.rrd")
    world = load_world(desk.file)
    try:
        for number in (1, 2):
            viewer.show(world)
            wait_until(lambda n=number: len(list(tmp_path.glob("*.seen"))) == n)
    finally:
        viewer.close()
    first, second = (path.read_bytes() for path in sorted(tmp_path.glob("*.seen")))
    assert b"building of attic 1" in first and b"building of attic 2" in second


def test_the_command_looks_once_and_its_exit_code_tells(desk: Desk, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["world", "edit", str(desk.file)]) == 0
    assert f"the plan is in {desk.page}" in capsys.readouterr().out and "<svg" in desk.shows()
    desk.save("name = 3")
    assert main(["world", "edit", str(desk.file)]) == 2


@pytest.mark.parametrize(("argv", "told"), [
    (["none.toml"], "expected a .toml file to edit, got 'none.toml'; harvey world new NAME writes a first one"),
    (["attic.toml", "--page", "plan.png"], "--page: expected a name that ends in .html, got 'plan.png'"),
    (["attic.toml", "--page", "missing/plan.html"], "expected a file to write to, got: No such file or directory"),
    (["attic.toml", "--viewer"], "--viewer: expected a screen"),
])
def test_what_cannot_be_done_is_refused(desk: Desk, argv: list[str], told: str, monkeypatch: pytest.MonkeyPatch,
                                        capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(desk.file.parent)
    monkeypatch.setattr("harvey.commands.view.has_screen", lambda: False)
    assert main(["world", "edit", *argv]) == 2
    assert told in capsys.readouterr().err
