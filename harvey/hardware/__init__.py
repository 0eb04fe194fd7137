"""Missions on a real robot. No simulator is imported here.

In reading order: ``hardware_mission`` (the file), ``preflight`` (what is checked before the first move),
``hardware_run`` (drive and resume), ``hardware_body`` (base and camera as one body), ``heartbeat`` and ``stop_key``
(what stops it), ``resume`` (what differs from the simulator after a crash), ``bases`` (bases by name),
``calibration``, ``drivers``.
"""
