"""How far a campaign is, read from its files while it runs or afterwards; and is one better than another?

Two campaigns are compared by the same cases of both, in pairs. Where both went alike, a pair says nothing of the
difference. Of the others, were the two campaigns alike, half would support each: McNemar's exact test (McNemar 1947,
Psychometrika 12; the binomial test on the discordant pairs). The difference of the rates is the rate of the pairs that
support the second less that of those that support the first; each has its exact interval (Clopper and Pearson 1934,
Biometrika 26) at half the risk, so that both hold together (Bonferroni). That is a little wide, and no pair that went
otherwise is no proof that there is no difference.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import timedelta
from itertools import accumulate
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from scipy.special import bdtr, betaincinv

from harvey.campaign.engine import CAMPAIGN, KILLED, RESULT, RESULTS, is_number, read_results, read_times
from harvey.errors import BadInput
from logs.run_directory import RUNS, read_json
from logs.tables import table
from world_models.words import count

PICTURE = "progress.png"
RATE_OF = 50
"""The rate is that of so many of the newest cases."""
PAUSE_S = 600.0
"""After so long without a result the campaign is taken to have been stopped in between."""
MOST_KINDS = 12
"""A field of a result with more values than this is no table row."""
SIZE_IN, DOTS = (7.0, 4.0), 130


@dataclass(frozen=True, slots=True)
class CampaignProgress:
    """What the files of a campaign tell.

    Attributes:
        folder: where they are.
        about: as the engine described it.
        results: by case; given_up: kills by case.
        times: what was measured, in the order in which the cases were done.
    """

    folder: Path
    about: dict[str, Any]
    results: dict[int, dict[str, Any]]
    given_up: dict[int, int]
    times: list[dict[str, Any]]

    @property
    def total(self) -> int:
        return max(int(self.about.get("total", 0)), len(self.results))

    @property
    def done_at_s(self) -> list[float]:
        """When each case was done [s since the first], without pauses between the engine's runs."""
        at: list[float] = []
        for before, now in zip([None, *self.times], self.times, strict=False):
            step = 0.0 if before is None else max(0.0, now["at"] - before["at"])
            at.append((at[-1] if at else 0.0) + (step if step < PAUSE_S else 0.0))
        return at

    @property
    def rate_per_s(self) -> float:
        """Of the newest cases; NaN where there are too few."""
        at = self.done_at_s[-RATE_OF - 1:]
        return (len(at) - 1) / (at[-1] - at[0]) if len(at) > 1 and at[-1] > at[0] else math.nan

    @property
    def remaining_s(self) -> float:
        """At this rate; NaN where it is not known."""
        left = self.total - len(self.results) - len(self.given_up)
        return left / self.rate_per_s if left else 0.0


def find_campaign(text: str) -> Path:
    """The folder of a campaign: as it is, or under ``runs/`` or ``runs/experiments/``. Raises BadInput."""
    for path in (Path(text), RUNS / text, RUNS / "experiments" / text):
        if (path / RESULTS).is_file():
            return path
    raise BadInput(f"expected the directory of a campaign, with a {RESULTS}, got {text!r} (harvey run --seed 0..19 and"
                   " harvey experiment make them under runs/)")


def read_progress(folder: Path) -> CampaignProgress:
    """Read it; a campaign may be under way. Raises BadInput."""
    about = read_json(folder / CAMPAIGN) if (folder / CAMPAIGN).exists() else {}
    _, records = read_results(folder / RESULTS)
    about = about if isinstance(about, dict) else {}
    if not (is_number(total := about.get("total", 0)) and isinstance(about.get("unit", ""), str)):
        raise BadInput(f"{folder / CAMPAIGN}: expected a number as total and a text as unit, got {total!r} and "
                       f"{about.get('unit')!r}")
    return CampaignProgress(
        folder, about,
        {case: record[RESULT] for case, record in records.items() if RESULT in record},
        {case: record[KILLED] for case, record in records.items() if RESULT not in record and KILLED in record},
        [record for record in read_times(folder) if is_number(record.get("at")) and is_number(record.get("took_s", 0))])


