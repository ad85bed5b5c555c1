"""How Sphinx builds the site. `make docs` calls it with the pages that docs/build.py has gathered."""

from typing import Any

import gallery_style

project = "cranectl"
author = "the cranectl authors"
project_copyright = f"%Y, {author}"

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx_click",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
]
root_doc = "index"
exclude_patterns = ["extra", "gallery"]
html_extra_path = ["extra"]  # pages that are whole already
suppress_warnings = ["myst.strikethrough"]

highlight_language = "text"
smartquotes = False  # it makes one dash of the two of an option

# Markdown
myst_heading_anchors = 4  # links to headings, as forges make them
myst_links_external_new_tab = False

# The API
autodoc_typehints = "none"  # the docstrings give types, with shapes and units
numpydoc_show_class_members = False
add_module_names = False

# The gallery. Its scripts run in the order of their names, in one folder.
sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "examples",
    "filename_pattern": r"\.py$",
    "within_subsection_order": "FileNameSortKey",
    "min_reported_time": float("inf"),  # pages do not depend on the machine
    "write_computation_times": False,
    "show_memory": False,
    "only_warn_on_example_error": False,
    "download_all_examples": False,
    "show_signature": False,
    "capture_repr": (),
    "reset_modules": ("gallery_style.set_style",),
    "thumbnail_size": gallery_style.THUMBNAIL,
}

# Appearance. Nothing is loaded from the network.
html_theme = "pydata_sphinx_theme"
html_static_path = ["looks"]
html_css_files = ["gallery.css"]
html_show_search_summary = False  # a summary is fetched, which a page from the disk cannot do
html_show_sourcelink = False
html_copy_source = False
# Pages without others below them need no bar for these.
html_sidebars: dict[str, list[str]] = {
    name: [] for name in ("index", "pages", "start", "contributing", "changes")
}
html_theme_options = {
    "header_links_before_dropdown": 7,  # the rest are for who works on cranectl
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "show_prev_next": False,
    "show_toc_level": 2,
}
pygments_style = "a11y-high-contrast-light"


def setup(app: Any) -> None:
    """Crop the thumbnails once the examples have run, which sphinx-gallery does at the same event."""
    app.connect("builder-inited", gallery_style.crop_thumbnails, priority=900)
