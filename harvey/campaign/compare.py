"""Is one campaign better than another? The same cases of both, in pairs.

Where both went alike, a pair says nothing of the difference. Of the others, were the two campaigns alike, half would
speak for each: McNemar's exact test (McNemar 1947, Psychometrika 12; the binomial test on the discordant pairs). The
difference of the rates is the rate of the pairs that speak for the second less that of those that speak for the first;
each has its exact interval (Clopper and Pearson 1934, Biometrika 26) at half the risk, so that both hold together
(Bonferroni). That is a little wide, and no pair that went otherwise is no proof that there is no difference.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from scipy.stats import binomtest

from harvey.errors import BadInput
from logs.tables import table

CONFIDENCE = 0.95
SHOWN = 10
"""Cases that went otherwise and are named."""

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
        """How many went otherwise."""
        return len(self.lost) + len(self.gained)

    @property
    def difference(self) -> float:
        """The second's rate of success less the first's."""
        return (len(self.gained) - len(self.lost)) / self.cases

    @property
    def p_value(self) -> float:
        """How often so much or more would come by chance, were both alike; two-sided."""
        return float(binomtest(len(self.gained), self.discordant).pvalue) if self.discordant else 1.0

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
    bounds = binomtest(successes, of).proportion_ci(confidence, method="exact")
    return float(bounds.low), float(bounds.high)


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
        f" {c.discordant} of {c.cases} went otherwise, p = {c.p_value:.3g} (McNemar, exact)",
        f"the second is {verdict}",
    ]
    for what, cases in (("only the first succeeds in", c.lost), ("only the second succeeds in", c.gained)):
        if cases:
            more = f" and {len(cases) - SHOWN} more" if len(cases) > SHOWN else ""
            lines.append(f"{what}: {', '.join(map(str, cases[:SHOWN]))}{more}")
    return "\n".join(lines)
