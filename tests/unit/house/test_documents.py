"""README and ARCHITECTURE say what is: table and picture are current, commands parse."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

from docs.tools.architecture_picture import PICTURE, draw_architecture, name_of
from docs.tools.knowledge_source_table import rows
from harvey.cli import parser
from harvey.wiring import KNOWLEDGE_SOURCES, load_kinds

ROOT = Path(__file__).parents[3]


def test_the_table_of_knowledge_sources_is_the_one_that_the_classes_give() -> None:
    text = (ROOT / "docs" / "knowledge-sources.md").read_text(encoding="utf-8")
    table = text.split("<!-- knowledge sources -->\n")[1].split("\n<!-- /knowledge sources -->")[0]
    assert table.splitlines() == rows(KNOWLEDGE_SOURCES)


def test_the_picture_is_the_one_that_the_classes_give() -> None:
    """It names every knowledge source and every kind of entry; ``python -m docs.tools.architecture_picture``."""
    picture = PICTURE.read_text(encoding="utf-8")
    assert picture == draw_architecture(KNOWLEDGE_SOURCES, load_kinds())
    words = {name for text in re.findall(r"<text[^>]*>([^<]*)</text>", picture) for name in text.split(" · ")}
    assert words >= {name_of(source) for source in KNOWLEDGE_SOURCES} | set(load_kinds())


def test_every_command_shown_in_the_readme_parses() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    shown = re.findall(r"^(?:\.venv/bin/)?harvey ([^#\n]+)", text, re.MULTILINE)
    assert len(shown) >= 8
    for line in shown:
        parser().parse_known_args(shlex.split(line))
