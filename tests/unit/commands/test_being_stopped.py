"""What a command says when it is stopped: by a key, by a closed pipe, by a full disk, by a package of another name."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from harvey.cli import main
from harvey.packages import MARKS
from logs.run_directory import RunDirectory

HARVEY = [sys.executable, "-m", "harvey.cli"]


def test_a_closed_pipe_ends_a_run_that_is_not_finished_with_an_error(tmp_path: Path) -> None:
    out = tmp_path / "run"
    argv = [*HARVEY, "run", "bump", "--trace", "--out", str(out)]
    with subprocess.Popen(argv, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stderr is not None
        process.stdout.readline()
        process.stdout.close()
        told = process.stderr.read()
    assert process.returncode == 141
    assert RunDirectory(out).read_result()["outcome"] == "unfinished"
    assert told.splitlines()[-1] == (
        f"harvey: the output was closed; what was recorded is kept; harvey resume {out} goes on with it")


@pytest.mark.parametrize("asked", ["list", "--version", "why --help"])
def test_a_closed_pipe_is_no_news_where_nothing_was_under_way(asked: str) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run([*HARVEY, *asked.split()], stdout=writer, stderr=subprocess.PIPE, text=True)
    os.close(writer)
    assert done.stderr == "" and done.returncode in ((0, 141) if "--help" in asked else (141,))


@pytest.mark.parametrize("asked", ["list", "settings", "--help"])
def test_a_terminal_that_knows_ascii_only_is_told_in_its_letters(asked: str) -> None:
    done = subprocess.run([*HARVEY, asked], capture_output=True, env={**os.environ, "PYTHONIOENCODING": "ascii"})
    assert (done.returncode, done.stderr) == (0, b"") and done.stdout.isascii() and len(done.stdout) > 500


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full")
@pytest.mark.parametrize("asked", ["list", "--version"])
def test_a_full_disk_behind_standard_output_is_named(asked: str) -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run([*HARVEY, asked], stdout=full, stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr) == (2, "harvey: standard output: No space left on device\n")


def test_ctrl_c_where_nothing_is_recorded_says_no_more(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("world_models.files.world_files.load_world", interrupt)
    assert main(["world", "check", "research_center"]) == 130
    assert capsys.readouterr().err == "harvey: interrupted\n"


def test_ctrl_c_while_modules_are_imported_is_no_traceback() -> None:
    """The interrupt comes from the module that is imported first of those that a command needs."""
    program = """
import sys
import harvey.cli

class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == "harvey.commands":
            raise KeyboardInterrupt

sys.meta_path.insert(0, Interrupting())
sys.exit(harvey.cli.main(["list"]))
"""
    done = subprocess.run([sys.executable, "-c", program], stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr) == (130, "harvey: interrupted\n")


def wait_until_idle(processes: list[subprocess.Popen[str]]) -> None:
    """Wait until processes have loaded all that they need, and then use no processor for two seconds."""
    used: list[list[str]] = []
    for _ in range(120):
        time.sleep(0.5)
        used.append([Path(f"/proc/{p.pid}/stat").read_text().rsplit(")", 1)[1].split()[11] for p in processes])
        if len(used) > 8 and all(before == used[-1] for before in used[-5:]) and all(int(t) >= 20 for t in used[-1]):
            return


def test_a_pipe_into_which_nobody_writes_can_be_interrupted(tmp_path: Path) -> None:
    """Each command by each signal; all are started before any is waited for."""
    world = ["--world", "research_center", "--goal", "(ptrans (hallway (4,4,0)) (hallway (9,4,0)))"]
    waiting: list[tuple[signal.Signals, subprocess.Popen[str]]] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        pipe, out = (tmp_path / f"{number}{end}" for end in ("", ".out"))
        os.mkfifo(pipe)
        argv = [*HARVEY, "drive", "--camera", str(pipe), *world, "--out", str(out)]
        process = subprocess.Popen(argv, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        waiting.append((number, process))
    try:
        wait_until_idle([process for _, process in waiting])
        for number, process in waiting:
            assert process.poll() is None
            process.send_signal(number)
        for number, process in waiting:
            _, told = process.communicate(timeout=20.0)
            assert process.returncode == 128 + number and "Traceback" not in told
    finally:
        for _, process in waiting:
            process.kill()


@pytest.mark.parametrize("name", MARKS)
def test_a_package_of_somebody_else_with_the_same_name_is_named(name: str, tmp_path: Path) -> None:
    (tmp_path / name).mkdir()
    (tmp_path / name / "__init__.py").write_text("")
    path = os.pathsep.join([str(tmp_path), *(p for p in sys.path if p)])
    done = subprocess.run([sys.executable, "-c", "import harvey"], env={**os.environ, "PYTHONPATH": path},
                          cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 1
    assert f"ImportError: harvey: its package '{name}' is hidden by {tmp_path / name}" in done.stderr
