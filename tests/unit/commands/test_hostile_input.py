"""What a hostile file or argument makes a command print: one printable line of at most 300 letters, exit code 2."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from harvey.cli import main
from harvey.errors import MOST_LETTERS, MOST_OF_A_WORD, in_one_line

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
