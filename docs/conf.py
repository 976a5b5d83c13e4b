"""How the site is built: `make docs` leaves it in build/site, to be opened as files.

Nothing in it needs a network: mathematics is MathML, fonts are the reader's own, and a
page that would load anything from elsewhere fails the build. Pictures of the gallery
are drawn by the programs in examples/ while it is built.
"""

from __future__ import annotations

import sys
from pathlib import Path

import unsmear

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_extensions"))

project = "unsmear"
author = "The unsmear authors"
version = release = unsmear.__version__

extensions = [
    "sphinx.ext.autodoc",
    "numpydoc",
    "myst_parser",
    "sphinx_gallery.gen_gallery",
    "mathml",
    "command_line",
    "offline",
]
exclude_patterns = ["_build"]
# The README's headings start at the second level where parts of it are included.
suppress_warnings = [
    "config.cache",  # the order of the gallery is an object
    "ref.footnote",  # references of docstrings are lists, not only notes to a word
]

# Docstrings: single backticks name things of the package.
default_role = "py:obj"
autodoc_typehints = "none"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_xref_param_type = False

myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 3

html_theme = "furo"
html_title = f"unsmear {version}"
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False
html_static_path = ["_static"]
html_css_files = ["site.css"]
pygments_style = "friendly"
pygments_dark_style = "github-dark"

# The order in which a reader should meet the examples.
GALLERY = (
    "plot_flow",
    "plot_real_frames",
    "plot_confidence",
    "plot_filters",
    "plot_two_motions",
    "plot_deblur",
    "plot_rotating_object",
    "plot_several_frames",
    "plot_exposure",
    "plot_wrong_motion",
    "plot_thesis_frequency",
    "plot_thesis_bandwidth",
    "plot_thesis_errors",
    "plot_thesis_regularization",
    "plot_thesis_comparison",
    "plot_command_line",
)


def in_reading_order(filename: str) -> int:
    """Return an example's place in the gallery; one that has none is an error."""
    return GALLERY.index(Path(filename).stem)


sphinx_gallery_conf = {
    "examples_dirs": str(HERE.parent / "examples"),
    "gallery_dirs": "gallery",
    "filename_pattern": r"plot_",
    "within_subsection_order": in_reading_order,
    "abort_on_example_error": True,
    "download_all_examples": False,
    "remove_config_comments": True,
    "show_signature": False,
    "write_computation_times": False,
    "image_scrapers": ("matplotlib",),
    "reset_modules": ("matplotlib",),
    "matplotlib_animations": False,
}
