"""Knowledge sources: each may be missing, one may be added, none may know the truth, all rate purely."""

from __future__ import annotations

import gc
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from types import FunctionType, ModuleType
from typing import Any

import pytest

from blackboard.board import View
from blackboard.change import Change, Posted, Watch
from blackboard.effect import Effect, Post
from blackboard.journal import Decision, plain
from blackboard.kinds import inference
from blackboard.knowledge_source import KnowledgeSource
from blackboard.level import Level
from harvey.simulation.run import run_mission
from harvey.wiring import KNOWLEDGE_SOURCES, knowledge_sources
from knowledge_sources.settings import Settings
from sim.body.building import Building as TrueBuilding
from sim.body.simulated_body import SimulatedBody
from sim.differences.change import Change as Difference
from sim.differences.table import Lasting, TrueCamera
from sim.made_up.short_missions import OFFICE
from sim.scenario import parse_scenario
from sim.stage import Stage, build_stage
from sim.truth import Truth
from world_models.actuator import ActuatorModel
from world_models.building.building import Building
from world_models.camera import Camera, CameraMount
from world_models.entries.body import MotionReport
from world_models.entries.robot import CameraState
from world_models.robot import RobotModel

FROM_VIEW = Building | RobotModel | Camera | CameraMount | ActuatorModel | View
"""What a knowledge source knows only from the view that it is given."""
OF_TRUTH = Truth | SimulatedBody | Stage | TrueBuilding | Lasting | TrueCamera | Difference
"""What belongs to the simulator."""
NAMES = [source.__module__.rpartition(".")[2] for source in KNOWLEDGE_SOURCES]
NOT_NEEDED = {"correlator_tracker", "plan_adjuster", "escalator", "relocalizer", "fault_handler", "path_follower",
              "elevator_rider", "obstruction_finder", "model_reviser", "withdrawer", "obstacle_finder", "door_watcher",
              "range_watcher"}
