"""``harvey view``: open the recording of a run."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path

from harvey.commands.command import Command
from harvey.errors import BadInput
from harvey.run_directory import open_run


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", metavar="RUN", help="a run directory")


def _run(args: Namespace) -> int:
    recording = open_run(args.run, "recording.rrd").recording
    if not _has_screen():
        print(f"no screen here to open a window on; the recording is {recording.resolve()}\n"
              f"open it where there is one, with: rerun {recording}", file=sys.stderr)
        return 1
    return subprocess.run([_viewer(), str(recording)], check=False).returncode


def _has_screen() -> bool:
    return not sys.platform.startswith("linux") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _viewer() -> str:
    """The viewer that came with the recording's library, beside this Python, or one on the path."""
    beside = shutil.which("rerun", path=str(Path(sys.executable).parent))
    viewer = beside or shutil.which("rerun")
    if viewer is None:
        raise BadInput("expected the rerun viewer to be installed (it comes with rerun-sdk), got none")
    return viewer


COMMAND = Command(
    "view", "open the recording of a run in the rerun viewer",
    (("harvey view runs/lab-to-allens-office-0", "building, camera, plan tree, experts and why"),),
    _arguments, _run,
)
