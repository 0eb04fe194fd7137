"""Laws of the campaign engine: whoever works and whatever is killed, the results file is that of the serial run."""

from __future__ import annotations

import multiprocessing
import signal
import tempfile
import time
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fake_cases import be_client, run_here, serial
from harvey.campaign.engine import RESULTS, Results, read_times
from harvey.campaign.workers import Workers
from harvey.errors import BadInput

SPAWN = multiprocessing.get_context("spawn")
QUICK = settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.too_slow])
KILLS = st.lists(st.sampled_from([0, 0, 0, 1, 2, 9]), min_size=1, max_size=6)


@QUICK
@given(KILLS, st.integers(1, 3), st.lists(st.tuples(st.integers(1, 4), st.integers(1, 3), st.binary(max_size=9)),
                                          max_size=2))
def test_any_kills_of_workers_and_clients_give_the_file_of_the_serial_run(
    kills: list[int], workers: int, clients: list[tuple[int, int, bytes]]
) -> None:
    """Each client is killed after some results, and tears the line that it was writing."""
    with tempfile.TemporaryDirectory() as name:
        folder, path = Path(name), Path(name) / "results" / RESULTS
        for end_after, number, torn in clients:
            client = SPAWN.Process(target=be_client, args=(folder, kills, Workers(number), end_after))
            client.start()
            client.join(60.0)
            assert client.exitcode in (0, -signal.SIGKILL)
            with path.open("ab") as out:
                out.write(torn.replace(b"\n", b"{"))
        found = run_here(folder, kills, Workers(workers))
        assert found == {n: 3 if kill >= 3 else n * n / 3.0 for n, kill in enumerate(kills)}
        assert path.read_bytes() == serial(kills)
        assert run_here(folder, kills, Workers(workers)) == found
        assert path.read_bytes() == serial(kills)


@QUICK
@given(st.permutations(range(5)), st.data())
def test_a_file_cut_off_anywhere_goes_on_to_the_same(order: list[int], data: st.DataObject) -> None:
    """Each result was added in any order; the file lost any part of its end."""
    head = {"code": "1"}
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / RESULTS
        whole = b""
        for again in range(2):
            with closing(Results(Path(name), head)) as results:
                for case in order:
                    if case not in results.known:
                        results.add(case, {"x": case}, {"at": 0.0})
                results.sort()
            whole = whole or path.read_bytes()
            assert path.read_bytes() == whole
            if not again:
                path.write_bytes(whole[: data.draw(st.integers(0, len(whole)))])


def test_results_of_another_program_are_not_mixed(tmp_path: Path) -> None:
    for code in "12":
        with closing(Results(tmp_path, {"code": code})) as results:
            assert results.known == {}
            results.add(0, {"x": code}, {})


def test_two_processes_do_not_work_on_the_same(tmp_path: Path) -> None:
    with closing(Results(tmp_path, {})), pytest.raises(BadInput, match="another process works on"):
        Results(tmp_path, {})


def test_workers_end_with_a_client_that_is_killed(tmp_path: Path) -> None:
    client = SPAWN.Process(target=be_client, args=(tmp_path, [0] * 4, Workers(2), 3))
    client.start()
    client.join(60.0)
    assert client.exitcode == -signal.SIGKILL
    workers = {int(record["worker"].rpartition(":")[2]) for record in read_times(tmp_path / "results")}
    assert workers
    for _ in range(200):
        if not any(_runs(pid) for pid in workers):
            return
        time.sleep(0.05)
    raise AssertionError(f"workers that nobody needs: {workers}")


def _runs(pid: int) -> bool:
    """Whether the process is there, and not only its entry in the table."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
