"""The only place where experts, ports and servo levels meet. Adding an expert takes one file and one line here."""

from __future__ import annotations

from blackboard.knowledge_source import KnowledgeSource
from blackboard.level import Level
from blackboard.servoing import Servoing
from knowledge_sources.action.correlator_tracker import CorrelatorTracker
from knowledge_sources.action.dead_reckoner import DeadReckoner
from knowledge_sources.action.elevator_rider import ElevatorRider
from knowledge_sources.action.fault_handler import FaultHandler
from knowledge_sources.action.motor import Motor
from knowledge_sources.action.path_follower import PathFollower
from knowledge_sources.goal.interpreter import Interpreter
from knowledge_sources.goal.mission_monitor import MissionMonitor
from knowledge_sources.goal.relocalizer import Relocalizer
from knowledge_sources.plan.escalator import Escalator
from knowledge_sources.plan.line_finder import LineFinder
from knowledge_sources.plan.matcher import Matcher
from knowledge_sources.plan.med_r_and_t import MedRAndT
from knowledge_sources.plan.milestone_judge import MilestoneJudge
from knowledge_sources.plan.milestone_selector import MilestoneSelector
from knowledge_sources.plan.obstruction_finder import ObstructionFinder
from knowledge_sources.plan.plan_adjuster import PlanAdjuster
from knowledge_sources.plan.sketcher import Sketcher
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from sim.scenario import Scenario, Servo
from world_models.actuator import ActuatorModel
from world_models.building.world import World
from world_models.entries.location import diagonal
from world_models.entries.task import Command
from world_models.files.store import load_world
from world_models.robot import RobotModel

KNOWLEDGE_SOURCES: tuple[type[RobotKnowledgeSource], ...] = (
    Interpreter,
    Sketcher,
    MilestoneSelector,
    Motor,
    PathFollower,
    ElevatorRider,
    DeadReckoner,
    CorrelatorTracker,
    LineFinder,
    ObstructionFinder,
    Matcher,
    MedRAndT,
    MilestoneJudge,
    PlanAdjuster,
    Escalator,
    Relocalizer,
    FaultHandler,
    MissionMonitor,
)
"""Every expert, in no order that matters: control comes from triggers, ratings and levels."""


def knowledge_sources(robot: RobotModel) -> tuple[KnowledgeSource, ...]:
    """The experts for a robot: each is built with what the robot knows of itself and its world, and nothing else."""
    return tuple(expert(robot) for expert in KNOWLEDGE_SOURCES)


def robot_model(scenario: Scenario, world: World | None = None) -> RobotModel:
    """What the robot knows: the world file without the building's details, its camera and its wheels' kind.

    ``world`` is that file's world where it has been read already.
    """
    camera = scenario.camera
    return RobotModel(world or load_world(scenario.world), camera.camera, camera.mount, ActuatorModel(),
                      continuous=scenario.motion.continuous)


def servoing(servo: Servo) -> Servoing:
    """The levels that a scenario leaves on."""
    on = {Level.ACTION: servo.action, Level.PLAN: servo.plan, Level.GOAL: servo.goal}
    return Servoing(frozenset(level for level, is_on in on.items() if not is_on))


def command(scenario: Scenario) -> Command:
    """What the user asks for in a scenario, and tells of how the robot was put down."""
    start, arrival = scenario.start, scenario.arrival
    covariance = diagonal(max(start.put_down_sigma_m, 0.005), max(start.put_down_sigma_rad, 0.005))
    heading = arrival.heading_rad if arrival.matters else None
    return Command(scenario.goal, start.heading_rad, heading, covariance)
