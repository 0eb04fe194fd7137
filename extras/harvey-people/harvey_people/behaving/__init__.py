"""What it does for the sake of people: it waits, or passes them; and why."""
