"""``harvey directions``: how a person gets from one place to another, by what is to be seen."""

from __future__ import annotations

import json
from argparse import ArgumentParser, Namespace

from harvey.commands.command import CliCommand
from harvey.commands.world_command import load_file
from harvey.errors import BadInput


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("start", metavar="FROM", help="a room, hall, door or thing, or X,Y in metres")
    parser.add_argument("goal", metavar="TO", help="another")
    parser.add_argument("--world", metavar="W", required=True, help="a world file, or the name of one of the project")
    parser.add_argument("--heading", metavar="DEG", type=float,
                        help="which way the person faces, counter-clockwise from the world's x (not known)")
    parser.add_argument("--json", action="store_true", help="print text, clearness and reading as JSON")


def _run(args: Namespace) -> int:
    from harvey_words.directions import write_directions
    from harvey_words.reading import RouteError
    from harvey_words.word_map import WordMap

    try:
        written = write_directions(WordMap(load_file(args.world, [])), args.start, args.goal, args.heading)
    except RouteError as error:
        raise BadInput(str(error)) from error
    if args.json:
        data = {"text": written.text, "clear": written.is_clear, "reading": written.reading.as_data()}
        print(json.dumps(data, indent=1))
    else:
        print(written.text)
        if not written.is_clear:
            print("It can be mistaken: nothing to be seen tells this way from another.")
    return 0 if written.is_clear else 1


COMMAND = CliCommand(
    "directions", "write how a person gets from one place to another, by what is to be seen on the way",
    (
        ("harvey directions robot-laboratory library --world research_center", "from a room to a room"),
        ("harvey directions reception archive --world two_ways --json", "with how it is read again"),
    ),
    _arguments, _run,
    "Each step can be said in several ways: by halls, things, crossings, doors counted. What is printed was\n"
    "read again by the reader of `harvey parse` from the same start, and is what leads there the most surely.\n"
    "Exit code 0: it leads there; 1: it may be mistaken; 2: there is no such place, or no way.",
)
