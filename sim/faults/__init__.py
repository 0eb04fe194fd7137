"""What goes wrong in a scenario."""
