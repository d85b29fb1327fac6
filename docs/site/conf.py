"""Configuration of the documentation site: the repository's own Markdown files, built by Sphinx.

`docs/build` runs it. The files are those that a forge renders: this only adds the table of contents.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

project = "hairbake"
author = "The hairbake developers"
copyright = author

extensions = ["myst_parser", "repository_pages"]
root_doc = "README"
include_patterns = [
    "README.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "docs/*.md",
    "benches/*/README.md",
    "examples/README.md",
    "examples/*/README.md",
    "pipeline/README.md",
    "samples/*/README.md",
    "tests/python/README.md",
    "validation/README.md",
    "validation/*/README.md",
]
exclude_patterns = [".*", ".venv", "shared", "src", "target"]

# The anchors of headings are those of a forge, to the depth that links use.
myst_heading_anchors = 4
# Display mathematics stands in fences, inline mathematics between $` and `$: what a forge leaves alone.
myst_enable_extensions = ["dollarmath"]
myst_fence_as_directive = ["math"]

html_theme = "furo"
html_title = "hairbake"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
highlight_language = "none"
