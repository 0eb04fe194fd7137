"""``harvey report`` and ``export``: a run, or several missions, as one page of HTML; a run as tables."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from harvey.commands.command import CliCommand
from harvey.errors import BadInput
from logs.run_directory import RunDirectory, open_run
from logs.run_errors import reading
from world_models.words import count

if TYPE_CHECKING:
    from harvey.report.several import MissionSummary

PLOTS = (".png", ".pdf", ".svg")

def _add_report_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", metavar="RUN", nargs="+",
                        help="a run directory, several of them, or the folder of a campaign")
    parser.add_argument("--out", metavar="FILE.html", help="the file (named as the first directory, here)")
    parser.add_argument("--each", action="store_true",
                        help="of several missions: also the report of each run that was kept, in a folder beside the"
                             " file; the table's names lead to them")
    parser.add_argument("--plot", metavar="FILE", help="no page, but the ways of the runs on the plan, believed and"
                        " true: .png, .pdf or .svg")


def _run_report(args: Namespace) -> int:
    from harvey.report.several import find_runs, read_missions

    if args.plot is not None:
        return _plot(args.run, Path(args.plot))
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
        write_page(out, build_run_page(RunDirectory(first)))
    else:
        missions = read_missions(found)
        if args.each:
            _write_each(missions, out)
        from harvey.report.several import build_page_of_several

        write_page(out, build_page_of_several(missions, _title(args.run, missions), out))
    print(f"{out}: {out.stat().st_size / 1e6:.1f} MB; opens in any browser, without network")
    return 0


def _plot(runs: Sequence[str], out: Path) -> int:
    from harvey.commands.plan_picture import draw_ways

    if out.suffix not in PLOTS:
        raise BadInput(f"--plot: expected a name that ends in {', '.join(PLOTS)}, got {str(out)!r}")
    draw_ways({Path(text).name: open_run(text) for text in runs}, out)
    print(f"{out}: the ways of {count(len(set(runs)), 'run')}")
    return 0


def build_run_page(run: RunDirectory) -> str:
    """The report of a run as HTML."""
    from harvey.report.page import build_page
    from logs.timeline import Timeline

    with reading(run.journal):
        return build_page(run, Timeline(run.journal))


def _title(named: Sequence[str], missions: Sequence[MissionSummary]) -> str:
    return Path(named[0]).resolve().name if len(named) == 1 else f"{len(missions)} missions"


def _write_each(missions: Sequence[MissionSummary], out: Path) -> None:
    """The report of each run that was kept; one that cannot be read is named, and left out."""
    from tqdm import tqdm

    from harvey.report.several import report_path

    kept = [(mission, mission.run) for mission in missions if mission.run is not None]
    for mission, run in tqdm(kept, unit=" reports", file=sys.stderr, disable=not sys.stderr.isatty(), leave=False):
        place = report_path(mission, out)
        try:
            page = build_run_page(run)
        except BadInput as error:
            print(f"{mission.name}: no report: {error}", file=sys.stderr)
            continue
        write_page(place, page, make_folder=True)


def write_page(out: Path, page: str, *, make_folder: bool = False) -> None:
    """Write a page. Raises BadInput where it cannot be written."""
    try:
        if make_folder:
            out.parent.mkdir(exist_ok=True)
        out.write_text(page, encoding="utf-8")
    except OSError as error:
        raise BadInput(f"--out {out}: expected a file to write to, got: {error.strerror}") from None


REPORT = CliCommand(
    "report", "a run as one HTML file: plan, pictures, decisions, reasons, errors, story; or a campaign",
    (
        ("harvey report runs/hallway-kidnap-0", "hallway-kidnap-0.html, to be opened, kept or sent by mail"),
        ("harvey report runs/hallway-kidnap-0 --out kidnap.html", "under another name"),
        ("harvey report runs/hallway-kidnap", "a campaign: its missions as a table, and their distributions"),
        ("harvey report runs/hallway-kidnap --each", "and the report of each run, to which the table leads"),
        ("harvey report runs/bump-0 runs/bump-1", "runs beside each other"),
        ("harvey report runs/bump-0 runs/bump-1 --plot ways.pdf", "their ways over each other on the plan"),
    ),
    _add_report_arguments, _run_report,
    "The file asks the network for nothing. It has the believed path and, of a simulated run, the true one; a slider\n"
    "over the cycles with the camera's picture and the lines expected and found in it; each decision, with what it\n"
    "rests on at a click; the errors against how sure the belief was; and the story.\n\n"
    "Of several runs, or of a campaign, it has a table of the missions, to be sorted and filtered by outcome; how\n"
    "often each outcome came, with bounds; and distributions of errors, times, probes (pictures taken to find out\n"
    "where it is) and others.",
)


def _add_export_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", metavar="RUN", help="a run directory")
    parser.add_argument("--csv", metavar="DIR", help="write the tables there as CSV; older ones are overwritten")
    parser.add_argument("--parquet", metavar="DIR", help="write them there as Parquet")
    parser.add_argument("--mcap", metavar="FILE", help="write it as one MCAP file of ROS 2 messages, for rerun,"
                        " Foxglove and others; needs harvey-ros2")
    parser.add_argument("--tum", metavar="FILE", help="write the believed poses in TUM's format, for evo; the true"
                        " ones of a simulated run beside it, as FILE-truth")


def _run_export(args: Namespace) -> int:
    wanted = {kind: Path(folder) for kind in ("csv", "parquet") if (folder := getattr(args, kind)) is not None}
    if not wanted and args.mcap is None and args.tum is None:
        raise BadInput("expected --csv DIR, --parquet DIR, --tum FILE or --mcap FILE, got none of them")
    from logs.export import find_run_exporter, read_tables, write_tables, write_ways
    from logs.timeline import Timeline

    run = open_run(args.run)
    exporter = None if args.mcap is None else find_run_exporter("mcap")
    history = Timeline(run.journal)
    history.expect_decisions()
    if exporter is not None:
        print(f"{args.mcap}: {count(exporter.write(run, Path(args.mcap)), 'message')}")
    with reading(run.journal):
        tables = list(read_tables(run, history)) if wanted or args.tum is not None else []
    for kind, folder in wanted.items():
        for path, table in zip(write_tables(tables, kind, folder), tables, strict=True):
            print(f"{path}: {count(len(table.rows), 'row')}")
    for path, poses in write_ways(tables, Path(args.tum)) if args.tum is not None else ():
        print(f"{path}: {count(poses, 'pose')}")
    return 0


EXPORT = CliCommand(
    "export", "a run as tables for other programs: decisions, poses, milestones, turning points",
    (
        ("harvey export runs/lab-to-allens-office-0 --csv tables", "decisions.csv, poses.csv, milestones.csv, ..."),
        ("harvey export runs/lab-to-allens-office-0 --parquet tables", "the same for pandas, polars, DuckDB, Arrow"),
        ("harvey export runs/lab-to-allens-office-0 --tum way.tum", "evo_ape tum way-truth.tum way.tum"),
        ("harvey export runs/lab-to-allens-office-0 --mcap run.mcap", "for rerun, Foxglove and tools that read bags"),
    ),
    _add_export_arguments, _run_export,
    "decisions: who acted in each cycle, woken by what; poses: each believed pose with its covariance, in its room's\n"
    "frame and in the world's; milestones: each verdict; turning_points; of a simulated run also truth: where the\n"
    "robot truly was, from the recording. Units stand at the end of each column's name: _m, _rad, _s; time_s is the\n"
    "body's clock.\n"
    "TUM: a pose a line, time x y z qx qy qz qw [s, m], in the world's frame, z 0; of one time only the last.\n"
    "The MCAP file has pictures, camera, odometry, transforms, believed poses, plan, landmarks and verdicts, by the\n"
    "run's time; a pose that no certificate vouches for has a covariance that says so.",
)
