"""Scheduler: one cycle takes the changes, asks knowledge sources for ratings, executes one act and journals it.

Order of a cycle: changes of the last cycle -> obviate what they made stale -> activate the watchers -> choose (pure),
asking the best whether it still holds, and obviating it if not -> act -> apply -> journal -> ports. A source is asked
once a cycle: the act gets the case that was found on the trigger or for the choice. The journal has the decision before
any port sees it, so that nothing reaches the motors that is not written down.

An act that lacks something asks for it (:class:`~blackboard.effect.MissingEntryError`): that request is all that the
cycle does, and the activation goes back to where it was, to be chosen again when a port has answered.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from enum import IntEnum
from itertools import chain
from typing import Any, Protocol

from blackboard.agenda import Activation, Agenda, Obviated
from blackboard.board import Blackboard, StaleError, TracedView, View
from blackboard.change import Change, Posted, Quiescence, Retracted
from blackboard.effect import Effect, MissingEntryError, Post, type_of
from blackboard.entry import Ref, new_tuple
from blackboard.journal import Decision, Sink
from blackboard.kinds import Kind, NotAKindError, Registry, always, is_request, kind_of
from blackboard.knowledge_source import KnowledgeSource
from blackboard.ladder import Groups, Ladder
from blackboard.retention import Retention

MISSING_RATING = 1.0
"""Rating of a source that lacks something to tell it: its act comes first, and asks."""

RAISED = "raised: "
"""How the refusal of an act begins whose knowledge source raised an exception; its traceback follows."""


class Port(Protocol):
    """The way to the world outside: it is given each change of a request, and answers with what was observed."""

    @property
    def name(self) -> str: ...

    def answer(self, change: Change) -> Iterable[Effect]:
        """The observations that follow from a change of a request; nothing for requests that do not concern it."""


Watchers = tuple[tuple[KnowledgeSource, tuple[Callable[[Any], bool], ...]], ...]
"""Who watches for a kind of change, each with the predicates of which one must hold; none where any value will do."""


class Scheduler:
    """Runs knowledge sources round a board."""

    def __init__(
        self,
        sources: Sequence[KnowledgeSource],
        *,
        ports: Sequence[Port] = (),
        ladder: Ladder | None = None,
        sinks: Sequence[Sink] = (),
        retention: Mapping[type[Any], Kind] | None = None,
        kinds: Iterable[type[Any]] = (),
    ) -> None:
        """A scheduler with an empty board.

        Args:
            ladder: levels and which is in focus; None: those of the sources, and the lowest in focus.
            retention: how long entries stay, by the type of their value; None: as the kinds themselves say.
            kinds: what else comes from outside: kinds that sources only read, or that nobody does.

        Raises:
            NotAKindError: a source watches or writes what is not marked as a kind of entry.
            ValueError: two sources, or two kinds, of one name.
        """
        names = [source.name for source in sources]
        if len(set(names)) != len(names):
            raise ValueError(f"expected knowledge sources of different names, got {names}")
        self.board = Blackboard()
        self.view: View = self.board.view
        self._current = self.board.current
        self.cycle = 0
        self._ladder = ladder or Ladder.of(source.level for source in sources)
        self._sources = tuple(s for s in sources if self._ladder.allows(s.closes))
        self._watchers: dict[tuple[type[Change], type[Any]], Watchers] = {}
        self._ports = tuple(ports)
        self._sinks = tuple(sinks)
        self._agenda = Agenda()
        self.kinds = registry_of(sources, kinds)
        self._known = frozenset(self.kinds.values())
        self._requests = frozenset(filter(is_request, self.kinds.values()))
        self._traced = frozenset(kind for kind in self.kinds.values() if kind_of(kind).traced)
        self._retention = Retention(self.kinds.marks() if retention is None else retention)
        self._numbers = 0
        self._cases: dict[int, tuple[TracedView, Any]] = {}  # of this cycle, by activation; the view notes what is read
        self._unseen: tuple[Change, ...] = ()
        self._observed: tuple[Change, ...] = ()
        self._is_waiting = False

    def post(self, effects: Iterable[Effect], author: str) -> tuple[Change, ...]:
        """Put something on the board from outside (a command, an observation); it is seen in the next cycle.

        Raises NotAKindError for a kind that a replay could not read back.
        """
        effects = tuple(effects)
        if alien := aliens(effects, self._known):
            raise NotAKindError(f"expected a kind that a source watches or writes, got {', '.join(alien)}: give it to "
                                f"the scheduler as well: Scheduler(..., kinds=[{', '.join(alien)}])")
        changes = self.board.apply(effects, author=author, cycle=self.cycle)
        self._unseen += changes
        self._observed += changes
        return changes

    def step(self) -> Decision | None:
        """Run one cycle; None when nothing is left to see and nothing to do."""
        seen, observed, agenda = self._unseen, self._observed, self._agenda
        if not seen and not len(agenda):
            return None
        self._unseen = self._observed = ()
        self._cases.clear()
        self.cycle += 1
        obviated: list[Obviated] = []
        activated: list[Activation] = []
        fault = self._hear_bids(seen, activated, obviated)
        left = self._retention.sweep(seen, self.board, agenda, hold=self._is_waiting)
        if left:  # the board is not as it was when they were found
            self._cases.clear()
        self._is_waiting = False
        focus = self._ladder.focus(self.view)
        chosen, runner_up, fault = (None, None, fault) if fault else self._two_best(focus, obviated)
        made, refused, used = self._execute(chosen) if chosen else ((), fault, ())
        decision = new_tuple(Decision, (
            self.cycle, seen, observed, focus, tuple(activated), tuple(obviated), chosen, runner_up, len(agenda), made,
            refused, used, left,
        ))
        self._unseen = made
        for sink in self._sinks:
            sink(decision)
        if self._ports:
            self._tell_ports(made)
        return decision

    def _hear_bids(self, seen: tuple[Change, ...], activated: list[Activation], obviated: list[Obviated]) -> str:
        """Drop what is stale, activate the watchers. Returns the traceback of a source that raised, else nothing."""
        try:
            for change in seen:
                if not isinstance(change, Posted):
                    for pending in self._agenda.triggered_by(change.entry.id):
                        if not self._stands(pending.trigger):  # by an earlier revision of an entry that changed
                            self._agenda.take(pending)
                            obviated.append(Obviated(pending, self._staleness(pending.trigger)))
            for change in seen:
                kind, value = type(change), type(change.entry.value)
                watchers = self._watchers.get((kind, value))
                if watchers is None:
                    watchers = self._watchers[kind, value] = self._watchers_of(kind, value)
                if watchers:
                    self._hear_bids_on(change, watchers, activated)
        except Exception:  # whatever a source does wrong is journalled, never lost
            return RAISED + traceback.format_exc(limit=-4)
        return ""

    def _staleness(self, trigger: Change) -> str:
        now = self.view.get(trigger.entry.id)
        return f"stale trigger: {trigger.entry.ref} is {f'now {now.ref}' if now else 'retracted'}"

    def _watchers_of(self, change: type[Change], value: type[Any]) -> Watchers:
        found = ((source, [w.where for w in source.on if w.is_for(change, value)]) for source in self._sources)
        return tuple((source, () if always in wheres else tuple(wheres)) for source, wheres in found if wheres)

    def _hear_bids_on(self, change: Change, watchers: Watchers, activated: list[Activation]) -> None:
        value = change.entry.value
        if not self._stands(change):
            return
        for source, wheres in watchers:
            if wheres and not any(where(value) for where in wheres):
                continue
            rating = self._rate(self._numbers + 1, source, change)
            if rating is None:
                continue
            if not 0.0 <= rating <= 1.0:
                raise ValueError(f"expected a rating of 0..1 from {source.name}, got {rating}")
            self._numbers += 1
            activation = new_tuple(Activation, (self._numbers, source, change, rating, self.cycle))
            activated.append(activation)
            self._agenda.add(activation)

    def _rate(self, number: int, source: KnowledgeSource, trigger: Change) -> float | None:
        """How urgent a source finds a trigger now; None: it could not act. The case is kept for the act."""
        view = TracedView(self.board, self._traced)
        try:
            case = source.find_case(view, trigger)
            rating = None if case is None else float(source.rate(case))  # a member of an enum is written as its name
        except MissingEntryError:
            return MISSING_RATING
        self._cases[number] = view, case
        return rating

    def _stands(self, trigger: Change) -> bool:
        """A trigger stands while its entry is the current revision; a retraction stands for good."""
        entry = trigger.entry
        return self._current.get(entry.id) is entry or isinstance(trigger, Retracted)

    def _two_best(
        self, focus: IntEnum, obviated: list[Obviated]
    ) -> tuple[Activation | None, Activation | None, str]:
        """Take the activation to be executed from the agenda; also the next best, or the traceback of a source."""
        chosen: Activation | None = None
        groups = self._ladder.nearest(focus)
        try:
            chosen = self._best(groups, obviated)
            if chosen is None:
                return None, None, ""
            self._agenda.take(chosen)
            return chosen, self._best(groups, obviated), ""
        except Exception:
            if chosen is not None:
                self._agenda.add(chosen)
            return None, None, RAISED + traceback.format_exc(limit=-4)

    def _best(self, groups: Groups, obviated: list[Obviated]) -> Activation | None:
        """The best that is pending and still holds; what is better and does not is obviated."""
        while (best := self._agenda.best(groups)) is not None:
            number, source, trigger, _rating, cycle = best
            if cycle == self.cycle:  # it was asked in this cycle, and the board is as it was then
                return best
            reason = "raised when it was asked"
            try:
                if not self._stands(trigger):
                    reason = self._staleness(trigger)
                else:
                    reason = "could not answer any more" if self._rate(number, source, trigger) is None else ""
            finally:
                if reason:
                    self._agenda.take(best)
                    obviated.append(Obviated(best, reason))
            if not reason:
                return best
        return None

    def _execute(self, chosen: Activation) -> tuple[tuple[Change, ...], str, tuple[Ref, ...]]:
        """The changes of an act, why it was refused, and which revisions of traced kinds it read."""
        source = chosen.source
        view, case = self._cases.get(chosen.number) or (TracedView(self.board, self._traced), None)
        try:
            try:
                case = source.find_case(view, chosen.trigger) if case is None else case
                effects = () if case is None else tuple(source.act(view, case))
                if not all(effect.because for effect in effects):
                    effects = self._reasoned(chosen, effects)
                made, refused = self._apply(source, effects)
            except MissingEntryError as missing:
                made, refused = self._ask(chosen, missing.request)
            return made, refused, tuple(sorted(view.used, key=_by_number))
        except StaleError as error:
            return (), f"stale: {error}", ()
        except Exception:
            return (), RAISED + traceback.format_exc(limit=-4), ()

    def _reasoned(self, chosen: Activation, effects: tuple[Effect, ...]) -> tuple[Effect, ...]:
        """Effects that name no reasons rest on all that the act read: it is pure, so it is watched doing it again."""
        view = TracedView(self.board, None)
        case = chosen.source.find_case(view, chosen.trigger)
        tuple(chosen.source.act(view, case))
        trigger = chosen.trigger.entry.ref
        read = (trigger, *sorted(view.used - {trigger}, key=_by_number))
        instead: dict[int, Effect] = {}
        for effect in effects:
            because = tuple(instead.get(id(reason), reason) for reason in effect.because) or read
            instead[id(effect)] = effect._replace(because=because)
        return tuple(instead.values())

    def run(self, limit: int | None = None) -> int:
        """Cycle until nothing is left to do, or so many times; how many cycles it took."""
        cycles = 0
        while (limit is None or cycles < limit) and self.step() is not None:
            cycles += 1
        return cycles

    def _apply(self, source: KnowledgeSource, effects: tuple[Effect, ...]) -> tuple[tuple[Change, ...], str]:
        alien = aliens(effects, source.writes)
        if alien:
            return (), f"{source.name} may not write {', '.join(alien)}"
        return self.board.apply(effects, author=source.name, cycle=self.cycle), ""

    def _ask(self, chosen: Activation, request: Any) -> tuple[tuple[Change, ...], str]:
        """Post what an act asks for, and put its activation back; the same is not asked again before an answer."""
        for asked in self.view.all(type(request)):
            if asked.value == request:
                return (), f"nobody answered {asked.ref}"
        made, refused = self._apply(chosen.source, (Post(request, (chosen.trigger.entry,)),))
        if made:
            self._agenda.add(chosen)
            self._is_waiting = True
        return made, refused

    def _tell_ports(self, made: tuple[Change, ...]) -> None:
        """Only requests reach a port, and each is in the journal by now: sinks come first."""
        for change in made:
            if type(change.entry.value) in self._requests:
                for port in self._ports:
                    self.post(port.answer(change), port.name)


def registry_of(
    sources: Iterable[KnowledgeSource | type[KnowledgeSource]], kinds: Iterable[type[Any]] = ()
) -> Registry:
    """The kinds that knowledge sources watch and write, with some more.

    Raises:
        NotAKindError: one of them is not marked; ValueError: two are of one name.
    """
    of_sources = ((*(watch.value_type for watch in s.on), *s.writes) for s in sources)
    return Registry((Quiescence, *kinds, *chain.from_iterable(of_sources)))


def _by_number(ref: Ref) -> tuple[str, int, int]:
    kind, _, number = ref.id.rpartition("-")
    return kind, int(number), ref.revision


def aliens(effects: Iterable[Effect], writes: Collection[type[Any]]) -> list[str]:
    """The types that effects touch and may not, by name."""
    return sorted({kind.__name__ for kind in map(type_of, effects) if kind not in writes})
