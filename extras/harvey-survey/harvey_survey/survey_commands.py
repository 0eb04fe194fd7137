"""``harvey world ledger`` and ``harvey survey``: what runs say of a building, and a better model by them."""

from __future__ import annotations

import re
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from harvey.commands.command import CliCommand
from harvey.commands.world_command import find_file, load_file
from harvey.errors import BadInput

if TYPE_CHECKING:
    from harvey_survey.patch_file import Patch, Proposal


def _ledger_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("file", metavar="WORLD", help="the world file in which the robot believed, or the name of one"
                                                      " that comes with the project")
    parser.add_argument("runs", metavar="RUN", nargs="+", help="run directories")
    parser.add_argument("--plan", metavar="OUT", help="draw it on the plan there: .png, .svg or .pdf")
    parser.add_argument("--json", metavar="OUT", help="write all of it there, line by line, as JSON (-: print it)")


def _run_ledger(args: Namespace) -> int:
    from harvey_survey.ledger import format_ledger, ledger_json, read_ledger, write_plan
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
        write_file(Path(args.json), "--json", ledger_json(ledger).encode())
    print(format_ledger(ledger), end="")
    return 0


def write_file(out: Path, option: str, data: bytes) -> None:
    """Write a file. Raises BadInput."""
    try:
        out.write_bytes(data)
    except OSError as error:
        raise BadInput(f"{option} {out}: expected a file to write to, got: {error.strerror}") from None


def _numbers(text: str) -> tuple[int, ...] | str:
    if text in ("all", "none"):
        return text
    if re.fullmatch(r"\d{1,6}(,\d{1,6})*", text, re.ASCII) is None:
        raise ArgumentTypeError(f"expected numbers of changes as 1,4,9, or all, or none, got {text!r}")
    return tuple(map(int, text.split(",")))


def _survey_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("runs", metavar="RUN", nargs="*", help="run directories; none: take the changes of --patch")
    parser.add_argument("--world", metavar="FILE", required=True,
                        help="the world file (.toml) in which the robot believed; it is never changed")
    parser.add_argument("--out", metavar="FILE", required=True, help="the world file to write (.toml)")
    parser.add_argument("--patch", metavar="FILE", help="the changes, one a table (OUT, ending in -patch.toml)")
    parser.add_argument("--accept", metavar="N,..", type=_numbers, help="only these changes are made, or all, or none")
    parser.add_argument("--undo", metavar="N,..", type=_numbers, help="these changes are not made, or all")
    parser.add_argument("--sigma-cm", metavar="CM", type=float, default=5.0,
                        help="how well what the world file states nothing of is known: standard deviation (5)")


def _run_survey(args: Namespace) -> int:
    from harvey_survey.patch_file import format_patch, read_patch, write_world

    path, out = find_file(args.world), Path(args.out)
    for option, file in (("--world", path), ("--out", out)):
        if file.suffix != ".toml":
            raise BadInput(f"{option}: expected a name that ends in .toml, got {str(file)!r}")
    if out.exists() and path.exists() and out.resolve() == path.resolve():
        raise BadInput(f"--out: expected another file than the world file {path}, which is kept, got the same")
    if not 0.1 <= args.sigma_cm <= 100.0:
        raise BadInput(f"--sigma-cm: expected 0.1 to 100 centimetres, got {args.sigma_cm:g}")
    target = Path(args.patch) if args.patch else out.with_name(f"{out.stem}-patch.toml")
    patch = _survey(args, path) if args.runs else read_patch(target)
    every = [one.number for one in patch.proposals]
    if args.accept is not None:
        chosen = {"all": every, "none": []}.get(args.accept, args.accept)
        patch = patch.accepting(chosen, is_accepted=True, others=False)
    if args.undo is not None:
        patch = patch.accepting({"all": every, "none": []}.get(args.undo, args.undo), is_accepted=False)
    write_file(out, "--out", write_world(path, patch))
    write_file(target, "--patch", format_patch(patch).encode())
    for one in patch.proposals:
        print(tell_proposal(one))
    made = sum(one.is_accepted and not one.why_not for one in patch.proposals)
    print(f"{out}: {made} of {len(patch.proposals)} changes of {path}; each of them stands in {target}")
    return 0


def _survey(args: Namespace, path: Path) -> Patch:
    """The patch by the runs; prints by what it was made."""
    from harvey_survey.adjustment import adjust, propose_changes
    from harvey_survey.patch_file import build_patch
    from harvey_survey.seen_pictures import read_looks
    from logs.run_directory import open_run

    world = load_file(str(path), [])
    looks = read_looks(world, path, [open_run(run) for run in args.runs])
    if not looks:
        raise BadInput(f"expected runs in which a place was verified, got none in {', '.join(args.runs)}")
    found = adjust(world, looks, 0.01 * args.sigma_cm)
    runs = len({look.run for look in looks})
    print(f"{found.looks} pictures of verified places in {runs} runs: {found.used} of {found.of} segments agree, to"
          f" {found.noise:.2f} of their standard deviation")
    return build_patch(path, propose_changes(world, looks, found), runs, len(looks))


def tell_proposal(one: Proposal) -> str:
    """``3  corridor wall 2   into -4.1 +-0.6 cm   99.9%   found elsewhere in 9 pictures, by 95 segments``."""
    change = one.change
    moved = ", ".join(f"{axis} {by_cm:+.1f} +-{change.sigmas[axis]:.1f} cm" for axis, by_cm in change.moved.items())
    said = f"not made: {one.why_not}" if one.why_not else "" if one.is_accepted else "not accepted"
    return (f"{one.number:4d}  {change.name:32}  {moved or 'is gone':32}  {change.certainty:8.3%}  {change.evidence}"
            f"{'; ' * bool(said)}{said}")


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
SURVEY = CliCommand(
    "survey", "find by runs what of a building stands elsewhere or is gone, and write a better world file",
    (("harvey survey runs/* --world floor.toml --out better.toml", "better.toml, and its changes as a patch"),
     ("harvey survey --world floor.toml --out better.toml --accept 1,4,9", "the same, but only these"),
     ("harvey survey --world floor.toml --out better.toml --undo 4", "without this one"),
     ("harvey survey --world floor.toml --out better.toml --undo all", "byte for byte as floor.toml is")),
    _survey_arguments, _run_survey,
    "All pictures of verified places are adjusted together: poses, cameras, and how far walls, doors and things are\n"
    "from where the file has them, each with its standard deviation; the file's own (sigma_cm) holds the whole in its\n"
    "place. A thing that is often expected and not found is gone. Only what is certain to 99 % is proposed. FILE is\n"
    "never changed: OUT is written from it and the changes that are accepted; comments and order stay. A change that\n"
    "the text has no number for (it stands in another file, is given by like or by a step, or is a wall of an\n"
    "outline) is named, and left to you.",
)
