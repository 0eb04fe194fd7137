"""The table of experts in ARCHITECTURE.md, made from the classes: ``python -m harvey.ks_table``."""

from __future__ import annotations

from collections.abc import Iterable

from blackboard.change import Watch
from harvey.wiring import EXPERTS
from knowledge_sources.expert import Expert


def rows(experts: Iterable[type[Expert]]) -> list[str]:
    """The table in markdown, a line an element."""
    head = ["| expert | level | closes | wakes on | writes | what it does |", "|---|---|---|---|---|---|"]
    return head + [_row(expert) for expert in experts]


def _row(expert: type[Expert]) -> str:
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
    print("\n".join(rows(EXPERTS)))
