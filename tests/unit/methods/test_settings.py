"""The table of settings: each number has a unit, a sentence and a source, and something reads it."""

from __future__ import annotations

import math
import re
from dataclasses import Field, fields
from pathlib import Path

import pytest

import knowledge_sources
from knowledge_sources.settings import DEFAULT

FOLDER = Path(knowledge_sources.__path__[0])
SETTINGS = [pytest.param(field, id=f"{room.name}.{field.name}")
            for room in fields(DEFAULT) for field in fields(getattr(DEFAULT, room.name))]
WORDS = {word for path in FOLDER.rglob("*.py") if path.parent.name != "settings"
         for word in re.findall(r"\w+", path.read_text(encoding="utf-8"))}


@pytest.mark.parametrize("field", SETTINGS)
def test_a_setting_has_a_unit_a_sentence_and_a_source(field: Field[float]) -> None:
    assert field.metadata["unit"] and field.metadata["source"]
    assert re.fullmatch(r"[A-Z].*\.", field.metadata["what"])
    assert math.isfinite(field.default)  # type: ignore[arg-type]
    assert type(field.default).__name__ == field.type


@pytest.mark.parametrize("field", SETTINGS)
def test_a_setting_is_read(field: Field[float]) -> None:
    assert field.name in WORDS
