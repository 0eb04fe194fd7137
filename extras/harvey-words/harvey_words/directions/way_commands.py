"""``harvey parse``: what a text about a way means on a building; ``harvey directions``: such a text for a person."""

from __future__ import annotations

import json
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from typing import TYPE_CHECKING

from harvey.commands.command import CliCommand
from harvey.commands.world_command import load_file
from harvey.errors import BadInput

if TYPE_CHECKING:
    from harvey_words.following.reading import Reading, RouteEnd

MOST_CHARACTERS = 10_000


def _add_both(parser: ArgumentParser) -> None:
    parser.add_argument("--world", metavar="W", required=True, help="a world file, or the name of one of the project")
    parser.add_argument("--heading", metavar="DEG", type=float,
                        help="which way the body faces, counter-clockwise from the world's x (not known)")
    parser.add_argument("--json", action="store_true", help="print all that is known of the reading as JSON")


def _add_parse(parser: ArgumentParser) -> None:
    parser.add_argument("text", metavar="TEXT", help="the way, in your words")
    parser.add_argument("--start", metavar="PLACE", required=True, help="a room, hall, door or thing, or X,Y in metres")
    parser.add_argument("--lexicon", metavar="FILE", help="the words of another language (English)")
    _add_both(parser)


def _add_directions(parser: ArgumentParser) -> None:
    parser.add_argument("start", metavar="FROM", help="a room, hall, door or thing, or X,Y in metres")
    parser.add_argument("goal", metavar="TO", help="another")
    _add_both(parser)


def _parse(args: Namespace) -> int:
    from harvey_words.following.reading import RouteError, read_route
    from harvey_words.reading.lexicon import OWN_FILE

    if len(args.text) > MOST_CHARACTERS:
        raise BadInput(f"TEXT: expected at most {MOST_CHARACTERS} characters, got {len(args.text)}")
    if args.heading is not None and not -720.0 <= args.heading <= 720.0:
        raise BadInput(f"--heading: expected degrees from -720 to 720, got {args.heading}")
    try:
        reading = read_route(args.text, load_file(args.world, []), args.start, args.heading, args.lexicon or OWN_FILE)
    except RouteError as error:
        raise BadInput(f"--start: {error}") from error
    print(json.dumps(reading.as_data(), indent=1) if args.json else "\n".join(tell(reading)))
    return 0 if reading.is_understood else 1


def _direct(args: Namespace) -> int:
    from harvey_words.directions.directions import write_directions
    from harvey_words.following.reading import RouteError
    from harvey_words.following.word_map import WordMap

    try:
        written = write_directions(WordMap(load_file(args.world, [])), args.start, args.goal, args.heading)
    except RouteError as error:
        raise BadInput(str(error)) from error
    if args.json:
        print(json.dumps({"text": written.text, "clear": written.is_clear, "reading": written.reading.as_data()},
                         indent=1))
    else:
        doubt = "" if written.is_clear else "\nIt can be mistaken: nothing to be seen tells this way from another."
        print(written.text + doubt)
    return 0 if written.is_clear else 1


def tell(reading: Reading) -> Iterator[str]:
    """A reading in lines for a person; where it is not sure, what it would ask."""
    if not reading.acts or reading.end is None:
        yield "Which way? Nothing in this text tells of one."
        return
    for act in reading.acts:
        side = act.way or (act.what.side if act.what else "")
        yield f"  {act.sort:6} {side:6} {act.text}".rstrip()
    end, rivals = reading.end, reading.ends[1:4]
    yield f"{'It leads to' if reading.is_understood else 'Perhaps to'} {name_end(end)} ({end.odds:.0%})."
    if rivals and not reading.is_understood:
        yield f"Or is it {', or '.join(f'{name_end(rival)} ({rival.odds:.0%})' for rival in rivals)}?"
    for phrase in reading.unused:
        yield f"Did not fit: '{phrase}'."


def name_end(end: RouteEnd) -> str:
    """A place in words."""
    at = f"at ({end.x_m:.1f}, {end.y_m:.1f}), facing {end.heading_rad * 57.29578:.0f}°"
    return f"{end.locale}, door {end.door}, {at}" if end.door else f"{end.locale}, {at}"


PARSE = CliCommand(
    "parse", "read a route instruction on a building: where it leads, how sure that is, and what did not fit",
    (
        ('harvey parse "out of the lab, left, third door" --world research_center --start robot-laboratory',
         "without a robot"),
        ('harvey parse "go to the end of the hall" --world two_ways --start north-hall --heading 0 --json', "as JSON"),
    ),
    _add_parse, _parse,
    "Each way in which the words may be meant is followed on the model of the building: which way the body faces\n"
    "where nobody says so, turns and walks that are left out, a thing called by another's name. The odds of an end\n"
    "are those of its best reading against all other ends, and against none of them.\n"
    "Exit code 0: understood; 1: not sure enough, it asks; 2: the input cannot be used.",
)
DIRECTIONS = CliCommand(
    "directions", "write how a person gets from one place to another, by what is to be seen on the way",
    (
        ("harvey directions robot-laboratory library --world research_center", "from a room to a room"),
        ("harvey directions reception archive --world two_ways --json", "with how it is read again"),
    ),
    _add_directions, _direct,
    "Each step can be said in several ways: by halls, things, crossings, doors counted. What is printed was\n"
    "read again by the reader of `harvey parse` from the same start, and is what leads there the most surely.\n"
    "Exit code 0: it leads there; 1: it may be mistaken; 2: there is no such place, or no way.",
)
