"""The report of several missions, of a campaign or of runs that are named one by one: a table, distributions and links
to the runs' own reports in one HTML file."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import quote

from harvey.campaign.engine import RESULTS
from harvey.campaign.show import find_campaign, rate_interval, read_progress
from harvey.errors import BadInput
from harvey.report.drawing import Field, count_outcomes, draw_distributions, read_fields
from harvey.report.page import fill_in, read_part
from harvey.runner.result import UNFINISHED
from logs.explain.story import run_name
from logs.run_directory import RunDirectory, find_directory, open_run

GIVEN_UP = "given up"
"""The outcome of a case whose workers were killed again and again."""


@dataclass(frozen=True, slots=True)
class MissionSummary:
    """One mission, or one case of an experiment.

    Attributes:
        name: ``hallway-kidnap, seed 3``, or ``case 3``.
        run: its run directory, where that was kept.
        result: what came of it, as JSON types.
    """

    name: str
    run: RunDirectory | None
    result: Mapping[str, Any]


def find_runs(text: str) -> Path | Sequence[RunDirectory]:
    """What a user names: the folder of a campaign, or the runs that it stands for, often one.

    Raises:
        BadInput: it is neither, or a run that lacks its journal.
    """
    if not (Path(text) / "journal.jsonl").is_file():
        try:
            return find_campaign(text)
        except BadInput:
            pass
    path = find_directory(text)
    inner = [] if (path / "journal.jsonl").is_file() else sorted(path.glob("*/journal.jsonl"))
    return [RunDirectory(journal.parent) for journal in inner] or [open_run(text)]


def read_missions(found: Sequence[Path | Sequence[RunDirectory]]) -> list[MissionSummary]:
    """Each mission once. Raises BadInput where a result cannot be read, or where there is none."""
    missions: dict[Path | tuple[Path, str], MissionSummary] = {}
    for one in found:
        for mission in _of_campaign(one) if isinstance(one, Path) else map(_of_run, one):
            key = mission.run.path.resolve() if mission.run is not None else (Path(str(one)).resolve(), mission.name)
            missions.setdefault(key, mission)
    if not missions:
        where = ", ".join(str(one / RESULTS) for one in found if isinstance(one, Path))
        raise BadInput(f"{where}: expected at least one mission that has ended, got none")
    return list(missions.values())


def _of_campaign(folder: Path) -> Iterator[MissionSummary]:
    progress = read_progress(folder)
    cases = progress.results | {case: {"outcome": GIVEN_UP} for case in progress.given_up}
    for case in sorted(cases):
        result, run = cases[case], RunDirectory(folder / str(case))
        scenario, seed = result.get("scenario"), result.get("seed")
        name = f"{scenario}, seed {seed}" if isinstance(scenario, str) and seed is not None else f"case {case}"
        yield MissionSummary(name, run if run.journal.is_file() else None, result)


def _of_run(run: RunDirectory) -> MissionSummary:
    return MissionSummary(run_name(run), run, {"outcome": UNFINISHED, **run.read_result()})


OWN = "{}-runs"
"""The folder next to a page of that name in which the runs' own reports are."""
HEAD_BYTES = 4096
"""The title of a report stands within so many."""


def build_page_of_several(missions: Sequence[MissionSummary], title: str, out: Path) -> str:
    """The whole file; ``out``: where it will be, as the links to the runs' own reports lead from there."""
    columns, same = read_fields([mission.result for mission in missions])
    links = [find_report(mission, out) for mission in missions]
    parts = {
        "title": escape(title), "style": read_part("page.css"), "script": read_part("several.js"),
        "opening": _opening(len(missions), sum(link is not None for link in links)),
        "outcomes": "\n".join(_outcomes(columns, len(missions))),
        "same": "".join(f"<p>{escape(label)}, of all: {escape(text)}</p>\n" for label, text in same.items()),
        "plots": "\n".join(f"<figure>{svg}<figcaption>{escape(words)}</figcaption></figure>"
                           for svg, words in draw_distributions(columns)) or "<p>No number of them differs.</p>",
        "filters": "\n".join(_filters(columns)),
        "heads": "".join(f'<th scope="col"><button type="button">{escape(label)}</button></th>'
                         for label in ("mission", *(column.label for column in columns))),
        "rows": "\n".join(f"<tr>{_name(mission, link)}{''.join(_cells(columns, number))}</tr>"
                          for number, (mission, link) in enumerate(zip(missions, links, strict=True))),
    }
    return fill_in(read_part("several.html"), parts)


def report_path(mission: MissionSummary, out: Path) -> Path:
    """Where the own report of a mission belongs, next to the page: the same for the same name."""
    name = quote(mission.name.replace(", ", "-").replace(" ", "-"), safe="")
    return out.parent / OWN.format(out.stem) / f"{name}.html"


def find_report(mission: MissionSummary, out: Path) -> str | None:
    """The link to a run's own report, next to the page or as ``harvey report`` names it; None without one."""
    places = [report_path(mission, out)]
    if mission.run is not None:
        places.append(out.parent / f"{mission.run.path.resolve().name}.html")
    for place in places:
        if place != out and _is_report_of(mission, place):
            return quote(place.relative_to(out.parent).as_posix())
    return None


def _is_report_of(mission: MissionSummary, place: Path) -> bool:
    try:
        with place.open("rb") as file:
            return f"<title>{escape(mission.name)}</title>".encode() in file.read(HEAD_BYTES)
    except OSError:
        return False


def _opening(missions: int, linked: int) -> str:
    more = " A mission's name leads to its own report." if linked == missions else (
        f" {linked} of them have a report of their own, to which their names lead." if linked else "")
    return f"<p>{missions} missions.{more}</p>"


def _outcomes(columns: Sequence[Field], missions: int) -> Iterator[str]:
    for outcome, number in count_outcomes(columns):
        low, high = (100.0 * bound for bound in rate_interval(number, missions))
        yield (f'<tr><th scope="row">{escape(outcome)}</th><td>{number}</td><td>{100.0 * number / missions:.1f}</td>'
               f"<td>{low:.1f} to {high:.1f}</td></tr>")


def _filters(columns: Sequence[Field]) -> Iterator[str]:
    """A choice for each column of few texts."""
    for number, column in enumerate(columns, start=1):
        if column.kinds:
            options = "".join(f'<option value="{escape(kind)}">{escape(kind)} ({often})</option>'
                              for kind, often in column.kinds.items())
            yield (f'<label>{escape(column.label)} <select data-column="{number}"><option value="">all</option>'
                   f"{options}</select></label>")


def _name(mission: MissionSummary, link: str | None) -> str:
    name = escape(mission.name)
    return f'<th scope="row">{name if link is None else f"""<a href="{escape(link)}">{name}</a>"""}</th>'


def _cells(columns: Sequence[Field], number: int) -> Iterator[str]:
    for column in columns:
        value = column.values[number]
        if not column.is_number:
            yield f"<td>{escape(column.cell(number))}</td>"
        elif isinstance(value, float):
            exact = value if math.isfinite(value) else f"{'-' * (value < 0.0)}Infinity"
            yield f'<td data-value="{exact}" class="number">{column.cell(number)}</td>'
        else:
            yield '<td data-value=""></td>'
