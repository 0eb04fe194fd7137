"""The only place where experts, ports and servo levels meet. Adding an expert takes one file and one line here."""

from __future__ import annotations

from blackboard.knowledge_source import KnowledgeSource
from blackboard.level import Level
from blackboard.servoing import Servoing
from knowledge_sources.correlator_tracker import CorrelatorTracker
from knowledge_sources.dead_reckoner import DeadReckoner
from knowledge_sources.escalator import Escalator
from knowledge_sources.expert import Expert
from knowledge_sources.helmsman import Helmsman
from knowledge_sources.interpreter import Interpreter
from knowledge_sources.line_finder import LineFinder
from knowledge_sources.matcher import Matcher
from knowledge_sources.med_r_and_t import MedRAndT
from knowledge_sources.milestone_judge import MilestoneJudge
from knowledge_sources.milestone_selector import MilestoneSelector
from knowledge_sources.mission_keeper import MissionKeeper
from knowledge_sources.motor import Motor
from knowledge_sources.obstruction_finder import ObstructionFinder
from knowledge_sources.passenger import Passenger
from knowledge_sources.plan_adjuster import PlanAdjuster
from knowledge_sources.relocalizer import Relocalizer
from knowledge_sources.safekeeper import Safekeeper
from knowledge_sources.sketcher import Sketcher
from sim.scenario import Scenario, Servo
from world_models.actuator import ActuatorModel
from world_models.location import diagonal
from world_models.robot import RobotModel
from world_models.store import load_world
from world_models.task import Command
from world_models.world import World

EXPERTS: tuple[type[Expert], ...] = (
    Interpreter,
    Sketcher,
    MilestoneSelector,
    Motor,
    Helmsman,
    Passenger,
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
    Safekeeper,
    MissionKeeper,
)
"""Every expert, in no order that matters: control comes from triggers, ratings and levels."""


def knowledge_sources(robot: RobotModel) -> tuple[KnowledgeSource, ...]:
    """The experts for a robot: each is built with what the robot knows of itself and its world, and nothing else."""
    return tuple(expert(robot) for expert in EXPERTS)


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
