"""Golden journals: did a change of the house change a decision of the robot?

    python tests/golden/golden.py check                drive every shipped scenario (seed 0), compare line by line
    python tests/golden/golden.py check bump figure9   some of them
    python tests/golden/golden.py make                 write the fingerprints anew, where decisions are meant to change

A fingerprint is six hexadecimal digits of each line of ``journal.jsonl``, after kinds and fields that have been renamed
since the fingerprints were made got their old names back (``RENAMED``). Exit codes: 0 the same, 1 not the same.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from itertools import zip_longest
from pathlib import Path
from typing import Any

import harvey

FINGERPRINTS = Path(__file__).parent / "fingerprints.json"
DIGITS = 6

RENAMED: dict[str, str] = {}
"""New name of a kind, field, knowledge source or value: the name that it had when the fingerprints were made."""

LEFT_OUT: frozenset[str] = frozenset()
"""Fields that journals had or have, and that say nothing of a decision."""


def with_old_names(value: Any) -> Any:
    """A journal line as it was before anything was renamed. Names of entries are ``Kind-number.revision``."""
    if isinstance(value, dict):
        return {str(with_old_names(key)): with_old_names(of) for key, of in value.items() if key not in LEFT_OUT}
    if isinstance(value, list):
        return [with_old_names(one) for one in value]
    if isinstance(value, str):
        kind, dash, number = value.partition("-")
        return RENAMED.get(value, RENAMED.get(kind, kind) + dash + number)
    return value


def fingerprints_of(journal: Path) -> list[str]:
    """One fingerprint a line; the order of the keys within a line does not count."""
    lines = (with_old_names(json.loads(line)) for line in journal.read_text(encoding="utf-8").splitlines())
    return [hashlib.blake2b(json.dumps(line, sort_keys=True).encode()).hexdigest()[:DIGITS] for line in lines]


def drive(scenario: str) -> list[str]:
    with tempfile.TemporaryDirectory() as folder:
        harvey.run(scenario, seed=0, out=Path(folder) / "run")
        return fingerprints_of(Path(folder) / "run" / "journal.jsonl")


def first_difference(ours: list[str], golden: list[str]) -> int | None:
    """The cycle in which they part, None where they do not."""
    pairs = enumerate(zip_longest(ours, golden), 1)
    return next((cycle for cycle, (one, other) in pairs if one != other), None)


def read_golden() -> dict[str, list[str]]:
    told = json.loads(FINGERPRINTS.read_text(encoding="utf-8"))
    return {name: [text[at:at + DIGITS] for at in range(0, len(text), DIGITS)] for name, text in told.items()}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["check", "make"])
    parser.add_argument("scenario", nargs="*", help="all that harvey list has")
    parser.add_argument("--workers", type=int, default=2)
    asked = parser.parse_args()
    scenarios = asked.scenario or sorted(path.stem for path in Path("sim/scenarios").glob("*.toml"))
    golden = read_golden() if FINGERPRINTS.exists() else {}
    same = True
    with ProcessPoolExecutor(asked.workers) as pool:
        for name, ours in zip(scenarios, pool.map(drive, scenarios), strict=True):
            if asked.what == "make":
                golden[name] = ours
                print(f"{name}: {len(ours)} lines")
                continue
            cycle = first_difference(ours, golden.get(name, []))
            same = same and cycle is None
            print(f"{name}:", f"the same, {len(ours)} lines" if cycle is None else f"NOT THE SAME from cycle {cycle}")
    if asked.what == "make":
        told = {name: "".join(ours) for name, ours in sorted(golden.items())}
        FINGERPRINTS.write_text(json.dumps(told, indent=0) + "\n", encoding="utf-8")
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
