"""``harvey world ledger``: what runs say of a building."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

from harvey.commands.command import CliCommand
from harvey.commands.world_command import find_file, load_file
from harvey.errors import BadInput


def _ledger_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("file", metavar="WORLD", help="the world file in which the robot believed, or the name of one"
                                                      " that comes with the project")
    parser.add_argument("runs", metavar="RUN", nargs="+", help="run directories")
    parser.add_argument("--plan", metavar="OUT", help="draw it on the plan there: .png, .svg or .pdf")
    parser.add_argument("--json", metavar="OUT", help="write all of it there, line by line, as JSON (-: print it)")


def _run_ledger(args: Namespace) -> int:
    from harvey_survey.ledger import read_ledger
    from harvey_survey.ledger_output import format_ledger, ledger_json, write_plan
    from logs.run_directory import open_run

    world = load_file(args.file, [])
    ledger = read_ledger(world, find_file(args.file), [open_run(run) for run in args.runs])
    if not ledger.looks:
        raise BadInput(f"expected runs in which a place was verified, got none in {', '.join(args.runs)}")
    if args.plan is not None:
        write_plan(world, ledger, Path(args.plan))
    if args.json == "-":
        print(ledger_json(ledger), end="")
        return 0
    if args.json is not None:
        write_text(args.json, "--json", ledger_json(ledger))
    print(format_ledger(ledger), end="")
    return 0


def write_text(out: str, option: str, text: str) -> None:
    """Write a file. Raises BadInput."""
    try:
        Path(out).write_text(text, encoding="utf-8")
    except OSError as error:
        raise BadInput(f"{option} {out}: expected a file to write to, got: {error.strerror}") from None


LEDGER = CliCommand(
    "ledger", "show what runs expected of a building, what they found, and how far off",
    (("harvey world ledger floor.toml runs/monday runs/tuesday", "a table of each wall, door and thing"),
     ("harvey world ledger floor.toml runs/* --plan found.png", "and on the plan: red is what is seldom found"),
     ("harvey world ledger research_center runs/first --json -", "each line of each of them, as JSON")),
    _ledger_arguments, _run_ledger,
    "Only pictures by which a place was verified count. Of each landmark: in how many pictures some of it was\n"
    "expected, in how many none of it was found, and its lines: expected, found, hidden by what the run found on the\n"
    "floor, and missing; found of expected by the picture's light and by distance (near: below 3 m, far: above 6 m).\n"
    "off: how far it is from where the file has it, in centimetres with its standard deviation: along its wall, up,\n"
    "or to x (east) and y (north); walls into their rooms; from the poses that the pictures gave. The order of the\n"
    "runs does not matter, and a run that is given twice counts once. A run of another world file is refused.",
)
