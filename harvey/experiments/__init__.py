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
    "corridor": "Real photographs: edges found, poses recovered from perturbed ones, failures known as such.",
    "figure12": "The trace of the 2D matcher's local search (Figure 12).",
    "levels": "What the three levels of perceptual servoing do: missions with each of them switched off (Figure 2).",
    "matcher": "2D matching of 4 to 40 model lines: success within a pixel, and time as problems grow.",
    "render-speed": "The simulator's camera: frames per second on one core, and where its edges lie.",
    "table2": "Pose from lines, R-then-T against R-and-T (Table 2), and the physical limit.",
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
