"""Resume: a run that was cut off goes on from its last decision; the robot was stopped in between.

What was cut off in the middle of writing is dropped. The board, the agenda and all that was pending come back by
telling the journal's observations again, each decision compared to the byte; the simulated world comes to where it was
by living through it again. A motor command that was written down but not reported on is the delicate case: it is not
carried out again. The robot has stopped somewhere in it, and the report says what the wheels claim by now.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from blackboard.change import Change, Posted, Retracted
from blackboard.effect import Post
from blackboard.journal import Decision, Sink
from harvey.agent import agent_of
from harvey.errors import BadInput
from harvey.replay.replay import camera_bytes, checked, pictures_of, replayed
from harvey.run_files.records import read_records
from harvey.run_files.run_directory import RunDirectory
from harvey.run_files.run_head import HARDWARE, RunHead
from harvey.run_files.run_recorder import Extent, RunRecorder
from harvey.simulation.body_replay import RESUME, BodyReplay
from harvey.simulation.referee import MissionResult
from harvey.simulation.run import Around, Mission
from logs.camera_file import Pictures
from sim.scenario import ScenarioError, scenario_from_tables
from sim.stage import Stage, build_stage
from world_models.entries.body import Course, MotorCommand
from world_models.entries.task import Outcome, Resumed
from world_models.files.toml.mission import ROOT


@dataclass(frozen=True, slots=True)
class Remains:
    """What is whole of a run that was cut off.

    Attributes:
        extent: of the files.
        decisions: how many.
        outcome: how the run ended by its journal; None where it did not.
        dropped: what is not whole, in words.
    """

    extent: Extent
    decisions: int
    outcome: Outcome | None
    dropped: tuple[str, ...]


def remains_of(run: RunDirectory) -> Remains:
    """Look at a run without touching it. Raises BadInput where it cannot be used at all."""
    there = camera_bytes(run)
    decisions, outcome = _decided(run) if run.journal.is_file() else (0, None)
    if decisions == 0:
        _begins_anew(run, there)
    if not run.journal.is_file():
        return Remains(Extent(), 0, None, ())
    whole, pictures = _whole_lines(run.journal), pictures_of(run)
    end = pictures.end if isinstance(pictures, Pictures) else 0
    dropped = []
    if run.journal.stat().st_size > whole:
        dropped.append(f"decision {decisions + 1}, which was cut off while it was written")
    if there > end:
        dropped.append(f"{there - end} bytes of a picture that no decision had seen")
    return Remains(Extent(whole, end), decisions, outcome, tuple(dropped))


def _begins_anew(run: RunDirectory, pictures: int) -> None:
    """Raises BadInput where a run of which no decision is there was more than begun: its journal was lost since.

    A picture is asked for by a decision that is on the disk by then; so where nothing was lost, there is none.
    """
    lost = [f"{run.camera.name} has {pictures} bytes of pictures"] * (pictures > 0)
    if told := run.read_result().get("decisions"):
        lost.append(f"{run.result.name} tells of {told} decisions")
    if lost:
        raise BadInput(f"{run.journal}: expected the decisions of the run, got none, although {' and '.join(lost)}; "
                       "nothing was touched")


def resume(
    run: RunDirectory, remains: Remains, *, sinks: Sequence[Sink] = (), live: bool = False,
    around: Around = lambda body, _retelling: body, stage: Stage | None = None,
) -> MissionResult:
    """Go on with a run to its outcome; its recording is drawn anew from the start.

    Args:
        remains: what is whole of it; the rest of its files is dropped.
        stage: the building of its scenario, where somebody has it at hand.
        sinks, live, around: as for :func:`harvey.simulation.run.run_mission`.

    Raises:
        BadInput: it is no run of the simulator, or cannot be told again as it was.
    """
    head = RunHead.read(run.path)
    stage = stage or stage_of(head)
    with agent_of(head) as agent:
        recorder = RunRecorder(run, head, agent.robot, live=live, whole=remains.extent)
        mission = Mission(stage, head, agent, recorder, sinks, around)
        return mission.driven(run, lambda: _go_on(run, mission, stage))


def stage_of(head: RunHead) -> Stage:
    """The building of a simulator's run. Raises BadInput."""
    if head.kind == HARDWARE:
        raise BadInput(f"expected a run of the simulator, got one on hardware: harvey drive {head.name} begins it anew")
    try:
        return build_stage(scenario_from_tables(head.scenario, head.name, ROOT / head.folder))
    except ScenarioError as error:
        raise BadInput(f"run.json: {error}") from None


def relived(run: RunDirectory, mission: Mission, stage: Stage) -> Decision | None:
    """Tell a run to its mission again, and let its body live through it; returns the last decision.

    Raises:
        BadInput: a decision, or an answer of the body, is not what it was.
    """
    pictures, last = pictures_of(run), None
    mission.body.use_recorded(pictures)
    reliving = BodyReplay(mission.port, mission.seed, stage.scenario.actuator)
    for told in replayed(run, pictures, mission.scheduler, live=reliving, before=mission.tell_truth):
        last = checked(run, told).now
    mission.body.use_recorded({})
    return last


def _go_on(run: RunDirectory, mission: Mission, stage: Stage) -> Outcome:
    last = relived(run, mission, stage)
    if last is not None:
        _tell_of_the_crash(mission, stage, last)
    mission.recorder.retelling = False
    if last is None:
        return mission.begin()
    for change in last.made:
        if not is_command(change):
            mission.scheduler.tell(mission.kept.answer(change), mission.kept.name)
    return mission.go_on(last)


def _tell_of_the_crash(mission: Mission, stage: Stage, last: Decision) -> None:
    """The commands that nobody reported on are answered by what the wheels claim."""
    scheduler, reliving = mission.scheduler, BodyReplay(mission.port, mission.seed, stage.scenario.actuator)
    broken_off = [change.entry for change in last.made if is_command(change)]
    refs = tuple(str(entry.ref) for entry in broken_off)
    scheduler.tell([Post(Resumed(scheduler.cycle, refs), tuple(broken_off))], RESUME)
    for entry in broken_off:
        for effect in reliving.answer(Posted(entry), True):
            mission.recorder.keep(effect)
            scheduler.tell([effect], mission.port.name)


def is_command(change: Change) -> bool:
    """Whether a change asks the wheels to turn."""
    if isinstance(change.entry.value, Course):
        return not isinstance(change, Retracted)
    return isinstance(change, Posted) and isinstance(change.entry.value, MotorCommand)


def _decided(run: RunDirectory) -> tuple[int, Outcome | None]:
    """How many decisions there are, and the outcome, if it was seen."""
    decisions, seen, outcome = 0, False, None
    for record in read_records(run.journal):
        decisions += 1
        ends = [entry.value for entry in (*record.observed, *record.made) if entry.type == Outcome.__name__]
        outcome = Outcome(str(ends[0].get("kind")), str(ends[0].get("reason"))) if ends else outcome
        seen = seen or any(ref.startswith(f"{Outcome.__name__}-") for ref in record.seen)
    return decisions, outcome if seen else None


def _whole_lines(path: Path) -> int:
    """Length of a file up to the end of its last whole line [bytes]."""
    whole = 0
    with path.open("rb") as file:
        for line in file:
            whole += len(line) if line.endswith(b"\n") else 0
    return whole
