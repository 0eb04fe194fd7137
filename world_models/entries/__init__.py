"""What lies on the blackboard: requests, observations and inferences."""
