"""Export: a run as tables for other programs.

In reading order: ``tables`` (what they hold), ``files`` (CSV and Parquet).
"""
