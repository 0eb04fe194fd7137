"""From what a world file says to surfaces and model lines."""
