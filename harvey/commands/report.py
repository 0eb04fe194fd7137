"""``harvey report``: a run as one HTML file."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

from harvey.commands.command import Command
from harvey.errors import BadInput
from harvey.run_files.run_directory import open_run


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", metavar="RUN", help="a run directory")
    parser.add_argument("--out", metavar="FILE.html", help="the file (named as the run's directory, here)")


def _run(args: Namespace) -> int:
    run = open_run(args.run)
    out = Path(args.out or f"{run.path.resolve().name}.html")
    if out.suffix not in (".html", ".htm"):
        raise BadInput(f"--out: expected a name that ends in .html, got {str(out)!r}")
    from harvey.report.page import build_page
    from harvey.why.journal import JournalHistory

    page = build_page(run, JournalHistory(run.journal))
    try:
        out.write_text(page, encoding="utf-8")
    except OSError as error:
        raise BadInput(f"--out {out}: expected a file to write to, got: {error.strerror}") from None
    print(f"{out}: {out.stat().st_size / 1e6:.1f} MB; opens in any browser, without network")
    return 0


COMMAND = Command(
    "report", "a run as one HTML file: plan, pictures, decisions, reasons, errors, story",
    (
        ("harvey report runs/hallway-kidnap-0", "hallway-kidnap-0.html, to be opened, kept or sent by mail"),
        ("harvey report runs/hallway-kidnap-0 --out kidnap.html", "under another name"),
    ),
    _arguments, _run,
    "The file asks the network for nothing. It has the believed path and, of a simulated run, the true one; a slider\n"
    "over the cycles with the camera's picture and the lines expected and found in it; each decision, with what it\n"
    "rests on at a click; the errors against how sure the belief was; and the story.",
)
