"""``harvey view``: open the recording of a run, or an overview of several; or write one of its pictures."""

from __future__ import annotations

import os
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
from logs.run_directory import RunDirectory, find_directory, open_run

OVERVIEW = "overview.rrd"
LOOPBACK = ("--bind", "127.0.0.1")
"""The viewer listens on this machine only; by itself it listens on every interface."""


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("runs", metavar="RUN", nargs="+",
                        help="a run directory; several, or a directory of them, make an overview of one row a run")
    parser.add_argument("--save", metavar="FILE",
                        help=f"write the overview there and do not open it (else {OVERVIEW} beside the runs); "
                             "with --picture: the name of the file")
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--web", action="store_true",
                     help="in a browser; the viewer serves it on this machine only, until Ctrl-C")
    how.add_argument("--picture", metavar="AT", type=whole,
                     help="write the camera picture that was seen last in cycle AT, as PNG, with the lines that were"
                          " found in it and those that were expected, and open nothing")
    parser.add_argument("--plain", action="store_true", help="with --picture: without lines")


def _run(args: Namespace) -> int:
    is_one = len(args.runs) == 1 and not _is_campaign(find_directory(args.runs[0]))
    if args.plain and args.picture is None:
        raise BadInput("--plain: expected it with --picture")
    if args.picture is not None:
        if not is_one:
            raise BadInput("--picture: expected one run, got several")
        return _write_picture(open_run(args.runs[0]), args.picture, args.save, plain=args.plain)
    if is_one:
        if args.save:
            raise BadInput("--save: expected several runs, or a directory of them, got one run")
        return _open(_whole(open_run(args.runs[0], "recording.rrd")), args.web)
    runs = [run for text in args.runs for run in _runs(text)]
    overview = Path(args.save) if args.save else _beside(runs)
    _write(runs, overview)
    if args.save:
        print(f"{len(runs)} runs in {overview}; open it with: rerun {overview}")
        return 0
    return _open(overview, args.web)


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
    from harvey.report.data import Lenses, list_lines
    from harvey.report.page import find_known
    from logs.timeline import Timeline

    return list_lines(Timeline(run.journal), Lenses(find_known(run)[1])).get(picture, {})


def _whole(run: RunDirectory) -> Path:
    """The recording; where it is damaged, that is said."""
    from logs.reader import damage_of

    if (damage := damage_of(run.recording)) is not None:
        print(f"{run.recording} is damaged: {damage}; harvey repair {run.path} draws it again", file=sys.stderr)
    return run.recording


def _runs(text: str) -> list[RunDirectory]:
    """One run, or all runs of a directory in the order of their numbers. Raises BadInput where there is none."""
    from world_models.words import by_numbers

    here = find_directory(text)
    if not _is_campaign(here):
        return [open_run(text)]
    return [open_run(str(path)) for path in sorted((p.parent for p in here.glob("*/journal.jsonl")), key=by_numbers)]


def _is_campaign(here: Path) -> bool:
    """Whether a directory holds runs and is none."""
    return not (here / "journal.jsonl").exists() and any(here.glob("*/journal.jsonl"))


def _beside(runs: list[RunDirectory]) -> Path:
    """In the directory that holds all of the runs."""
    return Path(os.path.commonpath([run.path.resolve().parent for run in runs])) / OVERVIEW


def _write(runs: list[RunDirectory], overview: Path) -> None:
    from logs.recording.overview import RunFiles, write_overview

    names = [run.path.name for run in runs]
    unique = len(set(names)) == len(names)
    files = [RunFiles(run.path.name if unique else str(run.path), run.recording, run.read_result()) for run in runs]
    print(f"reading {len(files)} recordings", file=sys.stderr, flush=True)
    for line in write_overview(files, overview, overview.parent.name or "runs"):
        print(f"only its result is shown: {line}", file=sys.stderr)


def _open(recording: Path, in_browser: bool) -> int:
    if in_browser:
        how = "--web-viewer" if has_screen() else "--serve-web"  # the latter opens no browser, but says the address
        return _wait_for([find_viewer(), str(recording), how, *LOOPBACK, "--port", "0", "--web-viewer-port", "0"])
    if not has_screen():
        print(f"no screen here to open a window on; the recording is {recording.resolve()}\n"
              f"open it where there is one, with: rerun {recording}", file=sys.stderr)
        return 1
    return _wait_for([find_viewer(), str(recording), *LOOPBACK])


def _wait_for(viewer: list[str]) -> int:
    """Run the viewer until it ends, or harvey does: its launcher leaves the viewer itself behind when only it ends."""
    with subprocess.Popen(viewer, process_group=0) as running:
        try:
            return running.wait()
        finally:
            with suppress(ProcessLookupError):
                os.killpg(running.pid, signal.SIGKILL)  # it has nothing to save, and may not heed less


def has_screen() -> bool:
    return not sys.platform.startswith("linux") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def find_viewer() -> str:
    """The viewer that came with the recording's library, beside this Python, or one on the path."""
    beside = shutil.which("rerun", path=str(Path(sys.executable).parent))
    viewer = beside or shutil.which("rerun")
    if viewer is None:
        raise BadInput("expected the rerun viewer to be installed (it comes with rerun-sdk), got none")
    return viewer


VIEW = CliCommand(
    "view", "open the recording of a run, or an overview of several, in the rerun viewer",
    (
        ("harvey view runs/lab-to-allens-office-0", "building, camera, plan, knowledge sources and why"),
        ("harvey view runs/lab-to-allens-office", "all runs of a campaign, one row each"),
        ("harvey view runs/bump-0 runs/hallway-kidnap-0 --save both.rrd", "two runs side by side, kept in a file"),
        ("harvey view runs/bump-0 --web", "in a browser"),
        ("harvey view runs/bump-0 --picture 88", "what the camera saw in cycle 88, with lines: bump-0-88.png"),
    ),
    _arguments, _run,
)
