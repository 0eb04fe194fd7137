"""A world file watched while somebody edits it: at each save it is checked and its plan is drawn, as a page."""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
import time
from collections.abc import Callable
from contextlib import suppress
from html import escape
from pathlib import Path

from world_models.building.checks import check_world
from world_models.building.plan_view import plan_svg
from world_models.building.world import World
from world_models.files.toml.other_files import compute_digest
from world_models.files.toml.source import WorldError
from world_models.files.world_files import load_world
from world_models.words import count

POLL_S = 0.3
LOOPBACK = ("--bind", "127.0.0.1")

PAGE = """\
<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta http-equiv="refresh" content="1"><title>{name}</title></head>
<body><pre>{summary}</pre>
{plan}</body></html>
"""
"""It loads itself again each second."""


class WorldEditor:
    """What is shown of a world file that is being edited.

    The last plan that could be drawn stays while the file cannot be read.
    """

    def __init__(self, path: Path, page: Path, say: Callable[[str], None], show: Callable[[World], None] | None = None
                 ) -> None:
        """``say`` takes a line for the person; ``show`` takes each world that could be drawn, for another viewer."""
        self._path, self._page, self._say, self._show = path, page, say, show
        self._plan = ""
        self._shown = self._last = ""

    def look(self) -> bool:
        """Read, draw and check the file; whether it has no faults. Raises OSError where the page cannot be written."""
        self._shown = self._last = self._digest()
        try:
            world = load_world(self._path)
            self._plan = plan_svg(world)
        except WorldError as error:
            self._tell([str(error)], "the plan is the last that could be drawn" if self._plan else "no plan yet")
            return False
        self._write("checking")
        if self._show is not None:
            self._show(world)
        faults = [str(fault) for fault in check_world(world)]
        inventory = ", ".join(count(number, what) for what, number in world.counts().items())
        self._tell(faults, f"{count(len(faults), 'fault') if faults else 'no faults'} in {inventory}")
        return not faults

    def look_again(self) -> bool | None:
        """Look where the file, or one that it includes, has changed and rests; else None."""
        before, self._last = self._last, self._digest()
        return self.look() if self._last == before != self._shown else None

    def watch(self, ended: Callable[[], bool] = lambda: False) -> bool:
        """Look at each save until Ctrl-C, or ``ended``; whether the file had no faults at last."""
        is_good = self.look()
        with suppress(KeyboardInterrupt):
            while not ended():
                time.sleep(POLL_S)
                again = self.look_again()
                is_good = is_good if again is None else again
        return is_good

    def _digest(self) -> str:
        """Of the file and those that it includes; of nothing while an editor replaces it."""
        try:
            return compute_digest(self._path)
        except (OSError, WorldError) as error:
            return hashlib.sha256(str(error).encode()).hexdigest()

    def _tell(self, faults: list[str], summary: str) -> None:
        for line in (*faults, f"{self._path}: {summary}"):
            self._say(line)
        self._write("\n".join([*faults, summary]))

    def _write(self, summary: str) -> None:
        """Write the page at once as a whole: a browser may read it at any time."""
        text = PAGE.format(name=escape(self._path.name), summary=escape(summary), plan=self._plan)
        half = self._page.with_name(f".{self._page.name}.part")
        half.write_text(text, encoding="utf-8")
        half.replace(self._page)


class BuildingViewer:
    """The building in the rerun viewer: each world is a recording; the viewer that is open takes it."""

    def __init__(self, viewer: str, recording: Path) -> None:
        """``recording``: the .rrd file that is written again for each world."""
        self._viewer, self._recording = viewer, recording
        self._running: list[subprocess.Popen[bytes]] = []
        self._shown = 0

    def show(self, world: World) -> None:
        """Write the world and give it to the viewer: the first call opens it. Raises RecordingError."""
        from logs.recording.loggers.surroundings.model_building import record_building

        self._shown += 1
        record_building(world, self._recording, f"{world.name} {self._shown}")
        self._running = [viewer for viewer in self._running if viewer.poll() is None]
        self._running.append(subprocess.Popen([self._viewer, str(self._recording), *LOOPBACK], process_group=0,
                                              stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))

    def close(self) -> None:
        """End what was opened: the viewer has nothing to save."""
        for viewer in self._running:
            with suppress(ProcessLookupError):
                os.killpg(viewer.pid, signal.SIGKILL)
            viewer.wait()
