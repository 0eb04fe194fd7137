"""Scheduler: one cycle takes the changes, lets the experts bid, executes one act and journals it.

Order of a cycle: changes of the last cycle -> ask all that is pending ``still_valid`` again, and obviate what is not ->
activate the watchers -> choose (pure) -> act -> apply -> journal -> ports. The journal has the decision before any port
sees it, so that nothing reaches the motors that is not written down.
"""

from __future__ import annotations

import traceback
from collections.abc import Iterable, Sequence
from typing import Protocol

from blackboard.activation import Activation, Obviated
from blackboard.agenda import Agenda
from blackboard.board import Blackboard, StaleError, View
from blackboard.change import Change
from blackboard.effect import Effect, kind_of
from blackboard.journal import Decision, Sink
from blackboard.knowledge_source import KnowledgeSource
from blackboard.servoing import Servoing

RAISED = "raised: "
"""How the refusal of an act begins whose knowledge source raised an exception; its traceback follows."""


class Port(Protocol):
    """The way to the world outside: told of each change, it answers with what was observed."""

    @property
    def name(self) -> str: ...

    def answer(self, change: Change) -> Iterable[Effect]:
        """The observations that follow from a change; nothing for changes that do not concern it."""


class Scheduler:
    """Runs knowledge sources round a board."""

    def __init__(
        self,
        sources: Sequence[KnowledgeSource],
        *,
        ports: Sequence[Port] = (),
        servoing: Servoing | None = None,
        sinks: Sequence[Sink] = (),
    ) -> None:
        names = [source.name for source in sources]
        if len(set(names)) != len(names):
            raise ValueError(f"expected knowledge sources of different names, got {names}")
        self.board = Blackboard()
        self.cycle = 0
        self._servoing = servoing or Servoing()
        self._sources = tuple(s for s in sources if self._servoing.allows(s.closes))
        self._ports = tuple(ports)
        self._sinks = tuple(sinks)
        self._agenda = Agenda()
        self._numbers = 0
        self._unseen: tuple[Change, ...] = ()
        self._observed: tuple[Change, ...] = ()

    @property
    def view(self) -> View:
        return self.board.view

    def tell(self, effects: Iterable[Effect], author: str) -> tuple[Change, ...]:
        """Put something on the board from outside (a command, an observation); it is seen in the next cycle."""
        changes = self.board.apply(effects, author=author, cycle=self.cycle)
        self._unseen += changes
        self._observed += changes
        return changes

    def step(self) -> Decision | None:
        """Run one cycle; None when nothing is left to see and nothing to do."""
        if not self._unseen and not len(self._agenda):
            return None
        self.cycle += 1
        seen, self._unseen = self._unseen, ()
        observed, self._observed = self._observed, ()
        obviated: list[Obviated] = []
        activated: list[Activation] = []
        fault = self._hear_bids(seen, activated, obviated)
        focus = self._servoing.focus(self.view)
        ranked = () if fault else self._servoing.choose(self._agenda, focus)
        chosen = ranked[0] if ranked else None
        made, refused = self._execute(chosen) if chosen else ((), fault)
        decision = Decision(
            self.cycle, seen, observed, focus, tuple(activated), tuple(obviated), chosen,
            ranked[1] if len(ranked) > 1 else None, len(self._agenda), made, refused,
        )
        self._unseen = made
        for sink in self._sinks:
            sink(decision)
        self._tell_ports(made)
        return decision

    def _holds(self, activation: Activation) -> bool:
        return activation.source.still_valid(self.view, activation.trigger)

    def _hear_bids(self, seen: tuple[Change, ...], activated: list[Activation], obviated: list[Obviated]) -> str:
        """Drops what no longer holds, activates the watchers; tells how an expert raised, if so: then nobody acts."""
        try:
            obviated += self._agenda.obviate(self._holds)
            bids = (self._activation(source, change, obviated) for change in seen for source in self._sources)
            activated += (bid for bid in bids if bid is not None)
        except Exception:  # whatever an expert does wrong is journalled, never lost
            return RAISED + traceback.format_exc(limit=-4)
        return ""

    def _activation(self, source: KnowledgeSource, change: Change, obviated: list[Obviated]) -> Activation | None:
        if not any(watch.sees(change) for watch in source.watches) or not source.still_valid(self.view, change):
            return None
        rating = source.rate(self.view, change)
        if rating is None:
            return None
        if not 0.0 <= rating <= 1.0:
            raise ValueError(f"expected a rating of 0..1 from {source.name}, got {rating}")
        self._numbers += 1
        activation = Activation(self._numbers, source, change, rating, self.cycle)
        replaced = self._agenda.add(activation)
        if replaced:
            obviated.append(replaced)
        return activation

    def _execute(self, chosen: Activation) -> tuple[tuple[Change, ...], str]:
        self._agenda.take(chosen)
        source = chosen.source
        try:
            effects = tuple(source.act(self.view, chosen.trigger))
            alien = sorted({kind_of(e).__name__ for e in effects if kind_of(e) not in source.writes})
            if alien:
                return (), f"{source.name} may not write {', '.join(alien)}"
            return self.board.apply(effects, author=source.name, cycle=self.cycle), ""
        except StaleError as error:
            return (), f"stale: {error}"
        except Exception:
            return (), RAISED + traceback.format_exc(limit=-4)

    def _tell_ports(self, made: tuple[Change, ...]) -> None:
        for change in made:
            for port in self._ports:
                self.tell(port.answer(change), port.name)
