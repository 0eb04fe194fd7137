"""The knowledge sources round the board: those of the project, and those of other installed packages.

A new knowledge source of the project takes one file in its level's folder and one line here. One of another package
takes an entry point of the group ``harvey.knowledge_sources`` there, and no edit here.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from blackboard.kinds import Registry
from blackboard.knowledge_source import KnowledgeSource
from blackboard.level import Level
from blackboard.scheduler import registry_of
from blackboard.servoing import Servoing
from knowledge_sources.action.correlator_tracker import CorrelatorTracker
from knowledge_sources.action.dead_reckoner import DeadReckoner
from knowledge_sources.action.dependency_withdrawer import DependencyWithdrawer
from knowledge_sources.action.door_toucher import DoorToucher
from knowledge_sources.action.door_watcher import DoorWatcher
from knowledge_sources.action.elevator_rider import ElevatorRider
from knowledge_sources.action.fault_handler import FaultHandler
from knowledge_sources.action.floor_changer import FloorChanger
from knowledge_sources.action.floor_watcher import FloorWatcher
from knowledge_sources.action.goal_changer import GoalChanger
from knowledge_sources.action.halt_explainer import HaltExplainer
from knowledge_sources.action.landmark_chooser import LandmarkChooser
from knowledge_sources.action.model_reviser import ModelReviser
from knowledge_sources.action.motor import Motor
from knowledge_sources.action.path_follower import PathFollower
from knowledge_sources.action.range_watcher import RangeWatcher
from knowledge_sources.action.thing_mapper import ThingMapper
from knowledge_sources.action.thing_mover import ThingMover
from knowledge_sources.action.touch_finder import TouchFinder
from knowledge_sources.action.travel_breaker import TravelBreaker
from knowledge_sources.action.yaw_calibrator import YawCalibrator
from knowledge_sources.goal.goal_closer import GoalCloser
from knowledge_sources.goal.goal_renewer import GoalRenewer
from knowledge_sources.goal.interpreter import Interpreter
from knowledge_sources.goal.localizer import Localizer
from knowledge_sources.goal.mission_monitor import MissionMonitor
from knowledge_sources.goal.panorama_builder import PanoramaBuilder
from knowledge_sources.goal.pose_adopter import PoseAdopter
from knowledge_sources.goal.probe_photographer import ProbePhotographer
from knowledge_sources.goal.prober import Prober
from knowledge_sources.plan.alias_monitor import AliasMonitor
from knowledge_sources.plan.belief_checker import BeliefChecker
from knowledge_sources.plan.camera_calibrator import CameraCalibrator
from knowledge_sources.plan.detour_finder import DetourFinder
from knowledge_sources.plan.discrepancy_raiser import DiscrepancyRaiser
from knowledge_sources.plan.goal_sketcher import GoalSketcher
from knowledge_sources.plan.line_finder import LineFinder
from knowledge_sources.plan.lookout_planner import LookoutPlanner
from knowledge_sources.plan.matcher import Matcher
from knowledge_sources.plan.med_r_and_t import MedRAndT
from knowledge_sources.plan.milestone_judge import MilestoneJudge
from knowledge_sources.plan.milestone_passer import MilestonePasser
from knowledge_sources.plan.obstruction_finder import ObstructionFinder
from knowledge_sources.plan.plan_adjuster import PlanAdjuster
from knowledge_sources.plan.refiner import Refiner
from knowledge_sources.plan.shut_door_explainer import ShutDoorExplainer
from knowledge_sources.plan.sketch_advancer import SketchAdvancer
from knowledge_sources.plan.view_chooser import ViewChooser
from knowledge_sources.plan.view_predictor import ViewPredictor
from knowledge_sources.plan.view_updater import ViewUpdater
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from knowledge_sources.settings import DEFAULT, Settings
from world_models.entries.entry_kinds import KINDS
from world_models.files.toml.mission import Servo
from world_models.plugins import SOURCES_GROUP, PluginError, load_plugin_classes

KNOWLEDGE_SOURCES: tuple[type[RobotKnowledgeSource], ...] = (
    Interpreter,
    GoalSketcher,
    Refiner,
    MilestonePasser,
    SketchAdvancer,
    DetourFinder,
    LookoutPlanner,
    ViewChooser,
    BeliefChecker,
    ViewPredictor,
    ViewUpdater,
    Motor,
    PathFollower,
    ElevatorRider,
    FloorChanger,
    DeadReckoner,
    CorrelatorTracker,
    LandmarkChooser,
    LineFinder,
    ObstructionFinder,
    Matcher,
    MedRAndT,
    MilestoneJudge,
    CameraCalibrator,
    YawCalibrator,
    TravelBreaker,
    PlanAdjuster,
    DiscrepancyRaiser,
    ProbePhotographer,
    PanoramaBuilder,
    Localizer,
    Prober,
    PoseAdopter,
    GoalRenewer,
    AliasMonitor,
    FaultHandler,
    ModelReviser,
    GoalChanger,
    FloorWatcher,
    RangeWatcher,
    ThingMapper,
    TouchFinder,
    HaltExplainer,
    ThingMover,
    DoorWatcher,
    DoorToucher,
    ShutDoorExplainer,
    DependencyWithdrawer,
    GoalCloser,
    MissionMonitor,
)
"""Every knowledge source. The order does not matter: control comes from triggers, ratings and levels."""


def knowledge_sources(settings: Settings = DEFAULT) -> tuple[KnowledgeSource, ...]:
    """The project's knowledge sources."""
    return tuple(build(source, settings) for source in KNOWLEDGE_SOURCES)


def build(source: type[KnowledgeSource], settings: Settings) -> KnowledgeSource:
    """A knowledge source with the settings; one that needs none is built without."""
    return source(settings) if issubclass(source, RobotKnowledgeSource) else source()


@cache
def foreign_sources(group: str = SOURCES_GROUP) -> Mapping[str, type[KnowledgeSource]]:
    """The knowledge sources of other installed packages, by name; or those that sit only where a run names them.

    Raises:
        PluginError: one cannot be loaded, or is called otherwise than its entry point.
    """
    found = load_plugin_classes(group, KnowledgeSource)
    for name, source in found.items():
        if source.called() != name:
            raise PluginError(f"entry point {group}, {name}: expected the name of its class, {source.called()}")
    return found


@cache
def load_kinds() -> Registry:
    """The kinds of entries that may be on a board: those of the project and of every knowledge source there is."""
    return registry_of((*KNOWLEDGE_SOURCES, *foreign_sources().values()), KINDS)


def servoing(servo: Servo) -> Servoing:
    """The levels that a scenario leaves on."""
    on = {Level.ACTION: servo.action, Level.PLAN: servo.plan, Level.GOAL: servo.goal}
    return Servoing(frozenset(level for level, is_on in on.items() if not is_on))
