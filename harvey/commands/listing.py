"""``harvey list``, ``settings``, ``experiment`` and ``completion``: what there is to run, to set and to type."""

from __future__ import annotations

import json
import shutil
from argparse import Action, ArgumentParser, Namespace, _SubParsersAction
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby, zip_longest
from math import degrees
from pathlib import Path
from textwrap import fill, wrap
from typing import TYPE_CHECKING, Any

from experiments import EXPERIMENTS
from harvey.campaign.workers import choose_workers
from harvey.commands.command import CliCommand, add_worker_arguments, parse_workers, whole
from harvey.errors import BadInput

if TYPE_CHECKING:
    from knowledge_sources.settings import Row

def _run_list(_args: Namespace) -> int:
    import experiments
    from sim.scenario_names import describe_scenario, find_scenarios

    print("scenarios (harvey run NAME):")
    for name, path in find_scenarios().items():
        print(_item(name, describe_scenario(path)))
    for folder, group in experiments.EXPERIMENTS.items():
        print(f"\nexperiments: {folder} (harvey experiment NAME):")
        for name, summary in sorted(group.items()):
            print(_item(name, summary))
    print("\nA seed fixes noise and chance: the same scenario and seed give the same run. Without --seed it is 0;"
          "\n--seed 0..19 runs twenty. A mission of your own is a TOML file like those in sim/scenarios/.")
    return 0


def _item(name: str, text: str) -> str:
    return fill(text, 112, initial_indent=f"  {name:<22} ", subsequent_indent=" " * 25)


LIST = CliCommand(
    "list", "what there is to run: scenarios and experiments",
    (("harvey list", "names and descriptions"),), lambda _parser: None, _run_list,
)


MIN_WIDTH, MAX_WIDTH = 80, 160
"""Columns of the terminal that a table takes."""
SOURCE_WIDTH = 24


def _add_settings_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("room", metavar="ROOM", nargs="?", help="one room, or one setting as plan.max_leg_m (all)")
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")


def _run_settings(args: Namespace) -> int:
    rows = select_rows(args.room)
    if args.json:
        print(json.dumps([to_record(row) for row in rows], indent=2, ensure_ascii=False))
        return 0
    width = min(max(shutil.get_terminal_size((120, 24)).columns, MIN_WIDTH), MAX_WIDTH)
    print("\n".join(format_rows(rows, width)))
    print("\nAn angle is set in radians. One number is replaced by --set ROOM.NAME=VALUE, in harvey run and replay.\n"
          "Those of camera, wheels and footprint may be set in other units too: camera.tilt_deg, camera.height_in.")
    return 0


def select_rows(name: str | None) -> tuple[Row, ...]:
    """All settings, those of a room, or one. Raises BadInput where there is no such room or setting."""
    from harvey.agent_settings import find_key, list_robot_rows
    from knowledge_sources.settings import list_rows
    from world_models.files.toml.settings_reader import suggest_keys

    rows, name = (*list_rows(), *list_robot_rows()), name and find_key(name)
    chosen = tuple(row for row in rows if name in (None, row.room, row.name))
    if not chosen:
        known = [*dict.fromkeys(row.room for row in rows), *(row.name for row in rows)]
        raise BadInput(f"ROOM: expected {suggest_keys(str(name), known)}, got {name!r}")
    return chosen


def to_record(row: Row) -> dict[str, Any]:
    """A setting as JSON types."""
    return {"name": row.name, "value": row.value, "unit": row.unit, "meaning": row.what, "source": row.source}


def format_rows(rows: Sequence[Row], width: int) -> Iterator[str]:
    """One table for each room, as wide as said: name, value with unit, meaning, source."""
    for number, (room, group) in enumerate(groupby(rows, key=lambda row: row.room)):
        yield f"{chr(10) * (number > 0)}{room}: {describe_room(room)}"
        yield ""
        yield from _format_room(list(group), width)


