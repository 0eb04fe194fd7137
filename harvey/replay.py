"""Replay: a recorded run decided again from its observations, without simulator or robot.

A run is what it observed and nothing else: whatever came from outside is put on the board where the journal says it
came, and every decision must come out as it stands in the journal, to the byte.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from blackboard.journal import Decision
from blackboard.scheduler import Scheduler
from harvey.errors import BadInput
from harvey.observations import effect_of
from harvey.records import DecisionRecord
from harvey.run_directory import RunDirectory

if TYPE_CHECKING:
    from sim.scenario import Scenario


@dataclass(frozen=True, slots=True)
class Pair:
    """A decision as recorded, and as it is decided now; None where nothing is left to decide."""

    recorded: DecisionRecord
    now: Decision | None


def scheduler_of(scenario: Scenario) -> Scheduler:
    """The experts round a board, as for a run, but with no body."""
    from harvey.wiring import knowledge_sources, robot_model, servoing

    return Scheduler(knowledge_sources(robot_model(scenario)), servoing=servoing(scenario.servo))


def replayed(decisions: Iterable[DecisionRecord], frames: Mapping[int, bytes], scheduler: Scheduler) -> Iterator[Pair]:
    """Each decision beside its record.

    Raises:
        BadInput: an observation cannot be told again.
    """
    for recorded in decisions:
        for observation in recorded.observed:
            scheduler.tell([effect_of(observation, frames, scheduler.view.get)], observation.author)
        yield Pair(recorded, scheduler.step())


def scenario_of(run: RunDirectory) -> Scenario:
    """The scenario with the settings that a run was made with. Raises BadInput where the result does not say."""
    from sim.scenario import ScenarioError, load_scenario, with_settings

    origin: Any = run.read_result().get("origin")
    try:
        file, settings = str(origin["file"]), dict(origin["settings"])
    except (TypeError, KeyError, ValueError):
        raise BadInput(f"{run.result}: expected an origin with file and settings, got {origin!r}") from None
    try:
        return with_settings(load_scenario(file), settings)
    except ScenarioError as error:
        raise BadInput(f"{run.result}: origin: {error}") from None
