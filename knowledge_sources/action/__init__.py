"""Knowledge sources of the action level (§5): move the robot, follow landmarks, stand still during a fault."""
