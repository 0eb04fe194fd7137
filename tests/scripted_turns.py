"""A run of eight decisions in which it is refuted, lost, found, and its camera fails."""

from __future__ import annotations

from dataclasses import replace

from blackboard import Blackboard, Decision, Effect, Level, Post, Revise
from world_models.entries import BodyFault, Certificate, Discrepancy, Hypothesis, Milestone, Outcome, Recovery, diagonal
from world_models.frames import Pose2

CERTIFICATE = Certificate("Milestone-1", "", "refuted", "1 of 9 lines", 9, 3, 1, 0.1, 1.0, 0.1, 0.0, 9.0, 30.0, 1.0,
                          1.0, 0.006)
HELD = Hypothesis("kitchen", Pose2(1.0, 2.0, 0.0), diagonal(0.01, 0.01), "odometry")


def decisions() -> list[Decision]:
    """Refuted, lost, found, a fault, the end: one a cycle."""
    board, made = Blackboard(), list[Decision]()

    def act(*effects: Effect) -> None:
        cycle = len(made) + 1
        changes = board.apply(list(effects), author="source", cycle=cycle)
        made.append(Decision(cycle, (), (), Level.ACTION, (), (), None, None, 0, changes, ""))

    act(Post(HELD), Post(Milestone("PlanSketch-1", 2, "M2 of the route", 0.0)))
    act(Post(CERTIFICATE))
    doubt = Discrepancy(Level.PLAN, "M2 is refuted", 99.0, (9.0, 30.0), "px")
    act(Post(doubt, (board.view["Hypothesis-1"],)))
    act(Revise(board.view["Discrepancy-1"], replace(doubt, status="escalated"), (board.view["Hypothesis-1"],)))
    there = replace(HELD, basis="relocalization", locale_from_robot=Pose2(3.0, 1.0, 0.0))
    act(Revise(board.view["Hypothesis-1"], there))
    fault = BodyFault("camera", "camera unplugged", "no such device", "PictureRequest-1", 7.0)
    act(Post(fault))
    act(Post(Recovery("BodyFault-1", "PictureRequest-1", 7.0, 2.0, tries=9, waited_s=30.0, status="still failing")))
    act(Post(Outcome("failed", "camera unplugged")))
    return made
