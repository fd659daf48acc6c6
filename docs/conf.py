"""How the site is built: ``make docs``, which makes build/docs."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE / "_ext"), str(HERE.parent / "src")]

from numpydoc.xref import DEFAULT_LINKS  # noqa: E402
from public_names import classes  # noqa: E402

from maniport.version import __version__  # noqa: E402

project, author, copyright = "maniport", "The maniport developers", "The maniport developers"
version = release = __version__
extensions = [
    "curriculum",
    "mathml",
    "public_names",
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["_build", "_ext"]
source_suffix = {".rst": "restructuredtext", ".md": "markdown"}
default_role = "py:obj"

html_theme = "furo"
html_title = f"maniport {release}"
html_theme_options = {
    "source_repository": "https://github.com/maniport/maniport",
    "source_branch": "main",
    "source_directory": "docs/",
}
html_static_path = ["_static"]
html_extra_path = ["../build/demo/report.html"]  # the demo's page, to be played with before anything is installed
html_css_files = ["maniport.css"]
html_show_sourcelink = False

myst_enable_extensions = ["dollarmath", "colon_fence", "deflist", "substitution"]
myst_substitutions = {"release": release}
myst_fence_as_directive = ["math"]
myst_heading_anchors = 4

autosummary_generate = False
autodoc_typehints = "none"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
numpydoc_xref_param_type = True  # types of arguments lead to their pages, where they are public
numpydoc_xref_ignore = "all"
numpydoc_xref_aliases = {word: word for word in DEFAULT_LINKS} | classes()  # words of Python's are told on other sites
copybutton_prompt_text = "$ "

sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "examples",
    "filename_pattern": r"/\d\d_",
    "image_scrapers": ("curriculum",),
    "download_all_examples": False,
    "remove_config_comments": True,
    "within_subsection_order": "FileNameSortKey",
    "show_memory": False,
    "min_reported_time": 1e9,
    "reset_modules": ("curriculum.with_file",),
    "parallel": True,  # as many processes as sphinx -j
    "abort_on_example_error": True,
}
