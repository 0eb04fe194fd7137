"""``harvey report``: a run, or several missions, as one HTML file."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from harvey.commands.command import Command
from harvey.errors import BadInput
from logs.run_directory import RunDirectory

if TYPE_CHECKING:
    from harvey.report.several import Mission


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", metavar="RUN", nargs="+",
                        help="a run directory, several of them, or the folder of a campaign")
    parser.add_argument("--out", metavar="FILE.html", help="the file (named as the first directory, here)")
    parser.add_argument("--each", action="store_true",
                        help="of several missions: also the report of each run that was kept, in a folder beside the"
                             " file; the table's names lead to them")


def _run(args: Namespace) -> int:
    from harvey.report.several import find_runs, read_missions

    found = [find_runs(text) for text in dict.fromkeys(args.run)]
    first = found[0] if isinstance(found[0], Path) else found[0][0].path
    is_one = len(found) == 1 and not isinstance(found[0], Path) and len(found[0]) == 1
    if not is_one and not isinstance(found[0], Path) and len(found[0]) > 1:
        first = first.parent
    out = Path(args.out or f"{first.resolve().name}.html")
    if out.suffix not in (".html", ".htm"):
        raise BadInput(f"--out: expected a name that ends in .html, got {str(out)!r}")
    if is_one:
        if args.each:
            raise BadInput("--each: expected several runs or a campaign, got one run")
        _write(out, _page_of(RunDirectory(first)))
    else:
        missions = read_missions(found)
        if args.each:
            _write_each(missions, out)
        from harvey.report.several import build_page_of_several

        _write(out, build_page_of_several(missions, _title(args.run, missions), out))
    print(f"{out}: {out.stat().st_size / 1e6:.1f} MB; opens in any browser, without network")
    return 0


def _page_of(run: RunDirectory) -> str:
    from harvey.report.page import build_page
    from logs.timeline import Timeline

    return build_page(run, Timeline(run.journal))


def _title(named: Sequence[str], missions: Sequence[Mission]) -> str:
    return Path(named[0]).resolve().name if len(named) == 1 else f"{len(missions)} missions"


def _write_each(missions: Sequence[Mission], out: Path) -> None:
    """The report of each run that was kept; one that cannot be read is named, and left out."""
    from tqdm import tqdm

    from harvey.report.several import report_path

    kept = [(mission, mission.run) for mission in missions if mission.run is not None]
    for mission, run in tqdm(kept, unit=" reports", file=sys.stderr, disable=not sys.stderr.isatty(), leave=False):
        place = report_path(mission, out)
        try:
            page = _page_of(run)
        except BadInput as error:
            print(f"{mission.name}: no report: {error}", file=sys.stderr)
            continue
        _write(place, page, make_folder=True)


def _write(out: Path, page: str, *, make_folder: bool = False) -> None:
    try:
        if make_folder:
            out.parent.mkdir(exist_ok=True)
        out.write_text(page, encoding="utf-8")
    except OSError as error:
        raise BadInput(f"--out {out}: expected a file to write to, got: {error.strerror}") from None


COMMAND = Command(
    "report", "a run as one HTML file: plan, pictures, decisions, reasons, errors, story; or a campaign",
    (
        ("harvey report runs/hallway-kidnap-0", "hallway-kidnap-0.html, to be opened, kept or sent by mail"),
        ("harvey report runs/hallway-kidnap-0 --out kidnap.html", "under another name"),
        ("harvey report runs/hallway-kidnap", "a campaign: its missions as a table, and their distributions"),
        ("harvey report runs/hallway-kidnap --each", "and the report of each run, to which the table leads"),
        ("harvey report runs/bump-0 runs/bump-1", "runs beside each other"),
    ),
    _arguments, _run,
    "The file asks the network for nothing. It has the believed path and, of a simulated run, the true one; a slider\n"
    "over the cycles with the camera's picture and the lines expected and found in it; each decision, with what it\n"
    "rests on at a click; the errors against how sure the belief was; and the story.\n\n"
    "Of several runs, or of a campaign, it has a table of the missions, to be sorted and filtered by outcome; how\n"
    "often each outcome came, with bounds; and distributions of errors, times, probes (pictures taken to find out\n"
    "where it is) and others.",
)
