"""Formulas as MathML, which browsers draw without scripts and network."""

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator


def inline(translator: HTML5Translator, node: nodes.math) -> None:
    """Write an inline formula."""
    translator.body.append(convert(node.astext()))
    raise nodes.SkipNode


def displayed(translator: HTML5Translator, node: nodes.math_block) -> None:
    r"""Write a displayed formula with the number of its ``\tag{…}``."""
    latex, _, tag = node.astext().partition(r"\tag{")
    number = f'<span class="eqno">({tag.strip().rstrip("}")})</span>' if tag else ""
    formula = convert(latex.strip(), display="block")
    translator.body.append(
        f'<div class="math-block"><div class="formula">{formula}</div>{number}</div>\n'
    )
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register both functions for their nodes."""
    for node, write in ((nodes.math, inline), (nodes.math_block, displayed)):
        app.add_node(node, override=True, html=(write, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
