"""From what a building file says to rooms with walls, doors and furniture in place."""
