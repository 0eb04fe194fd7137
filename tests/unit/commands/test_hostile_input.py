"""What a hostile file or argument makes a command print: one printable line of at most 300 letters, exit code 2."""

from __future__ import annotations

import os
import shutil
import sqlite3
import subprocess
import sys
import zlib
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from harvey.cli import main
from harvey.errors import MOST_LETTERS, MOST_OF_A_WORD, PlainOutput, in_one_line
from harvey.hardware.drivers.base_driver import SerialLink
from recorded_runs import Recorded
from world_models.files.packed import MOST_UNPACKED_BYTES, unpack_frame

SCENARIO = """\
world = "research_center"
start = { locale = "hallway", at = [1, 1], heading = 0 }
goal = "Go to the library"
[truth]
NAME = 1
"""


@given(st.text(max_size=2000))
def test_any_text_is_one_printable_line(text: str) -> None:
    line = in_one_line(text)
    assert (line.isprintable() or not line) and len(line) <= MOST_LETTERS
    is_short = len(text) <= MOST_LETTERS and all(len(word) <= MOST_OF_A_WORD for word in text.split(" "))
    if text.isprintable() and is_short:
        assert line == text


def test_of_what_is_long_the_middle_is_left_out() -> None:
    line = in_one_line(f"{'a' * 5000}.pgm: expected a picture, got none")
    assert line.startswith("aaa") and line.endswith("a.pgm: expected a picture, got none") and len(line) < 210


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert main(words) == 2
    out, line = capsys.readouterr()
    assert not out and line.count("\n") == 1 and line[:-1].isprintable() and len(line) <= MOST_LETTERS + 1
    return line


@pytest.mark.parametrize("name", ['"' + "a" * 100_000 + '"', '"' + "a b " * 25_000 + '"', '"\\u001b[31m\\u0000"'])
def test_a_name_in_a_scenario_is_shown_short(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str,
) -> None:
    (tmp_path / "s.toml").write_text(SCENARIO.replace("NAME", name))
    assert "expected" in refused(capsys, "run", str(tmp_path / "s.toml"))


@pytest.mark.parametrize("words", ["run", "world check", "drive"])
def test_only_regular_files_are_read(tmp_path: Path, capsys: pytest.CaptureFixture[str], words: str) -> None:
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "zero.toml").symlink_to("/dev/zero")
    os.mkfifo(tmp_path / "pipe.world")
    for name in ("pipe.toml", "zero.toml", *(["pipe.world"] if words == "world check" else [])):
        assert "regular file" in refused(capsys, *words.split(), str(tmp_path / name))


@pytest.mark.parametrize("name", ["run.json", "result.json", "camera.mjpeg", "journal.jsonl", "campaign.json"])
@pytest.mark.parametrize("what", ["pipe", "zero"])
def test_only_regular_files_of_a_run_are_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], recorded: Recorded, name: str, what: str
) -> None:
    run = tmp_path / "run"
    shutil.copytree(recorded("office").path, run)
    (run / "results.jsonl").touch()
    (run / name).unlink(missing_ok=True)
    os.mkfifo(run / name) if what == "pipe" else (run / name).symlink_to("/dev/zero")
    for words in ("story", "replay", "resume") if name != "campaign.json" else ("campaign show",):
        assert main([*words.split(), str(run)]) in ((2,) if name in ("journal.jsonl", "campaign.json") else (0, 1, 2))


def test_files_that_name_others_are_read_so_often_at_most(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for depth in range(7):
        copies = "".join(f'[locales.c{k}]\nfrom = "{depth + 1}.toml"\nprefix = "p{k}-"\n' for k in range(6))
        (tmp_path / f"{depth}.toml").write_text(f'name = "f{depth}"\nunits = "metres"\n{copies}')
    (tmp_path / "7.toml").write_text('name = "f"\nunits = "metres"\n[locales.a]\nkind = "room"\nsize = [4, 4]\n')
    assert "at most 5000 times" in refused(capsys, "world", "check", str(tmp_path / "0.toml"))


@pytest.mark.parametrize("spoil", [
    "update frame set packed = (select about from meta) where name = (select name from frame)",
    "alter table frame rename to frames; create view frame as select 'a' as name, 1 as packed",
    "update meta set sha256 = replace(sha256, substr(sha256, 1, 1), 'x')"])
def test_a_compiled_world_with_other_contents_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], spoil: str
) -> None:
    out = tmp_path / "f.world"
    assert main(["world", "compile", "research_center", "--out", str(out)]) == 0 and capsys.readouterr()
    with closing(sqlite3.connect(out)) as file:
        file.executescript(spoil)
    assert "compiled world" in refused(capsys, "world", "check", str(out))


def test_a_piece_that_stands_for_too_much_is_not_unpacked() -> None:
    with pytest.raises(ValueError, match="more than"):
        unpack_frame(zlib.compress(bytes(MOST_UNPACKED_BYTES + 1)))


def test_a_port_opens_nothing_but_a_line(tmp_path: Path) -> None:
    victim = tmp_path / "victim.txt"
    victim.write_text("mine")
    for url in (f"spy://loop://?file={victim}", f"loop://spy://loop://?file={victim}", f"SPY://loop://?file={victim}",
                f"alt://loop://?class=x&file={victim}"):
        with pytest.raises(OSError, match="expected a serial port"):
            SerialLink(url, 9600)
    assert victim.read_text() == "mine"
    SerialLink("loop://", 9600).close()


def test_what_a_foreign_text_says_moves_no_cursor(capsys: pytest.CaptureFixture[str]) -> None:
    print("\x1b]0;title\x07 \u202eback\tline", file=PlainOutput(sys.stdout))
    assert capsys.readouterr().out == "\\x1b]0;title\\x07 \\u202eback\tline\n"


@pytest.mark.parametrize("closed", [">&-", ">&- 2>&-", "<&- >&- 2>&-"])
def test_a_command_goes_on_without_its_outputs(tmp_path: Path, closed: str) -> None:
    command = f"{sys.executable} -m harvey.cli world new cottage {closed}"
    assert subprocess.run(["sh", "-c", command], cwd=tmp_path).returncode == 0
    assert (tmp_path / "cottage.toml").read_text().startswith("#")
