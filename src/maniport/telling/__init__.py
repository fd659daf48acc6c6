"""What one is told of results: facts once, and the renderings of them for terminal, files, notebooks and the page."""

from maniport.telling.answer import Answer, Card
from maniport.telling.facts import Fact, Facts, Section, Table, facts_of
from maniport.telling.renderings import as_html, as_markdown, as_numbers

__all__ = ["Answer", "Card", "Fact", "Facts", "Section", "Table", "as_html", "as_markdown", "as_numbers", "facts_of"]
