"""Counterfactuals: a run without a knowledge source, a landmark or a segment, or with other settings.

The changed agent gets the recorded observations as long as it requests the same of its body: until then they are what
it would have observed. From the first motion or picture that differs they no longer hold. A simulated body was replayed
up to there and goes on by itself; a run on hardware ends there.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from blackboard import Change, Decision, Post, Scheduler, View, decision_record, plain
from harvey.agent import Agent, build_agent
from harvey.replay.what_if import check_segments
from harvey.runner.ports import BodyPort, WorldPort, tell_robot
from harvey.runner.replay import Live, ignore, open_originals
from harvey.runner.result import UNFINISHED, MissionResult, format_error
from harvey.runner.resume import RESUME
from harvey.runner.run import Over, run_to_outcome
from harvey.runner.teller import PAGE, SOMEBODY, USER
from harvey.simulation.simulated_run import SimulatedRun, rebuild_stage
from logs.explain.phrases import sentence
from logs.records import WHAT_IF, DecisionRecord, EntryRecord, Originals, as_line, decision_of, effect_of
from logs.run_directory import RunDirectory, make_room
from logs.run_head import SIMULATOR, RunHead
from logs.run_recorder import RunRecorder
from logs.timeline import Timeline
from world_models.building.locale_frame import LocaleFrame
from world_models.entries import CameraPicture, MotionReport, Outcome, Redirection, RideReport, UserReport
from world_models.words import count, listed

REQUESTS: tuple[type[Any], ...] = tuple(BodyPort.acts_on)
"""The kinds of entries that ask the body for something."""
Pair = tuple[DecisionRecord | None, DecisionRecord | None]
"""A decision as recorded, and as it is decided; None where there is none any more."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What would have been.

    Attributes:
        agreed: how many decisions are the same, to the byte, before the first that is not. What was only told to ask
            the question is no difference (:class:`AsRecorded`).
        then, now: that one, as recorded and as decided; None where there is none.
        revised: what was revised to ask the question, as ``LocaleFrame-3.1``.
        answered: how many decisions had their requests to the body answered by the record.
        parting: where the agent asked its body for something else, so that the record could no longer answer; None
            where it could to the end.
        outcome: how it ends; kind ``unfinished`` where it was left at the parting.
        result: in the simulator: how it went, by the truth.
    """

    agreed: int
    then: DecisionRecord | None
    now: DecisionRecord | None
    revised: tuple[str, ...]
    answered: int
    parting: Pair | None
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
        without: knowledge sources, landmarks, faces, or ``CameraPicture-88 segment 12``, to be taken away.
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
        ports, retold = (WorldPort(agent.store),), Retelling(player.records, (USER, PAGE, SOMEBODY), player.originals)
        scheduler = agent.scheduler(ports=ports, sinks=(*recorder.sinks, player.compare))
        try:
            outcome = player.play(scheduler, agent, head, recorder, before=lambda: _ask(scheduler, agent, retold))
            return player.answer(outcome, None)
        finally:
            recorder.close()
    retold = Retelling(player.records, (PAGE, SOMEBODY), player.originals)
    with SimulatedRun(rebuild_stage(head), head, agent, recorder, (player.compare,), tell=retold.tell) as simulated:
        result = simulated.drive(out, lambda: _run_changed(simulated, agent, player, go_on))
    return player.answer(Outcome(result.outcome, result.reason), result)


def _ask(scheduler: Scheduler, agent: Agent, retold: Retelling) -> None:
    """What comes before each cycle of a run on hardware that is decided again."""
    agent.what_if(scheduler)
    retold.tell(scheduler)


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
        run.scheduler.post(run.recorded_port.answer(change), run.port.name)
    return run.go_on(player.last)


@dataclass(frozen=True, slots=True)
class _Step:
    """What a recorded decision asked of the body, and what was observed then."""

    decision: DecisionRecord
    asked: tuple[str, ...]
    answers: tuple[EntryRecord[Any], ...]


class _Player:
    """Answers an agent by the record of a run, as long as it requests the same."""

    def __init__(self, run: RunDirectory, agent: Agent) -> None:
        self.originals = open_originals(run, agent.store)
        self.records = list(Timeline(run.journal).decisions())
        self._steps = _steps(self.records)
        self._agreed = 0
        self._as_recorded, self._as_decided = AsRecorded(), AsRecorded()
        self._first: tuple[DecisionRecord | None, DecisionRecord] | None = None
        self._answered = 0
        self.last: Decision | None = None
        self.open: tuple[Change, ...] = ()
        self.parting: Pair | None = None

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
        scheduler.post([Post(head.task())], "user")

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
            self.parting = None if step is None else step.decision, now
            raise _PartedError
        self._answered += 1
        live(made, step.answers)
        for record in step.answers:
            effect = effect_of(record, self.originals, scheduler.view, scheduler.kinds)
            recorder.record_picture(effect)
            scheduler.post([effect], record.author)


def is_body_request(change: Change) -> bool:
    """Whether the body acts on a change. What is asked of the world is answered by the world, now as then."""
    return isinstance(change.entry.value, REQUESTS)


def _steps(records: Sequence[DecisionRecord]) -> list[_Step]:
    steps = []
    for decision, after in zip(records, [*records[1:], None], strict=True):
        asked = tuple(as_line(entry.fields) for entry in decision.made if entry.kind in REQUESTS)
        if asked and after is not None:
            answers = tuple(entry for entry in after.observed if entry.author in (BodyPort.name, RESUME))
            steps.append(_Step(decision, asked, answers))
    return steps


REF = re.compile(r'"([A-Za-z]+-\d+)\.(\d+)"')
"""A revision, where it is the whole of a text of a journal's line."""


