"""Bases on the other end of a serial line, written from their protocols: no line of code is shared with the drivers."""
