"""Campaigns on a Dask cluster; ``README.md`` of this extra tells how."""
