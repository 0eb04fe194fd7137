"""The process that the crash experiment kills: a mission whose simulated world remembers what was done in it.

``python -m experiments.robustness.crash_child run SCENARIO SEED RUN MEMORY`` drives, ``... resume RUN MEMORY`` goes on.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path

from harvey.agent import agent_of
from harvey.campaign.campaign import Task
from harvey.run_files.run_directory import RunDirectory
from harvey.run_files.run_head import RunHead
from harvey.runner.ports import Body
from harvey.runner.replay import pictures_of, replay
from harvey.runner.resume import remains_of
from harvey.simulation.run import Around, resume_mission, run_mission
from world_models.entries.body import BodyFault, Course, Frame, MotionReport, MotorCommand, Ride, RideReport

MOTION_S = 0.05
"""A motion takes so long here, so that a process may well be killed in the middle of one."""


class Remembered:
    """A body whose world remembers every command that reached it, whatever becomes of the agent."""

    def __init__(self, body: Body, replaying: Callable[[], bool], memory: Path) -> None:
        self._body, self._replaying = body, replaying
        self._memory = memory.open("ab", buffering=0)

    def execute(self, command: MotorCommand) -> MotionReport | BodyFault:
        if self._replaying():
            return self._body.execute(command)
        self._memory.write(json.dumps({"begun": [command.turn_rad, command.move_m]}).encode() + b"\n")
        time.sleep(MOTION_S)
        report = self._body.execute(command)
        self._memory.write(b'{"ended": true}\n')
        return report

    def steer(self, course: Course) -> tuple[MotionReport, Frame] | BodyFault:
        return self._body.steer(course)

    def claim(self) -> MotionReport | BodyFault:
        return self._body.claim()

    def look(self, purpose: str) -> Frame | BodyFault:
        return self._body.look(purpose)

    def ride(self, ride: Ride) -> RideReport | BodyFault:
        return self._body.ride(ride)

    def wait(self, duration_s: float) -> float:
        return self._body.wait(duration_s)

    def stop(self) -> None:
        self._body.stop()


def remembering(memory: Path) -> Around:
    """Puts a memory round a body."""
    return lambda body, replaying: Remembered(body, replaying, memory)


def main(argv: list[str]) -> int:
    """Run or resume; a run that was resumed is decided again, and the result printed as JSON."""
    if argv[0] == "run":
        scenario, seed, out, memory = argv[1:]
        run_mission(Task(scenario, (), int(seed)).stage(), int(seed), out=Path(out), around=remembering(Path(memory)))
        return 0
    run = RunDirectory(Path(argv[1]))
    result = resume_mission(run, remains_of(run), around=remembering(Path(argv[2])))
    with agent_of(RunHead.read(run.path)) as agent:
        same = all(told.same for told in replay(run, pictures_of(run), agent.scheduler()))
    print(json.dumps({"outcome": result.outcome, "reason": result.reason, "same": same,
                      "error_m": result.final_error_m, "decisions": result.decisions}))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