class AsRecorded:
    """Takes the decisions of a run in turn, and undoes the revisions with the author "what if".

    They are not observed, and later revisions of the same entries have the number that they would have had.

    Attributes:
        revised: the revisions that were undone.
    """

    def __init__(self) -> None:
        self.revised: tuple[str, ...] = ()
        self._undone: dict[str, list[int]] = {}

    def __call__(self, decision: DecisionRecord) -> DecisionRecord:
        """The decision as it would stand in the journal."""
        retold = [entry for entry in decision.observed if entry.author == WHAT_IF]
        for entry in retold:
            id, _, revision = entry.ref.rpartition(".")
            self._undone.setdefault(id, []).append(int(revision))
        refs = {entry.ref for entry in retold}
        self.revised += tuple(entry.ref for entry in retold)
        if not self._undone:
            return decision
        data = {**decision.data,
                "observed": [_undo_changes(one) for one in decision.data["observed"] if one["entry"] not in refs],
                "made": [_undo_changes(one) for one in decision.data["made"]],
                "seen": [ref for ref in decision.seen if ref not in refs]}
        return decision_of(json.loads(REF.sub(self._renumber, as_line(data))))

    def _renumber(self, ref: re.Match[str]) -> str:
        undone = self._undone.get(ref[1], ())
        return f'"{ref[1]}.{int(ref[2]) - sum(number <= int(ref[2]) for number in undone)}"'


def _undo_changes(record: dict[str, Any]) -> dict[str, Any]:
    """An entry without what its frame has of that author, where somebody else revised it since."""
    if record["type"] != LocaleFrame.__name__:
        return record
    changes = [change for change in record["value"]["changes"] if change["by"] != WHAT_IF]
    return {**record, "value": {**record["value"], "changes": changes}}


TIMED: tuple[type[Any], ...] = (CameraPicture, MotionReport, RideReport)
"""Kinds of observations that have the body's time."""
FROM_USER: tuple[type[Any], ...] = (UserReport, Redirection)


class Retelling:
    """Tells again, in its cycle, what some authors had told; later where the changed agent needs fewer cycles.

    By the body's time it is as late as it was; a cycle takes none.
    """

    def __init__(self, records: Sequence[DecisionRecord], authors: Sequence[str], originals: Originals) -> None:
        """``records``: of the run as it was; ``originals``: what they name only by reference."""
        self._originals, self._left = originals, list[tuple[int, float, EntryRecord[Any]]]()
        now_s = 0.0
        for record in records:
            for entry in record.observed:
                now_s = entry.fields["sim_time_s"] if entry.kind in TIMED else now_s
                if entry.author in authors and entry.kind in FROM_USER:
                    self._left.append((record.cycle - 1, now_s, entry))

    def tell(self, scheduler: Scheduler) -> None:
        """Tell what is due."""
        while self._left and self._is_due(scheduler):
            _, _, entry = self._left.pop(0)
            effect = effect_of(entry, self._originals, scheduler.view, scheduler.kinds)
            scheduler.post([effect], entry.author)

    def _is_due(self, scheduler: Scheduler) -> bool:
        cycle, when_s, _ = self._left[0]
        now_s = _find_time_s(scheduler.view)
        return now_s > when_s or (now_s == when_s and scheduler.cycle >= cycle)


def _find_time_s(view: View) -> float:
    """The body's time of the newest observation on the board; 0 before the first."""
    newest = [entry.value.sim_time_s for kind in TIMED if (entry := view.latest(kind)) is not None]
    return max(newest, default=0.0)


def describe_answer(answer: Answer, run: RunDirectory, changes: Sequence[str]) -> Iterator[str]:
    """How it would have ended, and where it would have done something else; ``changes`` as ``without line_finder``."""
    yield f"{run.path}, {' and '.join(changes)}:"
    if answer.then is None and answer.now is None:
        but = f", but for {listed(answer.revised)}, by which it was asked" if answer.revised else ""
        yield (f"nothing would have changed: all of its {count(answer.agreed, 'decision')} are the same, byte for"
               f" byte{but}.")
        return
    yield from _end(answer, run)
    yield from _parting(answer)
    if (first := answer.then or answer.now) is not None:
        yield (f"The first decision that differs is that of cycle {first.cycle}, after {answer.agreed} that are the"
               " same.")


def _parting(answer: Answer) -> Iterator[str]:
    if answer.parting is None:
        yield "It asks its body for the same as in the record to the end, so what was observed holds to the end."
        return
    held = count(answer.answered, "request")
    yield f"What was observed holds for {held} to the body, which are the same. Then it asks for something else:"
    for who, decision in zip(("as recorded:          ", "as it would have been:"), answer.parting, strict=True):
        yield f"  {who}    {_describe_requests(decision)}"
    if answer.outcome.kind == UNFINISHED:
        yield "From there the record cannot tell what it would have observed."
    else:
        yield "From there the record cannot tell what it would have observed; the simulated robot went on by itself."


def _describe_requests(decision: DecisionRecord | None) -> str:
    if decision is None:
        return "nothing any more"
    asked = "; ".join(f"{entry.ref}, {sentence(entry)}" for entry in decision.made if entry.kind in REQUESTS)
    return f"cycle {decision.cycle}: {asked}"


def _end(answer: Answer, run: RunDirectory) -> Iterator[str]:
    if answer.outcome.kind == UNFINISHED:
        return
    before = run.read_result()
    error_m = before.get("final_error_m")
    truly = f", {format_error(error_m)} from the goal" if isinstance(error_m, int | float) else ""
    yield f"  as recorded:              {before.get('outcome', UNFINISHED)}{truly}"
    now = f", {format_error(answer.result.error_m)} from the goal" if answer.result is not None else ""
    yield f"  as it would have been:    {answer.outcome.kind}{now}: {answer.outcome.reason}"
    yield ""
