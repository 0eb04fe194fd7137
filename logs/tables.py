"""Tables as plain text."""

from __future__ import annotations

import re
from collections.abc import Sequence

NUMBER = re.compile(r"[+-]?[\d.]+(e[+-]?\d+)?\s?%?|-|[+-]?inf|nan")
"""One number, or a dash for one that is not known."""


def table(columns: Sequence[str], rows: Sequence[Sequence[str]], *, last_is_summary: bool = False) -> str:
    """Columns as wide as what they hold; numbers to the right, words to the left."""
    lines = [list(columns), *(list(row) for row in rows)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(columns))]
    right = [bool(rows) and all(NUMBER.fullmatch(row[i]) for row in rows) for i in range(len(columns))]
    cells = ((cell.rjust(w) if r else cell.ljust(w) for cell, w, r in zip(line, widths, right, strict=True))
             for line in lines)
    shown = ["  ".join(line).rstrip() for line in cells]
    rule = "-" * (sum(widths) + 2 * (len(widths) - 1))
    body = [*shown[1:-1], rule, shown[-1]] if last_is_summary and rows else shown[1:]
    return "\n".join([shown[0], rule, *body])
