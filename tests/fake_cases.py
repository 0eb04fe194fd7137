"""Cases of a campaign that cost nothing and end their worker as often as they are told, in real processes."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from harvey.campaign.engine import Campaign, run_campaign
from harvey.campaign.workers import Killed, Workers, origin


@dataclass(frozen=True, slots=True)
class FakeCase:
    """Ends its worker ``kills`` times by SIGKILL before it answers; ``tries`` is where it counts them."""

    number: int
    kills: int
    tries: Path


@dataclass(frozen=True, slots=True)
class FakeResult:
    """What follows from the case, and what was measured of the machine."""

    square: float
    worker: str
    seconds: float


def work_on(case: FakeCase) -> FakeResult:
    made = len(list(case.tries.glob(f"{case.number}-*")))
    if made < case.kills:
        (case.tries / f"{case.number}-{made}").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return FakeResult(case.number * case.number / 3.0, "any", float(os.getpid()))


def of_record(record: Mapping[str, Any]) -> FakeResult:
    return FakeResult(**record)


def fake_cases(folder: Path, kills: Sequence[int]) -> list[FakeCase]:
    """One for each, numbered."""
    (folder / "tries").mkdir(parents=True, exist_ok=True)
    return [FakeCase(number, kill, folder / "tries") for number, kill in enumerate(kills)]


def fake_campaign(folder: Path, kills: Sequence[int]) -> Campaign[FakeCase, FakeResult]:
    """One case for each; results in ``folder/results``."""
    return Campaign(work_on, dict(enumerate(fake_cases(folder, kills))), folder / "results", asdict, of_record)


def be_client(folder: Path, kills: Sequence[int], workers: Workers, end_after: int | None) -> None:
    """Run the campaign as a process of its own, and end by SIGKILL after so many results (None: never)."""
    for number, _ in enumerate(run_campaign(fake_campaign(folder, kills), workers), 1):
        if number == end_after:
            os.kill(os.getpid(), signal.SIGKILL)


def run_here(folder: Path, kills: Sequence[int], workers: Workers) -> dict[int, float | int]:
    """Run it in this process: the square of each case, or the kills after which it was given up."""
    return {case: result.kills if isinstance(result, Killed) else result.square
            for case, result in run_campaign(fake_campaign(folder, kills), workers)}


def serial(kills: Sequence[int]) -> bytes:
    """The file of results as one process would write it that is never killed; 3 kills end a case."""
    lines = [origin()]
    for case, kill in enumerate(kills):
        result = {"square": case * case / 3.0, "worker": "any", "seconds": None}
        lines.append({"case": case, "killed": 3} if kill >= 3 else {"case": case, "result": result})
    return "".join(json.dumps(line) + "\n" for line in lines).encode()