def format_progress(progress: CampaignProgress) -> str:
    """For a terminal."""
    p, unit = progress, str(progress.about.get("unit", "case"))
    workers = sorted({str(record.get("worker")) for record in p.times})
    lines = [
        f"{p.about.get('name', p.folder)}: {len(p.results)} of {count(p.total, unit)} done"
        + (f", {len(p.given_up)} given up" if p.given_up else ""),
        f"  workers       {p.about.get('workers', 'not known')}; {len(workers)} have answered so far",
    ]
    if p.about.get("dashboard"):
        lines.append(f"  dashboard     {p.about['dashboard']}")
    if not math.isnan(p.rate_per_s):
        lines.append(f"  rate          {_rate(p.rate_per_s, unit)}, of the newest {min(RATE_OF, len(p.times) - 1)}")
    took = [float(record["took_s"]) for record in p.times if "took_s" in record]
    if took:
        lines.append(f"  a {unit} takes {math.fsum(took) / len(took):.1f} s on average, {max(took):.1f} s at most")
    if len(p.results) + len(p.given_up) < p.total:
        left = "not known yet" if math.isnan(p.remaining_s) else str(timedelta(seconds=round(p.remaining_s)))
        lines.append(f"  remaining     {left}")
    rows = _kinds(list(p.results.values()))
    if rows:
        lines += ["", table(("field", "value", "cases", "%"), rows)]
    lines += [f"case {case}: given up after {kills} kills" for case, kills in p.given_up.items()]
    return "\n".join(lines)


def _rate(per_s: float, unit: str) -> str:
    return f"{per_s:.1f} {unit}s a second" if per_s >= 1.0 else f"{per_s * 60.0:.1f} {unit}s a minute"


def _kinds(results: Sequence[dict[str, Any]]) -> list[tuple[str, str, str, str]]:
    """How often each value came, of the fields that are words or yes and no, and of few values."""
    rows = []
    for field in dict.fromkeys(key for result in results for key in result):
        values = [result[field] for result in results if field in result]
        if not all(isinstance(value, str | bool) for value in values):
            continue
        counted = Counter("yes" if v is True else "no" if v is False else v for v in values)
        if len(counted) <= MOST_KINDS and (len(counted) > 1 or field == "outcome"):
            rows += [(field, value, str(n), f"{100.0 * n / len(values):.1f}") for value, n in counted.most_common()]
    return rows


def draw_progress(progress: CampaignProgress) -> Path:
    """Draw how many cases were done when, by outcome where they have one; returns the picture (PNG)."""
    figure = Figure(figsize=SIZE_IN, dpi=DOTS, layout="constrained")
    axes = figure.add_subplot()
    minutes = [at / 60.0 for at in progress.done_at_s]
    outcomes = [str(progress.results.get(r["case"], {}).get("outcome", "done")) for r in progress.times]
    for outcome, _ in Counter(outcomes).most_common():
        mine = [outcome == other for other in outcomes]
        axes.step([0.0, *minutes], [0, *accumulate(mine)], where="post", label=f"{outcome}: {sum(mine)}")
    axes.axhline(progress.total, color="#777777", linewidth=0.8, linestyle="--", label=f"all: {progress.total}")
    axes.set_title(str(progress.about.get("name", progress.folder)), fontsize=11)
    axes.set_xlabel("minutes of work")
    axes.set_ylabel(f"{progress.about.get('unit', 'case')}s")
    axes.grid(alpha=0.3)
    axes.legend(frameon=False, fontsize=9)
    path = progress.folder / PICTURE
    path.unlink(missing_ok=True)  # it may be a link to somebody's file
    figure.savefig(path, format="png")
    return path


CONFIDENCE = 0.95
SHOWN = 10
"""Cases that went differently and are named."""

Results = Mapping[int, Mapping[str, Any]]


@dataclass(frozen=True, slots=True)
class Comparison:
    """Successes of the same cases in two campaigns.

    Attributes:
        both, neither: cases that succeeded in both, or in none.
        lost, gained: the cases that only the first, only the second did.
    """

    both: int
    neither: int
    lost: tuple[int, ...]
    gained: tuple[int, ...]

    @property
    def cases(self) -> int:
        return self.both + self.neither + self.discordant

    @property
    def discordant(self) -> int:
        """How many went differently."""
        return len(self.lost) + len(self.gained)

    @property
    def difference(self) -> float:
        """The second's rate of success less the first's."""
        return (len(self.gained) - len(self.lost)) / self.cases

    @property
    def p_value(self) -> float:
        """How often so much or more would come by chance, were both alike; two-sided."""
        return min(1.0, 2.0 * float(bdtr(min(len(self.gained), len(self.lost)), self.discordant, 0.5)))

    @property
    def interval(self) -> tuple[float, float]:
        """Of the difference; it holds at least as often as it says."""
        gained, lost = (rate_interval(len(alone), self.cases, (1.0 + CONFIDENCE) / 2.0)
                        for alone in (self.gained, self.lost))
        return gained[0] - lost[1], gained[1] - lost[0]

    @property
    def is_worse(self) -> bool:
        """Whether the second is worse, beyond chance."""
        return self.difference < 0.0 and self.p_value < 1.0 - CONFIDENCE

    @property
    def is_better(self) -> bool:
        """Whether it is better, beyond chance."""
        return self.difference > 0.0 and self.p_value < 1.0 - CONFIDENCE


