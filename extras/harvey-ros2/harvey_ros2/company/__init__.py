"""What others see of a run, and say to the robot."""
