"""Golden pages: what is said of three recorded runs, word for word, as ``tests/golden/pages/`` has it.

Where decisions or words are meant to change, delete a page: the next test writes it, and fails, so that it is read.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from harvey.cli import main
from harvey.report.page import build_page
from logs.explain.questions_in_words import QUESTIONS
from logs.timeline import Timeline
from recorded_runs import Recorded

PAGES = Path(__file__).parents[2] / "golden" / "pages"
ASKED = ((), ("--at", "60"), ("MotorCommand-2.0", "--depth", "3"), ("Hypothesis-1.20",), ("--milestone", "M1"),
         ("--not", "motor"), ("--not", "prober", "--at", "60"), ("--not", "Milestone-1"), ("--check",),
         *((question,) for question in sorted(QUESTIONS)), ("is the door shut?", "--at", "60"))


@pytest.mark.parametrize("name", ["bump", "box", "shut door"])
def test_what_is_said_of_a_run_is_on_its_page(
    name: str, recorded: Recorded, capsys: pytest.CaptureFixture[str]
) -> None:
    run, page = recorded(name), PAGES / f"{name.replace(' ', '-')}.txt"
    said = []
    for argv in (("story", str(run.path)), *(("why", str(run.path), *asked) for asked in ASKED)):
        code = main(list(argv))
        printed = capsys.readouterr()
        text = f"$ {' '.join((argv[0], *argv[2:]))}: {code}\n{printed.out}{printed.err}"
        said.append(text.replace(str(run.path), "RUN"))
    report = build_page(run, Timeline(run.journal))
    said += ["$ report\n", *(f"{row}\n" for row in re.findall(r"<(?:tr|h2|li)\b.*?</(?:tr|h2|li)>", report))]
    text = "\n".join(said)
    if not page.exists():
        page.parent.mkdir(exist_ok=True)
        page.write_text(text, "utf-8")
        pytest.fail(f"{page} was not there, and is written: read it")
    assert text.splitlines() == page.read_text("utf-8").splitlines()