def describe_room(room: str) -> str:
    """What a room's numbers are for, as its dataclass says."""
    from harvey.agent_settings import ROOMS
    from knowledge_sources.settings import DEFAULT

    if room in ROOMS:
        return ROOMS[room]
    return (getattr(DEFAULT, room).__doc__ or "").strip().splitlines()[0].rstrip(".").removeprefix("The ")


def _format_room(rows: Sequence[Row], width: int) -> Iterator[str]:
    values = [format_value(row) for row in rows]
    name, value = max(len(row.field) for row in rows), max(map(len, values))
    source = min(SOURCE_WIDTH, max(len(row.source) for row in rows))
    meaning = max(width - name - value - source - 8, 24)
    for row, text in zip(rows, values, strict=True):
        lines = zip_longest(wrap(row.what, meaning), wrap(row.source, source), fillvalue="")
        for number, (what, where) in enumerate(lines):
            first, second = (row.field, text) if number == 0 else ("", "")
            yield f"  {first:<{name}}  {second:<{value}}  {what:<{meaning}}  {where}".rstrip()


def format_value(row: Row) -> str:
    """A value with its unit; an angle in degrees too."""
    if isinstance(row.value, str):
        return row.value
    if isinstance(row.value, bool):
        return "on" if row.value else "off"
    unit = "" if row.unit in ("1", "count") else f" {row.unit}"
    return f"{row.value:.4g}{unit}" + (f" ({degrees(row.value):.3g} deg)" if row.unit == "rad" else "")


SETTINGS = CliCommand(
    "settings", "every number that can be set: value, unit, meaning and source",
    (
        ("harvey settings", "all rooms"),
        ("harvey settings floor", "one room"),
        ("harvey settings plan.max_leg_m", "one number"),
        ("harvey settings camera", "what the robot believes of its camera"),
        ("harvey settings --json", "for further use"),
        ("harvey run bump --set plan.max_leg_m=2", "run with another number"),
        ("harvey replay runs/bump-0 --set plan.max_leg_m=2", "decide a run again with another number"),
    ),
    _add_settings_arguments, _run_settings,
    "They belong to the robot's software. The numbers of a scenario (start, sensor, wheels, faults) are in its file.\n"
    "Camera, wheels and footprint are what the robot believes of itself: set, they change that and not what is true.",
)


def _add_experiment_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("experiment", metavar="NAME", help="which one; harvey list names them")
    parser.add_argument("--quick", action="store_true", help="a small one, of seconds to minutes: claims what it can")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--seed", metavar="N", type=whole, default=0, help="of all random numbers (0)")
    parser.add_argument("--out", metavar="FILE.json", help="also write the claims there, with date, commit and options")
    add_worker_arguments(parser)
    parser.add_argument("--missions", metavar="N", type=whole, help="how many, for the experiments that say so")


def _run_experiment(args: Namespace) -> int:
    import time
    from dataclasses import replace

    import experiments
    from experiments.results import build_result, write_result

    if args.out and not Path(args.out).parent.is_dir():
        raise BadInput(f"--out: expected a file in a folder that there is, got {args.out!r}")
    since_s = time.monotonic()
    with choose_workers(parse_workers(args)):
        report = experiments.run(args.experiment, quick=args.quick, seed=args.seed, missions=args.missions or None)
    options = " ".join(["--quick"] * args.quick + [f"--missions {args.missions}"] * bool(args.missions))
    report = replace(report, is_small=bool(options))
    if args.out:
        took_s = time.monotonic() - since_s
        write_result(build_result(args.experiment, report, options, args.seed, took_s), Path(args.out))
    print(json.dumps(report.record(), indent=2) if args.json else report.text())
    return 0 if report.holds else 1


