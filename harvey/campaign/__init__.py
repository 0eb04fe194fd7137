"""Many missions: worker processes, progress and the table of results."""
