"""Experiments: one a module with ``run(quick, seed) -> Report``. A new one needs its file and a line here."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Mapping
from typing import TYPE_CHECKING

from harvey.errors import BadInput

if TYPE_CHECKING:
    from harvey.experiments.report import Report

PLANNED: Mapping[str, str] = {
    "agenda": "Activations a second with the journal written, from 10 to 100,000 that wait; memory; peers.",
    "calibrate": "Calibration from rendered chessboards: are the deviations that it tells true?",
    "corridor": "Real photographs: edges found, poses recovered from perturbed ones, failures known as such.",
    "crash": "Missions killed at random moments and resumed: nothing lost, nothing done twice, all arrive.",
    "explanations": "Missions of every scenario: does every decision rest on something, does a replay decide the same?",
    "figure12": "The trace of the 2D matcher's local search (Figure 12).",
    "kidnap": "A thousand kidnaps to anywhere on a floor of forty rooms: found, ambiguous or, never, wrong?",
    "imported-building": "Missions between random rooms of a house that others have drawn (IFC).",
    "imported-floors": "Plans between any two rooms of different floors of a university (IndoorGML).",
    "lens": "Lines seen through a distorting lens: picture straightened first, or the segments' ends afterwards.",
    "frame-budget": "What perception costs a frame: tracking, and a milestone from picture to verdict.",
    "levels": "What the three levels of perceptual servoing do: missions with each of them switched off (Figure 2).",
    "malformed-worlds": "World files that somebody has spoilt: a clear error or a checked world, each time.",
    "matcher": "2D matching of 4 to 40 model lines: success within a pixel, and time as problems grow.",
    "missions": "A thousand missions on a good day and a thousand on a bad one: how near, and how the others end.",
    "milestones": "Right and wrong places on made-up floors: false accepts and rejects; is the probability true?",
    "milestones-calibrate": "What evidence for a milestone is worth, counted on floors that no other experiment uses.",
    "recorder": "What the recording costs a cycle beside the pictures, and how large it grows.",
    "planning": "How long the sketches and milestones of Figure 17 take to plan (§7: about 5 minutes).",
    "pose-speed": "How long a pose takes: one solve, and the combinatorial solvers, beside PoseLib.",
    "render-speed": "The simulator's camera: frames per second on one core, and where its edges lie.",
    "serial-chaos": "The drivers of all bases over lines that garble, lose, repeat, delay and break.",
    "table1": "Forty feet of hallway, servoed and unservoed, stopping and on the move (Table 1, Figure 11).",
    "table2": "Pose from lines, R-then-T against R-and-T (Table 2), and the physical limit.",
    "video-stream": "A mission's camera stream as a video file, through VideoCapture: the same milestones?",
    "visibility": "What the model takes to be visible against what the simulator's renderer draws, in made-up houses.",
    "world-size": "The same mission in worlds of 10, 1,000 and 100,000 locales: what it touches, time and memory.",
    "table3": "Pose from lines with outliers (Table 3), Med-R-and-T and beyond.",
}


def names() -> tuple[str, ...]:
    """Of the experiments that there are."""
    return tuple(name for name in PLANNED if importlib.util.find_spec(_module(name)) is not None)


def run(name: str, *, quick: bool = False, seed: int = 0) -> Report:
    """Run one.

    Raises:
        BadInput: there is no such experiment; near ones are named.
    """
    if name not in names():
        from sim.settings import near

        raise BadInput(f"expected an experiment: {near(name, names())}, got {name!r}")
    report: Report = importlib.import_module(_module(name)).run(quick, seed)
    return report


def _module(name: str) -> str:
    return f"{__name__}.{name.replace('-', '_')}"
