"""Where is the robot, when no pose is known: candidates, their likelihood, and what to look at next."""
