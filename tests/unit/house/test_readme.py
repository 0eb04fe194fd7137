"""README is short enough to be read, and shows what it says."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[3]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
MOST_WORDS, MOST_LINES, MOST_LETTERS = 800, 140, 124
PICTURES = re.compile(r"!\[[^\]]+\]\(([^)]+)\)")


def test_it_is_of_two_screens() -> None:
    assert len(TEXT.split()) <= MOST_WORDS
    assert TEXT.count("\n") <= MOST_LINES
    prose = [line for line in TEXT.splitlines() if not line.startswith(("|", "!["))]
    assert [line for line in prose if len(line) > MOST_LETTERS] == []


def test_a_moving_picture_comes_first_and_each_of_the_others_has_its_sentence() -> None:
    first, *others = PICTURES.findall(TEXT)
    assert first.endswith("rescue.webp") and 6 <= len(others) <= 10
    rows = [line for line in TEXT.splitlines() if PICTURES.match(line.strip("| "))]
    assert len(rows) == len(others) + 1
    for row in rows[1:]:
        name, said = re.fullmatch(r"\*\*(.+?)\.\*\* (.+)", row.split("|")[2].strip()).groups()  # type: ignore[union-attr]
        assert name and said.count(". ") == 0 and said.endswith(".")


def test_the_first_python_is_ten_lines_that_drive_and_ask_why() -> None:
    code, = re.findall(r"^```python\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)
    assert code.count("\n") <= 10
    assert "harvey.run(" in code and ".why(" in code
