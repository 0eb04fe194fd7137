"""Description: how to read the recording, in a few lines beside the views."""

from __future__ import annotations

from collections.abc import Sequence

import rerun as rr
import rerun.blueprint as rrb

from logs.recording.board_mirror import Moment
from logs.recording.logger import Logger, Panel, Subject
from logs.recording.paths import DESCRIPTION
from logs.recording.stream import RecordingStream, viewable

TEXT = """\
Harvey drives from room to room by what its camera shows. Knowledge sources round a blackboard decide,
**one decision a cycle**.
Play, or drag the cursor at the bottom; click the number of a turning point to go there.

**Levels:** *action* (blue) corrects moves, *plan* (orange) checks milestones, *goal* (red) finds a lost robot.
**Ring:** doubt, 1 sigma, 20 times as large; **bands** in plots: ±1 sigma. **Arrows in the picture:** drift, 5 times as
long. **Grey:** done. **Outlined rooms:** known on the board, pink ones otherwise than in the file. Ask on with
`harvey why`.
"""


class Description(Logger):
    """Logs the text once."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._title = subject.title

    def panels(self) -> Sequence[Panel]:
        return (Panel(rrb.TextDocumentView(origin=DESCRIPTION, name="How to read this"), "words", 1, 11),)

    def begin(self, stream: RecordingStream) -> None:
        text = f"**{viewable(self._title)}**. {TEXT}"
        stream.fix(DESCRIPTION, rr.TextDocument(text, media_type="text/markdown"))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        """It does not change."""


LOGGERS = (Description,)
