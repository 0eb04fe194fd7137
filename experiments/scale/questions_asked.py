"""Questions about a recorded run, answered by ``harvey why`` and by deciding again with the thing changed.

The run is decided again from its observations. At a cycle that is asked about the process forks: the child has board,
agenda and knowledge sources as they were, changes one thing, decides that one cycle, and tells what came of it.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from blackboard import Change, Effect, KnowledgeSource, Post, Retract, Scheduler, decision_record, plain
from harvey.agent import Agent, build_agent
from harvey.replay.why_not_again import Fate, in_cycle, why_absent
from harvey.runner.replay import open_originals, replay
from logs.explain.phrases import describe_decision
from logs.records import WHAT_IF, DecisionRecord, EntryRecord, decision_of
from logs.run_directory import RunDirectory
from logs.run_head import RunHead
from logs.timeline import Timeline

KINDS = ("what next", "why", "why not", "what if", "since when", "rested on", "did not rest on")
WOKEN = re.compile(r"woken by ([\w-]+\.\d+)")
COULD = "could have acted"
"""How :mod:`harvey.replay.why_not_again` says that a knowledge source would have acted."""


@dataclass(frozen=True, slots=True)
class Question:
    """A question with both answers.

    Attributes:
        kind: of KINDS; cycle: about which.
        text: in words.
        told: the answer of ``harvey why``; decided: that of deciding again.
    """

    kind: str
    cycle: int
    text: str
    told: str
    decided: str

    @property
    def agrees(self) -> bool:
        return self.told == self.decided


def ask(run: RunDirectory, number: int, rng: np.random.Generator) -> Iterator[Question]:
    """So many questions about a run, each kind as often as the others, as far as the run has occasions for it."""
    history, agent = Timeline(run.journal), build_agent(RunHead.read(run.path))
    deciding = [one for one in history.decisions() if one.chosen is not None and one.made and one.asks is None]
    chosen: dict[int, list[str]] = {}
    for n in range(number):
        cycle = int(rng.choice([one.cycle for one in deciding]))
        chosen.setdefault(cycle, []).append(KINDS[n % len(KINDS)])
    scheduler = agent.scheduler()
    asker = _Asker(history, agent, scheduler, rng)
    ready: list[Question] = []

    def before() -> None:
        cycle = scheduler.cycle + 1
        for kind in chosen.get(cycle, ()):
            ready.extend(asker.ask(kind, history.decision(cycle)))

    for _ in replay(run, open_originals(run, agent.store), scheduler, before=before):
        yield from ready
        ready.clear()


class _Asker:
    """Asks about the cycle that the scheduler comes to next."""

    def __init__(self, history: Timeline, agent: Agent, scheduler: Scheduler, rng: np.random.Generator) -> None:
        self._history, self._agent, self._scheduler, self._rng = history, agent, scheduler, rng
        self._sources = {source.name: source for source in agent.sources if agent.servoing.allows(source.closes)}

    def ask(self, kind: str, then: DecisionRecord) -> Iterator[Question]:
        """None, where the cycle has no occasion for a question of this kind."""
        asked: Mapping[str, Callable[[DecisionRecord], tuple[str, str, str] | None]] = {
            "what next": self._what_next, "why": self._why, "why not": self._why_not, "what if": self._what_if,
            "since when": self._since_when, "rested on": partial(self._rested_on, does=True),
            "did not rest on": partial(self._rested_on, does=False)}
        found = asked[kind](then)
        if found is not None:
            yield Question(kind, then.cycle, *found)

    def _pick(self, among: Collection[str]) -> str | None:
        return str(self._rng.choice(sorted(among))) if among else None

    def _what_next(self, then: DecisionRecord) -> tuple[str, str, str]:
        return "what did it do next?", _act(then.chosen, then.made), _decided(self._scheduler)

    def _why(self, then: DecisionRecord) -> tuple[str, str, str] | None:
        """Without what woke it, it does not act on that."""
        record = then.made[0]
        woken = WOKEN.search(describe_decision(self._history, record))
        entry = None if woken is None else self._scheduler.view.get(woken[1].rpartition(".")[0])
        if woken is None or entry is None or str(entry.ref) != woken[1] or then.chosen is None:
            return None

        def withdrawn() -> bool:
            self._scheduler.post([Retract(entry)], WHAT_IF)
            now = self._scheduler.step()
            return now is None or now.chosen is None or then.chosen is None or (
                (now.chosen.source.name, str(now.chosen.trigger.entry.ref)) != (then.chosen.source, woken[1]))

        return f"why was {record.ref} made?", f"for {woken[1]}", (
            f"for {woken[1]}" if _in_a_child(withdrawn) else f"without {woken[1]} too")

    def _why_not(self, then: DecisionRecord) -> tuple[str, str, str] | None:
        """With all others silent it acts where it was only outranked, and does not where it could not."""
        name = self._pick(self._sources.keys() - {then.chosen.source if then.chosen else ""})
        if name is None:
            return None
        found = in_cycle(self._history, name, then.cycle)
        could = any(one.fate is Fate.OUTRANKED for one in found) or (not found and any(
            COULD in text for text in why_absent(
                self._history, self._sources[name], then.cycle, self._agent.kinds, self._agent.store)))
        silent = [source for source in self._sources.values() if source.name != name]
        acted = _in_a_child(lambda: _acting(self._scheduler, silent) == name)
        words = {True: "it could have acted", False: "it could not act"}
        return f"why did the {name} not act?", words[could], words[acted]

    def _what_if(self, then: DecisionRecord) -> tuple[str, str, str] | None:
        """Without a knowledge source the next best acts, or all goes as it went."""
        name = then.chosen.source if then.chosen and self._rng.random() < 0.5 else self._pick(self._sources.keys())
        if name is None or then.chosen is None:
            return None
        instead = then.chosen if then.chosen.source != name else then.runner_up
        if instead is not None and instead.source == name:
            return None  # its next best is its own
        told = "nobody acts" if instead is None else f"{instead.source} on {instead.trigger}"
        return f"what if there were no {name}?", told, _in_a_child(
            lambda: _acting(self._scheduler, [self._sources[name]], with_trigger=True) or "nobody acts")

    def _since_when(self, then: DecisionRecord) -> tuple[str, str, str] | None:
        """It stands from that decision on: not before, and not where nobody acts then."""
        standing = [record for record in then.made if record.change != "Retracted"]
        if not standing:
            return None
        record = standing[int(self._rng.integers(len(standing)))]
        told = self._history.entry(record.ref)

        def after(silent: Sequence[KnowledgeSource]) -> str:
            _silence(silent)
            self._scheduler.step()
            return str(getattr(self._scheduler.view.get(record.id), "ref", ""))

        now = self._scheduler.view.get(record.id)
        since = (str(now.ref) if now else "") != record.ref == _in_a_child(lambda: after(())) != _in_a_child(
            lambda: after(list(self._sources.values())))
        return f"since when does {record.ref} stand?", f"since cycle {told.cycle if told else None}", (
            f"since cycle {then.cycle}" if since else "since another cycle")

    def _rested_on(self, then: DecisionRecord, *, does: bool) -> tuple[str, str, str] | None:
        """Without what it rests on, the act makes something else; without what it does not rest on, the same."""
        if then.chosen is None:
            return None
        direct = {ref for record in then.made for ref in (*record.because, *record.retracted_because)}
        touched = {record.id for record in then.made}
        current = {str(entry.ref) for kind in self._agent.kinds.values() for entry in self._scheduler.view.all(kind)}
        if does:
            # a reason that it takes over from another stays upheld by that one: its own question is asked of that
            others = {ref for one in direct | {then.chosen.trigger} for ref in _below(self._history, [one]) - {one}}
            among = {ref for ref in direct & current - others - {then.chosen.trigger} if _id(ref) not in touched}
        else:
            among = current - _below(self._history, direct) - {*then.used, *then.seen, then.chosen.trigger}
            among = {ref for ref in among if _id(ref) not in touched}
        ref = self._pick(among)
        if ref is None:
            return None
        source = self._sources[then.chosen.source]
        makes = [_in_a_child(partial(_made_without, self._scheduler, source, gone)) for gone in ("", ref)]
        words = {True: "it rests on it", False: "it does not rest on it"}
        return f"did {then.made[0].ref} rest on {ref}?", words[does], words[makes[0] != makes[1]]


def _id(ref: str) -> str:
    return ref.rpartition(".")[0]


def _below(history: Timeline, refs: Collection[str]) -> set[str]:
    """All that some revisions rest on, and they."""
    found: set[str] = set()
    ahead = list(refs)
    while ahead:
        ref = ahead.pop()
        record = history.entry(ref) if ref not in found else None
        found.add(ref)
        ahead += record.because if record is not None else ()
    return found


def _act(chosen: Any, made: Sequence[EntryRecord[Any]]) -> str:
    return f"{chosen.source} on {chosen.trigger}: {', '.join(f'{one.change} {one.ref}' for one in made)}"


def _decided(scheduler: Scheduler) -> str:
    def step() -> str:
        now = scheduler.step()
        record = None if now is None else decision_of(decision_record(now))
        return "nothing" if record is None else _act(record.chosen, record.made)

    return str(_in_a_child(step))


def _silence(sources: Sequence[KnowledgeSource]) -> None:
    """From now on, in this process, none of these can act."""
    for source in sources:
        object.__setattr__(source, "bind", lambda view, trigger: None)


def _acting(scheduler: Scheduler, silent: Sequence[KnowledgeSource], *, with_trigger: bool = False) -> str:
    """Who acts in the next cycle while some are silent; nothing where nobody does."""
    _silence(silent)
    now = scheduler.step()
    if now is None or now.chosen is None:
        return ""
    return f"{now.chosen.source.name} on {now.chosen.trigger.entry.ref}" if with_trigger else now.chosen.source.name


def _made_without(scheduler: Scheduler, source: KnowledgeSource, gone: str) -> str:
    """What the act of the next cycle asks for, after an entry has been withdrawn beneath it, as JSON."""
    bind, act = source.bind, source.act
    woken, made = list[Change](), list[Any]()

    def noting(view: Any, trigger: Change) -> Any:
        woken[:] = [trigger]
        return bind(view, trigger)

    def watched(view: Any, _case: Any) -> tuple[Effect, ...]:
        entry = view.get(_id(gone)) if gone else None
        if entry is not None:
            scheduler.board.apply([Retract(entry)], author=WHAT_IF, cycle=scheduler.cycle)
        try:
            case = bind(view, woken[0])
            effects = () if case is None else tuple(act(view, case))
        except Exception as error:  # what it lacks tells that it rests on it
            made.append(repr(error))
            return ()
        numbers = {id(effect): f"effect {n}" for n, effect in enumerate(effects)}
        made.append([[type(effect).__name__, *([] if isinstance(effect, Post) else [str(effect.entry.ref)]),
                      *([] if isinstance(effect, Retract) else [plain(effect.value)]),
                      [numbers.get(id(one), str(getattr(one, "ref", one))) for one in effect.because]]
                     for effect in effects])
        return ()

    object.__setattr__(source, "bind", noting)
    object.__setattr__(source, "act", watched)
    scheduler.step()
    return json.dumps(made)


def _in_a_child(work: Callable[[], Any]) -> Any:
    """The result of some work, as JSON types, done in a copy of this process, which it therefore leaves as it is."""
    read, write = os.pipe()
    child = os.fork()
    if not child:
        status = 1
        try:
            with os.fdopen(write, "w", encoding="utf-8") as out:
                json.dump(work(), out)
            status = 0
        finally:
            os._exit(status)
    os.close(write)
    with os.fdopen(read, encoding="utf-8") as answer:
        text = answer.read()
    if os.waitpid(child, 0)[1]:
        raise RuntimeError("expected an answer of the process that decides again, which ended without one")
    return json.loads(text)
