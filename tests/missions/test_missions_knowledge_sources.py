"""Knowledge sources: each may be missing, one may be added, none may know the truth, all rate purely."""

from __future__ import annotations

import gc
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from types import FunctionType, ModuleType
from typing import Any

import pytest

from blackboard import Change, Decision, Effect, KnowledgeSource, Level, Post, Posted, View, Watch, inference
from experiments.generated.missions import OFFICE
from harvey.simulation.simulated_run import run_mission
from harvey.wiring import KNOWLEDGE_SOURCES, knowledge_sources
from knowledge_sources.settings import Settings
from sim.body.simulated_body import SimulatedBody
from sim.body.simulated_building import SimulatedBuilding as TrueBuilding
from sim.ground_truth.table import Lasting, TrueCamera
from sim.ground_truth.true_changes import TrueChange as Difference
from sim.scenario import parse_scenario
from sim.stage import Stage, build_stage
from sim.truth import Truth
from world_models.actuator import ActuatorModel
from world_models.building.building import Building
from world_models.camera import Camera, CameraMount
from world_models.entries import CameraState, MotionReport
from world_models.robot import RobotModel

FROM_VIEW = Building | RobotModel | Camera | CameraMount | ActuatorModel | View
"""What a knowledge source knows only from the view that it is given."""
OF_TRUTH = Truth | SimulatedBody | Stage | TrueBuilding | Lasting | TrueCamera | Difference
"""What belongs to the simulator."""
NAMES = [source.__module__.rpartition(".")[2] for source in KNOWLEDGE_SOURCES]
NOT_NEEDED = {
    "correlator_tracker", "plan_adjuster", "discrepancy_raiser", "fault_handler", "path_follower", "elevator_rider",
    "obstruction_finder", "model_reviser", "goal_changer", "dependency_withdrawer", "thing_mapper", "door_watcher",
    "door_toucher", "touch_finder", "halt_explainer", "thing_mover",
    "shut_door_explainer", "range_watcher", "floor_watcher", "camera_calibrator", "yaw_calibrator", "alias_monitor",
    "detour_finder", "lookout_planner", "belief_checker", "view_updater", "probe_photographer", "panorama_builder",
    "localizer", "prober", "pose_adopter", "goal_renewer", "landmark_chooser",
    "floor_changer", "travel_breaker", "refiner", "rival_weigher", "lens_monitor", "correction_monitor", "sense_judge",
    "wheels_calibrator", "surveyor", "bumper_monitor", "exposure_monitor", "push_monitor"}
"""Where nothing goes wrong, the mission may be reached without these: they close servo loops, answer faults, steer on
the move, ride in elevators, find what is before the camera or in the way, take up what somebody tells, learn of the
camera, doubt a sense, or refine what passes through more than one room."""


@pytest.mark.parametrize("missing", NAMES)
def test_without_any_one_of_them_the_outcome_is_clear(short_stage: Stage, missing: str) -> None:
    def sources(settings: Settings) -> Sequence[KnowledgeSource]:
        return [ks for ks in knowledge_sources(settings) if ks.name != missing]

    result = run_mission(short_stage, 3, sources=sources)
    assert result.outcome in {"reached", "lost", "blocked", "failed"}
    assert result.reason
    if missing not in NOT_NEEDED:
        assert result.outcome != "reached"


@inference()
@dataclass(frozen=True)
class Counted:
    """A kind of its own: what one motion report claims."""

    text: str


class Odometer(KnowledgeSource):
    """A knowledge source of its own: counts motion reports."""

    level = Level.ACTION
    on = (Watch(MotionReport, (Posted,)),)
    writes = (Counted,)

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        yield Post(Counted(f"{trigger.entry.value.move_m:.2f} m"), (trigger.entry,))


def test_adding_one_takes_one_line(short_stage: Stage) -> None:
    said: list[str] = []

    def listen(decision: Decision) -> None:
        said.extend(c.entry.value.text for c in decision.made if c.entry.author == "odometer")

    result = run_mission(
        short_stage, 3, sources=lambda known: (*knowledge_sources(known), Odometer()), sinks=[listen])
    assert result.outcome == "reached"
    assert said


def test_no_expert_holds_the_truth(short_stage: Stage) -> None:
    """Neither the simulator nor the building or the robot can be reached from what a knowledge source holds."""
    body = short_stage.body(3)
    for source in knowledge_sources():
        held = [thing for thing in _reachable(source) if isinstance(thing, OF_TRUTH | FROM_VIEW)]
        assert held == [], source.name
    assert any(isinstance(thing, Truth) for thing in _reachable(body))  # the walk does find it where it is


TRUTH_TABLE = """
[truth.camera]
focal_px = 0.5
[[truth.things]]
thing = "allens-office/desk"
missing = true
[[truth.extra]]
kind = "bin"
locale = "allens-office"
x_ft = 2.0
y_ft = 6.0
at_s = 3.0
"""


def test_nothing_of_a_truth_that_differs_is_on_the_board() -> None:
    """Neither in an entry nor in a knowledge source after the mission; the robot is told the scenario's camera,
    and learns the rest."""
    stage, entries, sources = build_stage(parse_scenario(OFFICE + TRUTH_TABLE)), [], list(knowledge_sources())

    def listen(decision: Decision) -> None:
        entries.extend(change.entry for change in (*decision.observed, *decision.made))

    run_mission(stage, 3, sources=lambda _: sources, sinks=[listen])
    assert entries and stage.building.gone
    held = [thing for thing in _reachable((entries, sources)) if isinstance(thing, OF_TRUTH)]
    assert held == []
    texts = [thing for thing in _reachable(entries) if isinstance(thing, str)]
    assert not [text for text in texts if "extra-0" in text or text == "bin"]
    told, *learnt = [entry for entry in entries if isinstance(entry.value, CameraState)]
    assert told.value.lens.fx == stage.scenario.camera.camera.fx and told.author == "robot"
    assert {entry.author for entry in learnt} == {"camera_calibrator",
              "yaw_calibrator"}


def _reachable(root: Any) -> Iterable[Any]:
    """Every object that can be reached from one, code and modules left out."""
    seen, todo = {id(root)}, [root]
    while todo:
        thing = todo.pop()
        yield thing
        for other in gc.get_referents(thing):
            if id(other) not in seen and not isinstance(other, type | ModuleType | FunctionType):
                seen.add(id(other))
                todo.append(other)
