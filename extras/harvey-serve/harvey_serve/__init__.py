"""A page in the browser while a mission runs; ``README.md`` of this extra names the modules in reading order."""
