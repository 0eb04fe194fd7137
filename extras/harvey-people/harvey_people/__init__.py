"""People: who walks in the simulated building."""

from pathlib import Path

SCENARIOS = Path(__file__).parent / "scenarios"
