"""Runs in the simulator, scored against the truth.

In reading order: ``simulated_run`` (drive and resume a scenario's mission), ``referee`` (who knows the truth),
``happenings`` (what it touched, and what else happened), ``serial_body`` (the body behind an emulated base's line),
``body_replay`` (the body does again what a journal says).
"""
