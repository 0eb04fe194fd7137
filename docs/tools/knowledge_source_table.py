"""The table of experts in ARCHITECTURE.md, made from the classes: ``python -m docs.tools.knowledge_source_table``."""

from __future__ import annotations

from collections.abc import Iterable

from blackboard.change import Watch
from harvey.wiring import KNOWLEDGE_SOURCES
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource


def rows(experts: Iterable[type[RobotKnowledgeSource]]) -> list[str]:
    """The table in markdown, a line an element."""
    head = ["| expert | level | closes | wakes on | writes | what it does |", "|---|---|---|---|---|---|"]
    return head + [_row(expert) for expert in experts]


def _row(expert: type[RobotKnowledgeSource]) -> str:
    told = (expert.__doc__ or "").strip().split("\n\n")[0]
    wakes = ", ".join(dict.fromkeys(_watch(watch) for watch in expert.watches))
    writes = ", ".join(kind.__name__ for kind in expert.writes)
    closes = "" if expert.closes is None else str(expert.closes)
    name = expert.__module__.rpartition(".")[2]
    return f"| `{name}` | {expert.level} | {closes} | {wakes} | {writes} | {' '.join(told.split())} |"


def _watch(watch: Watch) -> str:
    kinds = "/".join(kind.__name__.lower() for kind in watch.kinds)
    return f"{watch.value_type.__name__} {kinds}"


if __name__ == "__main__":
    print("\n".join(rows(KNOWLEDGE_SOURCES)))
