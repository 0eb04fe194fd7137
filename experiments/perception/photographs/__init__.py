"""The corridor photographs: data, trials and pictures, for ``corridor``."""
