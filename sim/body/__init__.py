"""The simulated robot: wheels, collisions, elevator rides, and the truth."""
