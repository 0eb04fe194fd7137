"""``harvey why RUN --not NAME``: the answers about a knowledge source or an entry."""

from __future__ import annotations

import difflib
from collections.abc import Iterator

from blackboard.knowledge_source import KnowledgeSource
from harvey.errors import BadInput
from harvey.run_files.run_directory import RunDirectory
from harvey.why.history import History
from harvey.why.links import words
from harvey.why.why_not import Fate, in_cycle, in_run, of_entry, tell_fates


def answers(run: RunDirectory, history: History, name: str, cycle: int | None) -> Iterator[str]:
    """Why a knowledge source did not act (in a cycle), or why an entry did not stay.

    Raises:
        BadInput: the run has no such entry and no such knowledge source; near ones are named.
    """
    if "-" in name:
        yield from of_entry(history, history.resolve(name))
        return
    source = name.lower().replace(" ", "_")
    if cycle is None:
        occasions = in_run(history, source)
        if not occasions:
            yield from _never(run, source)
        yield from tell_fates(source, occasions)
        return
    found = in_cycle(history, source, cycle)
    if found:
        for one in found:
            yield f"In cycle {cycle} the {words(source)} {one.fate.value} on {one.trigger}: {one.why}."
    else:
        yield from _ask_again(run, history, source, cycle)
    yield from _instead(history, cycle, any(one.fate in (Fate.ACTED, Fate.ASKED) for one in found))


def _instead(history: History, cycle: int, acted: bool) -> Iterator[str]:
    decision = history.decision(cycle)
    chosen = decision.chosen
    if chosen is None:
        yield f"Nobody acted in cycle {cycle}."
    elif not acted:
        made = ", ".join(r.ref for r in decision.made) or "nothing"
        yield (f"The {words(chosen.source)} acted, on {chosen.trigger}, rated {chosen.rating:.2f}, with the"
               f" {decision.focus} level in focus: it made {made}.")


def _never(run: RunDirectory, source: str) -> Iterator[str]:
    from harvey.agent import build_agent
    from harvey.run_files.run_head import RunHead

    agent = build_agent(RunHead.read(run.path))
    named = _find(source, agent.sources)
    if not agent.servoing.allows(named.closes):
        yield f"The {named.closes} level of servoing was off, and the {words(source)} closes it."


def _ask_again(run: RunDirectory, history: History, source: str, cycle: int) -> Iterator[str]:
    """The knowledge source is asked once more, on the board as it was."""
    from harvey.agent import build_agent
    from harvey.run_files.run_head import RunHead
    from harvey.why.ask import why_absent

    head = RunHead.read(run.path)
    if source in head.without:
        yield f"The {words(source)} was left out of this run."
        return
    agent = build_agent(head)
    named = _find(source, agent.sources)
    if not agent.servoing.allows(named.closes):
        yield f"The {named.closes} level of servoing was off, and the {words(source)} closes it."
    else:
        yield from why_absent(history, named, cycle, agent.kinds, agent.store)


def _find(source: str, sources: tuple[KnowledgeSource, ...]) -> KnowledgeSource:
    names = [one.name for one in sources]
    if source not in names:
        near = difflib.get_close_matches(source, names, n=4, cutoff=0.5) or names
        raise BadInput(
            f"--not: expected a knowledge source as {', '.join(near)}, or an entry as Goal-1, got {source!r}")
    return sources[names.index(source)]
