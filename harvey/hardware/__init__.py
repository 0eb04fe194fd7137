"""Missions on a real robot. No simulator is imported here.

In reading order: ``mission`` (the file), ``preflight`` (what is checked before the first move), ``run`` (drive and
resume), ``body`` (base and camera as one body), ``heartbeat`` and ``stop_key`` (what stops it), ``resume`` (what
differs from the simulator after a crash), ``base`` (bases by name), ``calibration``, ``drivers``.
"""
