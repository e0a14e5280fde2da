"""The documentation's site (`make docs`): Sphinx reads the Markdown pages through MyST."""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from specs.version import VERSION  # noqa: E402

project = "Slewright"
author = "the Slewright authors"
version = release = VERSION

extensions = ["myst_parser"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["results/showcases/slew_one_pose"]
myst_heading_anchors = 4
# No typographic quotes: options (`--json`) and quoted keys stay as they are typed.
smartquotes = False
# Blocks without a language are commands and what they print.
highlight_language = "none"

# A link to a file outside of the docs (a model's README, the DBC) becomes a download.
FOLDERS = "|".join(path.name for path in ROOT.iterdir() if path.name != "docs")
OUTSIDE = re.compile(rf"\]\((?=(?:\.\./)+(?:{FOLDERS})(?:/|\)))")


def setup(app):
    """Mark links out of the docs, page by page as they are read."""
    app.connect("source-read", lambda _, name, text: text.__setitem__(0, OUTSIDE.sub("](path:", text[0])))


html_theme = "furo"
html_title = f"Slewright {VERSION}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_copyright = False
html_show_sphinx = False
html_copy_source = False
