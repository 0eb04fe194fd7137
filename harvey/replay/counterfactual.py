"""Counterfactuals: what a run would have done without a knowledge source, a landmark or a segment, or set otherwise.

The changed agent gets the recorded observations as long as it requests the same of its body: until then they are what
it would have observed. From the first motion or picture that differs they no longer hold. A simulated body was replayed
up to there and goes on by itself; a run on hardware ends there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass, replace

from blackboard.change import Change
from blackboard.effect import Post
from blackboard.journal import Decision, decision_record, plain
from blackboard.scheduler import Scheduler
from harvey.agent import Agent, build_agent
from harvey.campaign.campaign import make_room
from harvey.hidden_segments import check_segments
from harvey.replay.as_recorded import AsRecorded
from harvey.replay.retelling import Retelling
from harvey.run_files.observations import effect_of
from harvey.run_files.records import DecisionRecord, EntryRecord, as_line, decision_of, read_records
from harvey.run_files.run_directory import RunDirectory
from harvey.run_files.run_head import SIMULATOR, RunHead
from harvey.run_files.run_recorder import RunRecorder
from harvey.runner.ports import BodyPort
from harvey.runner.replay import Live, ignore, open_originals
from harvey.runner.result import UNFINISHED, MissionResult
from harvey.runner.resume import RESUME
from harvey.runner.run import Over, run_to_outcome
from harvey.runner.teller import PAGE, USER
from harvey.runner.world_port import WorldPort, tell_robot
from harvey.simulation.run import SimulatedRun, rebuild_stage
from world_models.entries.task import Outcome


@dataclass(frozen=True, slots=True)
class Parting:
    """Where the changed agent asked its body for something else; None where one of them asked for nothing any more.

    ``requests`` names the kinds of entries that ask the body for something.
    """

    then: DecisionRecord | None
    now: DecisionRecord | None
    requests: frozenset[str]


@dataclass(frozen=True, slots=True)
class Answer:
    """What would have been.

    Attributes:
        agreed: how many decisions are the same, to the byte, before the first that is not. What was only told to ask
            the question is no difference (:mod:`harvey.replay.as_recorded`).
        then, now: that one, as recorded and as decided; None where there is none.
        revised: what was revised to ask the question, as ``LocaleFrame-3.1``.
        answered: how many decisions had their requests to the body answered by the record.
        parting: where the record could no longer answer; None where it could to the end.
        outcome: how it ends; kind ``unfinished`` where it was left at the parting.
        result: in the simulator: how it went, by the truth.
    """

    agreed: int
    then: DecisionRecord | None
    now: DecisionRecord | None
    revised: tuple[str, ...]
    answered: int
    parting: Parting | None
    outcome: Outcome
    result: MissionResult | None


class _PartedError(Exception):
    """The run is to end where it parts from the record."""


def what_if(
    run: RunDirectory, without: Sequence[str], constants: Sequence[tuple[str, str]], *,
    out: RunDirectory | None = None, go_on: bool = True,
) -> Answer:
    """Decide a run again with a changed agent.

    Args:
        without: knowledge sources, landmarks, faces, or ``Frame-88 segment 12``, to be taken away.
        constants: (key, value) of servo levels and constants to be set.
        out: where what would have been is kept, as a run; an older one there goes once it is clear what is asked.
        go_on: in the simulator: go on where the record no longer answers.

    Raises:
        BadInput: the run cannot be used, or what is to be taken or set is not there.
    """
    then = RunHead.read(run.path)
    head = replace(then.here(), without=(*then.without, *without), constants=(*then.constants, *constants))
    agent = build_agent(head)
    player = _Player(run, agent)
    check_segments(player.records, without, then.without)
    if out is not None:
        make_room(out.path, head.name, head.seed)
    recorder = RunRecorder(out, head, agent.world, agent.robot)
    if head.kind != SIMULATOR:
        ports, told = (WorldPort(agent.store),), Retelling(player.records, (USER, PAGE), player.originals)
        scheduler = agent.scheduler(ports=ports, sinks=(*recorder.sinks, player.compare))
        try:
            outcome = player.play(scheduler, agent, head, recorder, before=lambda: _ask(scheduler, agent, told))
            return player.answer(outcome, None)
        finally:
            recorder.close()
    told = Retelling(player.records, (PAGE,), player.originals)
    with SimulatedRun(rebuild_stage(head), head, agent, recorder, (player.compare,), tell=told.tell) as simulated:
        result = simulated.drive(out, lambda: _run_changed(simulated, agent, player, go_on))
    return player.answer(Outcome(result.outcome, result.reason), result)


def _ask(scheduler: Scheduler, agent: Agent, told: Retelling) -> None:
    """What comes before each cycle of a run on hardware that is decided again."""
    agent.what_if(scheduler)
    told.tell(scheduler)


def _run_changed(run: SimulatedRun, agent: Agent, player: _Player, go_on: bool) -> Outcome:
    """By the record as far as it answers; then by the simulated robot, if it is to go on."""
    run.recorded_port.closed = True
    with run.body_replay.replay(player.originals.pictures) as live:
        outcome = player.play(
            run.scheduler, agent, run.head, run.recorder, live=live, before=run.before_cycle, over=run.over)
    if player.parting is None or not go_on:
        return outcome
    run.recorded_port.closed = False
    for change in player.open:
        run.scheduler.tell(run.recorded_port.answer(change), run.port.name)
    return run.go_on(player.last)


@dataclass(frozen=True, slots=True)
class _Step:
    """What a recorded decision asked of the body, and what was observed then."""

    decision: DecisionRecord
    asked: tuple[str, ...]
    answers: tuple[EntryRecord, ...]


class _Player:
    """Answers an agent by the record of a run, as long as it requests the same."""

    def __init__(self, run: RunDirectory, agent: Agent) -> None:
        self.originals = open_originals(run, agent.store)
        self.records = list(read_records(run.journal))
        self._requests = frozenset(kind.__name__ for kind in BodyPort.acts_on)
        self._steps = _steps(self.records, self._requests)
        self._agreed = 0
        self._as_recorded, self._as_decided = AsRecorded(), AsRecorded()
        self._first: tuple[DecisionRecord | None, DecisionRecord] | None = None
        self._answered = 0
        self.last: Decision | None = None
        self.open: tuple[Change, ...] = ()
        self.parting: Parting | None = None

    def compare(self, decision: Decision) -> None:
        """Sink: compares with the record until the first difference."""
        self.last, self.open = decision, tuple(change for change in decision.made if is_body_request(change))
        if self._first is None:
            then = self.records[self._agreed] if self._agreed < len(self.records) else None
            then = None if then is None else self._as_recorded(then)
            now = self._as_decided(decision_of(decision_record(decision)))
            if then is not None and then.line == now.line:
                self._agreed += 1
            else:
                self._first = then, now

    def play(
        self, scheduler: Scheduler, agent: Agent, head: RunHead, recorder: RunRecorder, *, live: Live = ignore,
        before: Callable[[], None] = lambda: None, over: Over = lambda _scheduler: None,
    ) -> Outcome:
        """Decide until the end, or until the record no longer answers."""
        tell_robot(scheduler, agent.robot)
        scheduler.tell([Post(head.task())], "user")

        def observe() -> None:
            self._answer(scheduler, recorder, live)
            before()

        try:
            return run_to_outcome(scheduler, over=over, before=observe)
        except _PartedError:
            return Outcome(UNFINISHED, "from here the recorded observations no longer hold")

    def answer(self, outcome: Outcome, result: MissionResult | None) -> Answer:
        """What was found."""
        then, now = self._first or (None, None)
        if self._first is None and self._agreed < len(self.records):
            then = self.records[self._agreed]
        return Answer(self._agreed, then, now, self._as_decided.revised, self._answered, self.parting, outcome, result)

    def _answer(self, scheduler: Scheduler, recorder: RunRecorder, live: Live) -> None:
        """What the record observed, if the last decision asked for what it asked for; ends the run if not."""
        if not self.open:
            return
        made, self.open = self.open, ()
        step = self._steps[self._answered] if self._answered < len(self._steps) else None
        if step is None or step.asked != tuple(as_line(plain(change.entry.value)) for change in made):
            self.open = made
            now = decision_of(decision_record(self.last)) if self.last else None
            self.parting = Parting(None if step is None else step.decision, now, self._requests)
            raise _PartedError
        self._answered += 1
        live(made, step.answers)
        for record in step.answers:
            effect = effect_of(record, self.originals, scheduler.view, scheduler.kinds)
            recorder.record_picture(effect)
            scheduler.tell([effect], record.author)


def is_body_request(change: Change) -> bool:
    """Whether the body acts on a change. What is asked of the world is answered by the world, now as then."""
    return isinstance(change.entry.value, BodyPort.acts_on)


def _steps(records: Sequence[DecisionRecord], requests: Set[str]) -> list[_Step]:
    steps = []
    for decision, after in zip(records, [*records[1:], None], strict=True):
        asked = tuple(as_line(entry.value) for entry in decision.made if entry.type in requests)
        if asked and after is not None:
            answers = tuple(entry for entry in after.observed if entry.author in (BodyPort.name, RESUME))
            steps.append(_Step(decision, asked, answers))
    return steps
