"""``harvey drive``: a mission on hardware."""

from __future__ import annotations

import os
import sys
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from harvey.commands.command import CliCommand, parse_pairs
from harvey.errors import BadInput
from logs.run_directory import RUNS, check_vacant, expect_unwritten, make_room

if TYPE_CHECKING:
    from blackboard import Decision
    from harvey.agent_settings import Pairs
    from harvey.hardware.hardware_mission import HardwareMission
    from harvey.hardware.preflight import Check, Preflight
    from harvey.runner.ports import Body
    from harvey.runner.result import MissionResult
    from harvey.runner.teller import PageKind
    from world_models.robot import RobotModel

PORT = 8750
"""Of the page."""
OPTIONS: Mapping[str, tuple[str, str, str]] = {
    "world": ("world", "FILE", "the building: a world file, or the name of one that comes with Harvey"),
    "goal": ("goal", "GOAL", 'from where to where: "Go from the hall to the kitchen", middle to middle; or in feet '
             'in each locale: "(ptrans (hall (3,4,0)) (kitchen (6,5,0)))"'),
    "tell": ("task", "TASK", 'what to do from there, as "Fetch the book"; needs harvey-words'),
    "heading": ("start.heading_deg", "DEGREES", "where the robot looks at the start, in the first locale's frame"),
    "base": ("base.port", "BASE", "denning:PORT, as denning:/dev/ttyUSB0; with harvey-bases p2os:PORT or create2:PORT,"
             " with harvey-ros2 ros2:robot.toml"),
    "camera": ("camera.source", "CAMERA", "number of a device, a video file, or a URL; with harvey-ros2"
               " ros2:robot.toml"),
    "calibration": ("camera.calibration", "FILE", "what harvey calibrate wrote"),
}


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("mission", metavar="MISSION.toml", nargs="?", help="a mission's file; or say it all by options")
    for name, (_, metavar, text) in OPTIONS.items():
        parser.add_argument(f"--{name}", metavar=metavar, help=text)
    parser.add_argument("--set", metavar="KEY=VALUE", action="append", default=[], dest="settings",
                        help="any other key of the file, as start.put_down_sigma_in=2, or a number of harvey settings,"
                             " as camera.tilt_deg=1 for what the robot believes of itself; may be repeated")
    parser.add_argument("--dry-run", action="store_true", help="check everything, move nothing")
    parser.add_argument("--out", metavar="DIR", help="where the run is kept (runs/MISSION-drive)")
    parser.add_argument("--live", action="store_true", help="send the recording to an open viewer as well")
    parser.add_argument("--serve", metavar="PORT", type=int, nargs="?", const=PORT,
                        help=f"show it on a page of 127.0.0.1, which can also send, pause and stop it ({PORT}); needs"
                             " harvey-serve")


def _run(args: Namespace) -> int:
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # what is wrong with a camera is said by us
    from harvey.agent_settings import build_settings, split_settings
    from harvey.hardware.hardware_mission import FORMAT
    from harvey.hardware.preflight import Preflight
    from harvey.replay.what_if import WhatIf
    from harvey.runner.teller import find_page

    page = None if args.serve is None else find_page("--serve")
    settings, numbers = split_settings(dict(parse_pairs(args.settings)), FORMAT.keys())
    mission = _mission(args, settings)
    out = expect_unwritten(check_vacant(Path(args.out) if args.out else RUNS / f"{mission.name}-drive"))
    began = time.monotonic()

    def clock() -> float:
        return time.monotonic() - began

    with Preflight(mission, out, clock, build_settings(numbers), WhatIf(pairs=numbers)) as dry:
        if not run_checks(dry):
            return 2
        if args.dry_run:
            print("\neverything is ready; nothing was moved")
            return 0
        return _drive(mission, dry, clock, make_room(out, mission.name, 0), args, numbers, page)


def run_checks(dry: Preflight) -> bool:
    """Make all checks, and tell what came of each; whether nothing failed."""
    for check in dry.run():
        _print_check(check)
    if not dry.ok:
        failed = sum(1 for check in dry.checks if not check.ok)
        print(f"\n{failed} of {len(dry.checks)} failed: nothing was moved", file=sys.stderr)
    return dry.ok


def _mission(args: Namespace, more: dict[str, Any]) -> HardwareMission:
    from harvey.hardware.hardware_mission import load_mission
    from world_models.files.packed import SUFFIXES

    given = {OPTIONS[name][0]: value for name in OPTIONS if (value := getattr(args, name)) is not None}
    settings: dict[str, Any] = {**more, **given}
    for key in ("world", "camera.calibration"):  # named on the command line: relative to where we are
        if str(settings.get(key, "")).endswith((".toml", *SUFFIXES)):
            settings[key] = str(Path(settings[key]).resolve())
    if args.mission is None and not {"world", "goal"} <= set(settings):
        raise BadInput("expected MISSION.toml, or --world and --goal at least")
    return load_mission(None if args.mission is None else Path(args.mission), settings)


def _print_check(check: Check) -> None:
    print(f"{'ok    ' if check.ok else 'FAILED'}  {check.what:<12} {check.found}", flush=True)
    if not check.ok:
        print(f"{'':<21} -> {check.todo}", flush=True)


