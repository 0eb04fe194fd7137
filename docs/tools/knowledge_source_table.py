"""The table of knowledge sources in ARCHITECTURE.md, made from the classes.

``python -m docs.tools.knowledge_source_table`` prints it.
"""

from __future__ import annotations

from collections.abc import Iterable

from blackboard.knowledge_source import KnowledgeSource
from harvey.wiring import KNOWLEDGE_SOURCES, foreign_sources
from world_models.building.locale_frame import FrameRequest

EVERYBODY_WRITES = (FrameRequest,)
"""Left out of the table: each knowledge source of a robot may ask for a locale frame."""


def rows(sources: Iterable[type[KnowledgeSource]]) -> list[str]:
    """The table in markdown, a line an element."""
    head = ["| knowledge source | level | wakes on | writes | what it does |", "|---|---|---|---|---|"]
    return head + [_row(source) for source in sources]


def _row(source: type[KnowledgeSource]) -> str:
    what = (source.__doc__ or "").strip().split("\n\n")[0]
    wakes = ", ".join(dict.fromkeys(watch.value_type.__name__ for watch in source.on))
    writes = ", ".join(kind.__name__ for kind in source.writes if kind not in EVERYBODY_WRITES)
    level = str(source.level) + ("" if source.closes is None else ", closes it")
    name = source.__module__.rpartition(".")[2]
    return f"| `{name}` | {level} | {wakes} | {writes} | {' '.join(what.split())} |"


if __name__ == "__main__":
    print("\n".join(rows((*KNOWLEDGE_SOURCES, *foreign_sources().values()))))
