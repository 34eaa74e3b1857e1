"""Settings of the documentation site: `make docs` builds it."""

from importlib.metadata import version as version_of

project = "Grebe"
author = "The Grebe authors"
version = release = version_of("grebe")
html_theme = "furo"
html_title = "Grebe"

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx_gallery.gen_gallery",
]
# The gallery writes notebooks beside its pages, and tables of how long things took.
exclude_patterns = [
    "_build",
    "gallery/*.ipynb",
    "**/sg_execution_times.rst",
    "sg_execution_times.rst",
]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
# Pages speak of files in the repository, which are no pages.
suppress_warnings = ["myst.xref_missing", "config.cache"]
# Tutorials are run when the site is built, and one that fails stops the build.
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300

autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "show-inheritance": False}

sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"/\d\d_",
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": True,
    "show_memory": False,
}
