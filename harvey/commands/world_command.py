"""``harvey world``: look at a world file."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from harvey.commands import find_added_commands
from harvey.commands.command import CliCommand, add_parser
from harvey.errors import BadInput, in_one_line
from world_models.words import count

if TYPE_CHECKING:
    from world_models.building.world import World

SILENT_S = 3.0
"""What takes longer than this shows a bar."""
LARGE_BYTES = 500_000
"""A world file of this size takes some seconds to read."""


def _arguments(parser: ArgumentParser) -> None:
    verbs = parser.add_subparsers(title="verbs", metavar="VERB", required=True)
    for verb in (*VERBS, *find_added_commands("world")):
        add_parser(verbs, verb).set_defaults(verb=verb)


def add_file_arguments(parser: ArgumentParser) -> None:
    """Of a verb that reads a world."""
    parser.add_argument("file", metavar="FILE",
                        help="a world file (.toml, compiled: .world), or the name of one that comes with the project")
    parser.add_argument("--details", metavar="FILE", action="append", default=[], help="add what only the building has")


def _show_arguments(parser: ArgumentParser) -> None:
    add_file_arguments(parser)
    parser.add_argument("--out", metavar="FILE",
                        help="draw the plan there, as .svg or .png, or the building for the viewer, as .rrd")


def _compile_arguments(parser: ArgumentParser) -> None:
    add_file_arguments(parser)
    parser.add_argument("--out", metavar="FILE", help="the .world file (named as the world, here)")


def _edit_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("file", metavar="FILE", help="a world file (.toml)")
    parser.add_argument("--live", action="store_true", help="go on at each save, until Ctrl-C")
    parser.add_argument("--page", metavar="OUT", help="the page with the plan (FILE-plan.html, beside FILE)")
    parser.add_argument("--viewer", action="store_true",
                        help="also in three dimensions, in the rerun viewer (FILE.rrd, beside FILE)")


def _new_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("name", metavar="NAME", help="of the world: small letters, digits and hyphens")
    parser.add_argument("--rooms", metavar="NAME,NAME", default="office,library",
                        help="2 to 20 rooms along the corridor, from west to east (office,library)")


def _run(args: Namespace) -> int:
    verb: CliCommand = args.verb
    return verb.run(args)


def load_file(file: str, details: list[str]) -> World:
    """A world file, or one that comes with the project. Raises BadInput, WorldError."""
    from world_models.files.world_files import load_world

    path = find_file(file)
    if path.suffix == ".toml" and path.is_file() and path.stat().st_size > LARGE_BYTES:
        print(f"{file}: reading {path.stat().st_size / 1e6:.1f} MB", file=sys.stderr, flush=True)
    return load_world(path, details=details)


def find_file(file: str) -> Path:
    """A file, or one that comes with the project, by its bare name."""
    from world_models.files.world_files import SUFFIXES, WORLDS

    shipped = WORLDS / f"{file}.toml"
    if file.endswith((".toml", *SUFFIXES)):
        return Path(file)
    if not shipped.is_file():
        names = ", ".join(sorted(p.stem for p in WORLDS.glob("*.toml")))
        raise BadInput(f"expected a .toml or .world file or one of {names}, got {file!r}")
    return shipped


def _compile(file: str, details: list[str], out: str | None) -> int:
    from world_models.files.world_files import SUFFIXES, compile_file

    path = find_file(file)
    if path.suffix != ".toml":
        raise BadInput(f"expected a .toml file to compile, got {file!r}")
    target = Path(out or path.with_suffix(".world").name)
    if target.suffix not in SUFFIXES:
        raise BadInput(f"--out: expected a name that ends in {' or '.join(SUFFIXES)}, got {str(target)!r}")
    world = compile_file(path, target, details)
    print(f"{target}: {_inventory(world)}, {target.stat().st_size / 1e6:.1f} MB")
    return 0


def _edit(args: Namespace) -> int:
    from harvey.commands.view import find_viewer, has_screen
    from harvey.commands.world_editor import BuildingViewer, WorldEditor

    path = Path(args.file)
    if path.suffix != ".toml" or not path.is_file():
        raise BadInput(f"expected a .toml file to edit, got {args.file!r}; harvey world new NAME writes a first one")
    page = Path(args.page or path.with_name(f"{path.stem}-plan.html"))
    if page.suffix != ".html":
        raise BadInput(f"--page: expected a name that ends in .html, got {str(page)!r}")
    if args.viewer and not has_screen():
        raise BadInput("--viewer: expected a screen to open a window on, got none; without it the plan is drawn")
    viewer = BuildingViewer(find_viewer(), path.with_suffix(".rrd")) if args.viewer else None
    editor = WorldEditor(path, page, lambda line: print(line, flush=True), viewer.show if viewer else None)
    print(f"the plan is in {page}: open it in a browser, it follows", flush=True)
    try:
        return 0 if (editor.watch() if args.live else editor.look()) else 2
    except OSError as error:
        raise BadInput(f"--page {page}: expected a file to write to, got: {error.strerror}") from None
    finally:
        if viewer is not None and args.live:
            viewer.close()


def _new(name: str, rooms: str) -> int:
    from world_models.files.first_world import first_world_text

    try:
        text = first_world_text(name, [room.strip() for room in rooms.split(",")])
    except ValueError as error:
        raise BadInput(str(error)) from None
    target = Path(f"{name}.toml")
    try:
        with target.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise BadInput(f"expected a name that is not taken here, got {str(target)!r}, which exists and is kept"
                       ) from None
    print(f"{target}: written; change it to what you measured, and check it with    harvey world check {target}")
    return 0


def print_check(world: World, file: str) -> int:
    """Print the faults of a world; the exit code."""
    from world_models.building.checks import check_world
    from world_models.files.packed import PackedFrames

    if isinstance(world.frames, PackedFrames):
        world.frames.verify()
    faults = check_world(world, with_bar)
    for fault in faults:
        print(in_one_line(str(fault)))
    if faults:
        print(f"{file}: {count(len(faults), 'fault')}", file=sys.stderr)
        return 2
    print(f"{file}: no faults in {_inventory(world)}")
    return 0


def with_bar(items: Sequence[Any], what: str) -> Iterable[Any]:
    """A bar on standard error, where it takes longer than some seconds."""
    from tqdm import tqdm

    yield from tqdm(items, desc=what, file=sys.stderr, leave=False, delay=SILENT_S, mininterval=1.0)


def _inventory(world: World) -> str:
    return ", ".join(count(number, what) for what, number in world.counts().items())


def _show(world: World, out: str | None) -> int:
    print(f"{world.name}: {_inventory(world)}")
    for name in _downward(world, world.root):
        doors = ", ".join(d.name for d in world.doorways_of(name))
        things = count(len(world.things_of(name)), "thing")
        inside = f"{things}, doorways: {doors or 'none'}" if world.is_room(name) else ""
        print(f"{'  ' * len(world.path_of(name))}{name}{': ' + inside if inside else ''}")
    if out is not None:
        _draw(world, Path(out))
        print(f"drawn in {out}")
    return 0


def _downward(world: World, name: str) -> Iterator[str]:
    """A locale and all in it, each before what it contains."""
    yield name
    for child in world.children_of(name):
        yield from _downward(world, child)


def _draw(world: World, out: Path) -> None:
    from logs.run_errors import RecordingError

    try:
        if out.suffix == ".svg":
            from world_models.building.plan_view import plan_svg

            out.write_text(plan_svg(world), encoding="utf-8")
        elif out.suffix == ".png":
            from harvey.commands.plan_picture import draw_plan

            draw_plan(world, out)
        elif out.suffix == ".rrd":
            from logs.recording.loggers.surroundings.model_building import record_building

            record_building(world, out)
        else:
            raise BadInput(f"--out: expected a name that ends in .svg, .png or .rrd, got {str(out)!r}")
    except RecordingError as error:
        raise BadInput(f"--out {out}: {error}") from None
    except OSError as error:
        raise BadInput(f"--out {out}: expected a file to write to, got: {error.strerror}") from None


VERBS = (
    CliCommand(
        "new", "write a first world file to change",
        (("harvey world new second-floor", "second-floor.toml: an office, a library and a corridor, with comments"),
         ("harvey world new second-floor --rooms office,kitchen,lab", "with these rooms along the corridor"),
         ("harvey world check second-floor.toml", "what it made has no faults, and missions run in it")),
        _new_arguments, lambda args: _new(args.name, args.rooms),
        "A file that exists is never overwritten. At the end of the file is a mission to copy.\n"
        "With many rooms some views look alike: harvey run MISSION --check says where to hang something else.",
    ),
    CliCommand(
        "edit", "check a world file and draw its plan at each save",
        (("harvey world edit second-floor.toml --live", "second-floor-plan.html follows in a browser, until Ctrl-C"),
         ("harvey world edit second-floor.toml --live --viewer", "and the building in the rerun viewer"),
         ("harvey world edit second-floor.toml", "once: checked, and drawn as a page")),
        _edit_arguments, _edit,
        "Faults are printed with file and line. While the file cannot be read the page keeps the last plan that\n"
        "could be drawn. Files that it includes are watched too. Exit code 0 where it has no faults at last, else 2.",
    ),
    CliCommand(
        "check", "check a world for faults",
        (("harvey world check my_floor.toml", "faults with file and line; exit code 2 where there are any"),
         ("harvey world check research_center", "one that comes with the project"),
         ("harvey world check floor.toml --details clutter.toml", "with what only the building has")),
        add_file_arguments, lambda args: print_check(load_file(args.file, args.details), args.file),
        "Exit code 0 where there are none, 2 where there are any.",
    ),
    CliCommand(
        "show", "show what is in a world, and draw its plan",
        (("harvey world show research_center", "rooms, doorways and what is in them"),
         ("harvey world show campus --out plan.png", "and the plan, storey beside storey (or .svg)"),
         ("harvey world show campus --out campus.rrd", "and the building for the viewer: rerun campus.rrd")),
        _show_arguments, lambda args: _show(load_file(args.file, args.details), args.out),
    ),
    CliCommand(
        "compile", "compile a world into one file that is read room by room",
        (("harvey world compile campus.toml --out campus.world", "for worlds that are too large to read at once"),
         ("harvey run mission.toml", "a mission names it as any world: world = \"campus.world\"")),
        _compile_arguments, lambda args: _compile(args.file, args.details, args.out),
    ),
)
WORLD = CliCommand(
    "world", "begin, edit, check, show, compile, import or export a world file",
    tuple(verb.examples[0] for verb in VERBS), _arguments, _run,
    "harvey world VERB --help tells more of each and gives examples.",
)
