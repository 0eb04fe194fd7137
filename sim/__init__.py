"""The simulator: a building, a body with a camera in it, and what goes wrong. It knows no board and no perception.

In reading order: ``scenario`` (a mission file), ``stage`` (scenario and building, from which runs get their bodies),
``scenario_changes`` (a scenario against its building), ``truth`` (the true state, and the score),
``ground_truth`` (where building and camera differ from the model), ``body`` (the robot), ``faults`` (what goes wrong,
one class a kind), ``render`` (the camera), ``emulators`` (bases on serial lines). ``scenarios`` and ``buildings`` hold
TOML files.
"""
