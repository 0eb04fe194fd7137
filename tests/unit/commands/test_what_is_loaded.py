"""What a mission in the simulator need not load is not loaded, as every start would wait for it."""

from __future__ import annotations

import subprocess
import sys

SPARED = ("harvey.hardware", "sim.emulators", "scipy.stats", "scipy.ndimage", "scipy.optimize")


def test_a_simulated_mission_loads_no_drivers_and_none_of_what_few_missions_need() -> None:
    program = (f"import sys, harvey.simulation.simulated_run, harvey.campaign.mission_task;"
               f"print([name for name in sys.modules if name.startswith({SPARED!r})])")
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
