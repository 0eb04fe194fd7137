"""A knowledge source that reads and revises locale frames: a door is locked at its hour, and the plan goes round it."""

from collections.abc import Iterable
from pathlib import Path

import harvey
from harvey import Change, Effect, Entry, Level, Posted, Revise, View, Watch
from knowledge_sources.reads import find_building, find_frames
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.building.locale_frame import CHANGED, FrameChange, LocaleFrame
from world_models.entries import MotionReport, PlanSketch

MISSION = """
world = "two_ways"
goal = "(ptrans (reception (9,8,0)) (archive (9,6,0)))"
start = { heading_deg = 30.0, put_down_sigma_m = 0.03, put_down_sigma_deg = 2.0 }
"""
DOOR, LOCKED_AT_S = "archive-north-door", 12.0
FILE, OUT = Path("to_the_archive.toml"), Path("runs") / "timetable"


class Timetable(RobotKnowledgeSource):
    """Knows at what time a door is locked, and revises the frames of both its rooms."""

    level = Level.ACTION
    on = (Watch(MotionReport, (Posted,), lambda report: report.sim_time_s >= LOCKED_AT_S),)
    priority = 1.0
    writes = (LocaleFrame,)

    def bind(self, view: View, trigger: Change) -> Entry[MotionReport] | None:
        known = [change.name for frame in view.having(CHANGED, True) for change in frame.value.changes]
        return None if DOOR in known else trigger.entry

    def act(self, view: View, case: Entry[MotionReport]) -> Iterable[Effect]:
        rooms = find_building(view).find_elements(DOOR)
        for frame in find_frames(view, rooms):
            shut = frame.value.changed(FrameChange("shut", DOOR, self.name))
            yield Revise(frame, shut, (case, frame))


FILE.write_text(MISSION, encoding="utf-8")
result = harvey.run(FILE, out=OUT, knowledge_sources=[Timetable])
run = harvey.open_run(OUT, knowledge_sources=[Timetable])
for entry in (*run.entries(LocaleFrame), *run.entries(PlanSketch)):
    if entry.author in ("timetable", "dependency_withdrawer"):
        print(f"cycle {entry.cycle}: {entry.value.sentence()}")
        print(f"  [{entry.ref} by {entry.author}, because of {', '.join(map(str, entry.because))}]")
print(f"{result.outcome}; replayed {'the same' if run.replay() is None else 'differently'}")
