"""Drivers of bases and cameras, each behind a small interface. They know no blackboard."""
