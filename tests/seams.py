"""What anything that is added by an entry point must keep: each check takes an implementation, whoever wrote it."""

from __future__ import annotations

import shlex
from argparse import ArgumentParser
from pathlib import Path

import pytest

from fake_cases import fake_cases, work_on
from harvey.campaign.case_work import CaseAnswer, Killed
from harvey.campaign.workers import ClusterWorkers
from harvey.commands.command import CliCommand, add_parser
from harvey.errors import BadInput


def check_command(command: CliCommand, of: str = "") -> None:
    """A command, or a verb of the command ``of``: it says what it is for, and its examples are parsed."""
    words = ["harvey", *of.split(), command.name]
    parser = ArgumentParser(prog=" ".join(words[:-1]), exit_on_error=False)
    add_parser(parser.add_subparsers(required=True), command)
    assert command.summary and command.summary[0].islower() and not command.summary.endswith(".")
    own = [shlex.split(line.partition("|")[0]) for line, what in command.examples if what]
    own = [given for given in own if given[:len(words)] == words]
    assert own, command.examples
    for given in own:
        _, unknown = parser.parse_known_args(given[len(words) - 1:])
        assert command.open_ended or not unknown, given


def check_cluster(workers: ClusterWorkers, cluster: str, folder: Path) -> None:
    """Workers of a cluster: each case is answered once, whoever is killed; only what kills its workers is given up."""
    cases, told = fake_cases(folder, [0, 9, 1, 0]), list[str]()
    found = list(workers.map_on_cluster(work_on, cases, cluster, told.append))
    answers = {place: answer.value.square for place, answer in found if isinstance(answer, CaseAnswer)}
    assert answers == {place: place * place / 3.0 for place in (0, 2, 3)}
    assert [place for place, answer in found if isinstance(answer, Killed)] == [1] and len(found) == len(cases)
    assert len(told) == 1
    with pytest.raises(ZeroDivisionError):
        list(workers.map_on_cluster(divide, [1.0, 0.0], cluster))
    with pytest.raises(BadInput, match="--cluster"):
        list(workers.map_on_cluster(divide, [1.0], "nowhere"))
    command = workers.worker_command("tcp://host:8786", 3)
    assert command[0] == "-m" and {"tcp://host:8786", "3"} <= set(command)


def divide(case: float) -> float:
    return 1.0 / case
