"""Drivers of robot bases over serial lines."""
