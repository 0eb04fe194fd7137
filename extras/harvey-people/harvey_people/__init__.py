"""People: who walks there in the simulator, how they are seen, and what the robot does for their sake."""

from pathlib import Path

SCENARIOS = Path(__file__).parent / "scenarios"
