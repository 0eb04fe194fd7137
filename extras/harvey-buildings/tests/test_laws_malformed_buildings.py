"""The law of spoilt building files, a small version: a clear error or a checked world; the text itself is sound."""

from pathlib import Path

import numpy as np

from experiments.robustness.malformed_worlds import CORRUPTIONS, GML, judge_file


def test_the_text_is_sound_before_it_is_spoilt(tmp_path: Path) -> None:
    assert judge_file(GML, tmp_path, ".gml") == "sound"


def test_a_spoilt_file_gives_a_clear_error_or_a_checked_world(tmp_path: Path) -> None:
    name, suffix, corrupt = CORRUPTIONS[-2]
    assert (name, suffix) == ("IndoorGML", ".gml")
    for number in range(40):
        verdict = judge_file(corrupt(np.random.default_rng([1, number]), b""), tmp_path, suffix)
        assert verdict in ("error", "sound", "faults"), f"{name} {number}: {verdict}"


def test_what_must_not_be_is_told(tmp_path: Path) -> None:
    assert judge_file("<a/>", tmp_path, ".gml") == "error"
