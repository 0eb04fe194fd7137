"""Senses (§3.2): does one of them lie?

Each monitor posts what is not as expected, once and unexplained; the rivals that would explain it compete. Read
``lens_monitor`` (the camera bends lines otherwise than is stated), ``correction_monitor`` (pictures and wheels do not
agree on the way) and ``sense_judge`` (what follows from that).
"""
