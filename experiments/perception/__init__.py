"""How well is it seen? Lines, matching, milestones, calibration."""
