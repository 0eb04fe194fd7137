"""Process that the crash experiment kills: a mission whose body logs the commands that reached it.

``python -m experiments.robustness.crash_child run SCENARIO SEED RUN LOG`` drives, ``... resume RUN LOG`` goes on.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path

from harvey.agent import build_agent
from harvey.campaign.mission_task import Task
from harvey.runner.ports import Body
from harvey.runner.replay import open_originals, replay
from harvey.runner.resume import find_remains
from harvey.simulation.simulated_run import Around, resume_mission, run_mission
from logs.run_directory import RunDirectory
from logs.run_head import RunHead
from world_models.entries import BodyFault, MotionReport, MotorCommand

MOTION_S = 0.05
"""Duration of a motion, so that a kill may fall in the middle of one."""


def logging_to(path: Path) -> Around:
    """Let a mission's body log every command that reaches it to a file, whatever becomes of the agent."""
    def around(body: Body, replaying: Callable[[], bool]) -> Body:
        log, execute = path.open("ab", buffering=0), body.execute

        def logged(command: MotorCommand) -> MotionReport | BodyFault:
            if replaying():
                return execute(command)
            log.write(json.dumps({"begun": [command.turn_rad, command.move_m]}).encode() + b"\n")
            time.sleep(MOTION_S)
            report = execute(command)
            log.write(b'{"ended": true}\n')
            return report

        object.__setattr__(body, "execute", logged)
        return body

    return around


def main(argv: list[str]) -> int:
    """Run, or resume and replay; the result is printed as JSON."""
    if argv[0] == "run":
        scenario, seed, out, log = argv[1:]
        run_mission(Task(scenario, (), int(seed)).stage(), int(seed), out=Path(out), around=logging_to(Path(log)))
        return 0
    run = RunDirectory(Path(argv[1]))
    result = resume_mission(run, find_remains(run), around=logging_to(Path(argv[2])))
    agent = build_agent(RunHead.read(run.path))
    same = all(step.same for step in replay(run, open_originals(run, agent.store), agent.scheduler()))
    print(json.dumps({"outcome": result.outcome, "reason": result.reason, "same": same,
                      "error_m": result.error_m, "decisions": result.decisions}))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
