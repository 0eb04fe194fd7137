"""Directions for people, and the commands."""
