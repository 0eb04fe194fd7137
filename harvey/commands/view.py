"""``harvey view``: open the recording of a run, or write one of its pictures."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
from argparse import ArgumentParser, Namespace
from contextlib import suppress
from pathlib import Path
from typing import Any

from harvey.commands.command import CliCommand, whole
from harvey.errors import BadInput
from logs.run_directory import RunDirectory, open_run

LOOPBACK = ("--bind", "127.0.0.1")
"""The viewer listens on this machine only; by itself it listens on every interface."""
ADDRESS = re.compile(r"http://\S+\?url=\S+")
"""Of the page with this recording, in what the viewer says."""


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", metavar="RUN", help="a run directory")
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--web", action="store_true",
                     help="in a browser; the viewer serves it on this machine only, until Ctrl-C")
    how.add_argument("--picture", metavar="AT", type=whole,
                     help="write the camera picture that was seen last in cycle AT, as PNG, with the lines that were"
                          " found in it and those that were expected, and open nothing")
    parser.add_argument("--save", metavar="FILE", help="with --picture: the name of the file")
    parser.add_argument("--plain", action="store_true", help="with --picture: without lines")


def _run(args: Namespace) -> int:
    if args.picture is not None:
        return _write_picture(open_run(args.run), args.picture, args.save, plain=args.plain)
    if args.plain or args.save:
        raise BadInput(f"--{'plain' if args.plain else 'save'}: expected it with --picture")
    return _open(_whole(open_run(args.run, "recording.rrd")), args.web)


def _write_picture(run: RunDirectory, cycle: int, name: str | None, *, plain: bool) -> int:
    from logs.pictures import find_picture, write_picture

    out = Path(name or f"{run.path.resolve().name}-{cycle}.png")
    if out.suffix != ".png":
        raise BadInput(f"--save: expected a name that ends in .png, got {str(out)!r}")
    record = find_picture(run, cycle)
    lines = {} if plain else _find_lines(run, record.id)
    width, height = write_picture(run, record, out, lines)
    print(f"{out}: {record.id}, seen in cycle {record.cycle}, taken at {record.fields['sim_time_s']:.1f} s; "
          f"{width} x {height} px")
    if counts := [f"{len(lines[kind])} {kind} ({colour})" for kind, colour in (
            ("expected", "yellow"), ("found", "blue"), ("agreed", "green")) if kind in lines]:
        print(f"lines: {', '.join(counts)}; --plain leaves them out")
    return 0


def _find_lines(run: RunDirectory, picture: str) -> dict[str, Any]:
    """What was found in a picture, and what was expected there."""
    from harvey.report.data import list_lines
    from harvey.report.page import find_known
    from logs.timeline import Timeline

    return list_lines(Timeline(run.journal), find_known(run)[1]).get(picture, {})


def _whole(run: RunDirectory) -> Path:
    """The recording; where it is damaged, that is said."""
    from logs.reader import damage_of

    if (damage := damage_of(run.recording)) is not None:
        print(f"{run.recording} is damaged: {damage}; harvey repair {run.path} draws it again", file=sys.stderr)
    return run.recording


def _open(recording: Path, in_browser: bool) -> int:
    if in_browser:
        how = "--web-viewer" if has_screen() else "--serve-web"  # the latter opens no browser
        return _wait_for([find_viewer(), str(recording), how, *LOOPBACK, "--port", "0", "--web-viewer-port", "0"],
                         subprocess.PIPE)
    if not has_screen():
        print(f"no screen here to open a window on; the recording is {recording.resolve()}\n"
              f"open it where there is one, with: rerun {recording}", file=sys.stderr)
        return 1
    return _wait_for([find_viewer(), str(recording), *LOOPBACK])


def _wait_for(viewer: list[str], out: int | None = None) -> int:
    """Run the viewer until it ends, or harvey does: its launcher leaves the viewer itself behind when only it ends.

    ``out``: where what it says goes; of a pipe the address and what went wrong are printed.
    """
    with subprocess.Popen(viewer, process_group=0, text=True, stdout=out, stderr=out and subprocess.STDOUT) as running:
        try:
            for line in running.stdout or ():
                if address := ADDRESS.search(line):
                    print(f"{address[0]}\nis its address, for a browser on this machine; Ctrl-C ends it", flush=True)
                elif " INFO" not in line:
                    print(line, end="", file=sys.stderr, flush=True)
            return running.wait()
        finally:
            with suppress(ProcessLookupError):
                os.killpg(running.pid, signal.SIGKILL)  # it has nothing to save, and may not heed less


def has_screen() -> bool:
    return not sys.platform.startswith("linux") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def find_viewer() -> str:
    """The viewer that came with the recording's library, next to this Python, or one on the path."""
    beside = shutil.which("rerun", path=str(Path(sys.executable).parent))
    viewer = beside or shutil.which("rerun")
    if viewer is None:
        raise BadInput("expected the rerun viewer to be installed (it comes with rerun-sdk), got none")
    return viewer


VIEW = CliCommand(
    "view", "open the recording of a run in the rerun viewer, or write one of its pictures",
    (
        ("harvey view runs/lab-to-allens-office-0", "building, camera, plan, knowledge sources and why"),
        ("harvey view runs/bump-0 --web", "in a browser"),
        ("harvey view runs/bump-0 --picture 88", "what the camera saw in cycle 88, with lines: bump-0-88.png"),
    ),
    _arguments, _run,
)
