"""Drivers over bad serial lines."""
