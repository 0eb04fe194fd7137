"""``harvey emulate``: a port that answers, in a process of its own, until it is interrupted."""

from __future__ import annotations

import re
import signal
import subprocess
import sys

import pytest

from harvey.cli import main
from harvey.hardware.bases import base_kinds, open_base


@pytest.mark.parametrize("kind", tuple(base_kinds()))
def test_a_driver_in_another_process_finds_a_base_there(kind: str) -> None:
    command = [sys.executable, "-m", "harvey.cli", "emulate", kind, "--trace"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        said = process.stdout.readline()
        match = re.fullmatch(rf"an emulated {kind} base is at (\S+); Ctrl-C ends it\n", said)
        assert match is not None, said
        try:
            base = open_base(f"{kind}:{match[1]}")
            try:
                report = base.move(0.2)
            finally:
                base.close()
        finally:  # whatever went wrong: the process does not end by itself
            process.send_signal(signal.SIGINT)
        try:
            traffic, farewell = process.communicate(timeout=60)
        finally:
            process.kill()  # else leaving the block waits for it for ever
    assert report.move_m == pytest.approx(0.2, abs=0.03)
    assert " < " in traffic and " > " in traffic
    assert process.returncode == 0 and farewell == "the base is gone\n"


def test_what_it_cannot_use_it_says(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["emulate", "zeppelin"]) == 2
    assert "denning" in capsys.readouterr().err
    assert main(["emulate", "denning", "--speed", "fast"]) == 2
    assert "expected a factor" in capsys.readouterr().err
    assert main(["emulate", "denning", "--scenario", "atlantis"]) == 2
    assert "scenario: expected" in capsys.readouterr().err
