"""Repair: the recording of a run drawn anew from its journal and its pictures."""

from __future__ import annotations

import os
from collections.abc import Sequence

from blackboard.journal import Sink
from harvey.again.replay import checked, pictures_of, replayed
from harvey.again.resume import relived, remains_of, stage_of
from harvey.diary import Diary
from harvey.minds import mind_of
from harvey.mission import Mission
from harvey.run_directory import RunDirectory
from harvey.run_head import SIMULATOR, RunHead


def redrawn(run: RunDirectory, sinks: Sequence[Sink] = ()) -> int:
    """Draw a run's recording anew; the old one stays until the new one is whole. Returns how many decisions it shows.

    Raises:
        BadInput: the run cannot be told again as it was.
        RecordingError: the recording cannot be written.
    """
    decisions = remains_of(run).decisions
    head, part = RunHead.read(run.path), run.recording.with_name("recording.rrd.part")
    with mind_of(head) as mind:
        diary = Diary(None, head, mind.robot, drawing=part)
        try:
            if head.kind == SIMULATOR:
                stage = stage_of(head)
                relived(run, Mission(stage, head, mind, diary, sinks), stage)
            else:
                scheduler = mind.scheduler(sinks=(*diary.sinks, *sinks))
                for told in replayed(run, pictures_of(run), scheduler):
                    checked(run, told)
            diary.close()
            os.replace(part, run.recording)
        finally:
            part.unlink(missing_ok=True)
    return decisions
