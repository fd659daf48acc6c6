"""Gallery: each example gets the picture of `docs/gallery` and a title from its docstring."""

import builtins
import json
import shutil
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx_gallery.scrapers import figure_rst

PICTURES = Path(__file__).parents[1] / "gallery"
PAGES = "examples/"


def picture(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Return the picture that `scripts/make_gallery.py` drew of an example."""
    example = Path(block_vars["src_file"]).stem
    caption = json.loads((PICTURES / "captions.json").read_text(encoding="utf-8"))[example]
    target = Path(next(block_vars["image_path_iterator"]))
    shutil.copy(PICTURES / f"{example}.png", target)
    return f"{figure_rst([str(target)], gallery_conf['src_dir'], caption)}\n*{caption}*\n\n"


def with_file(gallery_conf: dict[str, Any], example: str) -> None:
    """Set ``__file__`` of an example, which Sphinx-Gallery does not set."""
    builtins.__file__ = example  # type: ignore[attr-defined]


def with_title(app: Sphinx, docname: str, source: list[str]) -> None:
    """Make the first paragraph of an example's docstring the title of its page."""
    name = docname.removeprefix(PAGES)
    if not docname.startswith(PAGES) or not name.startswith((*"01", "ros2", "pink")):
        return
    label = f".. _sphx_glr_{docname.replace('/', '_')}.py:\n\n"
    before, _, after = source[0].partition(label)
    title, _, rest = after.partition("\n\n")
    title = f"{name[:2] if name[0].isdigit() else ''} {' '.join(title.split()).rstrip('.')}".strip()
    source[0] = f"{before}{label}{title}\n{'=' * len(title)}\n\n{rest}"


def _get_sg_image_scraper() -> Any:
    """Return the scraper, as Sphinx-Gallery requires of a module."""
    return picture


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the function to Sphinx."""
    app.connect("source-read", with_title)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
