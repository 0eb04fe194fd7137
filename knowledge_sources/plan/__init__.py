"""Knowledge sources of the plan level (§4, §6): sketches, milestones, and whether what was expected is seen."""
