"""Reports of results: metrics, their text, JSON, notebook and page renderings, and figures."""

from maniport.report.metrics import Metric, Report, Section, Summary, Table, facts_of
from maniport.report.renderings import as_html, as_markdown, as_numbers

__all__ = [
    "Metric", "Report", "Section", "Summary", "Table", "as_html", "as_markdown", "as_numbers", "facts_of",
]  # fmt: skip