EXPERIMENT = CliCommand(
    "experiment", "measure something and print the paper's figure, a peer's and ours",
    (
        ("harvey experiment levels --quick", "what the three servo levels do"),
        ("harvey experiment render-speed", "the simulator's frames per second and edge accuracy"),
        ("harvey experiment obstacles --missions 200", "a fifth of its missions"),
        ("harvey experiment missions --workers 4", "on four processors"),
        ("harvey experiment levels --json", "for further use"),
        ("harvey experiment figure12 --out figure12.json", "its claims, with date and commit, for docs/status.md"),
    ),
    _add_experiment_arguments, _run_experiment,
    "It prints a table, notes (assumptions, and what the columns mean) and claims, each 'proved' (by\n"
    "its 95 % bound), 'not contradicted' (too little was measured) or 'FAILS'.\n"
    "Exit code 0 if no claim fails, else 1. With --json one object is printed: title, rows (the cells by\n"
    "their columns; beside them paper, peer and ours: a figure, several by name, or null), notes and claims.\n\n"
    "Long ones keep their results and pictures in runs/experiments/NAME/; one that was interrupted continues there.\n"
    "Peers (PoseLib, CLIPS, py_trees): pip install '.[peers]'; for others' buildings ./extras/harvey-buildings.\n"
    "Photographs and buildings by others are not shipped: HARVEY_DATA=FOLDER has corridor/ and buildings/.\n\n"
    "Of integrity: PL, protection level: no further off, says a pose. AL, alert limit: what a mission can bear.\n"
    "MI, misleading: error > PL. HMI, hazardously so: error > AL >= PL. Available: PL <= AL.\n\n"
    "Names, by what is asked (harvey list says more):\n"
    + "\n".join(fill(", ".join(group), 100, initial_indent=f"  {folder:<12}", subsequent_indent=" " * 14,
                     break_on_hyphens=False)
                for folder, group in EXPERIMENTS.items()),
)


SHELLS = ("bash", "zsh")
NAMED: Mapping[str, str] = {"scenario": "_harvey_scenarios", "experiment": "_harvey_experiments"}
"""By the name of an argument: the shell function that completes it."""
FUNCTION: Mapping[str, str] = {
    "bash": '{name}() {{ compgen -W "{words}" -- "$1"; compgen -f -- "$1"; }}',
    "zsh": "{name}() {{ compadd -- {words}; _files }}",
}
"""Completes some words, or a file."""


def _add_completion_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("shell", metavar="SHELL", choices=SHELLS, help=" or ".join(SHELLS))


def _run_completion(args: Namespace) -> int:
    import shtab

    from experiments import list_names
    from harvey.cli import parser
    from sim.scenario_names import find_scenarios

    top = parser()
    for action in _list_actions(top):
        if action.dest in NAMED:
            action.complete = dict.fromkeys(SHELLS, NAMED[action.dest])  # type: ignore[attr-defined]
        elif action.choices is None and action.nargs != 0:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
    words: Mapping[str, Sequence[str]] = {"scenario": list(find_scenarios()), "experiment": list_names()}
    functions = [FUNCTION[args.shell].format(name=name, words=" ".join(words[what])) for what, name in NAMED.items()]
    print(shtab.complete(top, args.shell, preamble="\n".join(functions)))
    return 0


def _list_actions(parser: ArgumentParser) -> Iterator[Action]:
    """The arguments of a parser and of the parsers of its commands."""
    for action in parser._actions:
        if isinstance(action, _SubParsersAction):
            for inner in {id(one): one for one in action.choices.values()}.values():
                yield from _list_actions(inner)
        else:
            yield action


COMPLETION = CliCommand(
    "completion", "print what bash or zsh needs to complete commands, options, scenarios and files",
    (
        ("source <(harvey completion bash)", "in this shell, and in every one from ~/.bashrc"),
        ("harvey completion zsh > ~/.zfunc/_harvey", "for zsh, where ~/.zfunc is in fpath"),
    ),
    _add_completion_arguments, _run_completion,
)
