"""Formulas as MathML, which browsers draw themselves: the pages need no script and no network for them."""

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator


def inline(translator: HTML5Translator, node: nodes.math) -> None:
    """Put a formula into a line."""
    translator.body.append(convert(node.astext()))
    raise nodes.SkipNode


def displayed(translator: HTML5Translator, node: nodes.math_block) -> None:
    r"""Give a formula a line of its own, the number of its ``\tag{…}`` beside it."""
    latex, _, tag = node.astext().partition(r"\tag{")
    number = f'<span class="eqno">({tag.strip().rstrip("}")})</span>' if tag else ""
    formula = convert(latex.strip(), display="block")
    translator.body.append(f'<div class="math-block"><div class="formula">{formula}</div>{number}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Give both kinds of formulas to these functions."""
    for node, write in ((nodes.math, inline), (nodes.math_block, displayed)):
        app.add_node(node, override=True, html=(write, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
