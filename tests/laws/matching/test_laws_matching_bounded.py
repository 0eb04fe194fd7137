"""Laws of how many pairs are looked at: never more than the settings say, and the longest ones."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.perception.matcher_scenes import CAMERA, generate_large
from knowledge_sources.methods.matching import MAX_START_PAIRS, match_in_space, pose_matching
from knowledge_sources.methods.matching.pose_matching import PosePairs, keep_longest
from world_models.frames import Pose


def build_pairs(model: list[int], shares: list[float]) -> PosePairs:
    """Pairs of these model lines, as long as ``shares``."""
    p = len(model)
    two, one = np.zeros((p, 2)), np.zeros(p)
    return PosePairs(np.array(model), np.arange(p), two, np.zeros((p, 2, 6)), two, one, one, np.array(shares))


@given(st.lists(st.tuples(st.integers(0, 6), st.integers(0, 20)), min_size=1, max_size=80), st.integers(0, 90))
@settings(deadline=None)
def test_the_longest_of_each_line_are_kept(rows: list[tuple[int, int]], most: int) -> None:
    pairs = build_pairs([i for i, _ in rows], [float(share) for _, share in rows])
    kept = keep_longest(pairs, most)
    assert len(kept.model) <= most or len(rows) <= most
    if len(rows) <= most:
        assert np.array_equal(kept.data, pairs.data)
    counts = {i: int(np.sum(kept.model == i)) for i in set(pairs.model.tolist())}
    for i, count in counts.items():
        ours, chosen = pairs.shares[pairs.model == i], kept.shares[kept.model == i]
        assert sorted(chosen, reverse=True) == sorted(ours, reverse=True)[:count]
        assert count == len(ours) or count == max(counts.values())


@pytest.mark.parametrize("spread_m", [0.15, 1.0])
def test_300_lines_against_4500_segments_are_within_the_bounds(
    spread_m: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the time of a match grows with: the pairs that starts are refined with, and those that are searched."""
    looked: dict[str, list[int]] = {"start": [], "near": []}
    starts, build = pose_matching.find_start_poses, pose_matching._build_space

    def find_start_poses(scene: Any, wide: PosePairs) -> Any:
        looked["start"].append(len(wide.model))
        return starts(scene, wide)

    def build_space(scene: Any, pose: Pose, pairs: PosePairs, *more: Any) -> Any:
        looked["near"].append(len(pairs.model))
        return build(scene, pose, pairs, *more)

    monkeypatch.setattr(pose_matching, "find_start_poses", find_start_poses)
    monkeypatch.setattr(pose_matching, "_build_space", build_space)
    lines, data = generate_large(np.random.default_rng(1))
    covariance = np.diag([(0.1 * spread_m) ** 2] * 3 + [spread_m**2] * 3)
    monkeypatch.setattr(pose_matching, "MAX_NEAR_PAIRS", 800)
    match_in_space(lines, data, CAMERA, Pose.identity(), covariance)
    assert 0 < max(looked["start"]) <= MAX_START_PAIRS
    assert 0 < max(looked["near"]) <= 800
