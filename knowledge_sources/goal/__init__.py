"""Knowledge sources of the goal level (§2): the command, finding the robot when it is lost, and the outcome."""
