"""Run a mission in the simulator and read its result."""

from pathlib import Path

import harvey

OUT = Path("runs") / "example"

decisions: list[harvey.Decision] = []
result = harvey.run(
    "forty-foot-hallway", seed=1, out=OUT, settings={"limits.max_time_s": 600}, on_decision=decisions.append)

print(f"{result.outcome}: {result.reason}")
print(f"{result.error_m * 1000:.1f} mm from the goal after {result.path_length_m:.1f} m and {len(decisions)} decisions")
print(f"{result.milestones['verified']} milestones verified, {result.false_accepts} of them wrongly")
