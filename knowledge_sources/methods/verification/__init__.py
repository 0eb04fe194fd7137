"""Is the robot at this pose? PoseEvidence for a pose, and the probability that it is wrong."""
