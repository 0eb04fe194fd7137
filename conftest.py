"""Property tests try the same examples every time, so that what holds on one machine holds on the next.

``pytest --hypothesis-profile=search`` looks further: other examples at every run. What it finds is mended, and kept as
an ``@example`` beside its law. ``mutants`` does not look for the smallest example that fails.
None asks how long an example takes: the first one may compile what it calls.
"""

import os
import signal
from collections.abc import Iterator
from functools import wraps
from typing import Any

import pytest
from hypothesis import Phase, settings

import harvey  # noqa: F401  # before numpy: it tells the libraries how to calculate

# A shell that starts the tests in the background has them ignore Ctrl-C, and so would what they start and interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

settings.register_profile("same", derandomize=True, deadline=None)
settings.register_profile("search", derandomize=False, print_blob=True, deadline=None)
settings.register_profile("mutants", derandomize=True, deadline=None, phases=(Phase.explicit, Phase.generate))
settings.load_profile("same")


@pytest.fixture(scope="session", autouse=True)
def nothing_is_refused() -> Iterator[None]:
    """A mission of a test stops where a source raises or may not write; ``may_refuse`` is for those that want that."""
    from harvey.runner.result import Refusals, tell_refusal

    @wraps(Refusals.__call__)
    def hear(refusals: Any, decision: Any) -> None:
        assert not decision.refused, f"cycle {decision.cycle}: {tell_refusal(decision)}"

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Refusals, "__call__", hear)
        yield


@pytest.fixture(scope="module")
def may_refuse() -> Iterator[None]:
    """In the missions of this module sources may raise, and be refused."""
    from harvey.runner.result import Refusals

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Refusals, "__call__", getattr(Refusals.__call__, "__wrapped__"))  # noqa: B009  # mypy knows none
        yield


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """The library of recorded runs, one for all workers: ``recorded("office")``."""
    from recorded_runs import Library

    own = tmp_path_factory.getbasetemp()
    library = Library((own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / "recorded")
    yield library
    assert library.list_changed() == [], "a test has written into a recorded run; it should copy it"


@pytest.fixture(scope="session")
def short_stage() -> Any:
    """The stage of the recorded run "office", for laws that every mission must keep."""
    from recorded_runs import build_office

    return build_office()
