"""Emulated bases and cameras at the other end of a line. They share no code with the drivers.

In reading order: ``emulator`` (what a base is at its end of a line, and what its wheels roll on),
``denning_emulator`` (one protocol, written from its specification), ``line`` (a base as a serial port, or without real
time), ``camera_server`` (a camera on the network).
"""
