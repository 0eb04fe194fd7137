"""The experiments of the camera: small versions hold what they claim."""

from __future__ import annotations

import pytest

from experiments.perception import lens


def test_lines_are_best_found_in_the_straightened_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lens, "QUICK_CARDS", 3)
    monkeypatch.setattr(lens, "LENSES", tuple(k for k in lens.LENSES if k[0] in ("none", "k1 = -0.2")))
    report = lens.run(True, 0)
    assert report.holds, report.text()
    assert len(report.rows) == 3
