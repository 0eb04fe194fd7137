"""What another package can add to Harvey without an edit there: each file is one thing, each entry point names one."""
