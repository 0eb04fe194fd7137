"""The table of docs/knowledge-sources.md, made from the classes.

``python -m docs.tools.knowledge_source_table`` prints it with the rows of other packages.
"""

from __future__ import annotations

from collections.abc import Iterable

from blackboard import KnowledgeSource
from harvey.wiring import KNOWLEDGE_SOURCES, foreign_sources
from knowledge_sources.priority import Priority
from world_models.building.locale_frame import FrameRequest

EVERYBODY_WRITES = (FrameRequest,)
"""Left out of the table: each knowledge source of a robot may ask for a locale frame."""


def describe_knowledge_sources() -> str:
    """The table of those that come with Harvey."""
    return "\n".join(rows(KNOWLEDGE_SOURCES))


def rows(sources: Iterable[type[KnowledgeSource]]) -> list[str]:
    """The table in markdown, a line an element."""
    head = ["| knowledge source | watches | needs | priority | writes |", "|---|---|---|---|---|"]
    return head + [_row(source) for source in sources]


def _row(source: type[KnowledgeSource]) -> str:
    watches = ", ".join(dict.fromkeys(watch.value_type.__name__ for watch in source.on))
    needs = ", ".join(need.name for need in source.needs) or "nothing but what it watches"
    writes = ", ".join(kind.__name__ for kind in source.writes if kind not in EVERYBODY_WRITES)
    closes = "" if source.closes is None else ", closes"
    name = source.__module__.rpartition(".")[2]
    return f"| `{name}` {source.level}{closes} | {watches} | {needs} | {_tell_priority(source)} | {writes} |"


def _tell_priority(source: type[KnowledgeSource]) -> str:
    """The name of its priority; where its own ``rate`` tells it by the case, that."""
    if source.rate is not KnowledgeSource.rate:
        return "by the case"
    return source.priority.name.lower() if isinstance(source.priority, Priority) else f"{source.priority:g}"


if __name__ == "__main__":
    print("\n".join(rows((*KNOWLEDGE_SOURCES, *foreign_sources().values()))))
