"""``harvey world``: look at a world file."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from harvey.commands.command import Command
from harvey.errors import BadInput
from harvey.units import count

if TYPE_CHECKING:
    from world_models.world import World


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("what", choices=("check", "show", "import"),
                        help="check for faults; show what is in it; import from another format (not yet)")
    parser.add_argument("file", metavar="FILE", help="a world file, or the name of one that comes with the project")
    parser.add_argument("--details", metavar="FILE", action="append", default=[], help="add what only the building has")
    parser.add_argument("--out", metavar="FILE", help="show: draw the plan there, as SVG")


def _run(args: Namespace) -> int:
    if args.what == "import":
        print("harvey world import: not yet available; it will read plans of other formats", file=sys.stderr)
        return 2
    world = _load(args.file, args.details)
    return _check(world, args.file) if args.what == "check" else _show(world, args.out)


def _load(file: str, details: list[str]) -> World:
    from world_models.store import WORLDS, load_world

    shipped = WORLDS / f"{file}.toml"
    if not file.endswith(".toml") and not shipped.is_file():
        names = ", ".join(sorted(p.stem for p in WORLDS.glob("*.toml")))
        raise BadInput(f"expected a .toml file or one of {names}, got {file!r}")
    return load_world(Path(file) if file.endswith(".toml") else shipped, details=details)


def _check(world: World, file: str) -> int:
    faults = world.check()
    for fault in faults:
        print(fault)
    if faults:
        print(f"{file}: {count(len(faults), 'fault')}", file=sys.stderr)
        return 2
    print(f"{file}: no faults in {_inventory(world)}")
    return 0


def _inventory(world: World) -> str:
    return (f"{count(len(world.rooms), 'room')}, {count(len(world.doorways), 'open doorway')},"
            f" {count(len(world.things), 'thing')}, {count(len(world.faces), 'face')},"
            f" {count(len(world.landmarks), 'landmark')}")


def _show(world: World, out: str | None) -> int:
    print(f"{world.name}: {_inventory(world)}")
    for name in world.locales:
        doors = ", ".join(d.name for d in world.doorways_of(name)) if name in world.rooms else ""
        things = count(sum(1 for t in world.things if t.locale == name), "thing")
        inside = f"{things}, doorways: {doors or 'none'}" if name in world.rooms else ""
        print(f"{'  ' * len(world.path_of(name))}{name}{': ' + inside if inside else ''}")
    if out is not None:
        _draw(world, Path(out))
        print(f"plan drawn in {out}")
    return 0


def _draw(world: World, out: Path) -> None:
    from world_models.plan_view import plan_svg

    try:
        out.write_text(plan_svg(world), encoding="utf-8")
    except OSError as error:
        raise BadInput(f"--out {out}: expected a file to write to, got: {error.strerror}") from None


COMMAND = Command(
    "world", "check or show a world file",
    (
        ("harvey world check my_floor.toml", "faults with file and line; exit code 2 where there are any"),
        ("harvey world show research_center", "rooms, doorways and what is in them"),
        ("harvey world show research_center --out plan.svg", "and the plan as a drawing"),
    ),
    _arguments, _run,
)