def compare(first: Results, second: Results, succeeds: Callable[[Mapping[str, Any]], bool]) -> Comparison:
    """Compare the cases that both have. Raises BadInput where there is none."""
    pairs = {case: (succeeds(first[case]), succeeds(second[case])) for case in sorted(first.keys() & second.keys())}
    if not pairs:
        raise BadInput("expected campaigns with cases in common, got none: use the same --seed for both")
    found = {kind: tuple(case for case, pair in pairs.items() if pair == kind)
             for kind in ((True, True), (False, False), (True, False), (False, True))}
    return Comparison(len(found[True, True]), len(found[False, False]), found[True, False], found[False, True])


def rate_interval(successes: int, of: int, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Of a rate, by Clopper and Pearson."""
    failures, risk = of - successes, (1.0 - confidence) / 2.0
    low = betaincinv(successes, failures + 1, risk) if successes else 0.0
    high = betaincinv(successes + 1, failures, 1.0 - risk) if failures else 1.0
    return float(low), float(high)


def parse_success(text: str) -> Callable[[Mapping[str, Any]], bool]:
    """``outcome=reached``, ``collisions=0``, ``final_error_m<0.0254``: when a result is a success. Raises BadInput."""
    sign = next((sign for sign in ("<=", ">=", "<", ">", "=") if sign in text), "")
    field, _, wanted = text.partition(sign) if sign else (text, "", "")
    if not field.strip() or not wanted.strip():
        raise BadInput(f"--success: expected FIELD=VALUE, FIELD<NUMBER or FIELD>NUMBER, got {text!r}")
    field, wanted = field.strip(), wanted.strip()
    try:
        bound = math.nan if sign == "=" else float(wanted)
    except ValueError:
        raise BadInput(f"--success: expected a number after {sign!r}, got {wanted!r}") from None

    def succeeds(result: Mapping[str, Any]) -> bool:
        if field not in result:
            raise BadInput(f"--success: expected a field of the results ({', '.join(result)}), got {field!r}")
        value = result[field]
        if sign == "=":
            return wanted in (str(value), str(value).lower())
        if not isinstance(value, int | float):
            return False  # what nobody knows is no success
        return {"<": value < bound, "<=": value <= bound, ">": value > bound, ">=": value >= bound}[sign]

    return succeeds


def format_comparison(c: Comparison, success: str, names: tuple[str, str]) -> str:
    """For a terminal."""
    rows = []
    for name, alone in zip(names, (c.lost, c.gained), strict=True):
        successes = c.both + len(alone)
        low, high = rate_interval(successes, c.cases)
        rows.append((name, str(c.cases), str(successes), f"{100 * successes / c.cases:.2f}",
                     f"{100 * low:.2f} to {100 * high:.2f}", str(len(alone))))
    low, high = c.interval
    verdict = "better" if c.is_better else "worse" if c.is_worse else "not told apart by these cases"
    lines = [
        table(("campaign", "cases", success, "%", "95 %", "alone"), rows), "",
        f"second less first: {100 * c.difference:+.2f} points, 95 % from {100 * low:+.2f} to {100 * high:+.2f};"
        f" {c.discordant} of {c.cases} went differently, p = {c.p_value:.3g} (McNemar, exact)",
        f"the second is {verdict}",
    ]
    for what, cases in (("only the first succeeds in", c.lost), ("only the second succeeds in", c.gained)):
        if cases:
            more = f" and {len(cases) - SHOWN} more" if len(cases) > SHOWN else ""
            lines.append(f"{what}: {', '.join(map(str, cases[:SHOWN]))}{more}")
    return "\n".join(lines)
