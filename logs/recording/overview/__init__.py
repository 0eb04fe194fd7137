"""Several runs side by side in a recording of their own: ``overview`` (what of them), ``blueprint`` (its views)."""
