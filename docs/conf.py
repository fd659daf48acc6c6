"""Configuration of the site, which ``make docs`` builds in build/docs."""

import sys
import zlib
from pathlib import Path

HERE = Path(__file__).parent
BUILD = HERE.parent / "build"
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
    "sphinx.ext.intersphinx",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["_build", "_ext", "_templates"]
templates_path = ["_templates"]
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
html_extra_path = ["../build/demo/report.html"]  # written by `maniport demo`
html_sidebars = {
    "**": [
        "sidebar/brand.html",
        "sidebar/search.html",
        "sidebar/scroll-start.html",
        "sidebar/example_report.html",
        "sidebar/navigation.html",
        "sidebar/scroll-end.html",
    ]
}
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
numpydoc_xref_param_type = True  # link types of parameters
numpydoc_xref_ignore = "all"
numpydoc_xref_aliases = (
    {word: word for word in DEFAULT_LINKS}  # numpydoc's own links warn if there is no network
    | {
        word: f":obj:`{word} <{word}>`"
        for word in ("None", "bool", "dict", "float", "int", "list", "str", "tuple")
    }
    | {
        "ndarray": "numpy.ndarray",
        "array_like": "numpy.typing.ArrayLike",
        "path-like": "os.PathLike",
    }
    | {"numpy.random.Generator": ":obj:`numpy.random.Generator`"}
    | {
        word: f"collections.abc.{word.title()}"
        for word in ("callable", "iterable", "mapping", "sequence")
    }
    | classes()
)

# Without a network, the empty inventory replaces the others: the build then has no external links and no warnings.
BUILD.mkdir(exist_ok=True)
EMPTY = BUILD / "empty.inv"
EMPTY.write_bytes(
    b"# Sphinx inventory version 2\n# Project: none\n# Version: 0\n"
    b"# The remainder of this file is compressed using zlib.\n" + zlib.compress(b"")
)
intersphinx_mapping = {
    name: (address, (None, str(EMPTY)))
    for name, address in {
        "python": "https://docs.python.org/3/",
        "numpy": "https://numpy.org/doc/stable/",
        "scipy": "https://docs.scipy.org/doc/scipy/",
        "sklearn": "https://scikit-learn.org/stable/",
    }.items()
}
intersphinx_timeout = 10  # [s]

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
