"""Harvey: model-directed mobile robot navigation on a blackboard.

The Python interface. Everything below is loaded when it is first used:

- missions: :func:`run`, :func:`open_run`, :func:`show`, :func:`load_scenario`, :class:`RecordedRun`,
  :class:`MissionResult`; what a recorded run yields: :class:`DecisionRecord`, with :class:`EntryRecord` and
  :class:`Candidate`
- building models: :func:`load_world`, :func:`build_world`, :class:`World`
- poses from matched lines: :func:`med_r_and_t`, :func:`r_and_t_ml`, :func:`planar_from_lines`
  (``knowledge_sources.methods.pose`` says which to use when), :class:`Camera`, :class:`Pose`, :class:`Pose2`
- the blackboard by itself: :class:`Scheduler`, :class:`KnowledgeSource`, :class:`Watch`, :class:`Posted`,
  :class:`Revised`, :class:`Retracted`, :class:`Post`, :class:`Revise`, :class:`Retract`, :class:`View`, :class:`Entry`,
  :class:`Change`, :class:`Decision`, :class:`Effect`, :class:`Level`, and the marks :func:`request`,
  :func:`observation`, :func:`inference`
- errors: :class:`BadInput`

Importing it sets environment variables that are not set yet, because the libraries read them when they are first
imported: OPENBLAS_NUM_THREADS, OMP_NUM_THREADS, MKL_NUM_THREADS and OPENCV_FOR_THREADS_NUM to 1 and, on a processor
with AVX2, those that keep numpy, OpenBLAS and OpenCV from using more (:mod:`logs.decided_by` says which and why). So
the same run is decided the same on every such machine. A variable that is set already stays as it is.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from harvey.packages import check_packages

check_packages()
importlib.import_module("logs.decided_by").settle()

if TYPE_CHECKING:
    from blackboard import View
    from blackboard import Change, Posted, Retracted, Revised, Watch
    from blackboard import Effect, Post, Retract, Revise
    from blackboard import Entry
    from blackboard import Decision
    from blackboard import inference, observation, request
    from blackboard import KnowledgeSource
    from blackboard import Level
    from blackboard import Scheduler
    from harvey.api import RecordedRun, RunPicture, TrackPoint, build_world, open_run, run, show
    from harvey.errors import BadInput
    from harvey.runner.result import MissionResult
    from knowledge_sources.methods.pose import (
        PlanarEstimate,
        PoseEstimate,
        med_r_and_t,
        planar_from_lines,
        r_and_t_ml,
    )
    from logs.records import Candidate, DecisionRecord, EntryRecord
    from sim.scenario import load_scenario
    from world_models.building.world import World
    from world_models.camera import Camera, CameraMount
    from world_models.files.world_files import load_world
    from world_models.frames import Pose, Pose2

_MODULES: Mapping[str, tuple[str, ...]] = {
    "blackboard.board": ("View",),
    "blackboard.change": ("Change", "Posted", "Retracted", "Revised", "Watch"),
    "blackboard.effect": ("Effect", "Post", "Retract", "Revise"),
    "blackboard.entry": ("Entry",),
    "blackboard.journal": ("Decision",),
    "blackboard.kinds": ("inference", "observation", "request"),
    "blackboard.knowledge_source": ("KnowledgeSource",),
    "blackboard.ladder": ("Level",),
    "blackboard.scheduler": ("Scheduler",),
    "harvey.api": ("RunPicture", "RecordedRun", "TrackPoint", "build_world", "open_run", "run", "show"),
    "harvey.errors": ("BadInput",),
    "harvey.runner.result": ("MissionResult",),
    "knowledge_sources.methods.pose": (
        "PlanarEstimate", "PoseEstimate", "med_r_and_t", "planar_from_lines", "r_and_t_ml"),
    "logs.records": ("Candidate", "DecisionRecord", "EntryRecord"),
    "sim.scenario": ("load_scenario",),
    "world_models.building.world": ("World",),
    "world_models.camera": ("Camera", "CameraMount"),
    "world_models.files.world_files": ("load_world",),
    "world_models.frames": ("Pose", "Pose2"),
}
_MODULE_OF: Mapping[str, str] = {name: module for module, names in _MODULES.items() for name in names}

__all__ = [
    "BadInput", "Camera", "CameraMount", "Candidate", "Change", "Decision", "DecisionRecord", "Effect", "Entry",
    "EntryRecord", "KnowledgeSource", "Level",
    "MissionResult", "PlanarEstimate", "Pose", "Pose2", "PoseEstimate", "Post", "Posted", "RecordedRun", "Retract",
    "Retracted", "Revise", "Revised", "RunPicture", "Scheduler", "TrackPoint", "View", "Watch", "World",
    "build_world", "inference", "load_scenario", "load_world", "med_r_and_t", "observation", "open_run",
    "planar_from_lines", "r_and_t_ml", "request", "run", "show",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'harvey' has no attribute {name!r}")
    return getattr(importlib.import_module(_MODULE_OF[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
