"""Dask workers: what any cluster must keep, the file of the serial run, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from fake_cases import run_here, serial
from harvey.campaign.engine import RESULTS
from harvey.campaign.workers import Workers, find_cluster
from harvey.cli import main
from harvey_cluster.dask_workers import DASK
from seams import check_cluster


def test_it_is_what_a_cluster_must_be(tmp_path: Path) -> None:
    assert find_cluster("--cluster") is DASK
    check_cluster(DASK, "local:2", tmp_path)


def test_a_dask_cluster_gives_the_file_of_the_serial_run(tmp_path: Path) -> None:
    kills = [0, 1, 0, 9, 0, 2]
    run_here(tmp_path, kills, Workers(cluster="local:2"))
    assert (tmp_path / "results" / RESULTS).read_bytes() == serial(kills)


@pytest.mark.parametrize("cluster", ["nowhere", "local:none", "local:0"])
def test_what_is_no_cluster_is_refused(cluster: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                       capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["run", "bump", "--seed", "0..3", "--cluster", cluster]) == 2
    assert "--cluster: expected" in capsys.readouterr().err
