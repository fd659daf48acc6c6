"""Reports of results: metrics, their text, JSON, notebook and page renderings, and figures."""

from maniport.report.metrics import report_of
from maniport.report.renderings import as_html, as_markdown, as_numbers
from maniport.report.values import Metric, Report

__all__ = ["Metric", "Report", "as_html", "as_markdown", "as_numbers", "report_of"]
