"""The Python interface, for programs and notebooks: everything here is exported from ``harvey`` itself.

    import harvey

    result = harvey.run("lab-to-allens-office", seed=0, out="runs/first")
    print(result.outcome, result.final_error_m)
    run = harvey.open_run("runs/first")
    for decision in run.decisions():
        ...
    print(run.why("MotorCommand-12"))
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from blackboard import Decision, Entry, KnowledgeSource, Registry, registry_of
from harvey import wiring
from harvey.agent import Sources, build_agent
from harvey.agent_settings import split_settings
from harvey.errors import BadInput
from harvey.runner.replay import open_originals
from harvey.runner.replay import replay as replay_run
from harvey.runner.result import MissionResult
from harvey.simulation.simulated_run import build_head, run_mission
from knowledge_sources.settings import Settings
from logs import run_directory
from logs.explain.in_short import tell_end
from logs.explain.model import WorldFile
from logs.explain.phrases import Story
from logs.explain.questions_in_words import answers, is_question
from logs.explain.subjects import stories_of
from logs.explain.why import lines_of
from logs.pictures import open_pictures
from logs.reader import read_true_track
from logs.records import DecisionRecord, EntryRecord, entry_of, knowing
from logs.run_directory import RunDirectory
from logs.run_head import RunHead
from logs.timeline import Timeline
from sim.scenario import FORMAT, Scenario, ScenarioError, load_scenario, with_settings
from sim.stage import build_stage
from world_models.building.locale_frame import LocaleFrame
from world_models.building.world import World
from world_models.entries import CameraPicture, Hypothesis
from world_models.files.toml.source import Source, WorldError
from world_models.files.world_files import load_world, read_world
from world_models.frame_store import FrameStore
from world_models.frames import Pose2

T = TypeVar("T")

GIVEN = "the calling program"
"""Where a knowledge source comes from that no installed package brings."""


def run(
    scenario: str | Path | Scenario,
    *,
    seed: int = 0,
    settings: Mapping[str, Any] | None = None,
    out: str | Path | None = None,
    knowledge_sources: Sequence[type[KnowledgeSource]] = (),
    on_decision: Callable[[Decision], None] | None = None,
    live: bool = False,
) -> MissionResult:
    """Run a mission in the simulator to its outcome, as ``harvey run`` does.

    Args:
        scenario: a name from ``harvey list``, a TOML file, or a scenario that was loaded already.
        seed: of all chance; the same scenario and seed give the same decisions.
        settings: as after ``--set``: keys of the scenario and names of ``harvey settings``, for example
            ``{"servo.action": False, "start.heading_deg": 80, "plan.max_leg_m": 2.0}``.
        out: the run directory; an older run of the same scenario and seed there is replaced, another one moved aside.
            None keeps nothing.
        knowledge_sources: classes that sit round the board with the project's; what they decide can be replayed by
            ``open_run(out, knowledge_sources=...)`` with the same classes.
        on_decision: called with every decision, as it is made.
        live: also send the recording to an open rerun viewer.

    Raises:
        BadInput: the scenario, a setting or ``out`` cannot be used; says what was expected and what came.
    """
    try:
        mission = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
        of_mission, numbers = split_settings(settings or {}, FORMAT.keys())
        stage = build_stage(with_settings(mission, of_mission))
    except (ScenarioError, WorldError) as error:
        raise BadInput(str(error)) from None
    folder = None if out is None else run_directory.prepare_directory(Path(out), mission.name, seed)[0]
    head = build_head(stage, seed, settings=numbers)
    given = {source.called(): GIVEN for source in knowledge_sources}
    return run_mission(stage, seed, out=folder, sinks=() if on_decision is None else (on_decision,), live=live,
                       head=replace(head, plugins={**head.plugins, **given}), sources=with_sources(knowledge_sources))


def open_run(path: str | Path, *, knowledge_sources: Sequence[type[KnowledgeSource]] = ()) -> RecordedRun:
    """A run that was recorded: its directory, or its name under ``runs/``.

    Args:
        knowledge_sources: those that were given to :func:`run`.

    Raises:
        BadInput: there is none.
    """
    return RecordedRun(run_directory.open_run(str(path)), knowledge_sources)


@dataclass(frozen=True, slots=True)
class RunPage:
    """The report of a run, which a notebook shows in a frame of its own.

    Attributes:
        page: HTML that needs no network; height_px: of the frame.
    """

    page: str
    height_px: int

    def _repr_html_(self) -> str:
        return (f'<iframe srcdoc="{escape(self.page)}" title="report of a run" '
                f'style="border: 0; width: 100%; height: {self.height_px}px"></iframe>')


def show(run: RecordedRun, *, height_px: int = 800) -> RunPage:
    """Show a run in a notebook, as ``harvey report`` does in a browser. Raises BadInput where it cannot be read."""
    from harvey.report.page import build_page

    files = RunDirectory(run.path)
    return RunPage(build_page(files, Timeline(files.journal)), height_px)


def with_sources(more: Sequence[type[KnowledgeSource]]) -> Sources:
    """The project's knowledge sources and some more."""
    def build_all(settings: Settings) -> tuple[KnowledgeSource, ...]:
        return (*wiring.knowledge_sources(settings), *(wiring.build(one, settings) for one in more))

    return build_all


def build_world(text: str, name: str = "world") -> World:
    """A building model from the text of a world file.

    Raises:
        BadInput: the text is no world; names the line, what was expected and what came.
    """
    try:
        return read_world(Source.parse(text, name))
    except WorldError as error:
        raise BadInput(str(error)) from None


