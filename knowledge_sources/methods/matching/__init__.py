"""Which image line shows which model line (§6.1)."""
