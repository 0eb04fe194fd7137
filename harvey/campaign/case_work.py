"""Case work: what a worker does with one case, and what it sends back."""

from __future__ import annotations

import ctypes
import gc
import os
import socket
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from harvey.campaign.origin import code_digest
from harvey.errors import BadInput
from logs.decided_by import arithmetic

MOST_KILLS = 3
"""So often may a worker end while it works on a case; then the case is given up."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What a worker found of a case.

    Attributes:
        value: what the work returned.
        seconds: what it took.
        worker: host and process.
        code, arithmetic: with which program, and how it calculated.
    """

    value: Any
    seconds: float
    worker: str
    code: str
    arithmetic: str


@dataclass(frozen=True, slots=True)
class Killed:
    """A case that was given up: each worker that had it ended before it answered.

    Attributes:
        kills: how many did.
    """

    kills: int

    @property
    def text(self) -> str:
        """In words."""
        return f"given up: the worker that had it was killed {self.kills} times, as when memory runs out"


def answer_case(work: Callable[[Any], Any], case: Any) -> Answer:
    """Work on a case, in a worker."""
    began = time.perf_counter()
    value = work(case)
    seconds = time.perf_counter() - began
    return_memory()
    return Answer(value, seconds, f"{socket.gethostname()}:{os.getpid()}", code_digest(), arithmetic())


def return_memory() -> None:
    """Give memory that the process no longer uses back to the system: it would lie about between what is kept."""
    gc.collect()
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):  # another C library than glibc gives it back by itself
            ctypes.CDLL(None).malloc_trim(0)


def check_origin(answer: Answer) -> None:
    """Refuse what another program found, or another kind of processor. Raises BadInput."""
    for what, theirs, ours in (("code", answer.code, code_digest()),
                               ("arithmetic", answer.arithmetic, arithmetic())):
        if theirs != ours:
            raise BadInput(f"worker {answer.worker}: expected the {what} of this machine ({ours}), got {theirs}: its"
                           " results would differ; start workers with 'harvey campaign worker'")
