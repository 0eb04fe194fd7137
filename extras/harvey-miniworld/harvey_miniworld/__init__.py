"""Harvey in rooms by others: miniworld's textured rooms as a body's world, and floors with their plans."""
