"""Colours (red, green, blue, opacity) and what they mean, the same in every view.

What is drawn over camera pictures is bright. What is written, or fills boxes, is read on the viewer's white and on its
black: its relative luminance is between 0.11 and 0.30, a contrast of three to one or more to both.
"""

from __future__ import annotations

from collections.abc import Mapping

Colour = tuple[int, int, int, int]
TRUE: Colour = (70, 210, 90, 255)
BELIEVED: Colour = (70, 150, 255, 255)
CANDIDATE: Colour = (180, 120, 255, 200)
PLANNED: Colour = (222, 115, 15, 255)
EXPECTED: Colour = (255, 220, 70, 255)
FOUND: Colour = (0, 215, 230, 255)
MATCHED: Colour = (130, 255, 60, 255)
REJECTED: Colour = (255, 70, 60, 255)
DONE: Colour = (140, 140, 140, 255)
WAITING: Colour = (135, 135, 140, 255)
DOOR: Colour = (120, 200, 140, 255)
NAME: Colour = (255, 255, 255, 255)
KNOWN: Colour = (0, 200, 215, 170)
REVISED: Colour = (255, 90, 215, 255)
FREE: Colour = (80, 225, 190, 255)
NOT_TESTABLE: Colour = (190, 130, 255, 255)
LEVELS: Mapping[str, Colour] = {"action": (50, 135, 240, 255), "plan": PLANNED, "goal": (235, 90, 120, 255)}
VERDICTS: Mapping[str, Colour] = {
    "verified": (50, 150, 40, 255), "refuted": REJECTED, "not testable": (165, 105, 240, 255),
    "turning": (175, 125, 0, 255), "expected": (175, 125, 0, 255),
}

ACTIVITIES: Mapping[str, Colour] = {
    "waits": DONE, "plans": PLANNED, "drives": BELIEVED, "looks": VERDICTS["expected"],
    "doubts": VERDICTS["not testable"], "is lost": REJECTED, "is in trouble": REJECTED,
    "reached": VERDICTS["verified"], "lost": REJECTED, "blocked": REJECTED, "failed": REJECTED, "stopped": DONE,
}
"""What Harvey may be busy with, in a word or two."""


def faint(colour: Colour, opacity: int) -> Colour:
    """The same colour, less of it."""
    return (*colour[:3], opacity)
