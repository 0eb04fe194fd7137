"""What thinking costs: each act of a knowledge source is charged so long, in which people walk and wheels roll.

Means of the processor time of acts on one core, over two missions of seed 0 (crossing, hallway-kidnap), rounded up.
Stated, not measured in the run: so a run is the same on any machine.
"""

from __future__ import annotations

from collections.abc import Mapping

CHARGED_S: Mapping[str, float] = {
    "alias_monitor": 0.19, "correlator_tracker": 0.008, "door_watcher": 0.012, "floor_watcher": 0.03,
    "goal_sketcher": 0.005, "landmark_chooser": 0.012, "line_finder": 0.007, "localizer": 2.2, "matcher": 0.03,
    "med_r_and_t": 0.035, "milestone_judge": 0.017, "motor": 0.005, "mover_watcher": 0.005, "range_watcher": 0.04,
    "people_passer": 0.03, "people_waiter": 0.02,
    "refiner": 0.005, "surveyor": 0.1, "thing_mapper": 0.003, "view_chooser": 0.02, "view_predictor": 0.025,
}
"""By knowledge source [s]."""
OTHERS_S = 0.001
"""Of every other."""
