"""Line finder (§1.2): straight line segments of a picture."""

from __future__ import annotations

from collections.abc import Iterable

from blackboard import Change, Effect, Level, Post, Posted, View, Watch
from knowledge_sources.methods.features import compute_mean_and_deviation, find_lines, read_picture
from knowledge_sources.priority import Priority
from knowledge_sources.reads import find_robot, open_milestone
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import CameraPicture, Segments
from world_models.frames import frozen

MIN_SEGMENT_LENGTH_PX = 10.0  # shortest segment that is kept; shorter ones mostly belong to what the model lacks


class LineFinder(RobotKnowledgeSource):
    """Finds the line segments of a frame that was taken for a milestone or for relocalization.

    It searches the whole frame, not only where lines are expected: agreement by chance must be counted too.
    """

    level, priority = Level.PLAN, Priority.SEE
    on = (Watch(CameraPicture, (Posted,), lambda f: f.purpose in ("milestone", "probe")),)
    writes = (Segments,)

    def act(self, view: View, case: Change) -> Iterable[Effect]:
        frame, robot = case.entry, find_robot(view)
        image = read_picture(frame.value.jpeg).rectified(robot.lens, robot.camera)
        found = find_lines(image, min_length_px=MIN_SEGMENT_LENGTH_PX)
        brightness, contrast = compute_mean_and_deviation(image)
        waiting = open_milestone(view) if frame.value.purpose == "milestone" else None
        yield Post(
            Segments(
                frame.id,
                "" if waiting is None else waiting.id,
                frozen(found.segments_px),
                frozen(found.sigma_offset_px),
                contrast,
                brightness,
            ),
            (frame,) if waiting is None else (frame, waiting),
        )
