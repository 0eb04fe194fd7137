"""Experiments, in four folders by what they ask; each is a module with ``run(quick, seed) -> Report``.

``paper``: do the paper's tables and figures come out? ``perception``: how well is it seen? ``robustness``: what happens
when things go wrong? ``scale``: how fast, how large, how long? A new one needs its file and a line here.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import TYPE_CHECKING

from harvey.errors import BadInput

if TYPE_CHECKING:
    from experiments.report import Report

EXPERIMENTS: Mapping[str, Mapping[str, str]] = {
    "paper": {
        "figure12": "The trace of the 2D matcher's local search (Figure 12).",
        "levels": "What the three levels of perceptual servoing do: missions with each one off (Figure 2).",
        "planning": "How long the sketches and milestones of Figure 17 take to plan (§7: about 5 minutes).",
        "pose-speed": "How long a pose takes: one solve, and the combinatorial solvers, beside PoseLib.",
        "table1": "Forty feet of hallway, servoed and unservoed, stopping and on the move (Table 1, Figure 11).",
        "table2": "Pose from lines, R-then-T against R-and-T (Table 2), and the physical limit.",
        "table3": "Pose from lines with outliers (Table 3), Med-R-and-T and beyond.",
    },
    "perception": {
        "calibrate": "Calibration from rendered chessboards: are the deviations that it tells true?",
        "corridor": "Real photographs: edges found, poses recovered from perturbed ones, failures known as such.",
        "lens": "Lines seen through a distorting lens: picture straightened first, or the segments' ends afterwards.",
        "matcher": "2D matching of 4 to 40 model lines: success within a pixel, and time as problems grow.",
        "milestones": "Right and wrong places on made-up floors: false accepts and rejects; is the probability true?",
        "milestones-calibrate": "What evidence for a milestone is worth, on floors that no other experiment uses.",
        "visibility": "What the model takes to be visible against what the renderer draws, in made-up houses.",
    },
    "robustness": {
        "crash": "Missions killed at random moments and resumed: nothing lost, nothing done twice, all arrive.",
        "kidnap": "A thousand kidnaps to anywhere on a floor of forty rooms: found, ambiguous or, never, wrong?",
        "imported-building": "Missions between random rooms of a house that others have drawn (IFC).",
        "imported-floors": "Plans between any two rooms of different floors of a university (IndoorGML).",
        "malformed-worlds": "World files that somebody has spoilt: a clear error or a checked world, each time.",
        "missions": "A thousand missions on a good day and a thousand on a bad one: how near, and how the others end.",
        "serial-chaos": "The drivers of all bases over lines that garble, lose, repeat, delay and break.",
        "video-stream": "A mission's camera stream as a video file, through VideoCapture: the same milestones?",
    },
    "scale": {
        "agenda": "Activations a second with the journal written, from 10 to 100,000 that wait; memory; peers.",
        "explanations": "Missions of every scenario: does every decision rest on something, and replay the same?",
        "frame-budget": "What perception costs a frame: tracking, and a milestone from picture to verdict.",
        "recorder": "What the recording costs a cycle beside the pictures, and how large it grows.",
        "render-speed": "The simulator's camera: frames per second on one core, and where its edges lie.",
        "world-size": "The same mission in worlds of 10, 1,000 and 100,000 locales: what it touches, time and memory.",
    },
}
"""Each folder, by what its experiments ask, with their names and what each measures."""


def names() -> tuple[str, ...]:
    """Of all experiments."""
    return tuple(name for group in EXPERIMENTS.values() for name in group)


def run(name: str, *, quick: bool = False, seed: int = 0) -> Report:
    """Run one.

    Raises:
        BadInput: there is no such experiment; near ones are named.
    """
    if name not in names():
        from world_models.files.toml.settings import suggest_keys

        raise BadInput(f"expected an experiment: {suggest_keys(name, names())}, got {name!r}")
    report: Report = importlib.import_module(_module(name)).run(quick, seed)
    return report


def _module(name: str) -> str:
    folder = next(folder for folder, group in EXPERIMENTS.items() if name in group)
    return f"{__name__}.{folder}.{name.replace('-', '_')}"
