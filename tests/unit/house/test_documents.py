"""README and ARCHITECTURE say what is: the experts' table is current, links lead somewhere, commands parse."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from docs.tools.knowledge_source_table import rows
from harvey.cli import parser
from harvey.wiring import KNOWLEDGE_SOURCES

ROOT = Path(__file__).parents[3]
DOCUMENTS = ("README.md", "ARCHITECTURE.md")


def test_the_experts_table_is_the_one_that_the_classes_give() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    held = text.split("<!-- experts -->\n")[1].split("\n<!-- /experts -->")[0]
    assert held.splitlines() == rows(KNOWLEDGE_SOURCES)


@pytest.mark.parametrize("document", DOCUMENTS)
def test_links_and_files_named_exist(document: str) -> None:
    text = (ROOT / document).read_text(encoding="utf-8")
    links = [link for link in re.findall(r"\]\(([^)#]+)\)", text) if "://" not in link]
    assert links
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_every_command_shown_in_the_readme_parses() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    shown = re.findall(r"^(?:\.venv/bin/)?harvey ([^#\n]+)", text, re.MULTILINE)
    assert len(shown) >= 8
    for line in shown:
        parser().parse_known_args(shlex.split(line))
