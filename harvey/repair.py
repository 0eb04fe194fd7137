"""Repair: the recording of a run drawn anew from its journal and its pictures."""

from __future__ import annotations

import os
from collections.abc import Sequence

from blackboard.journal import Sink
from harvey.agent import build_agent
from harvey.runner.replay import check_same, open_originals, replay
from harvey.runner.resume import find_remains, replay_run
from harvey.simulation.run import SimulatedRun, rebuild_stage
from logs.run_directory import RunDirectory
from logs.run_head import SIMULATOR, RunHead
from logs.run_recorder import RunRecorder


def redraw(run: RunDirectory, sinks: Sequence[Sink] = ()) -> int:
    """Draw a run's recording anew; the old one stays until the new one is whole. Returns how many decisions it shows.

    Raises:
        BadInput: the run cannot be replayed as it was.
        RecordingError: the recording cannot be written.
    """
    decisions = find_remains(run).decisions
    head, part = RunHead.read(run.path), run.recording.with_name("recording.rrd.part")
    agent = build_agent(head)
    recorder = RunRecorder(None, head, agent.world, agent.robot, drawing=part)
    try:
        if head.kind == SIMULATOR:
            with SimulatedRun(rebuild_stage(head), head, agent, recorder, sinks) as simulated:
                replay_run(run, simulated, simulated.body_replay)
        else:
            scheduler = agent.scheduler(sinks=(*recorder.sinks, *sinks))
            for decision in replay(run, open_originals(run, agent.store), scheduler):
                check_same(run, decision)
        recorder.close()
        os.replace(part, run.recording)
    finally:
        part.unlink(missing_ok=True)
    return decisions
