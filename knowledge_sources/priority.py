"""Priority: how urgent the acts of knowledge sources are, on one scale."""

from __future__ import annotations

from enum import Enum


class Priority(float, Enum):
    """What comes first, of activations at one servo level: what is known is brought up to date before it is used.

    What has happened is entered into the belief and the plan before anything else; then the model is revised and the
    belief corrected; then pictures are read; only when nothing of that is left is anything new decided, and the wheels
    come last.
    """

    ENTER = 1.0  # what happened: motion, faults, verdicts, what was withdrawn, what climbs a level
    REVISE = 0.95  # what the model lacks: things, doors
    CORRECT = 0.9  # the belief, by what was seen
    SEE = 0.8  # read a picture, and judge what it shows; begin a plan for a new goal
    RECOVER = 0.7  # check a belief in doubt, or find the robot again
    ADVANCE = 0.6  # take the plan on to its next subgoal
    LOOK = 0.5  # choose what to look for next
    STEER = 0.4  # set the course of a robot on the move
    MOVE = 0.3  # turn the wheels
