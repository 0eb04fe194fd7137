"""The examples in the docstrings of the pose and matching packages."""

from __future__ import annotations

import doctest
from types import ModuleType

import pytest

from knowledge_sources.methods import matching, pose


@pytest.mark.parametrize("package", [pose, matching], ids=["pose", "matching"])
def test_the_example_of_the_package_runs(package: ModuleType) -> None:
    result = doctest.testmod(package)
    assert result.attempted > 0 and result.failed == 0
