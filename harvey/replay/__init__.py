"""Once more: a run decided again from what it observed, gone on with after a crash, drawn anew, or told otherwise."""
