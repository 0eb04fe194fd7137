"""``harvey view``: open the recording of a run, or an overview of several."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path

from harvey.commands.command import Command
from harvey.errors import BadInput
from harvey.run_files.run_directory import RunDirectory, find_directory, open_run

OVERVIEW = "overview.rrd"


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("runs", metavar="RUN", nargs="+",
                        help="a run directory; several, or a directory of them, make an overview of one row a run")
    parser.add_argument("--save", metavar="FILE",
                        help=f"write the overview there and do not open it (else {OVERVIEW} beside the runs)")


def _run(args: Namespace) -> int:
    if len(args.runs) == 1 and not _is_campaign(find_directory(args.runs[0])):
        if args.save:
            raise BadInput("--save: expected several runs, or a directory of them, got one run")
        return _open(_whole(open_run(args.runs[0], "recording.rrd")))
    runs = [run for text in args.runs for run in _runs(text)]
    overview = Path(args.save) if args.save else _beside(runs)
    _write(runs, overview)
    if args.save:
        print(f"{len(runs)} runs in {overview}; open it with: rerun {overview}")
        return 0
    return _open(overview)


def _whole(run: RunDirectory) -> Path:
    """The recording; where it is damaged, that is said."""
    from logs.reader import damage_of

    if (damage := damage_of(run.recording)) is not None:
        print(f"{run.recording} is damaged: {damage}; harvey repair {run.path} draws it anew", file=sys.stderr)
    return run.recording


def _runs(text: str) -> list[RunDirectory]:
    """One run, or all runs of a directory in the order of their numbers. Raises BadInput where there is none."""
    here = find_directory(text)
    if not _is_campaign(here):
        return [open_run(text)]
    return [RunDirectory(path) for path in sorted((p.parent for p in here.glob("*/journal.jsonl")), key=_natural)]


def _is_campaign(here: Path) -> bool:
    """Whether a directory holds runs and is none."""
    return not (here / "journal.jsonl").exists() and any(here.glob("*/journal.jsonl"))


def _natural(path: Path) -> list[tuple[int, str]]:
    """Sorts 2 before 10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", path.name)]


def _beside(runs: list[RunDirectory]) -> Path:
    """In the directory that holds all of the runs."""
    return Path(os.path.commonpath([run.path.resolve().parent for run in runs])) / OVERVIEW


def _write(runs: list[RunDirectory], overview: Path) -> None:
    from logs.recording.overview.overview import RunFiles, write_overview

    names = [run.path.name for run in runs]
    unique = len(set(names)) == len(names)
    files = [RunFiles(run.path.name if unique else str(run.path), run.recording, run.read_result()) for run in runs]
    print(f"reading {len(files)} recordings", file=sys.stderr, flush=True)
    for line in write_overview(files, overview, overview.parent.name or "runs"):
        print(f"only its result is shown: {line}", file=sys.stderr)


def _open(recording: Path) -> int:
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
    "view", "open the recording of a run, or an overview of several, in the rerun viewer",
    (
        ("harvey view runs/lab-to-allens-office-0", "building, camera, plan, knowledge sources and why"),
        ("harvey view runs/lab-to-allens-office", "all runs of a campaign, one row each"),
        ("harvey view runs/bump-0 runs/hallway-kidnap-0 --save both.rrd", "two runs side by side, kept in a file"),
    ),
    _arguments, _run,
)
