"""``harvey world import`` and ``harvey world export``."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path

from harvey.commands.command import CliCommand, whole
from harvey.commands.world_command import add_file_arguments, load_file, print_check, with_bar
from harvey.errors import BadInput

MIN_WALL_M, MAX_WALL_M = 1.0, 20.0


def _import_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("file", metavar="FILE", help="a building (.ifc, .gml, .geojson) or a ROS map (map.yaml)")
    parser.add_argument("--out", metavar="FILE", help="the .toml file (named as the building, here)")
    parser.add_argument("--wall-height", metavar="METRES", type=float,
                        help="of a ROS map: the height of its walls (2.5)")


def _export_arguments(parser: ArgumentParser) -> None:
    add_file_arguments(parser)
    parser.add_argument("--to", metavar="OUT", required=True,
                        help="the file to write: .yaml (a ROS map, with its .pgm), .svg, .geojson, .glb or .gltf")
    parser.add_argument("--format", metavar="FORMAT",
                        help="rosmap, svg, geojson or gltf, where the ending does not say")
    parser.add_argument("--storey", metavar="N", type=whole, help="of a ROS map: which storey, from 1 for the lowest")
    parser.add_argument("--resolution", metavar="METRES", type=float, help="of a ROS map: side of a cell (0.05)")
    parser.add_argument("--empty", action="store_true", help="of a ROS map: without what stands in the rooms")


def _import(file: str, out: str | None, wall_height_m: float | None) -> int:
    from harvey_buildings import import_building
    from harvey_buildings.fitting.building_plan import NoWayError

    path = Path(file)
    target = Path(out or path.with_suffix(".toml").name)
    if target.suffix != ".toml":
        raise BadInput(f"--out: expected a name that ends in .toml, got {str(target)!r}")
    if wall_height_m is not None and not MIN_WALL_M <= wall_height_m <= MAX_WALL_M:
        raise BadInput(f"--wall-height: expected {MIN_WALL_M:g} to {MAX_WALL_M:g} metres, got {wall_height_m:g}")
    try:
        made = import_building(path, wall_height_m, with_bar)
    except NoWayError as error:
        print(f"{error}; no file is written", file=sys.stderr)
        return 1
    target.write_text(made.text, encoding="utf-8")
    print(f"{made.report}\n")
    code = print_check(load_file(str(target), []), str(target))
    rooms = made.layout.rooms
    if not code and len(rooms) > 1 and len(made.layout.shut_off) == len(rooms) - 1:
        print(f"{target}: none of its {len(rooms)} rooms has a way to another, so no mission can be driven between "
              "them", file=sys.stderr)
        return 1
    return code


def _export(args: Namespace) -> int:
    from harvey_buildings.exporters import ExportError, export_world, list_formats

    out = Path(args.to)
    if args.format is not None and args.format not in list_formats():
        raise BadInput(f"--format: expected one of {', '.join(list_formats())}, got {args.format!r}")
    try:
        told = export_world(load_file(args.file, args.details), out, args.format, storey=args.storey,
                            resolution_m=args.resolution, with_things=not args.empty)
    except ExportError as error:
        raise BadInput(f"--to {out}: {error}") from None
    except OSError as error:
        raise BadInput(f"--to {out}: expected a file to write to, got: {error.strerror}") from None
    print(f"{out}: {told}")
    return 0


IMPORT = CliCommand(
    "import", "import a building from IFC, IndoorGML, GeoJSON or a ROS map",
    (("harvey world import house.ifc --out house.toml", "what was used of a building, guessed and left out"),
     ("harvey world import campus.gml --out campus.toml", "IndoorGML 1.0, 1.1 and the core of 2.0"),
     ("harvey world import campus.geojson --out campus.toml", "what export writes, or unit.geojson of IMDF"),
     ("harvey world import map.yaml --out floor.toml --wall-height 2.7", "rooms and doors traced from a ROS map")),
    _import_arguments, lambda args: _import(args.file, args.out, args.wall_height),
    "Then checks it, as harvey world check does. Exit code 0: it has no faults. 1: none of its rooms, two or more,\n"
    "has a way to another: no doorway, opening, stairs or lift; the file is written. Or it is a ROS map most of whose\n"
    "rooms have no doorway; no file is written. 2: it cannot be read, or has faults.",
)
EXPORT = CliCommand(
    "export", "write a world for other programs: a ROS map, SVG, GeoJSON or glTF",
    (("harvey world export research_center --to map.yaml --resolution 0.05", "a ROS map: map.yaml and map.pgm"),
     ("harvey world export campus --to upstairs.yaml --storey 2 --empty", "the second storey, without furniture"),
     ("harvey world export campus --to campus.svg", "the plan, storey beside storey"),
     ("harvey world export campus --to campus.geojson", "rooms, doorways, things and links, in metres"),
     ("harvey world export campus --to campus.glb", "for Blender, or a viewer in a browser")),
    _export_arguments, _export,
    "Coordinates are metres in the building's frame, x to the east and y to the north; in glTF y is up.\n"
    "An OUT that exists is written again.",
)
