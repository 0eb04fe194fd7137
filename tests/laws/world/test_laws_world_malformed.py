"""The law of spoilt world files, a small version: a clear error or a checked world; the text itself is sound."""

from pathlib import Path

import numpy as np
import pytest

from experiments.robustness.malformed_worlds import CORRUPTIONS, SMALL, judge_file, judge_files
from world_models.files.world_files import compile_file


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    folder = tmp_path_factory.mktemp("sound")
    (folder / "sound.toml").write_text(SMALL, encoding="utf-8")
    compile_file(folder / "sound.toml", folder / "sound.world")
    return (folder / "sound.world").read_bytes()


def test_the_texts_are_sound_before_they_are_spoilt(sound: bytes, tmp_path: Path) -> None:
    assert judge_file(SMALL, tmp_path) == judge_file(sound, tmp_path, ".world") == "sound"


@pytest.mark.parametrize("index", range(len(CORRUPTIONS) - 2))
def test_a_spoilt_file_gives_a_clear_error_or_a_checked_world(index: int, sound: bytes, tmp_path: Path) -> None:
    name, suffix, corrupt = CORRUPTIONS[index]
    for number in range(40):
        verdict = judge_file(corrupt(np.random.default_rng([1, number]), sound), tmp_path, suffix)
        assert verdict in ("error", "sound", "faults"), f"{name} {number}: {verdict}"


def test_what_must_not_be_is_told(tmp_path: Path) -> None:
    assert judge_file("name = 1\n".replace("name", "nom"), tmp_path) == "error"
    assert judge_file(b"nothing", tmp_path, ".world") == "error"


def test_a_file_has_the_same_fate_whoever_reads_it() -> None:
    assert [f.verdict for f in judge_files(range(12), 3)] == [
        f.verdict for first in (0, 6) for f in judge_files(range(first, first + 6), 3)]
