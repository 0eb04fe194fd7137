"""From acts to ends on a building: a map as people speak of it, and a beam of hypotheses that follow the acts on it."""
