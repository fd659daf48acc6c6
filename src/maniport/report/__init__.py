"""Reports of results: metrics, their text, JSON and page renderings, and figures."""

from maniport.report.renderings import as_markdown, as_numbers
from maniport.report.values import Metric, Report, report_of

__all__ = ["Metric", "Report", "as_markdown", "as_numbers", "report_of"]
