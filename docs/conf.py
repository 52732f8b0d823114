"""Sphinx: python -m sphinx -W docs build/site"""

from __future__ import annotations

import sys
from pathlib import Path

from numpydoc.xref import DEFAULT_LINKS

import stretchmap

sys.path.insert(0, str(Path(__file__).parent))  # gallery_figures, mathml

project = "stretchmap"
author = "The stretchmap developers"
copyright = "the stretchmap developers"
release = version = stretchmap.__version__

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autosummary",
    "mathml",
    "sphinx_gallery.gen_gallery",
]
html_math_renderer = "mathml"
html_theme = "pydata_sphinx_theme"
html_title = f"stretchmap {release}"
html_theme_options = {"navigation_with_keys": False, "show_prev_next": False}
# Pages by themselves have no section to navigate; API and folders do.
alone = ("search", "genindex", *(page.stem for page in Path(__file__).parent.glob("*.md")))
html_sidebars = {page: [] for page in alone if page != "api"}
templates_path = ["templates"]
html_static_path = ["static"]
html_css_files = ["narrow.css"]
html_favicon = "static/favicon.svg"
html_context = {"default_mode": "auto"}  # the theme complains in the browser when it is not set
exclude_patterns = [
    "results.md",
    "release.md",
    "gallery/*.ipynb",
    "gallery/*.py",
    "tutorials/*.ipynb",
    "tutorials/*.py",
    "**sg_execution_times.rst",  # linked from nowhere, and asks other servers for its scripts
]
myst_enable_extensions = ["dollarmath", "amsmath"]
myst_heading_anchors = 3

autosummary_generate = True
autodoc_typehints = "none"  # the sections of the docstrings have them
numpydoc_xref_param_type = True
numpydoc_xref_ignore = "all"  # but our classes; those of Python would need the network
numpydoc_xref_aliases = {name: name for name in DEFAULT_LINKS} | {
    name: f"stretchmap.{name}"
    for name in stretchmap.__all__
    if isinstance(getattr(stretchmap, name), type)
}
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False

sphinx_gallery_conf = {
    "image_scrapers": ("gallery_figures",),
    "examples_dirs": ["../tutorials", "../examples"],
    "gallery_dirs": ["tutorials", "gallery"],
    "ignore_repr_types": r"stretchmap\.plot\.figure",  # pictures are scraped
    "filename_pattern": r"\.py$",
    "abort_on_example_error": True,
    "show_memory": False,
    "reset_modules": (),
    "within_subsection_order": "FileNameSortKey",
    "copyfile_regex": r".*HEADER\.rst",
}
