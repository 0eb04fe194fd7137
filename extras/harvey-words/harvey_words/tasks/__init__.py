"""Tasks: words become steps, and steps goals on the board, by three knowledge sources."""