def _drive(
    mission: HardwareMission, dry: Preflight, clock: Callable[[], float], out: Path, args: Namespace, numbers: Pairs,
    page: PageKind | None,
) -> int:
    from harvey.hardware.hardware_run import drive

    if dry.robot is None or dry.base is None or dry.camera is None:
        raise BadInput("expected a world, a base and a camera, and one of them is lacking")
    start = partial(drive, mission, dry.robot, dry.base, dry.camera, clock, out=out, live=args.live, settings=numbers)
    if page is None:
        tell_how_to_stop()
        result = start(sinks=[follow])
    else:
        result = _drive_served(start, mission, dry.robot, page, args.serve)
    print(summary(result, out))
    return 0 if result.outcome == "reached" else 1


def _drive_served(start: Callable[..., MissionResult], mission: HardwareMission, robot: RobotModel, kind: PageKind,
                  port: int) -> MissionResult:
    """Drive, and show it on a page, which may pause and stop it."""
    from harvey.hardware.hardware_body import HardwareBody
    from logs.run_head import load_known_world

    with kind.serve(port, load_known_world(mission.world), robot.lens, mission.name) as page:
        def guard(body: HardwareBody, tick: Callable[[], None]) -> Body:
            page.gate.on_stop = body.stop_for_good
            guarded: Body = page.guard(body, tick)
            return guarded

        tell_how_to_stop()
        result = start(sinks=[follow, page.live], around=guard, tell=page.teller.tell)
        page.live.end(f"{result.outcome}: {result.reason}")
    return result


def tell_how_to_stop() -> None:
    """On the terminal, before the first move."""
    print("\nspace, enter, q, escape or Ctrl-C stops the robot at once", file=sys.stderr, flush=True)


def summary(result: MissionResult, out: Path) -> str:
    """How a mission on hardware went, and what to do with its run."""
    from logs.explain.story import first_lines

    m, first = result.milestones, "\n".join(first_lines(out))
    return (f"{result.outcome}: {result.reason}\n"
            f"  milestones    {m['verified']} verified, {m['refuted']} refuted, {m['not_testable']} not testable\n"
            f"{''.join(f'  camera        {lesson.text()}{chr(10)}' for lesson in result.camera)}"
            f"{''.join(f'  refused       {text}{chr(10)}' for text in result.refused)}"
            f"  way           {result.path_length_m:.1f} m, as the wheels claim, in {result.sim_time_s:.0f} s\n"
            f"  recording     {out / 'recording.rrd'}\n\n{first}\n\n"
            f"open it with    harvey view {out}\nhave it told    harvey story {out}\nask it with     harvey why {out}")


def follow(decision: Decision) -> None:
    """A line for every milestone, and for whatever is wrong with the body."""
    from world_models.entries import BodyFault, Milestone

    for change in (*decision.observed, *decision.made):
        value, said = change.entry.value, ""
        if isinstance(value, Milestone) and not value.is_open:
            said = f"{value.what}: {value.status}"
        elif isinstance(value, BodyFault):
            said = f"{value.part}: {value.what}" + (f" ({value.detail})" if value.is_open else ": over")
        if said:
            print(f"cycle {decision.cycle}: {said}", file=sys.stderr, flush=True)


DRIVE = CliCommand(
    "drive", "drive a mission on hardware",
    (
        ("harvey drive mission.toml --dry-run", "check world, plan, base, camera and disk; nothing moves"),
        ("harvey drive mission.toml", "the same checks, then the mission"),
        ("harvey drive mission.toml --base denning:/dev/pts/7", "on an emulated base: harvey emulate tells its port"),
        ("harvey drive mission.toml --serve", "the same, with a page to watch, send, pause and stop it"),
        ("harvey drive mission.toml --camera http://127.0.0.1:8090/stream.mjpg", "with another camera"),
    ),
    _arguments, _run,
    """
It is told before the first move what is not ready, and what to do about it. The robot moves only while the base
answers and the milestone before the move was verified. Any of space, enter, q, escape, Ctrl-C and SIGTERM stops it.
docs/hardware.md goes from the parts to a first mission. Exit code 0: reached; 1: not; 2: something is not ready.""",
)


def _add_tell_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", metavar="RUN", help="the directory of a run that goes on, or its name under runs/")
    parser.add_argument("text", metavar="TEXT", help='"Go to the library", "go on"; with harvey-words any task')


def _run_tell(args: Namespace) -> int:
    from harvey.runner.teller import TOLD_FILE
    from logs.disk import is_being_written
    from logs.run_directory import open_run

    run = open_run(args.run)
    if not is_being_written(run.journal):
        raise BadInput(f"{run.path}: expected a run that goes on, got one that has ended")
    with (run.path / TOLD_FILE).open("a", encoding="utf-8") as file:
        file.write(" ".join(args.text.split()) + "\n")
    print(f"told; harvey story {run.path} has its answer")
    return 0


TELL = CliCommand(
    "tell", "say something to a robot on its way, simulated or not",
    (("harvey tell runs/office-drive 'Fetch the book'", "a new task, with harvey-words"),
     ("harvey tell runs/office-drive done", "what it waits for is done")),
    _add_tell_arguments, _run_tell,
)
