"""Runs in the simulator: agent and simulated body put together, and scored against the truth."""
