"""``harvey demo``: kidnapped, refuted, lost, found, in a minute, with a page that opens."""

from __future__ import annotations

import sys
import webbrowser
from argparse import ArgumentParser, Namespace
from pathlib import Path

from harvey.commands.command import CliCommand
from logs.run_directory import RUNS, RunDirectory, check_vacant

SCENARIO = "hallway-kidnap"
BEFORE = """\
The robot drives to an office that it knows from a model only. In the hallway somebody moves it by a metre and
turns it by 20 degrees. Nobody tells it. See it refute what it believed, be lost, look round, and know where it is."""


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("--out", metavar="DIR", help="directory for the run's files and the page (runs/demo)")
    parser.add_argument("--no-page", action="store_true", help="write the page, but do not open it")


def _run(args: Namespace) -> int:
    from harvey.campaign.mission_task import Task, run_task
    from harvey.commands.report import build_run_page, write_page
    from logs.explain.story import first_lines

    out = check_vacant(Path(args.out or RUNS / "demo"))
    task = Task(SCENARIO, (), 0, out)
    task.load()
    print(f"{BEFORE}\n", flush=True)
    result = run_task(task, progress=sys.stderr)
    page = out / "report.html"
    write_page(page, build_run_page(RunDirectory(out)))
    print("", *first_lines(out), "", f"{page}: the whole run; opens in any browser", "", sep="\n")
    print(f"ask it      harvey why {out} 'when was it lost?'\nlook at it  harvey view {out}\n"
          "then        harvey run lab-to-allens-office")
    if not args.no_page:
        webbrowser.open(page.resolve().as_uri())
    return 0 if result.outcome == "reached" else 1


DEMO = CliCommand(
    "demo", "see it kidnapped, lost and found, in a minute; a page opens at the end",
    (
        ("harvey demo", "drive, tell what happened, and open the page"),
        ("harvey demo --no-page", "without opening it, as on a machine without a screen"),
    ),
    _arguments, _run,
)
