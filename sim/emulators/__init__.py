"""Emulated bases and cameras at the other end of a line. They share no code with the drivers.

In reading order: ``emulator`` (what a serial line needs of a base), ``ground`` (what its wheels roll on), ``denning``
with ``denning_motion``, ``p2os`` with ``p2os_packets``, and ``create2`` (one protocol each, written from its manual),
``pseudo_terminal`` (a base as a serial port), ``lockstep_link`` and ``pseudo_terminal_link`` (a line whose time passes
only while the host waits), ``faulty_line`` (a line that fails), ``camera_server`` (a camera on the network).
"""
