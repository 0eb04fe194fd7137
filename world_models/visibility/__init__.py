"""What of the building a camera sees."""
