"""People: who walks in the simulated building."""
