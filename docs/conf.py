"""How Sphinx builds the documentation: ``sphinx-build -W docs build/site``."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

project = "Harvey"
extensions = ["myst_parser", "docs.tools.site.pages"]
exclude_patterns = ["tools"]
highlight_language = "none"

html_theme = "furo"
html_title = "Harvey"
html_copy_source = False

myst_enable_extensions = ["deflist"]
myst_heading_anchors = 4

man_pages = [("reference/command-line", "harvey", "model-directed mobile robot navigation", [], 1)]
man_make_section_directory = False
