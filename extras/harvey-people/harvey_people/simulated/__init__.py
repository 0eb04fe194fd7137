"""People who walk in the simulated building, by models of others, while the robot thinks."""