@dataclass(frozen=True, slots=True)
class TrackPoint:
    """Where the robot was in one cycle, or believed to be: ``pose`` in the world frame [m, rad]."""

    cycle: int
    pose: Pose2


@dataclass(frozen=True, slots=True)
class RunPicture:
    """A camera picture of a run.

    Attributes:
        entry: its name on the board, as ``CameraPicture-49``.
        cycle: in which the board saw it; time_s: when it was taken, by the body's clock.
        jpeg: as the camera delivered it.
    """

    entry: str
    cycle: int
    time_s: float
    jpeg: bytes

    def pixels(self) -> NDArray[np.uint8]:
        """(height, width, 3) red, green, blue."""
        from knowledge_sources.methods.features import read_picture

        return np.asarray(read_picture(self.jpeg).color)


class RecordedRun:
    """A recorded run, read from its directory. Nothing of it is changed.

    Attributes:
        path: its directory.
    """

    def __init__(self, files: RunDirectory, sources: Sequence[type[KnowledgeSource]] = ()) -> None:
        self._files, self._sources = files, tuple(sources)
        self.path = files.path

    @cached_property
    def head(self) -> RunHead:
        """How it began: scenario, seed, world, settings. Raises BadInput."""
        return RunHead.read(self.path)

    @cached_property
    def _kinds(self) -> Registry:
        return registry_of(self._sources, wiring.load_kinds().values())

    @cached_property
    def _store(self) -> FrameStore:
        return FrameStore(self.head.load_world(), self.head.world_sha256)

    @property
    def result(self) -> Mapping[str, Any]:
        """``result.json``; empty where the run was cut off. Raises BadInput."""
        return self._files.read_result()

    def decisions(self) -> Iterator[DecisionRecord]:
        """Every decision, in order: what was seen, who could act, who was chosen, what changed. Raises BadInput."""
        return Timeline(self._files.journal).decisions()

    def records(self) -> Iterator[EntryRecord[Any]]:
        """Every change of every entry, in order, observed ones too. Raises BadInput."""
        return (record for decision in self.decisions() for record in decision.changes)

    @overload
    def entries(self, kind: type[T]) -> Iterator[Entry[T]]: ...
    @overload
    def entries(self, kind: None = None) -> Iterator[Entry[Any]]: ...

    def entries(self, kind: type[Any] | None = None) -> Iterator[Entry[Any]]:
        """Every revision of every entry with its typed value, or those of one kind.

        Raises:
            BadInput: a value is of a kind, or of a version of it, that is not known here.
        """
        for record in self.records():
            found = self._kinds.get(record.type)
            if not record.is_gone and (kind is None or found is kind):
                store = self._store if found is LocaleFrame else None
                yield entry_of(record, self._kinds, store)

    def pictures(self) -> Iterator[RunPicture]:
        """The camera's pictures, in order. Raises BadInput where they are missing."""
        jpegs = open_pictures(self._files)
        for record in self.records():
            if record.kind is CameraPicture and record.is_new:
                value = record.fields
                yield RunPicture(record.id, record.cycle, float(value["sim_time_s"]), jpegs[value["number"]])

    def believed_track(self) -> Sequence[TrackPoint]:
        """Where the robot believed it was: one point for each revision of the held pose hypothesis."""
        world = self.head.load_world()
        held = (entry for entry in self.entries(Hypothesis) if entry.value.is_held)
        return [TrackPoint(entry.cycle, entry.value.world_from_robot(world)) for entry in held]

    def true_track(self) -> Sequence[TrackPoint]:
        """Where it truly was, from the recording: a point wherever it had moved; none on hardware.

        Raises:
            RecordingError: the recording cannot be read.
        """
        return [TrackPoint(cycle, Pose2(x_m, y_m, heading_rad))
                for cycle, x_m, y_m, heading_rad in read_true_track(self._files.recording)]

    def why(self, what: str | int | None = None) -> str:
        """Why something came about, in sentences, as ``harvey why`` says it.

        Args:
            what: an entry, as ``"MotorCommand-12"``; a landmark, door, thing or room, as ``"allens-office/desk"``; a
                question, as ``"what is in the way?"``; the number of a cycle; None for the outcome, in short.

        Raises:
            BadInput: the run has none of that name; near ones are listed.
        """
        with knowing(self._kinds):
            history = Timeline(self._files.journal)
            stories = self.stories(what) if what is not None or history.cut_off is not None else [
                tell_end(self._files, history)]
            return "\n\n".join("\n".join(lines_of(one)) for one in stories)

    def stories(self, what: str | int | None = None) -> Sequence[Story]:
        """The same as data: headline, decision and reasons with the entries that say so."""
        history = Timeline(self._files.journal)
        with knowing(self._kinds):
            if isinstance(what, str) and is_question(what):
                return list(answers(history, what, run=self._files))
            return list(stories_of(history, what, WorldFile(self._files)))

    def replay(self) -> int | None:
        """Decide it again from what it observed: the first cycle that is decided differently, or None where none is.

        Raises:
            BadInput: an observation cannot be read.
        """
        agent = build_agent(self.head, with_sources(self._sources))
        decided = replay_run(self._files, open_originals(self._files, agent.store), agent.scheduler())
        return next((one.recorded.cycle for one in decided if not one.same), None)


__all__ = [
    "RecordedRun", "RunPicture", "TrackPoint", "build_world", "load_scenario", "load_world", "open_run", "run", "show",
]
