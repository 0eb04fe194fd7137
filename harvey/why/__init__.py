"""Why, and what differs: explanations of a run from its journal alone, in sentences that name their entries."""
