"""Experiments, in five folders by what they ask; each is a module with ``run(quick, seed) -> Report``.

``paper``: do the paper's tables and figures come out? ``perception``: how well does it see? ``robustness``: what
happens when things go wrong? ``differences``: when the truth differs from what is believed? ``scale``: how fast, how
large, how long? A new one needs its file and a line here. Those of an extra are with the extra.
"""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Mapping
from types import FunctionType
from typing import TYPE_CHECKING

from harvey.errors import BadInput
from world_models.plugins import list_absent, list_plugins, load_plugins

if TYPE_CHECKING:
    from experiments.report import Report

GROUP = "harvey.experiments"
"""The entry points of other packages."""
EXPERIMENTS: Mapping[str, Mapping[str, str]] = {
    "differences": {
        "doors": "1,000 missions with doors otherwise than the model says",
        "inexact": "1,000 missions with models wrong by 2, 5 and 10 cm",
        "light": "1,000 missions under lamps, sun and reflections",
        "miscalibrated": "1,000 missions with a camera mounted differently",
        "obstacles": "1,000 missions among things that the model lacks",
        "twins": "3,000 missions on floors of identical rooms",
    },
    "paper": {
        "covariance": "Ellipsoids of the pose solvers: do they hold?",
        "figure12": "Trace of the 2D matcher's local search (Figure 12)",
        "levels": "Missions with each servo level off (Figure 2)",
        "planning": "Planning time of Figure 17's mission (§7)",
        "pose-speed": "Time of the pose solvers, beside PoseLib",
        "table1": "Forty feet of hallway, servoed and unservoed (Table 1)",
        "table2": "Pose from noisy lines: R-then-T, R-and-T (Table 2)",
        "table3": "Pose from lines with wrong matches (Table 3)",
    },
    "perception": {
        "calibrate": "Camera calibration: are its standard deviations true?",
        "corridor": "Real photographs: line coverage and pose recovery",
        "matcher": "2D matching of growing problems: success and time",
        "milestones": "Milestones at right and wrong places: error rates",
        "milestones-calibrate": "Fits the weights of the evidence for milestones",
        "repeats": "Stairs, shelves, doors: a pose one repetition off",
    },
    "robustness": {
        "crash": "Missions killed at random moments and resumed",
        "explore": "Unknown floors explored, and missions in the models",
        "imported-building": "Missions between the rooms of a house from IFC",
        "integrity": "One fault a mission: is a pose as near as it says?",
        "kidnap": "Kidnaps to anywhere on generated floors of 40 rooms",
        "malformed-worlds": "World and building files with errors put in",
        "missions": "1,000 missions without trouble and 1,000 with",
        "other-worlds": "Missions in rooms drawn by others (miniworld)",
        "people": "Missions among people who walk (harvey-people)",
        "rosmaps": "ROS maps traced into worlds: rooms, doorways, missions",
        "serial-chaos": "Drivers of bases over serial lines with errors",
        "soak": "Errands in one building, day after day: 1,000 km",
        "survey": "Buildings that are wrong, surveyed by missions in them",
    },
    "scale": {
        "agenda": "Activations per second with 10 to 1,000 pending",
        "cost": "Where the processor time of missions goes",
        "driven-ways": "Ways told in words, driven by the camera",
        "explanations": "Missions of every scenario, explained and replayed",
        "frame-budget": "Time of perception per frame",
        "instructions": "Ways told in words: 300 drawn, 80 written by hand",
        "large": "Processor time, lost among 58 and 99 rooms",
        "questions": "Questions after runs: harvey why against deciding again",
        "render-speed": "Simulated camera: frame rate and edge accuracy",
        "watchers": "The live page: what 50 watchers cost, hostile requests",
    },
}
"""Name and one-line summary of each experiment, by folder; both in alphabetical order."""


def list_names() -> tuple[str, ...]:
    """Return the names of all experiments, those that other packages add last."""
    return tuple(dict.fromkeys([*(name for group in EXPERIMENTS.values() for name in group), *list_plugins(GROUP)]))


def run(name: str, *, quick: bool = False, seed: int = 0, missions: int | None = None) -> Report:
    """Run one experiment; ``missions``: how many, where it drives missions by number.

    Raises:
        BadInput: there is no such experiment (similar names are given), or none by number of missions.
    """
    if name not in list_names():
        from world_models.files.toml.settings_reader import suggest_keys

        raise BadInput(f"expected an experiment: {suggest_keys(name, list_names())}, got {name!r}")
    run_one = _find(name)
    if missions is not None and "missions" not in inspect.signature(run_one).parameters:
        raise BadInput(f"--missions: {name} has no number of missions to choose")
    report: Report = run_one(quick, seed) if missions is None else run_one(quick, seed, missions=missions)
    return report


def _find(name: str) -> Callable[..., Report]:
    """The ``run`` of an experiment, here or of another package. Raises BadInput where that is not installed."""
    if needs := list_absent(GROUP).get(name):
        raise BadInput(f"experiment {name} needs {needs}")
    if name in list_plugins(GROUP):
        found: Callable[..., Report] = load_plugins(GROUP, FunctionType, name)[name]
        return found
    folder = next(folder for folder, group in EXPERIMENTS.items() if name in group)
    run_one: Callable[..., Report] = importlib.import_module(f"{__name__}.{folder}.{name.replace('-', '_')}").run
    return run_one
